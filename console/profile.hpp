// SPDX-License-Identifier: MIT
// A course of current as a person writes it: "20A 0.3s, 6A 5s, -2.5A 200ms". A bare number is amperes, then seconds.
#pragma once

#include <string>
#include <vector>

namespace console {

struct Piece {
  float current_A, seconds;
};

/// At least one piece, at most `most`; finite amperes, seconds above zero. Throws UserError (usage) naming the piece.
std::vector<Piece> profile_in(const std::string& text, std::size_t most);

}  // namespace console

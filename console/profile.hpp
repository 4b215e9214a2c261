// SPDX-License-Identifier: MIT
// A course as a person writes it: "20A 0.3s, 6A 5s, -2.5 A 200 ms", or of torque: "50mNm 0.3s; 0Nm 1s". A bare number
// is amperes, then seconds.
#pragma once

#include <string>
#include <vector>

#include "wire/protocol.hpp"

namespace console {

struct Piece {
  float level;  // A or N m, as `mode` says
  float seconds;
  wire::ControlMode mode = wire::ControlMode::current;
};

/// "A" or "N m".
const char* unit_of(wire::ControlMode mode);

/// At least one piece, at most `most`, all of one mode; finite levels, seconds above zero. Throws UserError (usage)
/// naming the piece.
std::vector<Piece> profile_in(const std::string& text, std::size_t most);

}  // namespace console

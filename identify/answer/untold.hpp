// SPDX-License-Identifier: MIT
// A load that the cells of a log do not tell: beyond its sensor's reach, or between the rows.
#pragma once

#include <string>
#include <vector>

#include "identify/search/search.hpp"

namespace identify {

/// Does the sensor of what heats reach no further than what it shows most? Empty when it does, and when two resistors
/// are adequate all the same.
std::string clipped(const Found& found, const std::vector<Log>& logs);

/// May what was found, or what nothing explains, be of rows too far apart, or of a load that cells do not tell? Empty
/// when not.
std::string too_sparse(const Problem& problem, const Found& found, const std::vector<Log>& logs);

}  // namespace identify

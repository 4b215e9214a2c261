// SPDX-License-Identifier: MIT
// A recording that was interrupted: what flowed meanwhile is not known, so the motor begins anew as warm as it then is.
#pragma once

#include <vector>

#include "identify/log/log.hpp"

namespace identify {

/// Does a measured current's noise show from row to row, up and down by little, where more than a tenth of `range`
/// flows? A commanded one repeats itself, leaps, or goes one way; a coarse one repeats itself.
bool is_noisy(const std::vector<double>& v, double range);

/// Finds pauses: stretches in which nothing tells the heat input, no rows, empty cells, or a current that is noisy
/// elsewhere and stands still. Takes out what rows they hold and notes in Log::resumes_s where the log goes on; after a
/// long one the rest is a log of its own, in which also further masses begin anew.
std::vector<Log> parts_between_pauses(Log log);

}  // namespace identify

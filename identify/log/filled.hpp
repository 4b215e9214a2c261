// SPDX-License-Identifier: MIT
// A slow sensor written into faster rows: between two of its readings the log repeats the first, or follows the line
// between them. Only what was read is kept; the rest would count as many readings without noise.
#pragma once

#include "identify/log/log.hpp"

namespace identify {

/// Turns the winding's and the housing's filled-in cells into missing ones, and notes it in log.notes.
void forget_filled(Log& log);

/// A column of a log without the cells that lie on straight lines between readings; as it is where it has no such
/// lines.
std::vector<double> without_lines(const Log& log, Role role);

}  // namespace identify

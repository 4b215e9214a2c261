// SPDX-License-Identifier: MIT
// Finds what a log claims but cannot have measured: frozen channels, holes, gaps in time. Masks it and says so.
#pragma once

#include "identify/log.hpp"

namespace identify {

/// Turns frozen readings into missing ones, counts missing and frozen cells and gaps, and notes each in log.notes.
/// Throws UserError (unusable) when the heat input or every temperature is missing for most of the time.
void mask(Log& log);

/// [from, to) row ranges in which a channel stands still at exactly one value although it moves elsewhere.
std::vector<std::pair<std::size_t, std::size_t>> frozen_runs(const std::vector<double>& values);

}  // namespace identify

// SPDX-License-Identifier: MIT
// Finds what a log claims but cannot have measured: glitches, frozen channels, readings between the steps of a coarse
// sensor, holes, gaps in time. Masks it and says so.
#pragma once

#include "identify/log/log.hpp"

namespace identify {

/// Turns readings, up to three in a row, that jump away and back as no temperature can, and single rows of a current
/// that is ten times what ever lasts (of a power, a hundred), into missing ones.
void forget_glitches(Log& log);

/// Turns frozen readings into missing ones, sums up what is missing and lies in gaps, leaves of a coarse sensor the
/// moments of its steps, and notes each in log.notes.
/// Throws UserError (unusable) when the heat input is missing in three rows of ten, or no temperature is left at all.
void mask(Log& log);

/// The step of a channel that knows no values in between; 0 where it has none.
double step_of(const std::vector<double>& values);
inline constexpr double coarse_K = 0.4;  // finer steps are lost in what a thermistor wanders by

/// [from, to) row ranges in which a channel stands still at exactly one value although it moves elsewhere.
std::vector<std::pair<std::size_t, std::size_t>> frozen_runs(const std::vector<double>& values);

}  // namespace identify

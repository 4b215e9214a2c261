// SPDX-License-Identifier: MIT
// How noisy the readings are, by the log itself.
#pragma once

#include "identify/fit/problem.hpp"

namespace identify {

/// White and slow part of the housing noise: of one reading from its differences, the rest from rest. What is assumed
/// here matters where the noise decides: half of usual_slow_K, of after_load_s, of the least white, of the five minutes
/// and of a winding's 2 K at once named one effect of 1.3 K more, of 20 logs, and lost one of 3.6 K to "unknown" (those
/// of candidates.cpp).
void noise_from_rest(Problem& problem);

/// A current that is noisy from row to row tells a heat that is: white, of 2 i ohm times the current's. A housing
/// gathers it as slowly as it cools, a winding on top as slowly as it follows.
void allow_for_noisy_current(Problem& problem);

}  // namespace identify

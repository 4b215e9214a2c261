// SPDX-License-Identifier: MIT
// What the residuals of a fit say of the noise, and of what is no noise and yet has no name.
#pragma once

#include <vector>

#include "identify/fit/fit.hpp"

namespace identify {

/// A slow disturbance of the readings without a name, beside a set of causes: the one that makes the set's residual
/// likeliest. Where it gains much over the noise alone, the set leaves something that is not noise.
struct Disturbance {
  Noise noise;
  double evidence = 0;        // of it: over the noise alone
  double joint_evidence = 0;  // of the set with it; to compare sets that leave different disturbances
};

Disturbance disturbance_of(const Problem& problem, const Fit& undisturbed);

/// Of the coarsest housing sensor; 0: none is coarse.
double coarsest_step_K(const Problem& problem);

/// A winding read now and then does not show its own noise. The best model's residuals do.
void refine_core_noise(Problem& problem, const Fit& best);

/// Rest shows the housing's slow noise, and with it what still flows inside the motor: never less than the noise. What
/// is known of a coarse sensor's steps is known of the worst. Where the best model's residual is likelier with less,
/// less is taken; never more: the noise would swallow what is wrong.
void refine_housing_noise(Problem& problem, const Fit& best);

/// Readings further apart than a winding takes to move differ by more than their noise, as those of a table that
/// somebody wrote every five minutes. Where the best model's residual is likelier with less, less is taken. Says
/// whether it was.
bool refine_noise_of_slow_rows(Problem& problem, const Fit& best);

/// A meter that holds its reading and then catches up wanders faster and farther than rest shows. Too fast for what is
/// wrong with a motor, that is taken for its noise where it is likelier than any slow disturbance. Says whether it was.
bool take_sticking_for_noise(Problem& problem, const Fit& best, double worth);

/// The same readings, believed no closer than `times` what no model follows; `f` says where the housing's sensor sits.
/// Readings of a winding now and then are noisier than that, and what is known to be off by more says it already.
Problem believed_less(Problem problem, const Fit& f, double times);

}  // namespace identify

// SPDX-License-Identifier: MIT
// What fits average over, since no motor and no recording is without it: no cause is to be named for it.
#pragma once

#include "identify/fit/fit.hpp"

namespace identify {

/// In a sentence.
inline constexpr const char* leeway_words =
    "what no motor is without (a sensor a little early or late, a frame, the moment of a row)";

/// What no motor is without: a sensor that is not quite on the housing, so that its reading comes early or late by
/// seconds; a frame that takes a share of the housing's capacity; where the rotor stands under load, phases that share
/// their heat better or worse than was assumed; a row whose current and winding were not read at one moment, which
/// shows where every row has a winding's temperature: hundredths of a second looked like a hot spot or a delay there;
/// and a winding told by its resistance that is off by what the reference at rest was, which looked like a gain of the
/// housing's sensor; a sensor that cuts whole degrees off instead of rounding to them; and a room that moved while
/// nobody watched it. Causes are to be ranked by more than that. By the best fit at hand: where something is missing,
/// that of two resistors alone is no motor.
std::vector<Leeway> ordinary_leeway(const Problem& problem, const Fit& motor);

/// What is mistaken for a nearer or farther winding where neither a sheet nor a reading tells of it, for the housing
/// tells R1 by how copper's resistance grows alone: cooling that grows as well, and a sensor's gain.
std::vector<Leeway> leeway_of_an_unseen_winding(const Problem& problem, const Fit& fit);

/// Heat that goes otherwise with load than the recorded current's square says, as current sensors and sampling have it.
/// A housing known to hundredths of a kelvin would take it for copper that warms otherwise, and so for another R1.
Leeway leeway_of_load(const Problem& problem, const Fit& baseline);

}  // namespace identify

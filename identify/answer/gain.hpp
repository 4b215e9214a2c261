// SPDX-License-Identifier: MIT
// What the model that was found would change for this motor: the board's own estimator, governor and look-ahead
// (thermal/) run once with the two-resistor model as fitted and once with the extended one, on a motor that behaves
// like the extended one. A promise of the model; host-sim measures it on the motor that was recorded.
#pragma once

#include <optional>

#include "identify/answer/report.hpp"
#include "thermal/core_estimator.hpp"

namespace identify {

/// Nothing when the logs tell no current (heat known as power), or when a set cannot be run.
/// `extended` is taken for the truth.
std::optional<Gain> gain_of(const Problem& problem, const Fit& baseline, const Fit& extended);

/// What a board may be given.
struct Offer {
  Fit fit;
  thermal::Trust trust;
};

/// The offer under which a board bears a push for the shortest time: the one to write where the data cannot choose. Its
/// cooling is doubted by as much as another offer carries less for an hour. A set that the firmware refuses is passed
/// over; the first where none can be asked (heat logged as power).
Offer most_cautious(const Problem& problem, const std::vector<Offer>& offers);

}  // namespace identify

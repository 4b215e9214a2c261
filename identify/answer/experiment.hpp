// SPDX-License-Identifier: MIT
// Which experiment would tell tied causes apart? T-optimal design with refit: each tied model makes a noise-free log of
// each protocol, every other tied model is fitted to it, and the protocol wins whose smallest remaining misfit is
// largest.
//
// A misfit D (in squared noise units) of 20 gives a 90 % chance to name (measured on 8,736 logs; below 3: 3 %).
#pragma once

#include <limits>
#include <optional>

#include "identify/answer/report.hpp"
#include "identify/search/search.hpp"

namespace identify {

/// Nothing when there is no tie, or when the log tells no amperes to ask for (but a power, or a torque without the
/// motor's constant). The best three of the tied sets are told apart; every one keeps the winding 10 K below its limit,
/// and no step asks for more than `most_A` (amplitude).
std::optional<Experiment> experiment(const Problem& problem, const Found& found,
                                     double most_A = std::numeric_limits<double>::infinity());

}  // namespace identify

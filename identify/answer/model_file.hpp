// SPDX-License-Identifier: MIT
// Writes what was found as a heat-network parameter set (TOML): nodes, links and sources as thermal/heat_set.hpp has
// them, so that the board runs the extended model without new code. What belongs to the recording and not to the motor
// (clocks, ambient, offsets of the current) stands apart under [recording].
#pragma once

#include <string>

#include "identify/fit/fit.hpp"
#include "thermal/core_estimator.hpp"

namespace identify {

/// The set itself, with the winding's limit.
thermal::HeatSet<double> heat_set_of(const Problem& problem, const Fit& fit);

/// How far the board may trust the set: standard errors of the fit, the causes' own where they stand between a sensor
/// and the hottest node, widened where it leaves more than noise, and never better than `least`: what such a fit is
/// worth, or a sheet where the data does not bear out what was fitted.
thermal::Trust trust_of(const Problem& problem, const Fit& fit,
                        const thermal::Trust& least = thermal::identified_trust);

/// `sentence`: what was found, written as a comment at the top.
std::string heat_set_toml(const Problem& problem, const Fit& fit, const std::string& sentence,
                          const thermal::Trust& trust);

}  // namespace identify

// SPDX-License-Identifier: MIT
// The effects that a log can hide, each by its id, and how to draw one of a wanted size from a seed. The ids of the
// catalogue are those of the contract of identify; the rest must be answered "unknown". Truth files are written from
// here; identify never sees this room.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "host-sim/plant/thermal_bench.hpp"

namespace host_sim {

/// What an amount of 1 is measured by: a tenth or so of what the motor does at its rating.
struct HiddenScale {
  wire::Motor sheet;
  double rated_A, rated_W, full_speed_rad_per_s, length_s;
};

struct HiddenCause {
  const char* id;
  bool in_catalogue;
  bool either_sign;
  double largest;  // amount beyond which the form loses its meaning
  void (*apply)(HiddenEffects& hidden, const HiddenScale& scale, double amount, Random& random);
};

const std::vector<HiddenCause>& hidden_causes();
/// Throws std::invalid_argument for an id that is not in the table.
const HiddenCause& hidden_cause(const std::string& id);

struct DrawnEffect {
  HiddenEffects hidden;
  double amount;
  double error_K;  // what a model without it would err on these demands, before any refitting: larger of winding and
                   // housing reading, root mean square
};

/// Draws one effect whose error alone is about `target_K` (nearer than 10 %, or the largest amount the cause allows)
/// and adds it to what the design hides already: several at once are drawn one after the other.
DrawnEffect draw_effect(const HiddenCause& cause, const ThermalDesign& design, const std::vector<Demand>& demands,
                        double rate_Hz, double full_speed_rad_per_s, double target_K, std::uint64_t seed);

/// The error of a neutral plant that believes what the sensors of `design` log, no noise.
double unrefitted_error_K(const ThermalDesign& design, const std::vector<Demand>& demands, double rate_Hz);

}  // namespace host_sim

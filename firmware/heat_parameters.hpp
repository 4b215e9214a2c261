// SPDX-License-Identifier: MIT
// What is known about the heat of one axis as a plain struct, its dictionary and its check: what the heat set and the
// estimator's settings are built from. Declared in heat.params, one line each. Not for an ISR.
#pragma once

#include "firmware/axis_parameters.hpp"
#include "thermal/core_estimator.hpp"

namespace firmware {

struct HeatParameters {
#define PARAM(id, name, unit, fallback, min, max, doc) float name##_##unit = fallback;
#include "firmware/heat.params"
#undef PARAM
};

inline constexpr wire::ParameterInfo heat_dictionary[] = {
#define PARAM(id, name, unit, fallback, min, max, doc) {id, #name, wire::Unit::unit, fallback, min, max, doc},
#include "firmware/heat.params"
#undef PARAM
};
static_assert(wire::well_declared(heat_dictionary), "ids must rise, and a default must lie in its own range");

/// Those from here on are what identify may find beside the others.
inline constexpr std::uint16_t first_found_id = 0x0212;
inline constexpr int found_count = [] {
  int count = 0;
  for (const wire::ParameterInfo& p : heat_dictionary) count += p.id >= first_found_id ? 1 : 0;
  return count;
}();

[[nodiscard]] Finding validate(const HeatParameters& set);

/// The three-phase motor. Only of a set that passed; the resistance is that of axis.params.
[[nodiscard]] thermal::HeatSet<double> heat_set(const HeatParameters& set, float phase_resistance_ohm);
[[nodiscard]] thermal::EstimatorSettings estimator_settings(const HeatParameters& set);

/// A complete set from a motor's sheet.
[[nodiscard]] HeatParameters heat_parameters_from(const wire::Motor& motor, const thermal::Trust& trust);

}  // namespace firmware

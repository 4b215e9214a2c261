// SPDX-License-Identifier: MIT
// The parameters of one axis as a plain struct, their dictionary, and the check of a set as a whole.
// Declared in axis.params, one line each. Not for an ISR.
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/board_rating.hpp"
#include "wire/motor.hpp"
#include "wire/parameters.hpp"

namespace firmware {

using wire::unset;

struct AxisParameters {
#define PARAM(id, name, unit, fallback, min, max, doc) float name##_##unit = fallback;
#include "firmware/axis.params"
#undef PARAM
};

inline constexpr wire::ParameterInfo axis_dictionary[] = {
#define PARAM(id, name, unit, fallback, min, max, doc) {id, #name, wire::Unit::unit, fallback, min, max, doc},
#include "firmware/axis.params"
#undef PARAM
};
static_assert(wire::well_declared(axis_dictionary), "ids must rise, and a default must lie in its own range");

/// The first thing wrong with a set. id 0: nothing is; `missing`: the value was never given; else it is out of range,
/// or contradicts another one or the board.
struct Finding {
  std::uint16_t id;
  float value;
  bool missing;
};

/// Each value (in the dictionary's order) was given and lies in its range; missing ones are named first.
template <std::size_t count>
[[nodiscard]] Finding first_outside(const wire::ParameterInfo (&dictionary)[count], const float (&values)[count]) {
  for (std::size_t i = 0; i < count; ++i) {
    if (wire::is_unset(values[i])) return {dictionary[i].id, values[i], true};
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (!dictionary[i].holds(values[i])) return {dictionary[i].id, values[i], false};
  }
  return {0, 0.0f, false};
}

[[nodiscard]] Finding validate(const AxisParameters& set, const BoardRating& rating);

/// How the motor is mounted and fed: what its sheet cannot know.
struct Installation {
  float supply_V;          // nominal bus voltage
  float angle_offset_rad;  // electrical, see axis.params
};

/// A complete set from a motor's sheet; bus derating follows the supply (wire/bus_window.hpp).
[[nodiscard]] AxisParameters parameters_from(const wire::Motor& motor, const BoardRating& rating,
                                             const Installation& installation);

}  // namespace firmware

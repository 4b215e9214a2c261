// SPDX-License-Identifier: MIT
// Voltage -> duty: space-vector modulation up to the whole hexagon, with a minimum sampling window.
//
// Only differences between phases reach the motor, so the common part is free: it is centred (space-vector pulses), and
// moved down as far as the shunts need. Bounds, w = window / period:
//   lowest duty >= 0,  highest <= 1,  middle <= 1 - w   ->  two lower switches always stay on for w
// What lies outside is shortened in its own direction; `share` says how much is left. w = 0 is the whole hexagon; w > 0
// cuts the three corners at which two phases are high. Same cost every call, ISR.
#pragma once

#include "firmware/transforms.hpp"

namespace firmware {

struct Modulated {
  Abc ratio;
  float share;  // of the asked voltage, 0..1
};

/// A millionth of the bus is left unused, so that rounding cannot lift a ratio above 1.
inline constexpr float full_bus = 0.999999f;

/// usable_ratio = 1 - w, at most full_bus. bus_V > 0.
constexpr Modulated modulate(const Abc& asked_V, float bus_V, float usable_ratio) {
  const float high_ab = asked_V.a > asked_V.b ? asked_V.a : asked_V.b;
  const float low_ab = asked_V.a > asked_V.b ? asked_V.b : asked_V.a;
  const float high_V = asked_V.c > high_ab ? asked_V.c : high_ab;
  const float low_V = asked_V.c < low_ab ? asked_V.c : low_ab;

  const float per_V = 1.0f / bus_V;
  float spread = (high_V - low_V) * per_V;
  float share = 1.0f;
  float lowest = 0.5f - 0.5f * spread;
  if (lowest + spread > usable_ratio) {  // centred pulses would close a window
    const float middle_V = asked_V.c > high_ab ? high_ab : asked_V.c < low_ab ? low_ab : asked_V.c;
    const float lower_spread = (middle_V - low_V) * per_V;
    if (spread > full_bus) share = full_bus / spread;
    if (share * lower_spread > usable_ratio) share = usable_ratio / lower_spread;
    spread *= share;
    lowest = usable_ratio > spread ? usable_ratio - spread : 0.0f;
  }
  const float gain = share * per_V;
  return {
      {lowest + (asked_V.a - low_V) * gain, lowest + (asked_V.b - low_V) * gain, lowest + (asked_V.c - low_V) * gain},
      share};
}

}  // namespace firmware

// SPDX-License-Identifier: MIT
// The three doors of one axis. The core never meets them: it takes an AxisSample and returns a Duty, both plain values;
// only a board's main loop walks through the doors. All three may be called from the control interrupt.
#pragma once

#include <concepts>
#include <cstdint>

#include "wire/frames.hpp"

namespace hal {

/// Everything the fast lane learns about one axis in one PWM period. Counts became SI units inside the board.
struct AxisSample {
  wire::Abc current_A;  // phase currents, positive into the motor, sampled at the middle of the zero vector
  float bus_V;
  float rotor_rad;         // mechanical angle, [0, 2 pi)
  std::uint32_t sequence;  // rises by one each PWM period; a repeated number is an old sample
  bool valid;              // false: a conversion, a sensor or the encoder was not trustworthy
};

/// On-time of each phase's upper switch, 0..1 of the PWM period.
struct Duty {
  wire::Abc ratio;
  bool on;  // false: all six switches open, whatever the ratios say
};

template <class Port>
concept AxisPort = requires(Port port, const Duty& duty) {
  { port.sample() }
  noexcept->std::same_as<AxisSample>;  // newest conversion
  { port.drive(duty) }
  noexcept->std::same_as<void>;  // loads at the next PWM period
  { port.release() }
  noexcept->std::same_as<void>;  // opens all six switches, now
};

}  // namespace hal

// SPDX-License-Identifier: MIT
// The three doors of one axis. The core never meets them: it takes an AxisSample and returns a Duty, both plain values;
// only a board's main loop walks through the doors. All three may be called from the control interrupt.
//
// Timing, centre-aligned PWM, period T:  a sample is taken at the start of a period, in the middle of a zero vector;
// the duty computed from it loads one period later and its middle lies another half period on. The core therefore aims
// at the rotor angle of 1.5 T after the sample. A board that is timed otherwise must not use these doors.
#pragma once

#include <concepts>
#include <cstdint>

#include "wire/frames.hpp"

namespace hal {

inline constexpr float output_delay_periods = 1.5f;

/// Everything the fast lane learns about one axis in one PWM period. Counts became SI units inside the board.
/// With low-side shunts the phase of the largest duty may lack its sampling window; the other two never do, and the
/// board makes the third from them.
struct AxisSample {
  wire::Abc current_A;  // phase currents, positive into the motor, after the nominal offset
  float bus_V;
  float rotor_rad;         // mechanical angle, [0, 2 pi], rising when the phases follow each other as a, b, c
  std::uint32_t sequence;  // number of the PWM period: rises by one each, also over periods without a sample; may wrap.
                           // By one more where the encoder was set anew: a jump of the angle that is no movement
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

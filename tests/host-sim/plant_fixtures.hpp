// SPDX-License-Identifier: MIT
// Motors and small helpers that the plant's tests share.
#pragma once

#include <array>
#include <cmath>
#include <string>

#include "host-sim/plant/bench.hpp"
#include "wire/pc/motor_file.hpp"

namespace plant_tests {

inline wire::Motor sheet(const std::string& id) {
  return wire::pc::read_motor(id, HOTCORE_SOURCE_DIR "/boards/motors").motor;
}
inline wire::Motor small_motor() { return sheet("ec-16-40w"); }
inline wire::Motor low_inductance_motor() { return sheet("ec-powermax-30-24v"); }  // 8 uH, 0.051 ohm a phase

inline constexpr double period_s = 50e-6;

/// Duties of a voltage vector in the rotor frame, held over the coming period (angle at its middle).
inline hal::Duty vector_duty(const host_sim::Motor& motor, double d_V, double q_V, double bus_V) {
  const double angle_rad = motor.design().pole_pairs * (motor.angle_rad() + 0.5 * period_s * motor.speed_rad_per_s());
  const auto ratio = [&](double shift_rad) {
    const double a = angle_rad - shift_rad;
    return static_cast<float>(0.5 + (d_V * std::cos(a) - q_V * std::sin(a)) / bus_V);
  };
  return {{ratio(0), ratio(2 * host_sim::pi / 3), ratio(-2 * host_sim::pi / 3)}, true};
}

inline host_sim::BenchDesign bench_design(const wire::Motor& motor) {
  host_sim::BenchDesign design;
  design.axes = {host_sim::axis_from_sheet(motor), host_sim::axis_from_sheet(motor)};
  return design;
}

}  // namespace plant_tests

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

/// A motor turned at a speed whose current is held by what samples show of it. Cold resistance, no iron.
class Turning {
 public:
  Turning(const wire::Motor& sheet, const host_sim::BridgeDesign& design, double rad_per_s)
      : motor_(host_sim::motor_from_sheet(sheet), period_s), bridge_(design) {
    motor_.load.mode = host_sim::Load::Mode::imposed_speed;
    motor_.load.speed_rad_per_s = rad_per_s;
    motor_.place(0.3, rad_per_s);
    phase_ohm_.fill(sheet.phase_resistance_ohm);
    motor_.set_resistance(phase_ohm_, design.on_resistance_ohm);
  }

  std::array<double, 3> sampled_A() const { return bridge_.sampled_A(motor_); }

  struct Dq {
    double d, q;
  };
  Dq sampled_dq() const {
    const std::array<double, 3> a = sampled_A();
    const double alpha = a[0], beta = (a[1] - a[2]) / std::sqrt(3.0), angle_rad = electrical_rad();
    return {alpha * std::cos(angle_rad) + beta * std::sin(angle_rad),
            beta * std::cos(angle_rad) - alpha * std::sin(angle_rad)};
  }

  /// A vector that stands still for the rotor, in the middle of the coming period.
  wire::Abc phases_in_the_middle(double d, double q) const {
    const double middle_rad = electrical_rad() + 0.5 * period_s * motor_.design().pole_pairs * motor_.speed_rad_per_s();
    const auto phase = [&](double shift_rad) {
      return static_cast<float>(d * std::cos(middle_rad - shift_rad) - q * std::sin(middle_rad - shift_rad));
    };
    return {phase(0), phase(2 * host_sim::pi / 3), phase(-2 * host_sim::pi / 3)};
  }

  /// One period at `bus_V` towards d = 0, q = `q_A`: the duty that it ran with.
  hal::Duty period(double q_A, double bus_V) {
    const auto [d, q] = sampled_dq();
    d_V_ -= 0.01 * d, q_V_ += 0.01 * (q_A - q);
    const double emf_V = motor_.design().pole_pairs * motor_.speed_rad_per_s() * motor_.flux_linkage_Wb();
    const hal::Duty duty = vector_duty(motor_, d_V_ - 0.1 * d, emf_V + q_V_ + 0.1 * (q_A - q), bus_V);
    bridge_.advance(motor_, duty, bus_V, phase_ohm_);
    return duty;
  }

  /// Copper heat so far as the integral of the squared current vector.
  double true_A2s() const {
    double heat_J = 0;
    for (std::size_t k = 0; k < 3; ++k) heat_J += motor_.work().copper_J[k] + bridge_.work().ripple_J[k];
    return heat_J / 1.5 / phase_ohm_[0];
  }

 private:
  double electrical_rad() const { return motor_.design().pole_pairs * motor_.angle_rad(); }

  host_sim::Motor motor_;
  host_sim::Bridge bridge_;
  std::array<double, 3> phase_ohm_;
  double d_V_ = 0, q_V_ = 0;
};

inline host_sim::BenchDesign bench_design(const wire::Motor& motor) {
  host_sim::BenchDesign design;
  design.axes = {host_sim::axis_from_sheet(motor), host_sim::axis_from_sheet(motor)};
  return design;
}

}  // namespace plant_tests

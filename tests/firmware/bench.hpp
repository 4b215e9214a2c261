// SPDX-License-Identifier: MIT
// A small bench for the firmware's tests: a complete setup, a believable sample, and a motor written apart from the
// firmware (dq equations in double, exact angle, averaged bridge), so that the law meets something it does not share.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "boards/dual_48v_20a.hpp"
#include "firmware/driver.hpp"
#include "thermal/motor_set.hpp"

namespace bench {

inline constexpr double period_s = 1.0 / 20e3;
inline constexpr float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
inline constexpr firmware::BoardRating rating = boards::dual_48V_20A;

/// EC-powermax class, 48 V winding.
inline wire::Motor motor() {
  wire::Motor m{};
  m.phase_resistance_ohm = 0.193;
  m.inductance_d_H = m.inductance_q_H = 32.5e-6;
  m.flux_linkage_Wb = 27.6e-3 / (std::sqrt(3.0) * 2);
  m.pole_pairs = 2;
  m.rotor_inertia_kg_m2 = 33.3e-7;
  m.R1_K_per_W = 0.209;
  m.R2_K_per_W = 7.4;
  m.C1_J_per_K = 2.11 / 0.209;
  m.C2_J_per_K = 1180 / 7.4;
  m.copper_coefficient_per_K = 0.00393;
  m.winding_max_degC = 155;
  return m;
}

inline firmware::AxisParameters parameters() { return firmware::parameters_from(motor(), rating, {48.0f, 0.0f}); }

inline firmware::AxisSetup axis_setup() { return {parameters(), thermal::three_phase_set(motor())}; }

inline firmware::DriverSetup driver_setup() { return {rating, {axis_setup(), axis_setup()}}; }

inline hal::AxisSample quiet_sample(std::uint32_t sequence) {
  return {{0.0f, 0.0f, 0.0f}, 48.0f, 1.0f, sequence, true};
}

/// Lets an axis learn its offsets on quiet samples, arms it; returns the next sequence number.
inline std::uint32_t bring_up(firmware::Axis& axis, std::uint32_t sequence = 1) {
  for (int i = 0; i < 2100; ++i) (void)axis.tick(quiet_sample(sequence++));
  (void)axis.arm();
  (void)axis.tick(quiet_sample(sequence++));
  return sequence;
}

/// dq motor on an averaged bridge; the duty acts one period after its sample.
struct Motor {
  wire::Motor sheet = motor();
  double bus_V = 48.0, rad_per_s = 0.0, angle_rad = 0.0;  // mechanical
  double id_A = 0.0, iq_A = 0.0;
  bool holds_speed = true;      // a brake or a drive keeps the speed
  double dead_time_s = 500e-9;  // as the rating says
  hal::Duty acting{{0.5f, 0.5f, 0.5f}, false}, loaded{{0.5f, 0.5f, 0.5f}, false};
  std::uint32_t sequence = 0;

  wire::Abc phases() const {
    const double e = angle_rad * sheet.pole_pairs;
    const auto phase = [&](double shift) {
      return static_cast<float>(id_A * std::cos(e - shift) - iq_A * std::sin(e - shift));
    };
    constexpr double third = 2.0943951023931953;
    return {phase(0.0), phase(third), phase(-third)};
  }

  hal::AxisSample sample() {
    double wrapped = std::fmod(angle_rad, 2 * M_PI);
    if (wrapped < 0) wrapped += 2 * M_PI;
    return {phases(), static_cast<float>(bus_V), static_cast<float>(wrapped), ++sequence, true};
  }

  /// One PWM period with the duty loaded before; `next` loads for the following one.
  void run(const hal::Duty& next) {
    acting = loaded;
    loaded = next;
    constexpr int steps = 20;
    for (int i = 0; i < steps; ++i) step(period_s / steps);
  }

  void step(double dt_s) {
    const double e = angle_rad * sheet.pole_pairs, w = rad_per_s * sheet.pole_pairs;
    const wire::Abc i = phases();
    const auto volts = [&](float ratio, float current_A) {
      const double lost = current_A > 0 ? dead_time_s / period_s : current_A < 0 ? -dead_time_s / period_s : 0.0;
      return (static_cast<double>(ratio) - lost) * bus_V;
    };
    if (!acting.on) {
      id_A = iq_A = 0.0;
    } else {
      const double a = volts(acting.ratio.a, i.a), b = volts(acting.ratio.b, i.b), c = volts(acting.ratio.c, i.c);
      const double alpha = (2 * a - b - c) / 3, beta = (b - c) / std::sqrt(3.0);
      const double vd = alpha * std::cos(e) + beta * std::sin(e), vq = beta * std::cos(e) - alpha * std::sin(e);
      const double did =
          (vd - sheet.phase_resistance_ohm * id_A + w * sheet.inductance_q_H * iq_A) / sheet.inductance_d_H;
      const double diq =
          (vq - sheet.phase_resistance_ohm * iq_A - w * (sheet.inductance_d_H * id_A + sheet.flux_linkage_Wb)) /
          sheet.inductance_q_H;
      id_A += did * dt_s;
      iq_A += diq * dt_s;
    }
    if (!holds_speed)
      rad_per_s += 1.5 * sheet.pole_pairs * sheet.flux_linkage_Wb * iq_A / sheet.rotor_inertia_kg_m2 * dt_s;
    angle_rad += rad_per_s * dt_s;
  }
};

}  // namespace bench

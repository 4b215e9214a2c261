// SPDX-License-Identifier: MIT
// What a motor's sheet says about overload: indices (6) and (7), and behind them the exact curves of the paper's Figs 1
// and 2: how many times its rating a motor stands for t seconds from cold, and how warm its housing is by then.
//
// Two-resistor motor, R(T) in both the push and the rating. Currents are amplitudes of the phase currents; a sheet's
// direct current through two terminals is sqrt(3)/2 of that (wire/motor.hpp). For the PC: no state, bounded loops, not
// for a lane.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

#include "thermal/network.hpp"
#include "wire/motor.hpp"

namespace thermal {

/// Eq. 6, sqrt(s): I / I_N for a short time t is about index / sqrt(t); good for t well below R1 C1 only, 10 % low
/// there.
inline double short_term_index(const wire::Motor& m) { return std::sqrt(m.C1_J_per_K * (m.R1_K_per_W + m.R2_K_per_W)); }

/// Eq. 7: I / I_N with the housing held at ambient by a coolant; copper loss only.
inline double forced_cooling_index(const wire::Motor& m) {
  return std::sqrt((m.R1_K_per_W + m.R2_K_per_W) / m.R1_K_per_W);
}

/// Direct current through two terminals that heats like phase currents of this amplitude.
inline double direct_A(double amplitude_A) { return wire::direct_per_amplitude * amplitude_A; }

/// Amplitude that holds the winding at its limit for ever.
inline double rated_current_A(const wire::Motor& m, double ambient_degC) {
  const double ohm = 1.5 * m.phase_resistance_ohm * (1.0 + m.copper_coefficient_per_K * (m.winding_max_degC - 25.0));
  return std::sqrt((m.winding_max_degC - ambient_degC) / (m.R1_K_per_W + m.R2_K_per_W) / ohm);
}

/// Winding and housing after t seconds at a constant amplitude, both starting at ambient, degC. Exact: at constant
/// current the motor with R(T) is linear.
inline Eigen::Vector2d constant_current_degC(const wire::Motor& m, double current_A, double t_s, double ambient_degC) {
  const double heat_W = 1.5 * m.phase_resistance_ohm * current_A * current_A;
  const double g1 = 1.0 / m.R1_K_per_W, g2 = 1.0 / m.R2_K_per_W;
  Eigen::Matrix2d a;
  a << (heat_W * m.copper_coefficient_per_K - g1) / m.C1_J_per_K, g1 / m.C1_J_per_K, g1 / m.C2_J_per_K,
      -(g1 + g2) / m.C2_J_per_K;
  const double from_cold_W = heat_W * (1.0 + m.copper_coefficient_per_K * (ambient_degC - 25.0));
  Eigen::Matrix2d phi0, phi1, phi2;
  phi_functions(a, t_s, phi0, phi1, phi2);
  return phi1.col(0) * (from_cold_W / m.C1_J_per_K) + Eigen::Vector2d::Constant(ambient_degC);
}

/// Amplitude with which the winding reaches its limit after exactly t seconds from cold. Bisection to 1e-12.
inline double current_to_limit_A(const wire::Motor& m, double t_s, double ambient_degC) {
  double low_A = 0.0, high_A = rated_current_A(m, ambient_degC);
  const auto passes = [&](double current_A) {
    return !(constant_current_degC(m, current_A, t_s, ambient_degC)[0] < m.winding_max_degC);  // overflow passes too
  };
  for (int i = 0; i < 60 && !passes(high_A); ++i) low_A = high_A, high_A *= 2.0;
  for (int i = 0; i < 60; ++i) {
    const double middle_A = 0.5 * (low_A + high_A);
    (passes(middle_A) ? high_A : low_A) = middle_A;
  }
  return 0.5 * (low_A + high_A);
}

/// Fig 1: I / I_N against the time to the limit, from cold.
inline double overload_ratio(const wire::Motor& m, double t_s, double ambient_degC) {
  return current_to_limit_A(m, t_s, ambient_degC) / rated_current_A(m, ambient_degC);
}

/// Fig 2: housing temperature when the winding reaches its limit after t seconds.
inline double housing_at_limit_degC(const wire::Motor& m, double t_s, double ambient_degC) {
  return constant_current_degC(m, current_to_limit_A(m, t_s, ambient_degC), t_s, ambient_degC)[1];
}

}  // namespace thermal

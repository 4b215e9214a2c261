// SPDX-License-Identifier: MIT
// An independent reference for the thermal tests: the differential equations written once more, by hand, in long
// double, with classical Runge-Kutta steps. It shares no line with thermal/.
#pragma once

#include <array>
#include <cmath>

#include "wire/motor.hpp"

namespace reference {

using Real = long double;

inline wire::Motor motor(double R_ll_ohm, double R1, double R2, double tau_w, double tau_m) {
  wire::Motor m{};
  m.phase_resistance_ohm = R_ll_ohm / 2;
  m.R1_K_per_W = R1;
  m.R2_K_per_W = R2;
  m.C1_J_per_K = tau_w / R1;
  m.C2_J_per_K = tau_m / R2;
  m.copper_coefficient_per_K = 0.00393;
  m.winding_max_degC = 155;
  m.pole_pairs = 1;
  return m;
}

inline wire::Motor ec16() { return motor(1.0, 1.08, 16.3, 1.22, 294); }
inline wire::Motor powermax() { return motor(0.102, 0.209, 7.4, 2.11, 1180); }

/// One classical Runge-Kutta step of x' = f(x).
template <std::size_t N, class F>
void rk4(std::array<Real, N>& x, Real h, F f) {
  auto shifted = [&](const std::array<Real, N>& k, Real s) {
    auto y = x;
    for (std::size_t i = 0; i < N; ++i) y[i] += s * k[i];
    return y;
  };
  const auto k1 = f(x), k2 = f(shifted(k1, h / 2)), k3 = f(shifted(k2, h / 2)), k4 = f(shifted(k3, h));
  for (std::size_t i = 0; i < N; ++i) x[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
}

/// Winding and housing; current is the amplitude of the phase currents.
struct TwoNodes {
  wire::Motor m;
  std::array<Real, 2> degC{25, 25};

  void advance(Real seconds, int steps, Real current2_A2, Real ambient_degC, Real extra_W = 0) {
    const Real R1 = m.R1_K_per_W, R2 = m.R2_K_per_W, C1 = m.C1_J_per_K, C2 = m.C2_J_per_K;
    for (int i = 0; i < steps; ++i) {
      rk4(degC, seconds / steps, [&](const std::array<Real, 2>& T) {
        const Real heat =
            Real(1.5) * m.phase_resistance_ohm * current2_A2 * (1 + Real(m.copper_coefficient_per_K) * (T[0] - 25)) +
            extra_W;
        const Real across = (T[0] - T[1]) / R1;
        return std::array<Real, 2>{(heat - across) / C1, (across - (T[1] - ambient_degC) / R2) / C2};
      });
    }
  }
};

/// Three phase windings and the housing, coupled in pairs.
struct ThreePhases {
  wire::Motor m;
  std::array<Real, 4> degC{25, 25, 25, 25};

  void advance(Real seconds, int steps, const std::array<Real, 3>& phase_A2, Real ambient_degC) {
    const Real R1 = m.R1_K_per_W, R2 = m.R2_K_per_W, C1 = m.C1_J_per_K, C2 = m.C2_J_per_K;
    const Real couple = m.phase_coupling_W_per_K;
    for (int i = 0; i < steps; ++i) {
      rk4(degC, seconds / steps, [&](const std::array<Real, 4>& T) {
        std::array<Real, 4> rate{};
        Real into_housing = 0;
        for (std::size_t k = 0; k < 3; ++k) {
          const Real heat = m.phase_resistance_ohm * phase_A2[k] * (1 + Real(m.copper_coefficient_per_K) * (T[k] - 25));
          const Real across = (T[k] - T[3]) / (3 * R1);
          const Real beside = couple * (T[(k + 1) % 3] + T[(k + 2) % 3] - 2 * T[k]);
          rate[k] = (heat - across + beside) / (C1 / 3);
          into_housing += across;
        }
        rate[3] = (into_housing - (T[3] - ambient_degC) / R2) / C2;
        return rate;
      });
    }
  }

  Real hottest_degC() const { return std::max(degC[0], std::max(degC[1], degC[2])); }
};

}  // namespace reference

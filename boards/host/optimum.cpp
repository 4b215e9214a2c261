// SPDX-License-Identifier: MIT
#include "boards/host/optimum.hpp"

#include <algorithm>
#include <cmath>

namespace boards::host {

double optimal_impulse_As(const Scene& scene, const wire::Motor& m, double most_A) {
  // Euler at 10 us: the fastest winding of the table has a second; the error is below 0.001 % of the impulse.
  constexpr double step_s = 1e-5;
  double T1_degC = scene.start_degC, T2_degC = scene.start_degC, impulse_As = 0;
  const double loss_per_A2 = 1.5 * m.phase_resistance_ohm;
  for (double t_s = 0; t_s < scene.seconds; t_s += step_s) {
    const double resistance_ratio = 1 + m.copper_coefficient_per_K * (T1_degC - 25);
    const double outflow_W = (T1_degC - T2_degC) / m.R1_K_per_W;
    double i_A = std::min(std::abs(demand_A(scene, 0, t_s)), most_A);
    if (T1_degC >= m.winding_max_degC)
      i_A = std::min(i_A, std::sqrt(std::max(0.0, outflow_W) / (loss_per_A2 * resistance_ratio)));
    impulse_As += i_A * step_s;
    T1_degC += step_s * (loss_per_A2 * resistance_ratio * i_A * i_A - outflow_W) / m.C1_J_per_K;
    T2_degC += step_s * (outflow_W - (T2_degC - scene.ambient_degC) / m.R2_K_per_W) / m.C2_J_per_K;
  }
  return impulse_As;
}

}  // namespace boards::host

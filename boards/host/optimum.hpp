// SPDX-License-Identifier: MIT
// The best any limiter could do: full current until the winding is at its limit, then exactly the current that keeps it
// there (time-optimal for two nodes). It knows the true parameters and the true temperatures, which no firmware can.
#pragma once

#include "boards/host/scene.hpp"

namespace boards::host {

/// The plain two-resistor motor that the simulated one reduces to.
struct TwoNodes {
  double R1_K_per_W, R2_K_per_W, C1_J_per_K, C2_J_per_K;
  double phase_resistance_ohm;  // at 25 degC
  double copper_coefficient_per_K;
  double winding_max_degC;
  double hot_phase_share;  // of |i|^2 in the hottest phase: 1/2 rotating, up to 1 standing
};

/// Impulse (integral of |i|) of axis 0 over the scene's demand, clamped to `most_A`, in ampere seconds.
/// A standing rotor is treated as if all three phases carried the hottest phase's loss: the exact optimum is not lower
/// than this, so for stalled scenes the figure is a lower bound and is not used.
double optimal_impulse_As(const Scene& scene, const TwoNodes& motor, double most_A);

}  // namespace boards::host

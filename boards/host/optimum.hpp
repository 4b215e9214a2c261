// SPDX-License-Identifier: MIT
// The best any limiter could do: full current until the winding is at its limit, then exactly the current that keeps it
// there (time-optimal for two nodes). It knows the true parameters and the true temperatures, which no firmware can.
#pragma once

#include "boards/host/scene.hpp"
#include "wire/motor.hpp"

namespace boards::host {

/// Impulse (integral of |i|) of axis 0 over the scene's demand, clamped to `most_A`, in ampere seconds.
/// All three phases share the heat: not for a standing rotor.
double optimal_impulse_As(const Scene& scene, const wire::Motor& motor, double most_A);

}  // namespace boards::host

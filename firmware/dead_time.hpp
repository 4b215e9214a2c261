// SPDX-License-Identifier: MIT
// Puts back the volt-seconds that the dead time takes: while both switches are open the current chooses the rail, so a
// phase that delivers current loses dead time / period of the bus and one that draws it gains as much.
//
// Driven by the current that is asked for, not by the measured one: the measured one would close a positive feedback
// around zero with a gain of bus * ratio / soft current, about an ohm, more than many windings have. Soft around
// zero, where ripple and the switches' capacitance blur the step: half at the soft current, 98 % at fifty times that.
// Comes before the modulator, which then keeps its bounds for both. ISR.
#pragma once

#include <cmath>

#include "firmware/transforms.hpp"

namespace firmware {

class DeadTime {
 public:
  DeadTime() = default;
  DeadTime(float dead_time_s, float pwm_Hz, float soft_A) : ratio_(dead_time_s * pwm_Hz), soft_A_(soft_A) {}

  Abc compensate(const Abc& asked_V, const Abc& expected_A, float bus_V) const {
    const float full_V = ratio_ * bus_V;
    return {asked_V.a + full_V * expected_A.a / (soft_A_ + std::fabs(expected_A.a)),
            asked_V.b + full_V * expected_A.b / (soft_A_ + std::fabs(expected_A.b)),
            asked_V.c + full_V * expected_A.c / (soft_A_ + std::fabs(expected_A.c))};
  }

 private:
  float ratio_ = 0.0f, soft_A_ = 1.0f;
};

}  // namespace firmware

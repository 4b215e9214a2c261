// SPDX-License-Identifier: MIT
// Puts back the volt-seconds that the dead time takes: while both switches are open the current chooses the rail, so a
// phase that delivers current loses dead time / period of the bus and one that draws it gains as much.
//
// Driven by the current that is asked for, not by the measured one: the measured one would close a positive feedback
// around zero with a gain of bus * ratio / soft current, about an ohm, more than many windings have. Linear below the
// soft current, where ripple makes the sign of the current change within a period. ISR.
#pragma once

#include "firmware/transforms.hpp"

namespace firmware {

class DeadTime {
 public:
  DeadTime() = default;
  DeadTime(float dead_time_s, float pwm_Hz, float soft_A, float usable_ratio)
      : ratio_(dead_time_s * pwm_Hz), per_A_(ratio_ / soft_A), usable_ratio_(usable_ratio + rounding) {}

  Abc compensate(const Abc& ratio, const Abc& expected_A) const {
    return {phase(ratio.a, expected_A.a), phase(ratio.b, expected_A.b), phase(ratio.c, expected_A.c)};
  }

 private:
  static constexpr float rounding = 1e-5f;  // of the modulator, which may put a duty a last place above the window

  float phase(float ratio, float expected_A) const {
    const float ceiling = ratio > usable_ratio_ ? 1.0f : usable_ratio_;  // a sampling window that is there stays
    const float lift = per_A_ * expected_A;
    const float out = ratio + (lift > ratio_ ? ratio_ : lift < -ratio_ ? -ratio_ : lift);
    return out > ceiling ? ceiling : out < 0.0f ? 0.0f : out;
  }

  float ratio_ = 0.0f, per_A_ = 0.0f, usable_ratio_ = 1.0f;
};

}  // namespace firmware

// SPDX-License-Identifier: MIT
// Where the rotor is, how fast it turns, and where it will be when the duty acts.
//
//   in   mechanical angle rad [0, 2 pi], PWM periods since the last one
//   out  electrical angle at the sample and in the middle of the next PWM period, speed
//
// The angle is taken as measured; only the speed is observed (a tracking loop with both poles at 1/(1 + w T)), because
// a filtered angle would lag by acceleration / w^2, which for a small motor pushed hard is a large part of a radian.
// Does not judge its input (the guard did). Same cost every call, ISR.
#pragma once

#include <cstdint>

#include "firmware/axis_parameters.hpp"
#include "hal/axis_port.hpp"

namespace firmware {

inline constexpr float pi = 3.14159265f;

struct RotorAngle {
  float at_sample_rad;  // electrical
  float at_output_rad;  // electrical
};

class Rotor {
 public:
  Rotor() = default;
  Rotor(const AxisParameters& p, const BoardRating& rating)
      : period_s_(1.0f / rating.pwm_Hz), pole_pairs_(p.pole_pairs_count), offset_rad_(p.angle_offset_rad) {
    const float pole = 1.0f / (1.0f + 2.0f * pi * p.rotor_bandwidth_Hz * period_s_);
    angle_gain_ = 1.0f - pole * pole;
    speed_gain_per_s_ = (1.0f - pole) * (1.0f - pole) * rating.pwm_Hz;
    max_rad_per_s_ = 0.25f * pi * rating.pwm_Hz;
  }

  RotorAngle follow(float mechanical_rad, std::uint32_t periods) {
    if (periods == 1) {
      const float expected_rad = tracked_rad_ + speed_rad_per_s_ * period_s_;
      const float error_rad = within_half_turn(mechanical_rad - expected_rad);
      tracked_rad_ = within_half_turn(expected_rad + angle_gain_ * error_rad);
      speed_rad_per_s_ = clamped(speed_rad_per_s_ + speed_gain_per_s_ * error_rad, max_rad_per_s_);
    } else {
      tracked_rad_ = within_half_turn(mechanical_rad);  // after a gap the speed stands, the angle starts anew
    }
    const float electrical_rad = mechanical_rad * pole_pairs_ - offset_rad_;
    return {electrical_rad, electrical_rad + electrical_rad_per_s() * (hal::output_delay_periods * period_s_)};
  }

  float rad_per_s() const { return speed_rad_per_s_; }  // mechanical
  float electrical_rad_per_s() const { return speed_rad_per_s_ * pole_pairs_; }

 private:
  /// For |x| < 3 pi.
  static float within_half_turn(float x_rad) {
    if (x_rad > pi) return x_rad - 2.0f * pi;
    if (x_rad < -pi) return x_rad + 2.0f * pi;
    return x_rad;
  }
  static float clamped(float x, float bound) { return x > bound ? bound : x < -bound ? -bound : x; }

  float period_s_ = 0.0f, pole_pairs_ = 0.0f, offset_rad_ = 0.0f;
  float angle_gain_ = 0.0f, speed_gain_per_s_ = 0.0f;
  float max_rad_per_s_ = 0.0f;  // an eighth of a turn per period: keeps every angle in reach of one correction
  float tracked_rad_ = 0.0f, speed_rad_per_s_ = 0.0f;
};

}  // namespace firmware

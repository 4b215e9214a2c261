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
#include "firmware/bits.hpp"
#include "firmware/transforms.hpp"
#include "hal/axis_port.hpp"
#include "thermal/flip_sum.hpp"

namespace firmware {

struct RotorAngle {
  ElectricalAngle at_sample;
  ElectricalAngle at_output;  // in the middle of the PWM period that the duty acts in
};

class Rotor {
 public:
  Rotor() = default;
  Rotor(const AxisParameters& p, const BoardRating& rating)
      : pole_pairs_(static_cast<std::uint32_t>(p.pole_pairs_count)),
        electrical_per_mechanical_(p.pole_pairs_count),
        offset_(quarters_of(p.angle_offset_rad)) {
    const float pole = 1.0f / (1.0f + 2.0f * pi * p.rotor_bandwidth_Hz / rating.pwm_Hz);
    angle_gain_ = 1.0f - pole * pole;
    speed_gain_ = (1.0f - pole) * (1.0f - pole) * rating.pwm_Hz * rad_per_turn32;
    turn32_per_speed_ = 1.0f / (rating.pwm_Hz * rad_per_turn32);
    ahead_per_speed_ = turn32_per_speed_ * hal::output_delay_periods * p.pole_pairs_count;
    // A quarter of an electrical turn per period: beyond it there is no sine left to modulate, and 1.5 periods of it
    // still fit into half a turn.
    max_rad_per_s_ = 0.5f * pi * rating.pwm_Hz / p.pole_pairs_count;
  }

  /// With other parameters the rotor turns as fast as it did.
  Rotor(const AxisParameters& p, const BoardRating& rating, const Rotor& last) : Rotor(p, rating) {
    tracked_ = last.tracked_;
    rad_per_s_ = within(last.rad_per_s_, max_rad_per_s_) ? last.rad_per_s_ : 0.0f;
  }

  /// mechanical_rad within [0, 2 pi].
  RotorAngle follow(float mechanical_rad, std::uint32_t periods) {
    const std::uint32_t measured = quarters_of(mechanical_rad);
    if (periods == 1) {
      const std::uint32_t expected = tracked_ + whole(rad_per_s_ * turn32_per_speed_);
      const float error = static_cast<float>(static_cast<std::int32_t>(measured - expected));
      tracked_ = expected + whole(angle_gain_ * error);
      rad_per_s_ += speed_gain_ * error;
      if (!within(rad_per_s_, max_rad_per_s_)) rad_per_s_ = rad_per_s_ > 0.0f ? max_rad_per_s_ : -max_rad_per_s_;
    } else {
      tracked_ = measured;  // after a gap the speed stands, the angle starts anew
    }
    const std::uint32_t electrical = measured * pole_pairs_ - offset_;
    return {{electrical}, {electrical + whole(rad_per_s_ * ahead_per_speed_)}};
  }

  /// Half a PWM period before it stood at mechanical_rad, within [0, 2 pi].
  ElectricalAngle half_a_period_before(float mechanical_rad) const {
    const float turn32 = 0.5f * rad_per_s_ * turn32_per_speed_ * electrical_per_mechanical_;
    return {quarters_of(mechanical_rad) * pole_pairs_ - offset_ - whole(turn32)};
  }
  const float& rad_per_s() const { return rad_per_s_; }  // mechanical
  float electrical_rad_per_s() const { return rad_per_s_ * electrical_per_mechanical_; }

  void add_built_to(thermal::FlipSum& sum) const {
    sum.add(pole_pairs_, electrical_per_mechanical_, offset_, angle_gain_, speed_gain_, turn32_per_speed_,
            ahead_per_speed_, max_rad_per_s_);
  }

 private:
  static constexpr float rad_per_turn32 = 2.0f * pi / 4294967296.0f;

  /// Angle to turns of 2^32, by way of a quarter of it so that 2 pi fits into an int; |angle| <= 2 pi.
  static constexpr std::uint32_t quarters_of(float rad) {
    return static_cast<std::uint32_t>(static_cast<std::int32_t>(rad * (0.25f / rad_per_turn32))) << 2;
  }
  static std::uint32_t whole(float turn32) { return static_cast<std::uint32_t>(static_cast<std::int32_t>(turn32)); }

  std::uint32_t pole_pairs_ = 1;
  float electrical_per_mechanical_ = 1.0f;
  std::uint32_t offset_ = 0;
  float angle_gain_ = 0.0f, speed_gain_ = 0.0f;
  float turn32_per_speed_ = 0.0f, ahead_per_speed_ = 0.0f;
  float max_rad_per_s_ = 0.0f;
  std::uint32_t tracked_ = 0;
  float rad_per_s_ = 0.0f;
};

}  // namespace firmware

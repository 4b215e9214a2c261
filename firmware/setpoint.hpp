// SPDX-License-Identifier: MIT
// The current that is asked for, and how old the asking is.
//
// `set` is called by one writer outside the control interrupt; the fast lane follows. Age is counted in PWM periods, so
// there is no clock to be wrong or to wrap: every fresh, valid setpoint of this axis starts it anew. Past the time-out
// the request fades linearly to zero, then the setpoint is gone and the bridge opens.
#pragma once

#include <atomic>
#include <cstdint>

#include "firmware/axis_parameters.hpp"
#include "firmware/transforms.hpp"
#include "thermal/flip_sum.hpp"
#include "wire/codes.hpp"

namespace firmware {

inline constexpr float largest_setpoint_A = 1000.0f;  // beyond any board: not a wish but garbage

class Setpoint {
 public:
  /// Before the first tick.
  void configure(const AxisParameters& p, const BoardRating& rating) {
    timeout_periods_ = static_cast<std::uint32_t>(p.setpoint_timeout_s * rating.pwm_Hz);
    fade_per_period_ = 1.0f / (p.ramp_s * rating.pwm_Hz);
  }

  /// Not from the control interrupt, one caller per axis. A refused setpoint leaves the last one and its age alone.
  wire::Status set(const Dq& current_A) {
    if (!(within(current_A.d) && within(current_A.q))) return wire::Status::not_a_current;
    const std::uint32_t serial = serial_.load(std::memory_order_relaxed) + 1;
    slots_[serial & 1] = current_A;
    std::atomic_signal_fence(std::memory_order_release);  // one core: the interrupt sees what the compiler wrote before
    serial_.store(serial, std::memory_order_relaxed);
    return wire::Status::done;
  }

  /// Call once a tick, before the two below.
  void follow(std::uint32_t periods) {
    const std::uint32_t serial = serial_.load(std::memory_order_relaxed);
    if (serial != seen_) {
      seen_ = serial;
      age_periods_ = 0;
      share_ = 1.0f;
    } else {
      age_periods_ += periods;
      if (age_periods_ >= timeout_periods_) [[unlikely]]
        fade(periods);
    }
  }

  const Dq& current_A() const { return slots_[seen_ & 1]; }
  /// Of the current that is still asked for: 1, fading, or 0 when the setpoint is gone and the bridge may open.
  float share() const { return share_; }

  /// Forgets whatever was asked until now: only what comes later counts.
  void discard() {
    seen_ = serial_.load(std::memory_order_relaxed);
    share_ = 0.0f;
  }

  bool is_zero() const {
    const Dq& last_A = slots_[serial_.load(std::memory_order_relaxed) & 1];
    return last_A.d == 0.0f && last_A.q == 0.0f;
  }

  void add_built_to(thermal::FlipSum& sum) const { sum.add(timeout_periods_, fade_per_period_); }

 private:
  static bool within(float x_A) { return x_A >= -largest_setpoint_A && x_A <= largest_setpoint_A; }

  void fade(std::uint32_t periods) {
    share_ -= fade_per_period_ * static_cast<float>(periods);
    if (!(share_ > 0.0f)) share_ = 0.0f;
  }

  std::uint32_t timeout_periods_ = 0;
  float fade_per_period_ = 1.0f;
  Dq slots_[2]{};
  std::atomic<std::uint32_t> serial_{0};  // its last bit names the slot that holds
  std::uint32_t seen_ = 0, age_periods_ = 0;
  float share_ = 0.0f;
};

}  // namespace firmware

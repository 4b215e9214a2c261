// SPDX-License-Identifier: MIT
// Asked current -> permitted current: the one limiter on |i|, in every mode, with the one reason that holds.
//
//   in   asked current, allowance of the slow lane and its age, bus voltage, speed
//   out  permitted current (same direction, |i| never above the board's peak), reason
//
// Every comparison is written so that NaN ends at zero amperes. Same cost class every call, ISR.
#pragma once

#include <cmath>
#include <cstdint>

#include "firmware/axis_parameters.hpp"
#include "firmware/bits.hpp"
#include "firmware/setpoint.hpp"
#include "firmware/transforms.hpp"
#include "thermal/flip_sum.hpp"
#include "wire/codes.hpp"

namespace firmware {

/// What the slow lane hands inward.
struct Allowance {
  float current_A;
  wire::Limit reason;
};

struct Permitted {
  Dq current_A;
  wire::Limit reason;
};

class Permit {
 public:
  /// Without an answer of the slow lane for this long, no more than a share of the continuous current.
  static constexpr float patience_s = 0.03f;
  static constexpr float late_share = 0.6f;
  /// The speed of a rotor that stands swings about zero by rounding: that is no braking.
  static constexpr float nothing_A_rad_per_s = 1.0f;

  Permit() = default;
  Permit(const AxisParameters& p, const BoardRating& rating)
      : most_A_(p.current_limit_A < rating.peak_A ? p.current_limit_A : rating.peak_A),
        most_reason_(p.current_limit_A < rating.peak_A ? wire::Limit::configured : wire::Limit::hardware),
        late_A_(late_share * rating.continuous_A),
        sound_A_(0.0f, most_A_),
        easy_bus_V_(p.bus_low_start_V, p.bus_high_start_V),
        patience_periods_(static_cast<std::uint32_t>(patience_s * rating.pwm_Hz)),
        high_end_V_(p.bus_high_end_V),
        high_A_per_V_(rating.peak_A / (p.bus_high_end_V - p.bus_high_start_V)),
        low_end_V_(p.bus_low_end_V),
        low_A_per_V_(rating.peak_A / (p.bus_low_start_V - p.bus_low_end_V)) {}

  /// The largest |i| whatever the slow lane says, and why: what it starts from.
  Allowance most() const { return {most_A_, most_reason_}; }

  /// allowance.current_A must lie within [0, most]: what does not is broken memory and allows nothing.
  Permitted permit(const Setpoint& asked, const Allowance& allowance, std::uint32_t allowance_age_periods, float bus_V,
                   float rad_per_s) const {
    float limit_A = sound_A_.holds(allowance.current_A) ? allowance.current_A : 0.0f;
    wire::Limit reason = allowance.reason;
    if (allowance_age_periods > patience_periods_) tighten(limit_A, reason, late_A_, wire::Limit::thermal_late);
    if (!easy_bus_V_.holds(bus_V)) [[unlikely]] {
      const bool brakes = asked.current_A().q * rad_per_s < -nothing_A_rad_per_s;
      if (brakes)
        tighten(limit_A, reason, (high_end_V_ - bus_V) * high_A_per_V_, wire::Limit::bus_high);
      else
        tighten(limit_A, reason, (bus_V - low_end_V_) * low_A_per_V_, wire::Limit::bus_low);
    }
    const Dq wish_A = {asked.current_A().d * asked.share(), asked.current_A().q * asked.share()};
    const float wish_A2 = wish_A.d * wish_A.d + wish_A.q * wish_A.q;
    if (wish_A2 <= limit_A * limit_A)
      return {wish_A, asked.share() < 1.0f ? wire::Limit::setpoint_old : wire::Limit::none};
    const float scale = limit_A / std::sqrt(wish_A2);
    return {{wish_A.d * scale, wish_A.q * scale}, reason};
  }

  void add_built_to(thermal::FlipSum& sum) const {
    sum.add(most_A_, most_reason_, late_A_, sound_A_, easy_bus_V_, patience_periods_, high_end_V_, high_A_per_V_,
            low_end_V_, low_A_per_V_);
  }

 private:
  static void tighten(float& limit_A, wire::Limit& reason, float candidate_A, wire::Limit why) {
    if (candidate_A >= limit_A) return;
    limit_A = candidate_A > 0.0f ? candidate_A : 0.0f;
    reason = why;
  }

  float most_A_ = 0.0f;
  wire::Limit most_reason_ = wire::Limit::hardware;
  float late_A_ = 0.0f;
  Range sound_A_, easy_bus_V_;
  std::uint32_t patience_periods_ = 0;
  float high_end_V_ = 0.0f, high_A_per_V_ = 0.0f;
  float low_end_V_ = 0.0f, low_A_per_V_ = 0.0f;
};

}  // namespace firmware

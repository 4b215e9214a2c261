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
#include "firmware/setpoint.hpp"
#include "firmware/transforms.hpp"
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

  Permit() = default;
  Permit(const AxisParameters& p, const BoardRating& rating)
      : hardware_A_(rating.peak_A),
        configured_A_(p.current_limit_A),
        late_A_(late_share * rating.continuous_A),
        patience_periods_(static_cast<std::uint32_t>(patience_s * rating.pwm_Hz)),
        high_start_V_(p.bus_high_start_V),
        high_end_V_(p.bus_high_end_V),
        high_A_per_V_(rating.peak_A / (p.bus_high_end_V - p.bus_high_start_V)),
        low_start_V_(p.bus_low_start_V),
        low_end_V_(p.bus_low_end_V),
        low_A_per_V_(rating.peak_A / (p.bus_low_start_V - p.bus_low_end_V)) {}

  Permitted permit(const Setpoint::Asked& asked, const Allowance& allowance, std::uint32_t allowance_age_periods,
                   float bus_V, float rad_per_s) const {
    float limit_A = hardware_A_;
    wire::Limit reason = wire::Limit::hardware;
    tighten(limit_A, reason, configured_A_, wire::Limit::configured);
    tighten(limit_A, reason, allowance.current_A, allowance.reason);
    if (allowance_age_periods > patience_periods_) tighten(limit_A, reason, late_A_, wire::Limit::thermal_late);
    if (!(bus_V >= low_start_V_ && bus_V <= high_start_V_)) {
      const bool brakes = asked.current_A.q * rad_per_s < 0.0f;
      if (brakes)
        tighten(limit_A, reason, (high_end_V_ - bus_V) * high_A_per_V_, wire::Limit::bus_high);
      else
        tighten(limit_A, reason, (bus_V - low_end_V_) * low_A_per_V_, wire::Limit::bus_low);
    }
    const float asked_A2 = asked.current_A.d * asked.current_A.d + asked.current_A.q * asked.current_A.q;
    if (asked_A2 <= limit_A * limit_A)
      return {asked.current_A, asked.old ? wire::Limit::setpoint_old : wire::Limit::none};
    const float scale = asked_A2 > 0.0f ? limit_A / std::sqrt(asked_A2) : 0.0f;
    return {{asked.current_A.d * scale, asked.current_A.q * scale}, reason};
  }

 private:
  static void tighten(float& limit_A, wire::Limit& reason, float candidate_A, wire::Limit why) {
    if (candidate_A >= limit_A) return;
    limit_A = candidate_A > 0.0f ? candidate_A : 0.0f;
    reason = why;
  }

  float hardware_A_ = 0.0f, configured_A_ = 0.0f, late_A_ = 0.0f;
  std::uint32_t patience_periods_ = 0;
  float high_start_V_ = 0.0f, high_end_V_ = 0.0f, high_A_per_V_ = 0.0f;
  float low_start_V_ = 0.0f, low_end_V_ = 0.0f, low_A_per_V_ = 0.0f;
};

}  // namespace firmware

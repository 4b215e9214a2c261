// SPDX-License-Identifier: MIT
#include "firmware/guard.hpp"

#include <cmath>

namespace firmware {

Sight Guard::refuse(wire::Fault fault, float value, float threshold) {
  found_ = {fault, 0, value, threshold, 0.0f};
  return {Verdict::refused, 0};
}

/// The rare path: which of the conditions of `admits` failed, and is it enough to trip?
Sight Guard::judge(const hal::AxisSample& s, std::uint32_t periods) {
  if (s.valid) {
    const float seen[] = {s.current_A.a, s.current_A.b, s.current_A.c, s.bus_V, s.rotor_rad};
    for (const float x : seen) {
      if (!std::isfinite(x)) return refuse(wire::Fault::not_finite, x, 0.0f);
    }
    for (int phase = 0; phase < 3; ++phase) {
      if (!within(seen[phase], trip_A_)) return refuse(wire::Fault::over_current, seen[phase], trip_A_);
    }
    if (s.bus_V > bus_max_V_) return refuse(wire::Fault::bus_over_voltage, s.bus_V, bus_max_V_);
    if (s.bus_V < bus_min_V_) return refuse(wire::Fault::bus_under_voltage, s.bus_V, bus_min_V_);
  }
  const bool usable = s.valid && turn_rad.holds(s.rotor_rad);
  if (usable && gap_ == 0) {  // the first sample ever has no predecessor
    gap_ = longest_gap;
    sequence_ = s.sequence;
    misses_ = 0;
    return {Verdict::fresh, 1};
  }
  if (usable && periods > longest_gap) {  // also a number that went backwards: no telling how much time is missing
    sequence_ = s.sequence;
    return refuse(wire::Fault::late_sample, static_cast<float>(periods) * period_s_,
                  static_cast<float>(longest_gap) * period_s_);
  }
  if (misses_ < misses_to_trip) ++misses_;
  if (misses_ < misses_to_trip) return {Verdict::bridged, 0};
  if (!usable) return refuse(wire::Fault::invalid_sample, static_cast<float>(misses_), misses_to_trip);
  return refuse(wire::Fault::late_sample, static_cast<float>(misses_) * period_s_,
                static_cast<float>(misses_to_trip) * period_s_);
}

}  // namespace firmware

// SPDX-License-Identifier: MIT
// What a board's power stage is and can stand: handed in by the board, never writable, above every user limit.
#pragma once

namespace firmware {

struct BoardRating {
  float pwm_Hz;
  float peak_A;             // phase amplitude, the last word on |i| in every mode
  float continuous_A;       // phase amplitude the board can carry for ever
  float trip_A;             // |phase current| that opens the bridge
  float bus_min_V;          // below: gates off
  float bus_max_V;          // above: gates off
  float dead_time_s;        // both switches of a phase open, at each edge
  float sampling_window_s;  // lower switches of two phases stay on at least this long, for the shunts
};

/// A rating that could not be meant is refused as a whole; NaN anywhere is such a one.
constexpr bool plausible(const BoardRating& r) {
  const float period_s = 1.0f / r.pwm_Hz;
  return r.pwm_Hz >= 1e3f && r.pwm_Hz <= 200e3f && r.continuous_A > 0.0f && r.peak_A >= r.continuous_A &&
         r.trip_A > r.peak_A && r.trip_A < 1e3f && r.bus_min_V > 0.0f && r.bus_max_V > r.bus_min_V &&
         r.bus_max_V < 1e3f && r.dead_time_s >= 0.0f && r.dead_time_s < 0.1f * period_s &&
         r.sampling_window_s >= 0.0f && r.sampling_window_s < 0.25f * period_s;
}

}  // namespace firmware

// SPDX-License-Identifier: MIT
// Between which bus voltages a drive derates, from the supply that feeds it: what no motor's sheet can know.
#pragma once

namespace wire {

/// V. Braking current comes down from `high_start` to none at `high_end`, driving current from `low_start` to none at
/// `low_end`.
struct BusWindow {
  float low_end_V, low_start_V, high_start_V, high_end_V;
};

/// Braking from 106 % to 113 % of the supply, driving from 75 % down to 50 % of it (design values of ours). Two axes
/// that brake with all they have raise a bus of 1 mF by 25 V a millisecond, and a current takes a quarter of one to
/// follow: 3.3 V above the end at 1700 rad/s and 48 V (closed_loop_test). Lower supplies leave more.
/// Both ends stay 2 % inside the board's own trips, so that derating is complete before the bridge opens.
constexpr BusWindow bus_window(float supply_V, float trip_low_V, float trip_high_V) {
  const float low_end_V = 0.5f * supply_V, high_end_V = 1.13f * supply_V;
  const float least_V = 1.02f * trip_low_V, most_V = 0.98f * trip_high_V;
  return {low_end_V < least_V ? least_V : low_end_V, 0.75f * supply_V, 1.06f * supply_V,
          high_end_V > most_V ? most_V : high_end_V};
}

}  // namespace wire

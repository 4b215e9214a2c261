// SPDX-License-Identifier: MIT
// The larger stage of the same design (H8-17.5D class): 80 A for seconds. What is known of it is the 80 A; the
// continuous current is an assumption of ours (the smaller stage's ratio), and so is everything it shares with the
// smaller one.
#pragma once

#include "boards/dual_48v_20a.hpp"

namespace boards {

inline constexpr firmware::BoardRating dual_48V_80A = [] {
  firmware::BoardRating rating = dual_48V_20A;
  rating.peak_A = 80.0f;
  rating.continuous_A = rating.peak_A * dual_48V_20A.continuous_A / dual_48V_20A.peak_A;
  rating.trip_A = rating.peak_A * dual_48V_20A.trip_A / dual_48V_20A.peak_A;
  return rating;
}();
static_assert(firmware::plausible(dual_48V_80A));

}  // namespace boards

// SPDX-License-Identifier: MIT
// The power stage that this project designs for: two axes on 48 V, 6 A for ever, 20 A for seconds.
// Voltages, dead time and window are design values of ours, to be confirmed against a schematic before a board is
// built.
#pragma once

#include "firmware/board_rating.hpp"

namespace boards {

inline constexpr firmware::BoardRating dual_48V_20A{
    .pwm_Hz = 20e3f,
    .peak_A = 20.0f,
    .continuous_A = 6.0f,
    .trip_A = 28.0f,         // 1.4 x peak: room for ripple and overshoot, below what 80 V MOSFETs of this class stand
    .bus_min_V = 12.0f,      // gate drivers lose their supply near 10 V
    .bus_max_V = 58.0f,      // 48 V + 20 %
    .dead_time_s = 500e-9f,  // longer than turn-off plus driver skew of such a stage (some 200 ns)
    // Shunts are sampled in the middle of the zero vector, so half of the window has to hold dead time (0.5 us),
    // settling of a shunt amplifier (1 us) and three cycles of a 14 MHz ADC (0.21 us): 1.71 us, and some slack.
    .sampling_window_s = 3.5e-6f,
};
static_assert(firmware::plausible(dual_48V_20A));

}  // namespace boards

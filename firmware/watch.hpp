// SPDX-License-Identifier: MIT
// Looks at what the fast lane left behind, every millisecond from the slow lane's context: do its readings contradict
// each other, or the motor? The fast lane has no instructions left for this, and a look takes none of it.
//
//   sum     three currents of a star have none. Where they have one a sensor is dead or stuck, or current leaks
//   answer  v = R i + j w (L i + flux). What is left over, the motor of the parameters cannot have made: a phase is
//           open, the encoder does not say where the rotor is, or the samples are another motor's
//
// No look decides alone: a doubt grows with each that contradicts and shrinks with each that does not. So noise, a step
// of the current (over in a millisecond) or a spoilt sample trips nothing, and a contradiction that comes and goes with
// the turning rotor does. At 1000 electrical turns a second all looks see one angle: no bound may hang on it. Blind to
// the sum where the board makes a third current from the others.
#pragma once

#include <cmath>

#include "firmware/guard.hpp"
#include "firmware/transforms.hpp"

namespace firmware {

class Watch {
 public:
  /// Of one tick.
  struct Look {
    Abc phase_A;
    Dq current_A, asked_V;
    float electrical_rad_per_s, bus_V;
    float share;    // of the voltage asked for that the bus could give
    bool switches;  // the bridge does: the voltage is the motor's
  };
  struct Motor {
    float ohm, inductance_H, flux_Wb;  // of the hottest phase, as it is now
  };

  void forget() { *this = {}; }

  /// Fault::none unless it is beyond doubt, and never by a look that agrees. The axis is the caller's to fill in.
  FaultRecord judge(const Look& look, const Motor& motor) {
    const float read_A[3] = {look.phase_A.a, look.phase_A.b, look.phase_A.c};
    const float sum_A = read_A[0] + read_A[1] + read_A[2];
    const float most_A = std::fmax(std::fabs(read_A[0]), std::fmax(std::fabs(read_A[1]), std::fabs(read_A[2])));
    const float sum_bound_A = sum_free_A + sum_share * most_A;
    const bool has_none = within(sum_A, sum_bound_A);
    sum_doubt_ = grown(sum_doubt_, has_none ? 0 : 2);
    if (!has_none && sum_doubt_ >= sum_beyond) return {wire::Fault::current_sum, 0, sum_A, sum_bound_A, 0.0f};

    if (!look.switches) return {};
    const float left_V = unexplained_V(look, motor), bound_V = answer_bound_V(look, motor);
    const bool answers = left_V <= bound_V;
    answer_doubt_ = grown(answer_doubt_, answers ? 0 : left_V <= 2.0f * bound_V ? 1 : 2);
    if (!answers && answer_doubt_ >= answer_beyond) return {wire::Fault::motor_differs, 0, left_V, bound_V, 0.0f};
    return {};
  }

 private:
  // Gains apart by 3 % make 1.2 A at 20 A, three offsets that drifted by 0.3 A each 0.9 A. Three looks in a row, or
  // more than one in three for some time.
  static constexpr float sum_free_A = 1.5f, sum_share = 0.06f;
  static constexpr int sum_beyond = 6;
  // Free: 1.5 V of 48 V is three times what dead time is. A winding may have half the resistance of its hottest phase
  // (copper at 25 and at 200 degC), a magnet a quarter less flux than its sheet says (hot, and a sheet's tolerance),
  // iron half of its inductance.
  static constexpr float free_of_bus = 0.03f, of_ohm = 0.5f, of_inductance = 0.5f, of_flux = 0.25f;
  static constexpr int answer_beyond = 8;  // looks more than those that agree

  static int grown(int doubt, int by) { return by > 0 ? doubt + by : doubt > 0 ? doubt - 1 : 0; }

  static float unexplained_V(const Look& look, const Motor& m) {
    const float w = look.electrical_rad_per_s;
    const Dq i = look.current_A;
    const float d_V = look.asked_V.d * look.share - m.ohm * i.d + w * m.inductance_H * i.q;
    const float q_V = look.asked_V.q * look.share - m.ohm * i.q - w * (m.inductance_H * i.d + m.flux_Wb);
    return std::sqrt(d_V * d_V + q_V * q_V);
  }
  static float answer_bound_V(const Look& look, const Motor& m) {
    const float w = std::fabs(look.electrical_rad_per_s);
    const float i_A = std::fabs(look.current_A.d) + std::fabs(look.current_A.q);
    return free_of_bus * look.bus_V + (of_ohm * m.ohm + of_inductance * w * m.inductance_H) * i_A +
           of_flux * w * m.flux_Wb;
  }

  int sum_doubt_ = 0, answer_doubt_ = 0;
};

}  // namespace firmware

// SPDX-License-Identifier: MIT
// Current error -> voltage, in the rotor frame.
//
//   kp = L w, ki = R w: the controller's zero lies on the winding's pole, the closed loop is one pole at w (plus delay)
//   v  = kp e + integral + feed-forward;   feed-forward d: -w_el Lq iq,  q: w_el (Ld id + flux linkage)
//
// Anti-windup: `settle` is told which share of the voltage the bridge could give, and moves the integral as if the
// error had been the one that asks for exactly that much. Same cost every call, ISR.
#pragma once

#include "firmware/axis_parameters.hpp"
#include "firmware/transforms.hpp"
#include "thermal/flip_sum.hpp"

namespace firmware {

class CurrentLoop {
 public:
  CurrentLoop() = default;
  CurrentLoop(const AxisParameters& p, const BoardRating& rating)
      : inductance_d_H_(p.inductance_d_H), inductance_q_H_(p.inductance_q_H), flux_linkage_Wb_(p.flux_linkage_Wb) {
    const float bandwidth_rad_per_s = 2.0f * pi * p.current_bandwidth_Hz;
    kp_d_V_per_A_ = p.inductance_d_H * bandwidth_rad_per_s;
    kp_q_V_per_A_ = p.inductance_q_H * bandwidth_rad_per_s;
    ki_V_per_A_ = p.phase_resistance_ohm * bandwidth_rad_per_s / rating.pwm_Hz;
    relief_d_ = relief(ki_V_per_A_ / kp_d_V_per_A_);
    relief_q_ = relief(ki_V_per_A_ / kp_q_V_per_A_);
  }

  void reset() { integral_V_ = {0.0f, 0.0f}; }

  Dq ask(const Dq& error_A, const Dq& current_A, float electrical_rad_per_s) const {
    const float cross_d_V = electrical_rad_per_s * (inductance_q_H_ * current_A.q);
    const float cross_q_V = electrical_rad_per_s * (inductance_d_H_ * current_A.d + flux_linkage_Wb_);
    return {kp_d_V_per_A_ * error_A.d + integral_V_.d - cross_d_V,
            kp_q_V_per_A_ * error_A.q + integral_V_.q + cross_q_V};
  }

  /// share: of asked_V that reached the motor, 0..1.
  void settle(const Dq& error_A, const Dq& asked_V, float share) {
    const float missing = 1.0f - share;
    integral_V_.d += ki_V_per_A_ * error_A.d - missing * relief_d_ * asked_V.d;
    integral_V_.q += ki_V_per_A_ * error_A.q - missing * relief_q_ * asked_V.q;
  }

  void add_built_to(thermal::FlipSum& sum) const {
    sum.add(inductance_d_H_, inductance_q_H_, flux_linkage_Wb_, kp_d_V_per_A_, kp_q_V_per_A_, ki_V_per_A_, relief_d_,
            relief_q_);
  }

 private:
  /// A winding that is done within a period would be relieved of more than what is missing, and swing about the limit.
  static constexpr float relief(float ratio) { return ratio < 1.0f ? ratio : 1.0f; }

  float inductance_d_H_ = 0.0f, inductance_q_H_ = 0.0f, flux_linkage_Wb_ = 0.0f;
  float kp_d_V_per_A_ = 0.0f, kp_q_V_per_A_ = 0.0f;
  float ki_V_per_A_ = 0.0f;                  // per PWM period
  float relief_d_ = 0.0f, relief_q_ = 0.0f;  // ki / kp, per PWM period
  Dq integral_V_{0.0f, 0.0f};
};

}  // namespace firmware

// SPDX-License-Identifier: MIT
// What the winding's heat has besides the sampled current: the ripple that sampling cannot see, the power that sensor
// set B infers from the bus, and the speed features of a heat set. Pure functions of one step's means; SI in, SI out.
//
// Knows no motor state. No state; any context, though set_speed calls pow and is for the 100 Hz lane.
#pragma once

#include <cmath>

#include "thermal/heat_set.hpp"
#include "wire/frames.hpp"

namespace thermal {

/// Mean square of the PWM ripple current vector, A^2: to be added to current_A2 (half of it to each phase's A^2).
///
/// Current is sampled in the middle of the zero vector, where the ripple is zero, so that no sample shows it. Over half
/// a centre-aligned period the voltage runs 000, one phase on, two phases on, 111, and the ripple is four straight
/// lines: exact for equal ld = lq (ripple at standstill is zero, unlike the half-bridge bound V / (4 L f)).
///   duty  on-time ratios 0..1, in any order      inductance_H  per phase (star)
inline float ripple_A2(const wire::Abc& duty, float bus_V, float inductance_H, float pwm_Hz) {
  float high = duty.a, middle = duty.b, low = duty.c;
  if (middle > high) {
    const float t = high;
    high = middle, middle = t;
  }
  if (low > middle) {
    const float t = middle;
    middle = low, low = t;
  }
  if (middle > high) {
    const float t = high;
    high = middle, middle = t;
  }
  // Active vectors of length 2/3, 60 degrees apart; u, v are coordinates on them: |x|^2 = 4/9 (u^2 + u v + v^2).
  const float one = high - middle, two = middle - low;
  struct Point {
    float u, v;
  };
  const Point corner[5] = {{0.0f, 0.0f},
                           {-(1.0f - high) * one, -(1.0f - high) * two},
                           {middle * one, -(1.0f - middle) * two},
                           {low * one, low * two},
                           {0.0f, 0.0f}};
  const float length[4] = {1.0f - high, one, two, low};
  float sum = 0.0f;
  for (int i = 0; i < 4; ++i) {
    const Point p = corner[i], q = corner[i + 1];
    const auto dot = [](Point x, Point y) {
      return (x.u * y.u + x.v * y.v + 0.5f * (x.u * y.v + x.v * y.u)) * (4.0f / 9.0f);
    };
    sum += length[i] * (dot(p, p) + dot(p, q) + dot(q, q)) * (1.0f / 3.0f);
  }
  const float unit_A = bus_V / (2.0f * inductance_H * pwm_Hz);
  return sum * unit_A * unit_A;
}

/// Heat of the winding from the bus (eq. 5 as corrected), W: (d Vi - Ke w) Ii / d, never below zero, so that braking
/// cannot cool. Holds iron and bridge loss as well: its error grows with speed. Below a modulation depth of 2 % the
/// winding current cannot be told from the bus current; the depth is then taken as 2 %, which reads too hot.
///   depth  modulation depth d = V_motor / V_bus      Ke_Vs  back-EMF per rad/s, same two terminals as V_motor
inline float bus_power_W(float depth, float bus_V, float bus_A, float Ke_Vs, float speed_rad_per_s) {
  const float d = depth > 0.02f ? depth : 0.02f;
  const float power_W = (d * bus_V - Ke_Vs * speed_rad_per_s) * bus_A / d;
  return power_W < 0.0f ? 0.0f : power_W;  // NaN stays NaN: the estimator replaces it by something hot
}

/// Fills every drive that holds speed, from the mean of |w| over one step and the currents that the input holds already
/// (10 ms is short against both).
inline void set_speed(HeatInput<>& input, double speed_rad_per_s) {
  const double w = std::abs(speed_rad_per_s);
  input[Drive::speed_rad_per_s] = w;
  input[Drive::speed2_rad2_per_s2] = w * w;
  input[Drive::speed3_rad3_per_s3] = w * w * w;
  input[Drive::current2_speed2] = input[Drive::current_A2] * w * w;
  input[Drive::current_speed] = input[Drive::current_A] * w;
  input[Drive::speed_to_0_8] = std::pow(w, 0.8);
}

}  // namespace thermal

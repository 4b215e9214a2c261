// SPDX-License-Identifier: MIT
// What the winding's heat has besides the sampled current: what a sample cannot see, the power that sensor set B infers
// from the bus, and the speed features of a heat set. Pure functions of one step's means; SI in, SI out.
//
// Knows no motor state. No state; any context, though set_speed calls pow and is for the 100 Hz lane.
#pragma once

#include <cmath>

#include "thermal/heat_set.hpp"
#include "wire/frames.hpp"

namespace thermal {

/// What unseen() must know of the bridge and the winding.
struct Switching {
  float bus_V, phase_ohm, inductance_H, pwm_Hz;  // the winding per phase (star), as warm as it is
  float dead_time_s;
};

/// What the square of a sample, A^2, must be added to say: of the current vector the square of its mean over a PWM
/// period, which torque goes by, and the mean of its square, which heats (half of it to each phase's A^2). May be
/// negative.
struct Unseen {
  float of_mean_A2, of_heat_A2;
};

///
/// Current is sampled in the middle of the zero vector, where the ripple is zero, so that no sample shows it. Over half
/// a centre-aligned period the voltage runs 000, one phase on, two phases on, 111, and the ripple is four straight
/// lines, the same backwards in the other half. What it drops in the resistance makes the sample differ from the mean
/// current, by the ripple's first moment over the time constant (first order: a hundredth of that remains while a
/// period is no longer than the time constant). Dead time delays a pulse's begin where current flows out and its end
/// where it flows in, so that the middle comes half of it, or all, after the sample. Where L/R is much longer than a
/// period only the ripple counts; of the paper's motor (60 us) the rest is up to 8 % of the heat.
///   duty  on-time ratios 0..1 of the period that ends with the sample      sample_A  phase currents
inline Unseen unseen(const wire::Abc& duty, const wire::Abc& sample_A, const Switching& by) {
  const float ratio[3] = {duty.a, duty.b, duty.c}, current_A[3] = {sample_A.a, sample_A.b, sample_A.c};
  int high = 0, low = 2;
  for (int k = 1; k < 3; ++k) high = ratio[k] > ratio[high] ? k : high;
  for (int k = 1; k >= 0; --k) low = ratio[k] < ratio[low] ? k : low;  // from the other end: of equals another one
  const int middle = 3 - high - low;

  const float zero = ratio[low], one = ratio[high] - ratio[middle], two = ratio[middle] - zero;
  const float mean = (ratio[0] + ratio[1] + ratio[2]) * (1.0f / 3.0f);
  // In parts of half a period: when each straight line begins and ends.
  const float at[5] = {0.0f, 1.0f - ratio[high], 1.0f - ratio[middle], 1.0f - zero, 1.0f};
  const float unit_A = by.bus_V / (2.0f * by.inductance_H * by.pwm_Hz);
  const float decay = by.phase_ohm / (by.inductance_H * by.pwm_Hz);  // a period in time constants
  const float half_dead = by.dead_time_s * by.pwm_Hz;                // half the dead time in parts of half a period
  float mean_A2 = 0.0f, ripple_A2 = 0.0f;
  for (int k = 0; k < 3; ++k) {
    const float error = ratio[k] - mean;
    const float first = k == high ? 2.0f / 3.0f : -1.0f / 3.0f, last = k == low ? -2.0f / 3.0f : 1.0f / 3.0f;
    const float begin = -error * at[1], end = begin + (first - error) * one;
    const float corner[5] = {0.0f, begin, end, end + (last - error) * two, 0.0f};
    float square = 0.0f, moment = 0.0f;
    for (int i = 0; i < 4; ++i) {
      const float p = corner[i], q = corner[i + 1], length = at[i + 1] - at[i];
      square += length * (p * p + p * q + q * q) * (1.0f / 3.0f);
      moment -= length * (0.5f * (1.0f - at[i]) * (p + q) - length * (p + 2.0f * q) * (1.0f / 6.0f));
    }
    const float edge_A = unit_A * (k == high ? begin : k == low ? corner[3] : end);
    const float delays = (current_A[k] + edge_A > 0.0f ? 1.0f : 0.0f) + (current_A[k] - edge_A < 0.0f ? 1.0f : 0.0f);
    const float missed_A = unit_A * (0.5f * decay * moment - error * delays * half_dead);
    mean_A2 += missed_A * (2.0f * current_A[k] + missed_A);
    ripple_A2 += unit_A * unit_A * square;
  }
  return {mean_A2 * (2.0f / 3.0f), (mean_A2 + ripple_A2) * (2.0f / 3.0f)};  // a vector's square is 2/3 of its phases'
}

/// The same of a rotor that turns by `turn_rad` (electrical) in a period, on top.
///
/// The bridge's voltage stands still for a period. So the current runs along a chord between two samples, and the
/// magnet's flux, on its arc, pushes it off by flux turn^2 / 8 L in the middle: two thirds of that in the mean, against
/// d.
inline Unseen unseen_turning(float d_A, float q_A, float flux_Wb, float turn_rad, float inductance_H) {
  const float turn2 = turn_rad * turn_rad, bow_A = flux_Wb * turn2 / (8.0f * inductance_H);
  const float along_A2 = -bow_A * d_A * (4.0f / 3.0f), chord_A2 = (d_A * d_A + q_A * q_A) * turn2;
  return {along_A2 + bow_A * bow_A * (4.0f / 9.0f) - chord_A2 * (1.0f / 4.0f),
          along_A2 + bow_A * bow_A * (8.0f / 15.0f) - chord_A2 * (1.0f / 6.0f)};
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

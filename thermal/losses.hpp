// SPDX-License-Identifier: MIT
// What the winding's heat has besides the sampled current: what a sample cannot see, the power that sensor set B infers
// from the bus, and the speed features of a heat set. Pure functions of one step's means; SI in, SI out.
//
// Knows no motor state. Any context, though SpeedLooks::fill and set_speed call pow and are for the 100 Hz lane.
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

/// Ripple of the phases in units of bus voltage * half a period / inductance. `moment`: its first moment over the
/// period, by which the mean current differs from a sample. `begin`: the ripple where the phase's pulse begins.
struct Ripple {
  float square[3], moment[3], begin[3];
};

/// Over half a centre-aligned period the voltage runs 000, one phase on, two phases on, 111, and the ripple is four
/// straight lines, the same backwards in the other half.
inline Ripple ripple_of(const float (&ratio)[3]) {
  int high = 0, low = 2;
  for (int k = 1; k < 3; ++k) high = ratio[k] > ratio[high] ? k : high;
  for (int k = 1; k >= 0; --k) low = ratio[k] < ratio[low] ? k : low;  // from the other end: of equals another one
  const int middle = 3 - high - low;

  const float zero = ratio[low], one = ratio[high] - ratio[middle], two = ratio[middle] - zero;
  const float mean = (ratio[0] + ratio[1] + ratio[2]) * (1.0f / 3.0f);
  // In parts of half a period: when each straight line begins and ends.
  const float at[5] = {0.0f, 1.0f - ratio[high], 1.0f - ratio[middle], 1.0f - zero, 1.0f};
  Ripple out{};
  for (int k = 0; k < 3; ++k) {
    const float error = ratio[k] - mean;
    const float first = k == high ? 2.0f / 3.0f : -1.0f / 3.0f, last = k == low ? -2.0f / 3.0f : 1.0f / 3.0f;
    const float begin = -error * at[1], end = begin + (first - error) * one;
    const float corner[5] = {0.0f, begin, end, end + (last - error) * two, 0.0f};
    for (int i = 0; i < 4; ++i) {
      const float p = corner[i], q = corner[i + 1], length = at[i + 1] - at[i];
      out.square[k] += length * (p * p + p * q + q * q) * (1.0f / 3.0f);
      out.moment[k] -= length * (0.5f * (1.0f - at[i]) * (p + q) - length * (p + 2.0f * q) * (1.0f / 6.0f));
    }
    out.begin[k] = k == high ? begin : k == low ? corner[3] : end;
  }
  return out;
}

/// 0 far below -soft, 1 above soft, straight between.
inline float share_above(float current_A, float soft_A) {
  if (!(current_A < soft_A)) return 1.0f;
  return current_A > -soft_A ? 0.5f + 0.5f * current_A / soft_A : 0.0f;
}

/// Current is sampled in the middle of the zero vector, where the ripple is zero, so that no sample shows it. What it
/// drops in the resistance makes the sample differ from the mean current, by the ripple's first moment over the time
/// constant (first order: a hundredth of that remains while a period is no longer than the time constant). Dead time
/// delays a pulse's begin where current flows out and its end where it flows in: the pulse is narrower or wider for it,
/// and its middle comes half of it, or all, after the sample. Where L/R is much longer than a period only the ripple
/// counts; of the paper's motor (60 us) the rest is up to 8 % of the heat.
///
/// A turning rotor's samples go round with it, so all is said of the middle of the period:
///   duty      on-time ratios 0..1, of the period that ends with the sample
///   middle_A  phase currents half way between two samples (chord_of)      bow_A  what bends them there (bow_of)
inline Unseen unseen(const wire::Abc& duty, const wire::Abc& middle_A, const wire::Abc& bow_A, const Switching& by) {
  const float current_A[3] = {middle_A.a, middle_A.b, middle_A.c}, bent_A[3] = {bow_A.a, bow_A.b, bow_A.c};
  const float unit_A = by.bus_V / (2.0f * by.inductance_H * by.pwm_Hz);
  const float decay = by.phase_ohm / (by.inductance_H * by.pwm_Hz);  // a period in time constants
  const float dead = by.dead_time_s * by.pwm_Hz;                     // of a period; half of it, of half a period

  float ratio[3] = {duty.a, duty.b, duty.c}, late[3], mean_late = 0.0f;
  // Where all pulses have their edges together, dead time turns currents of this size either way.
  const float unknown_A = 0.5f * unit_A * dead;
  const Ripple asked = ripple_of(ratio);
  for (int k = 0; k < 3; ++k) {
    const float begin_A = unit_A * asked.begin[k];
    const float mean_A = current_A[k] + unit_A * 0.5f * decay * asked.moment[k] + bent_A[k] * (2.0f / 3.0f);
    const float begins_late = share_above(mean_A + begin_A, unknown_A);
    const float ends_late = share_above(begin_A - mean_A, unknown_A);
    // What ripple turns round at an edge is narrowed or widened at times.
    const float soft_A = std::fmax(unknown_A, std::fabs(begin_A));
    ratio[k] += dead * (1.0f - 2.0f * share_above(mean_A, soft_A));
    late[k] = ratio[k] * dead * (ends_late + begins_late);
    mean_late += late[k] * (1.0f / 3.0f);
  }

  const Ripple ripple = ripple_of(ratio);
  float mean_A2 = 0.0f, more_A2 = 0.0f;
  for (int k = 0; k < 3; ++k) {
    const float missed_A =
        unit_A * (0.5f * decay * ripple.moment[k] - (late[k] - mean_late)) + bent_A[k] * (2.0f / 3.0f);
    mean_A2 += missed_A * (2.0f * current_A[k] + missed_A);
    more_A2 += unit_A * unit_A * ripple.square[k] + bent_A[k] * bent_A[k] * (4.0f / 45.0f);
  }
  return {mean_A2 * (2.0f / 3.0f), (mean_A2 + more_A2) * (2.0f / 3.0f)};  // a vector's square is 2/3 of its phases'
}

/// The bridge's voltage stands still for a period, while a rotor turns by `turn_rad` (electrical). So the current runs
/// along a chord between two samples, and the magnet's flux, on its arc, pushes it off against d: this far in the
/// middle, A, and two thirds of that in the mean.
inline float bow_of(float turn_rad, float flux_Wb, float inductance_H) {
  return flux_Wb * turn_rad * turn_rad / (8.0f * inductance_H);
}

/// How much shorter that chord is than a sample: its middle, and what unseen() then says, of the sample's square.
struct Chord {
  float middle, of_mean, of_heat;
};
inline Chord chord_of(float turn_rad) {
  const float turn2 = turn_rad * turn_rad;
  return {1.0f - turn2 * (1.0f / 8.0f), turn2 * (-1.0f / 4.0f), turn2 * (-1.0f / 6.0f)};
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

/// |w| during one step, rad/s: means of its powers over some looks at it, and the least, which cools for certain.
class SpeedLooks {
 public:
  void add(float rad_per_s) {
    const float w = std::fabs(rad_per_s);
    least_ = looks_ == 0 || !(w >= least_) ? w : least_;
    sum_ += w, sum2_ += w * w, sum3_ += w * w * w;
    ++looks_;
  }
  bool none() const { return looks_ == 0; }

  /// Fills every drive that holds speed, also from the currents that the input holds already (10 ms is short against
  /// them). One look at least.
  void fill(HeatInput<>& input) const {
    const double share = 1.0 / looks_, w = static_cast<double>(sum_) * share, w2 = static_cast<double>(sum2_) * share;
    input[Drive::speed_rad_per_s] = w;
    input[Drive::speed2_rad2_per_s2] = w2;
    input[Drive::speed3_rad3_per_s3] = static_cast<double>(sum3_) * share;
    input[Drive::current2_speed2] = input[Drive::current_A] * input[Drive::current_A] * w2;  // not of ripple
    input[Drive::current_speed] = input[Drive::current_A] * w;
    input[Drive::speed_to_0_8] = std::pow(static_cast<double>(least_), 0.8);
  }

 private:
  float sum_ = 0.0f, sum2_ = 0.0f, sum3_ = 0.0f, least_ = 0.0f;
  int looks_ = 0;
};

/// The same of a speed that stays as it is.
inline void set_speed(HeatInput<>& input, double speed_rad_per_s) {
  SpeedLooks one;
  one.add(static_cast<float>(speed_rad_per_s));
  one.fill(input);
}

}  // namespace thermal

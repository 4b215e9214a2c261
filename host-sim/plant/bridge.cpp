// SPDX-License-Identifier: MIT
#include "host-sim/plant/bridge.hpp"

#include <algorithm>
#include <cmath>

namespace host_sim {
namespace {

/// A switched period is cut into at least this many steps, so that a step is short beside L/R.
constexpr int pieces = 8;

}  // namespace

/// The flux error of each phase is piecewise linear over half a period (000, one upper, two uppers, 111), starts and
/// ends at zero and is antisymmetric in the other half. A segment of length t from a to b contributes t (a^2 + ab +
/// b^2)/3 to half the square, and to the moment the integral of -(1 - 2s) times it, s counting periods.
RippleShare ripple_share(const std::array<double, 3>& ratio) {
  int high = 0, low = 0;
  for (int k = 1; k < 3; ++k) {
    if (ratio[k] > ratio[high]) high = k;
    if (ratio[k] <= ratio[low]) low = k;
  }
  RippleShare share;
  if (high == low) return share;
  const int middle = 3 - high - low;
  const double mean = (ratio[0] + ratio[1] + ratio[2]) / 3;
  const std::array<double, 4> length = {0.5 * (1 - ratio[high]), 0.5 * (ratio[high] - ratio[middle]),
                                        0.5 * (ratio[middle] - ratio[low]), 0.5 * ratio[low]};
  for (int k = 0; k < 3; ++k) {
    const double error = ratio[k] - mean;
    std::array<double, 5> corner{};
    corner[1] = -error * length[0];
    corner[2] = corner[1] + ((k == high ? 2.0 / 3 : -1.0 / 3) - error) * length[1];
    corner[3] = corner[2] + ((k == low ? -2.0 / 3 : 1.0 / 3) - error) * length[2];
    share.edge[k] = corner[k == high ? 1 : k == middle ? 2 : 3];
    double from = 0;
    for (int part = 0; part < 4; ++part) {
      const double a = corner[part], b = corner[part + 1], t = length[part];
      share.square[k] += 2 * t * (a * a + a * b + b * b) / 3;
      share.moment[k] -= t * (0.5 * (1 - 2 * from) * (a + b) - t * (a + 2 * b) / 3);
      from += t;
    }
  }
  return share;
}

void Bridge::advance(Motor& motor, const hal::Duty& duty, double bus_V, const std::array<double, 3>& winding_ohm) {
  const double period_s = period_s_;
  short_A_ = 0;
  missed_A_ = {};
  if (!duty.on) {
    const std::array<double, 3> emf_V = motor.back_emf_V();
    const double swing_V = std::max({emf_V[0], emf_V[1], emf_V[2]}) - std::min({emf_V[0], emf_V[1], emf_V[2]});
    if (motor.current_squared_A2() == 0 && swing_V < bus_V) {
      motor.step(period_s, {0, 0, 0}, 7, false);  // at rest or slow: no diode can open
      return;
    }
    for (int part = 0; part < 8; ++part)
      segment(motor, period_s / 8, {Gate::off, Gate::off, Gate::off}, bus_V, winding_ohm);
    return;
  }
  const std::array<double, 3> ratio = {std::clamp(static_cast<double>(duty.ratio.a), 0.0, 1.0),
                                       std::clamp(static_cast<double>(duty.ratio.b), 0.0, 1.0),
                                       std::clamp(static_cast<double>(duty.ratio.c), 0.0, 1.0)};
  if (design_.switched) {
    switched(motor, ratio, bus_V, winding_ohm);
  } else {
    averaged(motor, ratio, bus_V, winding_ohm);
  }
  charge_edges(motor, ratio, bus_V);
  if (short_from >= 0) carry_short(ratio, bus_V);
}

void Bridge::averaged(Motor& motor, const std::array<double, 3>& ratio, double bus_V,
                      const std::array<double, 3>& winding_ohm) {
  const double period_s = period_s_;
  const double dead = design_.dead_time_s * design_.pwm_Hz;
  const std::array<double, 3> current_A = motor.current_A();
  // Below the current that dead time ends within a period it would turn it round for ever.
  const double per_soft = 1 / std::max(soft_A_, dead * bus_V * period_s / motor.mean_inductance_H());
  std::array<double, 3> effective, drop_V, terminal_V;
  for (int k = 0; k < 3; ++k) {
    effective[k] = ratio[k];
    drop_V[k] = 0;
    if (ratio[k] > 0 && ratio[k] < 1) {  // no edges, no dead time
      const double sign = std::clamp(current_A[k] * per_soft, -1.0, 1.0);
      effective[k] = std::clamp(ratio[k] - dead * sign, 0.0, 1.0);
      drop_V[k] = design_.diode_V * 2 * dead * sign;
    }
    terminal_V[k] = effective[k] * bus_V - drop_V[k];
  }
  motor.step(period_s, terminal_V, open_phases, true);

  const std::array<double, 3> mean_A = motor.mean_current_A();
  for (int k = 0; k < 3; ++k) {
    work_.bus_J += period_s * mean_A[k] * effective[k] * bus_V;
    work_.heat_J += period_s * mean_A[k] * drop_V[k];
  }
  if (open_phases == 0) within_the_period(motor, current_A, effective, bus_V, winding_ohm);
}

/// What an averaged step leaves out: the ripple; the ramp from its start to its end; and, of a motor that turns, that
/// the bridge's voltage stands still for a period while the back-EMF turns by `turn`: the magnet's flux goes along an
/// arc, the driven flux along its chord, and the current bows by their difference: flux turn^2/8 in the middle, two
/// thirds in the mean, and 4/45 of its square more in the mean square. Dead time delays a pulse's begin where current
/// flows out and its end where current flows in: usually one of them, and the pulse stands half of it late, a sample
/// half of it early. The pulses belong to the middle of the step, a sample to its end, and what the one misses for the
/// other goes round with the rotor.
void Bridge::within_the_period(const Motor& motor, const std::array<double, 3>& start_A,
                               const std::array<double, 3>& effective, double bus_V,
                               const std::array<double, 3>& winding_ohm) {
  const double period_s = period_s_, inductance_H = motor.mean_inductance_H();
  const double unit_A = bus_V * period_s / inductance_H;
  const double mean_ohm = (winding_ohm[0] + winding_ohm[1] + winding_ohm[2]) / 3 + design_.on_resistance_ohm;
  const double droop_A = unit_A * mean_ohm * period_s / inductance_H;
  const double early_A = unit_A * 0.5 * design_.dead_time_s * design_.pwm_Hz;
  const double turn_rad = motor.design().pole_pairs * motor.speed_rad_per_s() * period_s;
  const std::array<double, 3> magnet_Wb = motor.magnet_Wb(), end_A = motor.current_A();
  // All pulses together, dead time turns a quarter of this and less either way.
  const double ended_A = 2 * early_A;
  const auto outward = [&](double a) { return std::clamp(0.5 + 2 * a / std::max(ended_A, 1e-9), 0.0, 1.0); };
  const RippleShare share = ripple_share(effective);
  std::array<double, 3> switching_A, bow_A;
  double squared_A2 = 0, early_mean_A = 0;
  for (int k = 0; k < 3; ++k) {
    const double ripple_A2 = share.square[k] * unit_A * unit_A, ramp_A = end_A[k] - start_A[k];
    bow_A[k] = -magnet_Wb[k] / inductance_H * turn_rad * turn_rad / 8;
    squared_A2 += ripple_A2;
    charge_ripple(k, (ripple_A2 + ramp_A * ramp_A / 12 + bow_A[k] * bow_A[k] * 4 / 45) * period_s, winding_ohm[k]);
    const double edge_A = share.edge[k] * unit_A;
    const double delayed = outward(end_A[k] + edge_A) + outward(edge_A - end_A[k]);
    const double shifted_A = effective[k] * delayed * early_A;
    switching_A[k] = share.moment[k] * droop_A - shifted_A;
    early_mean_A += shifted_A / 3;
  }
  for (double& a : switching_A) a += early_mean_A;
  for (int k = 0; k < 3; ++k) {
    const double across_A = (switching_A[(k + 1) % 3] - switching_A[(k + 2) % 3]) / std::sqrt(3.0);
    missed_A_[k] = switching_A[k] * std::cos(0.5 * turn_rad) - across_A * std::sin(0.5 * turn_rad) + bow_A[k] * 2 / 3;
  }
  soft_A_ = 1e-3 + std::sqrt(squared_A2);  // peak of a triangle: sqrt(3) of its rms; squared_A2 sums three phases
}

std::array<double, 3> Bridge::sampled_A(const Motor& motor) const {
  std::array<double, 3> sample_A = motor.current_A();
  for (int k = 0; k < 3; ++k) sample_A[k] -= missed_A_[k];
  return sample_A;
}

void Bridge::switched(Motor& motor, const std::array<double, 3>& ratio, double bus_V,
                      const std::array<double, 3>& winding_ohm) {
  const double period_s = period_s_;
  std::array<double, pieces + 12> edge_s;
  int edges = 0;
  for (int part = 1; part <= pieces; ++part) edge_s[edges++] = period_s * part / pieces;
  std::array<double, 3> rise_s, fall_s;
  for (int k = 0; k < 3; ++k) {
    rise_s[k] = 0.5 * (1 - ratio[k]) * period_s;
    fall_s[k] = 0.5 * (1 + ratio[k]) * period_s;
    if (ratio[k] <= 0 || ratio[k] >= 1) continue;
    for (const double at_s : {rise_s[k], rise_s[k] + design_.dead_time_s, fall_s[k], fall_s[k] + design_.dead_time_s}) {
      if (at_s < period_s) edge_s[edges++] = at_s;
    }
  }
  std::sort(edge_s.begin(), edge_s.begin() + edges);
  double now_s = 0;
  for (int e = 0; e < edges; ++e) {
    const double h_s = edge_s[e] - now_s;
    if (h_s < 1e-12) continue;
    const double middle_s = now_s + 0.5 * h_s;
    std::array<Gate, 3> gates;
    for (int k = 0; k < 3; ++k) {
      if (open_phases >> k & 1) {
        gates[k] = Gate::off;
      } else if (ratio[k] <= 0 ||
                 (ratio[k] < 1 && (middle_s < rise_s[k] || middle_s > fall_s[k] + design_.dead_time_s))) {
        gates[k] = Gate::lower;
      } else if (ratio[k] >= 1 || (middle_s > rise_s[k] + design_.dead_time_s && middle_s < fall_s[k])) {
        gates[k] = Gate::upper;
      } else {
        gates[k] = Gate::off;
      }
    }
    segment(motor, h_s, gates, bus_V, winding_ohm);
    now_s = edge_s[e];
  }
}

/// A stretch with constant gates. Where both switches of a phase are off its current chooses the diode; a diode whose
/// current reaches zero stops, and a floating lead that leaves the rails starts one, unless that would carry backwards
/// at once. All of the stretch passes: what a shaft that others turn does meanwhile would come as one jump of flux.
void Bridge::segment(Motor& motor, double h_s, const std::array<Gate, 3>& gates, double bus_V,
                     const std::array<double, 3>& winding_ohm) {
  constexpr int most_splits = 13;  // each phase may stop and start a diode, and one that starts may be refused
  constexpr double nothing_A = 1e-3;
  const bool driven = std::any_of(gates.begin(), gates.end(), [](Gate gate) { return gate != Gate::off; });
  unsigned refused = 0;  // that start at no current and would carry backwards
  double left_s = h_s;
  for (int split = 1; left_s > 0; ++split) {
    const std::array<double, 3> current_A = motor.current_A();
    const bool rests =
        std::all_of(current_A.begin(), current_A.end(), [](double i_A) { return std::fabs(i_A) < nothing_A; });
    // Diodes that the back-EMF just reaches open and close without end: then none of them carries.
    if (split == most_splits && !driven && rests) return motor.step(left_s, {0, 0, 0}, 7, false);
    std::array<double, 3> terminal_V{};
    std::array<bool, 3> at_upper{};
    std::array<int, 3> diode{};  // +1 upper, -1 lower, 0 none
    unsigned open = 0;
    for (int k = 0; k < 3; ++k) {
      if (open_phases >> k & 1) {
        open |= 1u << k;
      } else if (gates[k] != Gate::off) {
        at_upper[k] = gates[k] == Gate::upper;
        terminal_V[k] = at_upper[k] ? bus_V : 0;
      } else if (std::fabs(current_A[k]) > 1e-9) {
        diode[k] = current_A[k] > 0 ? -1 : 1;
      } else {
        open |= 1u << k;
      }
    }
    const auto close = [&](int k, int which) {
      diode[k] = which;
      open &= ~(1u << k);
    };
    const auto settle = [&] {
      for (int k = 0; k < 3; ++k) {
        if (diode[k] == 0) continue;
        at_upper[k] = diode[k] > 0;
        terminal_V[k] = diode[k] > 0 ? bus_V + design_.diode_V : -design_.diode_V;
      }
    };
    settle();
    if (open != 0) {
      const unsigned never = open_phases | refused;
      const std::array<double, 3> emf_V = motor.back_emf_V();
      double star_V = 0;
      int closed = 0;
      for (int k = 0; k < 3; ++k) {
        if (open >> k & 1) continue;
        star_V += terminal_V[k] - emf_V[k];
        ++closed;
      }
      if (closed == 0) {
        const auto highest = static_cast<int>(std::max_element(emf_V.begin(), emf_V.end()) - emf_V.begin());
        const auto lowest = static_cast<int>(std::min_element(emf_V.begin(), emf_V.end()) - emf_V.begin());
        const bool can = !((never >> highest & 1) || (never >> lowest & 1));
        if (can && emf_V[highest] - emf_V[lowest] > bus_V + 2 * design_.diode_V) {
          close(highest, 1);
          close(lowest, -1);
        }
      } else {
        star_V /= closed;
        for (int k = 0; k < 3; ++k) {
          if (!(open >> k & 1) || (never >> k & 1)) continue;
          const double lead_V = star_V + emf_V[k];
          if (lead_V > bus_V + design_.diode_V) close(k, 1);
          if (lead_V < -design_.diode_V) close(k, -1);
        }
      }
      settle();
    }

    const Motor::Snapshot before = motor.save();
    double step_s = left_s;
    motor.step(step_s, terminal_V, open, false);
    // The first diode whose current would turn round ends this split there.
    const std::array<double, 3> after_A = motor.current_A();
    int stopped = -1;
    double share = 1;
    unsigned backwards = 0;
    for (int k = 0; k < 3 && split < most_splits; ++k) {
      if (diode[k] == 0 || after_A[k] * diode[k] <= 0) continue;  // still flows its way
      if (std::fabs(current_A[k]) <= 1e-9) backwards |= 1u << k;
      const double here = current_A[k] / (current_A[k] - after_A[k]);
      if (here < share) {
        share = here;
        stopped = k;
      }
    }
    if (backwards != 0) {
      motor.restore(before);
      refused |= backwards;
      continue;
    }
    refused = 0;
    if (stopped >= 0) {
      motor.restore(before);
      step_s = std::max(share * left_s, 1e-12);
      motor.step(step_s, terminal_V, open, false);
    }
    const std::array<double, 3> mean_A = motor.mean_current_A();
    for (int k = 0; k < 3; ++k) {
      if (open >> k & 1) continue;
      if (at_upper[k]) work_.bus_J += step_s * bus_V * mean_A[k];
      if (diode[k] != 0) work_.heat_J -= step_s * design_.diode_V * diode[k] * mean_A[k];
    }
    // The motor heats by the mean current of the step; a ramp from a to b has (b - a)^2/12 more mean square.
    const std::array<double, 3> end_A = motor.current_A();
    for (int k = 0; k < 3; ++k) {
      const double more_A2s = (end_A[k] - current_A[k]) * (end_A[k] - current_A[k]) / 12 * step_s;
      charge_ripple(k, more_A2s, winding_ohm[k]);
    }
    if (stopped >= 0) motor.extinguish(stopped);
    left_s -= step_s;
    if (left_s < 1e-12) return;
  }
}

void Bridge::charge_ripple(int phase, double squared_A2s, double winding_ohm) {
  const double heat_J = squared_A2s * winding_ohm, series_J = squared_A2s * design_.on_resistance_ohm;
  work_.ripple_A2s[phase] += squared_A2s;
  work_.ripple_J[phase] += heat_J;
  work_.ripple_series_J += series_J;
  work_.bus_J += heat_J + series_J;
}

/// Overlap of voltage and current at the edges.
void Bridge::charge_edges(const Motor& motor, const std::array<double, 3>& ratio, double bus_V) {
  const std::array<double, 3> current_A = motor.current_A();
  for (int k = 0; k < 3; ++k) {
    if (ratio[k] <= 0 || ratio[k] >= 1 || (open_phases >> k & 1)) continue;
    const double loss_J = bus_V * std::fabs(current_A[k]) * design_.overlap_s;
    work_.heat_J += loss_J;
    work_.bus_J += loss_J;
  }
}

void Bridge::carry_short(const std::array<double, 3>& ratio, double bus_V) {
  const double across_V = (ratio[short_from] - ratio[short_to]) * bus_V;
  short_A_ = across_V / short_ohm;
  const double loss_J = across_V * short_A_ / design_.pwm_Hz;
  work_.short_J += loss_J;
  work_.bus_J += loss_J;
}

}  // namespace host_sim

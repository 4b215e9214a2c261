// SPDX-License-Identifier: MIT
// A three-phase bridge made of numbers, one axis. In: duties and bus voltage for one PWM period; it drives the motor
// and says what it took from the bus and what became heat in it. Two faithfulnesses:
//   averaged: one motor step a period, whose currents are means; dead time as a voltage error by current sign. What the
//             current does within the period, and by how much a sample of it misses its mean, in closed form
//   switched: every edge, dead time with the diodes that really conduct, real ripple
// Centre-aligned: a period begins and ends in the middle of the zero vector with all lower switches on, which is where
// currents are sampled. Released (all six switches open) both modes follow the diodes.
#pragma once

#include <array>

#include "hal/axis_port.hpp"
#include "host-sim/plant/motor.hpp"

namespace host_sim {

/// Defaults: a small MOSFET stage of the 20 A class; assumptions of ours, not a measured board.
struct BridgeDesign {
  double pwm_Hz = 20000;
  double dead_time_s = 500e-9;
  double on_resistance_ohm = 0.01;  // one switch, shunt and copper of one phase
  double diode_V = 0.8;
  double overlap_s = 20e-9;  // voltage times current overlap of one on and one off edge together
  bool switched = false;
};

/// Joules since construction. Out of the bus = into the motor + heat + ripple + short.
struct BridgeWork {
  double bus_J = 0;
  double heat_J = 0;  // switches and diodes; the resistive part is the motor's series_J
  std::array<double, 3>
      ripple_J{};  // copper heat of ripple inside a step, which the motor's mean current does not show
  std::array<double, 3> ripple_A2s{};  // the same as integral of squared current
  double ripple_series_J = 0;          // ripple in the on-resistance
  double short_J = 0;                  // in a shorted pair of leads
};

/// Ripple current of each phase over a PWM period, in units of bus voltage * period / inductance (square: the square of
/// that). It is zero where it is sampled, but drops voltage in the resistance, which leaves current behind: the sample
/// misses `moment` * resistance * period / inductance of the mean (first order in that last factor).
struct RippleShare {
  std::array<double, 3> square{}, moment{}, edge{};  // edge: the ripple where the phase's pulse begins
};
RippleShare ripple_share(const std::array<double, 3>& ratio);

class Bridge {
 public:
  explicit Bridge(const BridgeDesign& design) : design_(design), period_s_(1 / design.pwm_Hz) {}

  /// One PWM period. `winding_ohm`: what the ripple meets, phase by phase.
  void advance(Motor& motor, const hal::Duty& duty, double bus_V, const std::array<double, 3>& winding_ohm);

  // Faults of the wiring and of the stage; neutral by default.
  unsigned open_phases = 0;            // bit k: lead or both switches of phase k open
  int short_from = -1, short_to = -1;  // pair of leads that touch
  double short_ohm = 0.05;

  const BridgeWork& work() const { return work_; }
  const BridgeDesign& design() const { return design_; }
  /// Current through the short that the current sensors see besides the motor's.
  double short_A() const { return short_A_; }
  /// What flows in the middle of the zero vector, where a period ends; averaged, the motor's own currents are means.
  std::array<double, 3> sampled_A(const Motor& motor) const;

 private:
  enum class Gate { upper, lower, off };
  void averaged(Motor& motor, const std::array<double, 3>& ratio, double bus_V,
                const std::array<double, 3>& winding_ohm);
  void switched(Motor& motor, const std::array<double, 3>& ratio, double bus_V,
                const std::array<double, 3>& winding_ohm);
  void segment(Motor& motor, double h_s, const std::array<Gate, 3>& gates, double bus_V,
               const std::array<double, 3>& winding_ohm);
  void within_the_period(const Motor& motor, const std::array<double, 3>& start_A,
                         const std::array<double, 3>& effective, double bus_V, const std::array<double, 3>& winding_ohm);
  void charge_ripple(int phase, double squared_A2s, double winding_ohm);
  void charge_edges(const Motor& motor, const std::array<double, 3>& ratio, double bus_V);
  void carry_short(const std::array<double, 3>& ratio, double bus_V);

  BridgeDesign design_;
  double period_s_;
  BridgeWork work_;
  double soft_A_ = 1e-3;  // below this current the ripple crosses zero and the dead time errs less
  double short_A_ = 0;
  std::array<double, 3> missed_A_{};
};

}  // namespace host_sim

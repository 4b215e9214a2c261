// SPDX-License-Identifier: MIT
// A permanent-magnet synchronous motor made of numbers: winding, magnet, iron, rotor, load. Double precision.
//
// In: the voltages at its three terminals (or which of them are open) for a step; out: currents, torque, speed, angle
// and where every joule went. State: phase currents (stator frame), speed, angle. Knows no bridge, sensor or heat.
//
// Integrator: implicit midpoint on the stator flux linkages. It is second order, stable for any step, cheap, exact in
// the kinematics of the back-EMF, and its discrete torque times angle equals its discrete EMF times current to
// rounding, so no energy is invented. `fitted` scales the inductance by (x/2)/tanh(x/2), x = hR/L: then the response to
// a constant voltage is the exact exponential, even where a whole PWM period is longer than L/R.
#pragma once

#include <array>
#include <functional>

#include "wire/motor.hpp"

namespace host_sim {

inline constexpr double pi = 3.141592653589793;

struct MotorDesign {
  double phase_resistance_ohm = 0;  // at 25 degC
  double inductance_d_H = 0;
  double inductance_q_H = 0;
  double flux_linkage_Wb = 0;  // peak, per phase, magnet at 25 degC
  int pole_pairs = 1;
  double rotor_inertia_kg_m2 = 0;
  double copper_coefficient_per_K = 0.00393;
  double magnet_coefficient_per_K = 0;  // of the flux; sintered NdFeB is near -0.0011
  // Flux map: psi(i) = L (s i + (1 - s) i / sqrt(1 + (i/saturation)^2)) on each axis; 0 A switches it off.
  double saturation_A = 0;
  double saturated_share = 0.4;  // s: incremental inductance deep in saturation, relative
  // Drag on the rotor; the iron parts scale with the square of the flux linkage, their heat arises in the iron.
  double hysteresis_Nm = 0;
  double eddy_Nm_s = 0;
  double coulomb_Nm = 0;
  double viscous_Nm_s = 0;
  double cogging_Nm = 0;
  int cogging_periods = 12;
};

MotorDesign motor_from_sheet(const wire::Motor& sheet);

/// What the shaft is coupled to. Positive torque brakes a forward-turning rotor.
struct Load {
  enum class Mode { free, locked, imposed_speed };
  Mode mode = Mode::free;
  double speed_rad_per_s = 0;  // imposed_speed
  double torque_Nm = 0;        // free: constant part, also at rest (a weight, not a brake)
  double viscous_Nm_s = 0;
  double quadratic_Nm_s2 = 0;
  double spring_Nm_per_rad = 0;  // towards angle zero of the first turn
  double inertia_kg_m2 = 0;
  std::function<double(double angle_rad, double speed_rad_per_s)> more_Nm;  // empty: none
};

/// Joules since construction. electrical = copper + field + iron + friction + shaft + kinetic (the last is zero work
/// while the speed is imposed: then the shaft is somebody else's).
struct MotorWork {
  double electrical_J = 0;           // into the terminals
  std::array<double, 3> series_J{};  // in what stands in series with each phase (bridge)
  std::array<double, 3> copper_J{};
  double iron_J = 0;
  double friction_J = 0;
  double shaft_J = 0;  // to the load
};

class Motor {
 public:
  explicit Motor(const MotorDesign& design, double period_s);

  /// Winding resistance of each phase and what the bridge adds in series.
  void set_resistance(const std::array<double, 3>& winding_ohm, double series_ohm);
  double mean_inductance_H() const { return mean_inductance_H_; }
  void set_magnet_degC(double magnet_degC);
  void place(double angle_rad, double speed_rad_per_s);  // mechanical

  /// One step with constant terminal voltages; bit k of `open` cuts phase k (its voltage is ignored, its current is 0).
  void step(double h_s, const std::array<double, 3>& terminal_V, unsigned open, bool fitted);

  /// Sets a phase current to zero where a diode has just stopped to conduct.
  void extinguish(int phase);

  Load load;

  std::array<double, 3> current_A() const;
  double current_squared_A2() const { return i_alpha_A_ * i_alpha_A_ + i_beta_A_ * i_beta_A_; }
  /// Rotor frame.
  void current_dq_A(double& d_A, double& q_A) const;
  std::array<double, 3> mean_current_A() const;  // over the last step
  std::array<double, 3> back_emf_V() const;
  double torque_Nm() const { return torque_Nm_; }  // of the air gap, mean over the last step
  double speed_rad_per_s() const { return speed_rad_per_s_; }
  double angle_rad() const { return angle_rad_; }  // [0, 2 pi)
  long turns() const { return turns_; }
  double flux_linkage_Wb() const { return magnet_Wb_; }
  std::array<double, 3> magnet_Wb() const;  // the magnet's flux in each phase
  double field_J() const;
  double kinetic_J() const;
  const MotorWork& work() const { return work_; }
  const MotorDesign& design() const { return design_; }

  struct Snapshot {
    double i_alpha_A, i_beta_A, angle_rad, speed_rad_per_s, acceleration_rad_per_s2, cosine, sine, torque_Nm,
        mean_alpha_A, mean_beta_A;
    long turns;
    MotorWork work;
  };
  Snapshot save() const;
  void restore(const Snapshot& snapshot);

 private:
  struct Start {
    double alpha_A, beta_A, angle_rad, cosine, sine;
    long turns;
  };
  struct Push {
    double speed_rad_per_s, iron_Nm, friction_Nm, load_Nm;  // speed at the end, mean drags
  };
  void advance_electrically(const Start& start, double h_s, double travel_rad, double u_alpha_V, double u_beta_V,
                            unsigned open);
  void solve(double h_s, double u_alpha_V, double u_beta_V, unsigned open, double cosine1, double sine1);
  void solve_saturable(double h_s, double u_alpha_V, double u_beta_V, double cosine1, double sine1);
  Push push_freely(double h_s) const;
  void book_forced(double travel_rad);
  double flux_share() const;
  void refresh();
  double flux_of(double current_A, double inductance_H) const;
  double incremental_H(double current_A, double inductance_H) const;
  double field_energy_of(double current_A, double inductance_H) const;

  MotorDesign design_;
  double period_s_;
  double fitted_d_H_, fitted_q_H_, mean_inductance_H_;
  std::array<double, 3> winding_ohm_{}, total_ohm_{};
  double r_aa_ohm_ = 0, r_ab_ohm_ = 0, r_bb_ohm_ = 0;  // of the three phases, seen in the stator frame
  double magnet_Wb_;
  double i_alpha_A_ = 0, i_beta_A_ = 0, mean_alpha_A_ = 0, mean_beta_A_ = 0;
  double angle_rad_ = 0, speed_rad_per_s_ = 0, acceleration_rad_per_s2_ = 0;
  double cosine_ = 1, sine_ = 0;  // of the electrical angle
  double torque_Nm_ = 0;
  bool fitted_ = false;
  long turns_ = 0;
  MotorWork work_;
};

}  // namespace host_sim

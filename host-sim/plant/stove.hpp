// SPDX-License-Identifier: MIT
// One motor's temperatures. In: watts by place and what moves them (speed, current) for a step; out: node temperatures,
// joules stored and given away. Adds the heat of hidden effects by its own equations.
//
// Integrator: classic Runge-Kutta of fourth order, sub-stepped so that step times a bound of the fastest rate stays
// below 1.5; heat flows are integrated with the same weights, so stored + outflow = heat in, to rounding (unless a
// latent heat is hidden).
#pragma once

#include <array>

#include "host-sim/plant/heat.hpp"
#include "host-sim/plant/hidden.hpp"
#include "host-sim/plant/random.hpp"

namespace host_sim {

enum class Place { phase_a, phase_b, phase_c, teeth, yoke, housing, frame, rotor, third_mass, hot_spot, count };
inline constexpr int place_count = static_cast<int>(Place::count);

/// What drives one step; means over it.
struct HeatDrive {
  std::array<double, 3> copper_W{};  // per phase, at its present resistance
  double iron_W = 0;
  double friction_W = 0;
  double current_A = 0;    // mean |I| of the current vector, without the ripple of the pulses, which makes no torque
  double current2_A2 = 0;  // mean I^2, with it
  double speed_rad_per_s = 0;  // |w|
  bool enabled = true;
};

/// What surrounds the motor; a scene may change it at any time.
struct Surroundings {
  double ambient_degC = 25;
  double coolant_degC = 25;
  double neighbour_degC = 25;  // housing of the other motor
  double frame_degC = 25;      // what the motor is mounted on
  double cooling = 1;          // factor on both ways to ambient: 0.5 = R2 doubled
};

class Stove {
 public:
  Stove(const HeatDetail& detail, const HiddenEffects& hidden, std::uint64_t seed);

  void soak(double degC);  // all nodes
  void set(Place place, double degC) { T_degC_[static_cast<int>(place)] = degC; }
  void advance(double h_s, const HeatDrive& drive);

  Surroundings around;

  double degC(Place place) const { return T_degC_[static_cast<int>(place)]; }
  double winding_degC() const { return (T_degC_[0] + T_degC_[1] + T_degC_[2]) / 3; }
  /// Of all copper, a hot spot's share included: what the winding's resistance tells.
  double copper_degC() const;
  double hottest_degC() const;  // of the windings and a hot spot
  double magnet_degC() const;
  /// Resistance of a phase at present, alternating-current factor included.
  double phase_ohm(int phase, double speed_rad_per_s) const;
  /// What the housing sensor's body is at: lag, offset and gain of the hidden effects, no noise.
  double sensed_degC() const;
  double time_s() const { return time_s_; }

  // Joules since construction.
  double stored_J() const;                         // over 0 degC
  double heat_J() const { return heat_J_; }        // what came in, hidden heats included
  double hidden_J() const { return hidden_J_; }    // of it, what no electrical part delivered
  double outflow_J() const { return outflow_J_; }  // to ambient, coolant, frame, neighbour

 private:
  using Vector = std::array<double, place_count>;
  struct Flow {
    Vector rate_K_per_s;
    double out_W;
  };
  Flow flow(const Vector& T_degC, const Vector& heat_W) const;
  double at_sensor_degC() const;               // what the housing sensor is glued to
  double ohm_ratio(double copper_degC) const;  // of copper's resistance to that at 25 degC
  Vector place_heat(const HeatDrive& drive, double& hidden_W) const;
  void change_weather(double h_s);

  HeatDetail d_;
  HiddenEffects hidden_;
  Random random_;
  Vector T_degC_, capacity_J_per_K_, per_capacity_;
  double hot_spot_W_per_K_ = 0, third_mass_W_per_K_ = 0;
  double fastest_per_s_;
  double sensed_degC_ = 25;
  double time_s_ = 0, heat_J_ = 0, hidden_J_ = 0, outflow_J_ = 0;
  // Of the present step.
  double cooling_ = 1, ambient_degC_ = 25, winding_path_ = 1;
  bool gust_ = false, fan_ = false;
  double gust_left_s_ = 0, cured_ = 0;
};

}  // namespace host_sim

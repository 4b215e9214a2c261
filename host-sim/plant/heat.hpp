// SPDX-License-Identifier: MIT
// The numbers of one motor's heat: finer than what a driver board models, and calibrated so that a plain two-resistor
// observer of it would find exactly the motor's sheet.
//
//   phase a,b,c (coupled in pairs) - teeth - yoke - housing - ambient (and coolant)
//                                               housing - frame - ambient;  housing - rotor (optional)
//
// Reduction: R1 = (mean winding - housing)/P and R2 = (housing - ambient)/P in the steady state with all heat in the
// windings; C1, C2 = least-squares fit of two nodes with these resistances to the step responses of winding and
// housing, samples even in log time from tau_w/100 to 5 tau_m, each as share of its final rise.
#pragma once

#include "wire/motor.hpp"

namespace host_sim {

struct HeatDetail {
  // Per phase: capacity, way to the teeth; between each pair of phases.
  double phase_J_per_K, phase_to_teeth_W_per_K, phase_coupling_W_per_K;
  double teeth_J_per_K, teeth_to_yoke_W_per_K;
  double yoke_J_per_K, yoke_to_housing_W_per_K;
  double housing_J_per_K, housing_to_ambient_W_per_K, housing_to_coolant_W_per_K;
  double frame_J_per_K, housing_to_frame_W_per_K, frame_to_ambient_W_per_K;
  double rotor_J_per_K, rotor_to_housing_W_per_K;  // 0 J/K: no rotor node, magnets are as warm as the teeth
  // Laws of the ways to ambient, neutral at 0 (they add to the hidden ones).
  double convection_exponent = 0, radiation_W_per_K = 0, speed_cooling_per_speed08 = 0;
  // Copper.
  double phase_resistance_ohm, copper_coefficient_per_K, ac_copper_s2 = 0;
  // Where iron loss goes: teeth share, the rest in the yoke.
  double iron_in_teeth = 0.6;
};

/// How the sheet's two resistances and two capacities are spread. The defaults are mild on purpose: a board that knows
/// the reduced values must be able to follow the winding within about 2 K. All shares are assumptions of ours.
struct HeatOptions {
  double teeth_yoke_share_of_R1 = 0.04, yoke_housing_share_of_R1 = 0.04;
  double teeth_share_of_C2 = 0.05, yoke_share_of_C2 = 0.15, frame_share_of_C2 = 0.20;
  double frame_contact_share_of_R2 = 0.02;  // housing to frame
  double frame_share_of_cooling = 0.35;
  double rotor_share_of_C2 = 0, rotor_resistance_share_of_R2 = 1;
  /// Between each pair of phases, as share of 1/R1, where the sheet says 0. Estimated for the slotless 30 mm winding:
  /// crossing layers of different phases, about 8e-4 m^2 a pair across 1 mm of resin and wire at 0.5 W/(m K), give
  /// 0.4 W/K; neighbouring bands, 3e-4 m^2 over 6 mm at 1.5 W/(m K), add 0.08: 0.5 W/K of 1/R1 = 4.8 W/K.
  double phase_coupling_share = 0.1;
  double coolant_R2_K_per_W = 0;  // > 0: liquid cooling such that R2 in all (air and liquid) becomes this
};

HeatDetail heat_from_sheet(const wire::Motor& sheet, const HeatOptions& options = {});

/// What a perfect identification of a plain model would find in this motor, coolant at ambient.
struct TwoResistor {
  double R1_K_per_W, R2_K_per_W, C1_J_per_K, C2_J_per_K;
  double phase_coupling_W_per_K;  // of three phase nodes, each tied to the housing by 1/(3 R1)
};

TwoResistor reduced(const HeatDetail& detail);

/// The sheet with the thermal values that are true of this plant: what a board "with true parameters" is given.
wire::Motor true_sheet(const wire::Motor& sheet, const HeatDetail& detail);

}  // namespace host_sim

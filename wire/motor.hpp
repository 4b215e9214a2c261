// SPDX-License-Identifier: MIT
// What a motor's sheet says, in SI units: the one description from which the firmware takes its parameters, the
// simulation its plant and the workshop its starting point. Plain data; files are read by wire/pc/motor_file.hpp.
#pragma once

#include <numbers>

namespace wire {

/// Sheet values of one motor. Thermal values of sheets are good to 10..30 %: they are where identification starts.
///
/// Conventions. Sheets of brushless motors state terminal (line-to-line) resistance and inductance and a torque
/// constant per ampere of direct current through two terminals. With sinusoidal phase currents of amplitude i:
///   phase resistance = terminal / 2,   loss = 3/2 R_ph i^2 = 3/4 R_ll i^2,
///   flux linkage = Kt / (sqrt(3) pole_pairs),   torque = 3/2 pole_pairs flux_linkage i = sqrt(3)/2 Kt i,
/// so that amplitude i heats and pushes like sqrt(3)/2 i of direct current.
struct Motor {
  // Electrical, per phase (star equivalent).
  double phase_resistance_ohm;  // at 25 degC
  double inductance_d_H;
  double inductance_q_H;
  double flux_linkage_Wb;  // peak, per phase
  int pole_pairs;
  double rotor_inertia_kg_m2;

  // Two-resistor thermal model: winding -R1- housing -R2- ambient.
  double R1_K_per_W;
  double R2_K_per_W;
  double C1_J_per_K;
  double C2_J_per_K;
  double copper_coefficient_per_K;  // of resistance, referred to 25 degC
  double winding_max_degC;
  double phase_coupling_W_per_K;  // between each pair of phase windings; 0 is the safe side
  double rated_current_A;         // catalogue, direct current through two terminals
};

/// What heats and pushes like an amplitude of 1 A.
inline constexpr double direct_per_amplitude = std::numbers::sqrt3 / 2;

}  // namespace wire

// SPDX-License-Identifier: MIT
// What may be hidden in a plant: physics that a plain two-resistor model does not know. Every field is neutral at its
// default. The plant's own equations use them (stove.cpp, thermal_bench.cpp); nothing outside host-sim reads this.
#pragma once

namespace host_sim {

struct HiddenEffects {
  // Heat that follows the speed w (rad/s, magnitude).
  double hysteresis_W_s = 0;     // |w|, in the iron
  double coulomb_drag_W_s = 0;   // |w|, in the housing (bearings): the same class
  double eddy_W_s2 = 0;          // w^2, in the iron
  double viscous_drag_W_s2 = 0;  // w^2, in the housing: the same class
  double windage_W_s3 = 0;       // w^3, in the housing
  double winding_eddy_W_s2 = 0;  // w^2, in the windings (eddies, a shorted turn)
  // Heat that follows the current I (A, amplitude of the current vector).
  double ac_copper_s2 = 0;              // winding resistance times (1 + k w^2)
  double load_friction_W_s_per_A = 0;   // |I||w|, in the housing
  double copper_coefficient_per_K = 0;  // added to what the sheet says
  double bridge_loss_W_per_A = 0;       // |I|, in the windings
  double board_heat_ohm = 0;            // I^2, in the housing
  double stall_imbalance = 0;           // winding heat times (1 + k) while |w| < stall_below
  double stall_below_rad_per_s = 1;
  // Heat that follows nothing.
  double constant_heat_W = 0;  // in the housing
  double enabled_heat_W = 0;   // in the windings, while the bridge switches
  // Ways out.
  double speed_cooling_per_speed08 = 0;  // G2 (1 + k w^0.8)
  double convection_exponent = 0;        // G2 (|dT| / 20 K)^n
  double radiation_W_per_K = 0;          // at 300 K, housing to ambient
  double cooling_change = 1;             // R2 times this from cooling_change_s on
  double cooling_change_s = 0;
  double neighbour_W_per_K = 0;      // housing to the other motor's housing
  double frame_W_per_K = 0;          // housing to what the motor is mounted on (Surroundings::frame_degC)
  double ambient_drift_K_per_s = 0;  // true ambient leaves the one that is believed
  // More masses.
  double third_mass_J_per_K = 0;  // on the housing
  double third_mass_K_per_W = 1;
  double hot_spot_J_per_K = 0;  // on the windings
  double hot_spot_K_per_W = 1;
  double hot_spot_share = 0;  // of the copper loss that arises in it
  // What the sensors say: measured = true effects seen through these.
  double current_offset_A = 0;  // true = gain * measured + offset
  double current_gain = 1;
  double sensor_lag_s = 0;
  double sensor_offset_K = 0;
  double sensor_gain = 0;    // y = T + g (T - 25)
  double sensor_share = 0;   // the sensor is glued so that it feels the windings: T + share (T_winding - T)
  double clock_delay_s = 0;  // the heat follows the logged current and speed this much later

  // Outside the catalogue of identification: it must say "unknown" to these.
  double latent_J = 0;  // phase change in the housing (potting, moisture), spread over latent_width_K
  double latent_degC = 60;
  double latent_width_K = 2;
  double gust_depth = 0;  // draught on and off at random: G2 (1 + depth)
  double gust_mean_s = 60;
  double contact_per_K = 0;  // winding contact R1 (1 + k (T_winding - 40))
  // Three of our own, with forms that the catalogue does not have, and a fourth.
  double grease_W_s = 0;  // |w| exp(-(T_housing - 25)/grease_K): grease thins as it warms
  double grease_K = 20;
  double thermostat_gain = 0;  // a fan with hysteresis: G2 (1 + k) from thermostat_degC down to thermostat - 8 K
  double thermostat_degC = 55;
  double curing_gain = 0;  // impregnation cures for good: R1 (1 - k c), dc/dt = (1-c) 2^((Tw-100)/10) / curing_s
  double curing_s = 300;
  double overload_W_per_A4 = 0;  // stray loss of saturated iron, I^4, in the teeth
};

}  // namespace host_sim

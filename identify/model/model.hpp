// SPDX-License-Identifier: MIT
// What is simulated: a heat set (thermal/heat_set.hpp), and what may be wrong around it: clocks, sensors, ambient.
//
// The heat set is what the board runs, with the sensor's share (model_file.cpp). The rest stays on the PC.
// Templated on the scalar: double to look, dual numbers to fit.
#pragma once

#include "thermal/heat_set.hpp"

namespace identify {

/// Of how late a sensor is, the share that a pause leaves: none is shorter than 5 s (log/pauses.cpp), in which a sensor
/// that lags by much less has caught up.
template <class S>
S still_late(const S& lag_s) {
  return lag_s * lag_s / (lag_s * lag_s + 25.0);
}

template <class S>
struct Model {
  thermal::HeatSet<S> set{};
  int core = 0, housing = 1;
  int hot_node = -1;     // an end winding of its own; a core reading is then the mean of both by their copper
  double hot_share = 0;  // its part of the copper
  int core_link = 0;     // winding to housing
  int sink_link = 1;     // housing to ambient or coolant

  S current_offset_A = S(0);  // true current = recorded + offset
  S delay_s = S(0);           // temperatures answer to the inputs of so long ago
  S drift_K_per_s = S(0);     // true sink = recorded + drift * (time + drifted_s)
  S drifted_s = S(0);
  // Where a log begins warm: how far a further mass is behind the housing, as a share of what that is above the sink,
  // and a late sensor, of what it reads above that.
  S mass_behind = S(0), sensor_behind = S(0);
  S stall_share = S(0);     // extra share of copper heat while the rotor stands
  S cooling_factor = S(1);  // of the sink conductance, from cooling_from_s on
  S cooling_from_s = S(0);
  double uneven_per_A2 = 0;  // times i^4 of a standing rotor: what its uneven phases heat more than the inputs have
  S sensor_share = S(0);     // the housing sensor reads housing + share * (winding - housing)
  S winding_lag_s = S(0);    // of what reads the winding, first order
  bool winding_lags = false;
  bool offset = false, delayed = false, drifts = false, stalls = false, cooling_changes = false, feels_winding = false;
};

}  // namespace identify

// SPDX-License-Identifier: MIT
// What may be wrong with a simulation, as data: each cause is an edit of the heat set or of a sensor, with its
// parameters, its words, and what tells it from others. The table stands in causes.cpp; adding a cause is one entry.
#pragma once

#include <string>
#include <vector>

#include "identify/model/model.hpp"

namespace identify {

enum class Edit {
  source,          // heat into a node, parameter 0 W per unit of the drive
  coefficient,     // parameter 0: temperature coefficient of the copper loss
  sink_law,        // parameter 0: k of the law of the link housing-sink
  radiation,       // parameter 0: conductance of a radiating link housing-sink, W/K at 300 K
  link,            // parameter 0: conductance housing-boundary
  mass,            // parameters: capacity and resistance of a further node on the housing
  hot_spot,        // the same on the winding, taking a share of its loss
  cooling_step,    // parameters: factor of the sink conductance, and when
  cooling_of_log,  // parameter 0: factor of the sink conductance throughout one of several logs
  power_of_log,    // parameter 0: factor of the recorded power that heats, likewise
  current_of_log,  // parameter 0: factor of the recorded current, likewise
  current_offset,
  sensor_lag,
  winding_lag,
  sensor_offset,
  sensor_gain,
  sensor_share,  // parameter 0: how far towards the winding the housing sensor sits
  drift,
  delay,
  stall_share
};

/// What a parameter is measured by, so that one bound suits a 5 W motor and a 50 kW one.
enum class Scale {
  one,
  heat_per_drive,    // mean copper heat / mean drive: 1 = as much heat as the copper makes
  heat,              // mean copper heat
  sink_conductance,  // 1/R2
  core_capacity,
  housing_capacity,
  core_resistance,
  sink_resistance,
  rms_current,
  duration,
  speed08
};

struct Parameter {
  const char* name;
  const char* unit;
  Scale scale;
  double low, high;  // in units of the scale
  double typical;    // the prior's width about `none` (of its logarithm, where `logarithmic`): Student's t
  bool logarithmic = false;
  double none = 0;  // where the prior is centred: what does nothing, or, of what always does something, the usual
};

enum class Needs {
  nothing,
  current,
  speed,
  neighbour,
  frame,
  several_currents,
  several_logs,
  several_housings,
  logs_of_power,
  logs_of_current,
  copper,
  winding
};

struct Cause {
  const char* id;
  const char* name;  // in words, with the members of the class that temperatures cannot tell apart
  Edit edit;
  thermal::Drive drive;
  int node;  // 0 winding, 1 housing
  thermal::LinkLaw law;
  thermal::Boundary boundary;
  Needs needs;
  std::vector<Parameter> parameters;
  const char* signature;   // how it shows
  const char* rivals;      // ids it is easily taken for
  const char* experiment;  // what tells them apart
};

const std::vector<Cause>& causes();

/// Index in causes(), -1: none of that id.
int cause_named(const std::string& id);

/// The cause is of one log among several, and may be chosen for each of them.
inline bool of_one_log(const Cause& cause) {
  return cause.needs == Needs::several_logs || cause.needs == Needs::several_housings ||
         cause.needs == Needs::logs_of_power || cause.needs == Needs::logs_of_current;
}

/// A cause chosen for a fit; `log` only for causes of one log, -1 otherwise.
struct Chosen {
  int cause = -1;
  int log = -1;
  bool operator==(const Chosen&) const = default;
};

inline const Cause& cause_of(const Chosen& chosen) { return causes()[static_cast<std::size_t>(chosen.cause)]; }

inline constexpr double least_lag_s = 0.02;  // of a sensor that lags: none at all has no slope to fit by

/// Edits `model` by `cause` with parameters `k` in physical units. `log`: which log the model replays.
template <class S>
void apply(const Cause& cause, const S* k, const Chosen& chosen, std::size_t log, Model<S>& model) {
  auto& set = model.set;
  if (of_one_log(cause) && chosen.log != static_cast<int>(log)) return;
  const auto ambient = set.links[model.sink_link].to;
  const auto add_link = [&](int from, int to, thermal::LinkLaw law, const S& conductance) {
    set.links[set.link_count++] = {static_cast<std::int8_t>(from), static_cast<std::int8_t>(to), law, conductance,
                                   S(0)};
  };
  const auto add_node = [&](const S& capacity) {
    set.nodes[set.node_count] = {capacity, {}};
    return set.node_count++;
  };
  switch (cause.edit) {
    case Edit::source:
      // What adds to the copper loss grows with temperature as copper does.
      set.sources[set.source_count++] = {
          static_cast<std::int8_t>(cause.node), cause.drive, k[0],
          cause.drive == thermal::Drive::current2_speed2 ? set.sources[0].coefficient_per_K : S(0)};
      break;
    case Edit::coefficient:  // of all copper, whichever of two causes comes first
      for (int s = 0; s < set.source_count; ++s) {
        if (s == 0 || !(set.sources[s].coefficient_per_K == 0.0)) set.sources[s].coefficient_per_K = k[0];
      }
      break;
    case Edit::sink_law:
      set.links[model.sink_link].law = cause.law;
      set.links[model.sink_link].k = k[0];
      break;
    case Edit::radiation:
      add_link(model.housing, ambient, thermal::LinkLaw::radiation, k[0]);
      break;
    case Edit::link:
      add_link(model.housing, thermal::boundary_end(cause.boundary), thermal::LinkLaw::constant, k[0]);
      break;
    case Edit::mass: {
      const int node = add_node(k[0]);
      add_link(model.housing, node, thermal::LinkLaw::constant, 1.0 / k[1]);
      break;
    }
    case Edit::hot_spot: {
      const int node = add_node(k[0]);
      add_link(model.core, node, thermal::LinkLaw::constant, 1.0 / k[1]);
      model.hot_node = node;
      model.hot_share = 0.4;  // end turns are about two fifths of the copper of a short motor
      auto& copper = set.sources[0];
      set.sources[set.source_count] = copper;
      set.sources[set.source_count].node = static_cast<std::int8_t>(node);
      set.sources[set.source_count].gain = copper.gain * model.hot_share;
      copper.gain = copper.gain * (1 - model.hot_share);
      ++set.source_count;
      break;
    }
    case Edit::cooling_step:
      model.cooling_factor = k[0];
      model.cooling_from_s = k[1];
      model.cooling_changes = true;
      break;
    case Edit::cooling_of_log:
      set.links[model.sink_link].conductance_W_per_K = set.links[model.sink_link].conductance_W_per_K * k[0];
      break;
    case Edit::power_of_log:
      for (int s = 0; s < set.source_count; ++s) {
        if (set.sources[s].drive == thermal::Drive::power_W) set.sources[s].gain = set.sources[s].gain * k[0];
      }
      break;
    case Edit::current_of_log:
      for (int s = 0; s < set.source_count; ++s) {
        auto& source = set.sources[s];
        if (thermal::is_current_square(source.drive) || source.drive == thermal::Drive::current2_speed2)
          source.gain = source.gain * k[0] * k[0];
        else if (source.drive == thermal::Drive::current_A || source.drive == thermal::Drive::current_speed)
          source.gain = source.gain * k[0];
      }
      break;
    case Edit::current_offset:
      model.current_offset_A = k[0];
      model.offset = true;
      break;
    case Edit::sensor_lag:
      set.housing.lag_s = k[0] + least_lag_s;
      break;
    case Edit::winding_lag:
      model.winding_lag_s = k[0] + least_lag_s;
      model.winding_lags = true;
      break;
    case Edit::sensor_offset:
      set.housing.offset_K += k[0];
      break;
    case Edit::sensor_gain:
      set.housing.gain_error += k[0];
      break;
    case Edit::sensor_share:
      model.sensor_share = k[0];
      model.feels_winding = true;
      break;
    case Edit::drift:
      model.drift_K_per_s = k[0];
      model.drifts = true;
      break;
    case Edit::delay:
      model.delay_s = k[0];
      model.delayed = true;
      break;
    case Edit::stall_share:
      model.stall_share = k[0];
      model.stalls = true;
      break;
  }
}

}  // namespace identify

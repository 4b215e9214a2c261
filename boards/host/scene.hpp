// SPDX-License-Identifier: MIT
// A scene as a person writes it: host-sim/scenes/*.toml. What is asked of the motor, what holds the shaft, how warm it
// starts, and which limiters stand beside each other. Plain data; run_scene.hpp plays it.
#pragma once

#include <string>
#include <vector>

namespace boards::host {

/// What keeps the current down. Each limiter of a scene gets a board and a motor of its own in the same run.
enum class Limiter {
  governor,  // hotcore: the estimated winding temperature
  rated,     // a naive current limit at the catalogue rating
  housing,   // full current until the housing sensor reaches its limit
  hard_cut,  // the paper's: full current until the estimated winding temperature reaches the limit, then none
  oracle,    // what no firmware can: full current until the true winding is at the limit, then what holds it there
};
const char* name_of(Limiter limiter);

/// One stretch of demand on the q axis; after the last one the demand is zero. Stretches of one axis follow each other.
struct Demand {
  int axis = 0;
  double from_s = 0, to_s = 0;
  double current_A = 0;     // amplitude of the phase current
  double ripple_ratio = 0;  // demand is current (1 + ripple sin(2 pi f t))
  double frequency_Hz = 0;
};

/// What holds the shaft.
struct Shaft {
  enum class Kind { locked, free, imposed } kind = Kind::locked;
  double angle_rad = 0;            // electrical angle of a locked rotor
  double load_inertia_kg_m2 = 0;   // of a free shaft, added to the rotor's
  std::vector<double> landings_s;  // of a free shaft: times at which the load is brought to rest
  double speed_rad_per_s = 0;      // of an imposed motion: mean
  double speed_amplitude_rad_per_s = 0;
  double frequency_Hz = 0;
};

/// One instant of a program: what is asked for and how fast the shaft is turned.
struct ProgramStep {
  double current_A, speed_rad_per_s;
};

struct Scene {
  std::string id, title, note;
  std::string motor = "ec-16-40w";
  std::string board = "h8-15d";  // rating of the power stage: h8-15d or h8-17.5d
  std::string trust = "exact";   // in the motor's thermal values: exact (the simulated motor's own), identified (as the
                                 // model says), sheet
  std::string model;             // a heat-network file of identify that the firmware runs; empty: from the motor
  double seconds = 1;
  double log_Hz = 1000;
  unsigned seed = 1;
  double ambient_degC = 25;
  double start_degC = 25;           // winding and housing
  double housing_limit_degC = 100;  // of the limiter `housing`: what a cautious user of a sensor would set
  double coolant_K_per_W = 0;       // 0: air; otherwise R2 of a water jacket
  double supply_V = 48;
  bool supply_sinks = true;  // a battery; false: a mains supply that takes nothing back
  std::vector<Limiter> limiters = {Limiter::governor};
  std::vector<Demand> demands;
  std::vector<ProgramStep> program;  // of axis 0 instead of demands and shaft; straight lines between the steps
  double program_Hz = 0;
  Shaft shaft;
};

/// Names of the scene files in a folder, sorted.
std::vector<std::string> scene_names(const std::string& folder);

/// Reads a scene: a name in `folder` or a path ending in .toml; `overrides` are "key=value" (keys of the top level and
/// "shaft.key"). Throws UserError (usage) for an unknown scene or key (the nearest is named) and for impossible values.
Scene read_scene(const std::string& which, const std::string& folder, const std::vector<std::string>& overrides);

/// Demand of one axis at a time, in amperes of phase amplitude.
double demand_A(const Scene& scene, int axis, double time_s);

/// Speed of a shaft that is turned from outside.
double imposed_speed_rad_per_s(const Shaft& shaft, double time_s);
double imposed_speed_rad_per_s(const Scene& scene, double time_s);

}  // namespace boards::host

// SPDX-License-Identifier: MIT
// Logs with an effect hidden in them, made by host-sim's stove (its own nodes, equations and integrator; nothing of
// thermal/ or identify/) on raw samples at 10 Hz, with thermistor noise, slow wander, steps, and 1 % current noise.
// Effect, size, sign, time, motor, duty and seed come from one number that the program never sees.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "host-sim/plant/stove.hpp"
#include "wire/pc/motor_file.hpp"

namespace tests {

enum class Duty { robot, designed };
enum class Core { none, sparse, dense };

/// A stretch of a profile: direct current as the log has it.
struct ProfileStretch {
  double seconds, current_A, speed_rad_per_s;
};

struct HiddenLogOptions {
  Duty duty = Duty::robot;
  Core core = Core::sparse;
  std::uint64_t seed = 1;
  std::vector<std::string> effects = {};  // ids of hideable() and outside()
  double strength = 1;                    // of the size drawn
  bool mostly_small = false;              // sizes of 1..10 K are drawn evenly in their logarithm, not in themselves
  double structure = 0.1;  // how far the clean motor is from two nodes: teeth, yoke, frame, 1 as host-sim has them
  double seconds = 1200;
  bool small_ones = false;   // eleven small effects besides
  double step_K = 0.1;       // of what the housing sensor tells; where it is coarser, of a dense winding sensor too
  double current_noise = 0;  // white, of the current's rms, at rest as well; beside 1 % of itself
  bool noisy = true;         // false: the same log as the sensors would read it without noise and steps
  // A further log of the same motor with the same effect, sized as before: another duty and noise from this seed, or
  // this profile played.
  std::uint64_t again = 0;
  std::vector<ProfileStretch> profile = {};
};

struct HiddenLog {
  wire::pc::MotorFile sheet;  // what the program is told
  wire::Motor truth;
  double core_error_K = 0;        // rms of the winding with the effect against without it
  std::vector<double> core_degC;  // truth at each row
  // What each effect truly is, in the parameters of identify's table (none for effects outside of it).
  std::map<std::string, std::vector<double>> parameters;
};

/// All ids that can be hidden (of the catalogue), and those outside of it.
std::vector<std::string> hideable();
std::vector<std::string> outside();

/// An effect of the plant in the parameters of identify's table; none for effects outside of it.
std::vector<double> in_words_of_the_table(const std::string& id, const host_sim::HiddenEffects& effects,
                                          const wire::Motor& motor);

HiddenLog make_hidden_log(const HiddenLogOptions& options, const std::string& path);

}  // namespace tests

// SPDX-License-Identifier: MIT
// Records a long log as a robot's would be: the firmware drives a simulated motor under protection, and the log holds
// what sensors say. An effect drawn from a seed may be hidden in the motor; the truth goes to a file of its own.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "host-sim/plant/hidden.hpp"
#include "wire/motor.hpp"

namespace boards::host {

struct RecordOptions {
  std::string excitation = "duty";  // duty, designed, step or profile; or a scene
  std::string profile = {};         // of the excitation "profile": the answer of identify (JSON) with its experiment
  std::string motor = "ec-16-40w";
  double minutes = 20;
  std::uint64_t seed = 1;                  // of excitation and sensor noise
  std::optional<std::uint64_t> hide = {};  // seed of the hidden motor, below
  bool thermocouple = false;  // a winding temperature in every line; otherwise a resistance reading now and then
  std::string motor_folder, scene_folder;
  std::function<void(double)> progress = {};
};

struct Recording {
  std::string log_csv;
  std::string truth_json;
  double hottest_true_degC, winding_max_degC;
};

/// A motor off its sheet, with an effect drawn from `seed`: the same whatever is recorded of it or played on it.
struct HiddenMotor {
  wire::Motor motor;
  host_sim::HiddenEffects hidden;
  std::string truth_json;
};
HiddenMotor hidden_motor(std::uint64_t seed, const std::string& motor, const std::string& motor_folder);

Recording record(const RecordOptions& options);

}  // namespace boards::host

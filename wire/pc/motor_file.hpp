// SPDX-License-Identifier: MIT
// Reads boards/motors/*.toml: sheet values in sheet units, converted to SI here and nowhere else.
#pragma once

#include <string>
#include <vector>

#include "wire/motor.hpp"

namespace wire::pc {

/// A motor with what a person is told about it.
struct MotorFile {
  Motor motor;
  std::string id;          // file name without folder and ending
  std::string name;        // "maxon EC 16, 40 W"
  std::string source;      // where the numbers come from
  bool surrogate = false;  // true: recalled or scaled, not read from a sheet; said wherever the motor is shown
};

/// Reads a motor file. `which` is a path ending in .toml or the name of a file in `folder`.
/// Throws UserError (usage) with the file, the key and what to do for: no such motor (the nearest is named), broken
/// TOML, a misspelt key (the nearest is named), a missing key, a number that no motor has, another status than
/// surrogate.
MotorFile read_motor(const std::string& which, const std::string& folder);

/// Names of the motor files in a folder, sorted.
std::vector<std::string> motor_names(const std::string& folder);

}  // namespace wire::pc

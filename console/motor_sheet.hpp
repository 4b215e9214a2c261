// SPDX-License-Identifier: MIT
// A motor between its sheet and a board's parameters, both ways. Pure: no board.
#pragma once

#include <map>
#include <string>

#include "wire/bus_window.hpp"
#include "wire/motor.hpp"

namespace console {

/// Values of one axis by name without axis: "R1_K_per_W".
using Values = std::map<std::string, float>;

/// Throws UserError (usage) where the axis does not have it or it is unset.
double value_of(const Values& values, const std::string& name);

/// The steady amplitude that would bring the winding to its limit in the end, from the board's own parameters.
/// Throws UserError (usage) naming the first one that is unset.
double continuous_A(const Values& values);

/// A motor sheet (TOML) that says what the board believes: identify's gauge is then the board's resistance.
std::string sheet_of(const Values& values, const std::string& name);

/// What an axis is told of a motor: its sheet and the bus as they say. What identify found of an earlier motor, and how
/// far that was trusted, goes back to `defaults`; what is of the drive, of the housing's sensor and of the room is not
/// among these values, and neither is the encoder's angle.
Values parameters_of_sheet(const wire::Motor& motor, const wire::BusWindow& bus, const Values& defaults);

}  // namespace console

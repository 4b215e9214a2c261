// SPDX-License-Identifier: MIT
// What is measured in place of a current or of the winding's temperature: phases, a torque, a resistance.
#pragma once

#include <optional>

#include "identify/log/log.hpp"

namespace identify {

/// Registers of drives and servos hold negative numbers, and many a script prints them without a sign: 65535 for -1.
/// Then small and large numbers are there and none between; these become what they are. How many bits: 16 or 32; 0:
/// none of it.
int give_sign(std::vector<double>& cells);

/// The direct current that heats alike, of the currents of the phases at each moment: 2 R i^2 = R (a^2 + b^2 + c^2).
/// Two of them tell the third, for a motor's star has no fourth wire.
void read_phases(Log& log);

/// Robots' logs often have a joint's torque and no current.
void read_torque(Log& log, const std::optional<wire::Motor>& motor);

/// The winding's resistance tells its temperature once both are known of one moment: at the start, where a motor that
/// rested is as warm as the room everywhere. All readings of that rest count: what they are off by, all that follow
/// are.
void read_resistance(Log& log);

}  // namespace identify

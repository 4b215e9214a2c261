// SPDX-License-Identifier: MIT
// From logs to a problem: bins as fine as the winding asks for, the readings' noise, and what is believed of the motor.
#pragma once

#include <optional>

#include "identify/fit/problem.hpp"
#include "wire/pc/motor_file.hpp"

namespace identify {

/// Bins the logs, takes the noise from rest, and settles the belief (from the sheet, or from the data by a rough
/// search). `copper_per_K`: overrides the coefficient of the winding's resistance (0: constant).
Problem problem_of(const std::vector<Log>& logs, const std::optional<wire::pc::MotorFile>& motor,
                   std::optional<double> copper_per_K = std::nullopt);

}  // namespace identify

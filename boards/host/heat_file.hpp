// SPDX-License-Identifier: MIT
// Reads the heat-network parameter set that identify wrote (--write-model), for the firmware to run.
#pragma once

#include <string>

#include "thermal/heat_set.hpp"

namespace boards::host {

/// Throws UserError (usage) for a missing file, broken TOML, an unknown key or name (the nearest is said), a number
/// that cannot be, or a set that thermal/validate.hpp refuses.
thermal::HeatSet<double> read_heat_set(const std::string& path);

}  // namespace boards::host

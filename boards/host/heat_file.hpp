// SPDX-License-Identifier: MIT
// Reads the heat-network parameter set that identify wrote (--write-model), for the firmware to run.
#pragma once

#include <optional>
#include <string>

#include "thermal/core_estimator.hpp"
#include "thermal/heat_set.hpp"

namespace boards::host {

struct HeatModel {
  std::string motor;  // whose it is, where the file says it
  thermal::HeatSet<double> set;
  std::optional<thermal::Trust> trust;  // how sure the fit was, where the file says it
};

/// Throws UserError (usage) for a missing file, broken TOML, an unknown key or name (the nearest is said), a number
/// that cannot be, or a set that thermal/validate.hpp refuses.
HeatModel read_heat_model(const std::string& path);

}  // namespace boards::host

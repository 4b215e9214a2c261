// SPDX-License-Identifier: MIT
// Plays a scene: for each limiter a simulated board with two motors, and the firmware that would be flashed.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "boards/host/scene.hpp"
#include "boards/host/trace.hpp"
#include "host-sim/plant/hidden.hpp"
#include "wire/motor.hpp"

namespace boards::host {

struct RunOptions {
  std::string motor_folder;
  std::optional<wire::Motor> plant_motor = {};      // the motor as it is; then the firmware believes the sheet
  double winding_margin_K = 0;                      // by which the firmware's limit lies below the sheet's
  host_sim::HiddenEffects hidden = {};              // that the firmware does not know
  std::function<void(double share)> progress = {};  // 0..1, a few times a second of simulated time
};

Result run_scene(const Scene& scene, const RunOptions& options);

}  // namespace boards::host

// SPDX-License-Identifier: MIT
// Plays a scene: for each limiter a simulated board with two motors, and the firmware that would be flashed.
#pragma once

#include <functional>
#include <string>

#include "boards/host/scene.hpp"
#include "boards/host/trace.hpp"
#include "host-sim/plant/hidden.hpp"

namespace boards::host {

struct RunOptions {
  std::string motor_folder;
  host_sim::HiddenEffects hidden = {};              // that the firmware does not know
  std::function<void(double share)> progress = {};  // 0..1, a few times a second of simulated time
};

Result run_scene(const Scene& scene, const RunOptions& options);

}  // namespace boards::host

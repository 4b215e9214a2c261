// SPDX-License-Identifier: MIT
// Plays a scene of host-sim on the flash image: same plant, same sheet, same demands, and the same trace at the end.
// Only the governor's own trace: the other limiters of a scene are comparisons that need no chip.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "boards/host/chip/pcb.hpp"
#include "boards/host/scene.hpp"
#include "boards/host/trace.hpp"

namespace boards {

struct ChipPlay {
  host::Result result{};
  std::string mistakes{};  // of the firmware, one a line; empty: none
  std::uint64_t mistake_count = 0;
  double wall_s = 0;              // elapsed, of the scene and its start
  double lane_worst[2] = {0, 0};  // instructions: fast lane (one axis, one period), main loop between two sleeps
  double lane_mean[2] = {0, 0};
  double asleep_share = 0;
  int resets = 0;
};

/// The board with the scene's motors, shafts and supply; image and parameters flashed, power still off.
std::unique_ptr<Pcb> board_of(const host::Scene& scene, const std::string& elf, const std::string& motor_folder);

ChipPlay play_on_chip(const host::Scene& scene, const std::string& elf, const std::string& motor_folder,
                      const std::function<void(double share)>& progress = {});

}  // namespace boards

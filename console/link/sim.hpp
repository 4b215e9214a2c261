// SPDX-License-Identifier: MIT
// A board in this process: the same firmware, its USB stack included, with simulated motors. Declared here and defined
// in boards/host/virtual, because the console knows no firmware.
#pragma once

#include <memory>
#include <string>

#include "console/link/transport.hpp"

namespace console::link {

struct SimulatedBoard {
  std::string serial = "SIM0";
  /// false: time passes only in Transport::wait, and there as fast as the computer can; now_s() is the board's own
  /// time.
  bool real_time = true;
  bool full_motors = true;          // false: simpler ones at a hundredth of the cost, for many boards
  std::string motor_folder;         // where motor sheets lie
  std::string motor = "ec-16-40w";  // on both axes; its parameters are set and saved
};

std::unique_ptr<Transport> simulated_board(const SimulatedBoard& options);

}  // namespace console::link

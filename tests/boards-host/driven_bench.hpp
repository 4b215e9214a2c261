// SPDX-License-Identifier: MIT
// A bench and the firmware's driver of both its axes, a millisecond at a time.
#pragma once

#include <array>

#include "boards/dual_48v_20a.hpp"
#include "boards/host/board.hpp"
#include "firmware/driver.hpp"

namespace board_tests {

struct DrivenBench {
  DrivenBench(const host_sim::BenchDesign& design_, const firmware::AxisSetup& axis)
      : design(design_), bench(design, 1), driver({boards::dual_48V_20A, {axis, axis}}) {}

  /// True: the slow lane ran at its end, as after each tenth.
  bool advance_ms() {
    for (int period = 0; period < 20; ++period) {
      const std::array<hal::Duty, 2> duty = {doors[0].next(), doors[1].next()};
      for (std::size_t i = 0; i < 2; ++i) doors[i].drive(driver.axis(static_cast<int>(i)).tick(doors[i].sample()));
      bench.advance_period(duty);
    }
    driver.watch();
    if (++ms % 10 != 0) return false;
    driver.slow_tick(boards::host::slow_sample(bench.board_raw(), design.sensors),
                     {boards::host::slow_sample(bench.raw(0), design.sensors),
                      boards::host::slow_sample(bench.raw(1), design.sensors)});
    return true;
  }

  host_sim::BenchDesign design;
  host_sim::Bench bench;
  firmware::Driver driver;
  std::array<boards::host::AxisDoor, 2> doors = {boards::host::AxisDoor(bench, design.sensors, 0),
                                                 boards::host::AxisDoor(bench, design.sensors, 1)};
  int ms = 0;
};

}  // namespace board_tests

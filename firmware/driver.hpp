// SPDX-License-Identifier: MIT
// The whole driver: two axes on one power stage. A board's control interrupt calls axis(i).tick for each axis, its main
// loop calls slow_tick every 10 ms; nothing else couples the axes but the heat of the board they share.
// No statics, no heap: a board owns one Driver, a PC may own many.
#pragma once

#include "firmware/axis.hpp"
#include "thermal/board_heat.hpp"

namespace firmware {

inline constexpr int axis_count = 2;

struct DriverSetup {
  BoardRating rating;
  AxisSetup axes[axis_count];
  thermal::BoardRating board_heat{};  // its continuous current is taken from the rating
};

class Driver {
 public:
  explicit Driver(const DriverSetup& setup);

  Axis& axis(int index) { return axes_[index]; }
  const Axis& axis(int index) const { return axes_[index]; }

  /// Every 10 ms, from one context below the control interrupt.
  void slow_tick(const hal::BoardSlowSample& board, const hal::AxisSlowSample (&axes)[axis_count]);
  const thermal::BoardHeat& board_heat() const { return board_heat_; }

 private:
  thermal::GovernorSettings governor_;
  thermal::BoardHeat board_heat_;
  Axis axes_[axis_count];
};

}  // namespace firmware

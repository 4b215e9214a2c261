// SPDX-License-Identifier: MIT
// The whole driver: two axes on one power stage. A board's control interrupt calls axis(i).tick for each axis, its main
// loop watch every millisecond and slow_tick every 10 ms; nothing else couples the axes but the heat of the board they
// share and of each other's housing. No statics, no heap: a board owns one Driver, a PC may own many.
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

/// What must survive a reset: how hot everything was, and why it stopped.
struct DriverMemory {
  AxisMemory axes[axis_count];
  float board_used_ratio;
};

class Driver {
 public:
  explicit Driver(const DriverSetup& setup);

  Axis& axis(int index) { return axes_[index]; }
  const Axis& axis(int index) const { return axes_[index]; }

  /// Both axes off or tripped, and nothing posted that could change that.
  bool at_rest() const { return axes_[0].at_rest() && axes_[1].at_rest(); }
  /// Another set for a disarmed axis.
  void configure(int index, const AxisSetup& setup, HeatModel heat) { axes_[index].configure(setup, heat); }

  /// What must survive a reset, as of the last slow tick.
  DriverMemory memory() const { return {{axes_[0].memory(), axes_[1].memory()}, board_heat_.used_ratio()}; }
  /// Before the control interrupt runs: once, either with what was remembered or as hot as may be.
  void restore(const DriverMemory& memory);
  void start_hot();

  /// Every 10 ms, from one context below the control interrupt.
  void slow_tick(const hal::BoardSlowSample& board, const hal::AxisSlowSample (&axes)[axis_count]);
  /// Every millisecond, from the same context.
  void watch() {
    for (Axis& axis : axes_) axis.watch();
  }
  /// Every millisecond once all else is done: a step of one axis' look-ahead, every other time. Nothing else needs it.
  void look_ahead() {
    turn_ = (turn_ + 1) % (2 * axis_count);
    if (turn_ % 2 == 0) axes_[turn_ / 2].look_ahead();
  }
  const thermal::BoardHeat& board_heat() const { return board_heat_; }

 private:
  std::uint32_t sum() const;

  thermal::GovernorSettings governor_;
  thermal::BoardHeat board_heat_;
  float board_A_[axis_count] = {-1.0f, -1.0f};  // what it leaves each axis; negative: nothing said yet
  std::uint32_t left_ = 0;                      // sum of these three, as each call left them
  Axis axes_[axis_count];
  unsigned turn_ = 0;
};

}  // namespace firmware

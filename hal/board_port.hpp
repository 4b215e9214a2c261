// SPDX-License-Identifier: MIT
// What the slow lane (100 Hz) learns from the board. A missing sensor is said by its flag, never by a cold reading.
#pragma once

namespace hal {

/// A temperature that may be missing. `valid` false: open, short, out of range or stale; then `value_degC` means
/// nothing.
struct Temperature {
  float value_degC;
  bool valid;
};

/// Slow measurements of one axis.
struct AxisSlowSample {
  Temperature housing;
};

/// Slow measurements shared by both axes.
struct BoardSlowSample {
  Temperature power_stage;
  float bus_A;  // bus current, positive out of the supply
  bool bus_A_valid;
};

}  // namespace hal

// SPDX-License-Identifier: MIT
// The simulated board behind the same doors as a real one: it turns host-sim's counts into SI units by itself, knowing
// only the design numbers that a real board file would state, and carries the duty to the simulated bridge.
#pragma once

#include <cstdint>

#include "hal/axis_port.hpp"
#include "hal/board_port.hpp"
#include "host-sim/plant/bench.hpp"

namespace boards::host {

/// The three doors of one simulated axis.
class AxisDoor {
 public:
  AxisDoor(const host_sim::Bench& bench, const host_sim::SensorDesign& design, int axis)
      : bench_(&bench), design_(&design), axis_(axis) {}

  hal::AxisSample sample() noexcept;
  /// Loads at the next PWM period, as preloaded compare registers do.
  void drive(const hal::Duty& duty) noexcept { next_ = duty; }
  void release() noexcept { next_.on = false; }

  const hal::Duty& next() const { return next_; }

 private:
  const host_sim::Bench* bench_;
  const host_sim::SensorDesign* design_;
  int axis_;
  hal::Duty next_{{0.5f, 0.5f, 0.5f}, false};
};
static_assert(hal::AxisPort<AxisDoor>);

/// A thermistor's counts as a temperature; counts that no plausible temperature gives (open, short) are invalid.
hal::Temperature thermistor(std::uint16_t counts, const host_sim::NtcDesign& design, int full_scale);

/// Slow measurements, each a single conversion.
hal::AxisSlowSample slow_sample(const host_sim::AxisRaw& raw, const host_sim::SensorDesign& design);
hal::BoardSlowSample slow_sample(const host_sim::BoardRaw& raw, const host_sim::SensorDesign& design);

}  // namespace boards::host

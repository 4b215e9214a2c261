// SPDX-License-Identifier: MIT
// What the fast lane hands outward: sums since the slow lane last took them, each nonlinear form taken before the sum.
//
// Two buffers: the fast lane adds to one, the slow lane takes the other; the flip is one byte, so no sum is ever torn
// and nothing is counted twice or lost. float32 carries a sum of some hundred terms to 1e-5; the state that grows for
// minutes lives in the slow lane in double. `add` is for the control interrupt, `take` for the slow lane.
#pragma once

#include <atomic>
#include <cstdint>

#include "firmware/transforms.hpp"

namespace firmware {

struct HeatSums {
  Abc phase_A2{0.0f, 0.0f, 0.0f};  // sum over PWM periods of i^2: times the period A^2 s, times R joules
  float rad_per_s = 0.0f;          // mechanical, sum of |w|
  float bus_V = 0.0f;
  std::uint32_t periods = 0;  // that are in these sums
  std::uint32_t driven = 0;   // of them with the bridge on
};

class HeatHandOver {
 public:
  HeatSums& adding() { return sums_[active_.load(std::memory_order_relaxed)]; }

  HeatSums take() {
    const std::uint8_t filled = active_.load(std::memory_order_relaxed);
    active_.store(filled ^ 1u, std::memory_order_release);
    const HeatSums taken = sums_[filled];
    sums_[filled] = {};
    return taken;
  }

 private:
  HeatSums sums_[2];
  std::atomic<std::uint8_t> active_{0};
};

}  // namespace firmware

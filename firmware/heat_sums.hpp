// SPDX-License-Identifier: MIT
// What the fast lane hands outward: sums since the slow lane last took them, each nonlinear form taken before the sum.
//
// Two buffers: the fast lane adds to one, the slow lane takes the other; the turn is one word, so no sum is ever torn
// and nothing is counted twice or lost. No pointer: one with a flipped bit would let the fast lane write anywhere.
// float32 carries a sum of some hundred terms to 1e-5; the state that grows for minutes lives in the slow lane in
// double. `add` is for the control interrupt, `take` for the slow lane.
#pragma once

#include <atomic>
#include <cstdint>

#include "firmware/transforms.hpp"

namespace firmware {

struct HeatSums {
  Abc phase_A2{0.0f, 0.0f, 0.0f};  // sum over PWM periods of i^2: times the period A^2 s, times R joules
  std::uint32_t periods = 0;       // since the slow lane last took: also the age of its answer
};

class HeatHandOver {
 public:
  HeatSums& adding() { return sums_[turn_.load(std::memory_order_relaxed) / sizeof(HeatSums) % 2]; }

  HeatSums take() {
    HeatSums& filled = adding();
    turn_.store(turn_.load(std::memory_order_relaxed) + sizeof(HeatSums), std::memory_order_relaxed);
    std::atomic_signal_fence(std::memory_order_seq_cst);  // one core: the interrupt adds elsewhere from here on
    const HeatSums taken = filled;
    filled = {};
    return taken;
  }

 private:
  HeatSums sums_[2];
  std::atomic<std::uint32_t> turn_{0};  // in bytes: where to add is then one mask away
};

}  // namespace firmware

// SPDX-License-Identifier: MIT
// What the current sensors read when no current flows: learnt over blocks of samples while the bridge is open.
//
// The board has taken off the nominal offset; what is left here must stay within a bound, or the sensor is broken. A
// block counts only if the motor cannot have pushed current through the diodes: the caller says so. ISR.
#pragma once

#include <cstdint>

#include "firmware/transforms.hpp"

namespace firmware {

class Offsets {
 public:
  static constexpr std::uint32_t block = 2048;  // 0.1 s at 20 kHz: averages 50 Hz over five periods, noise down to 2 %

  Abc correct(const Abc& raw_A) const { return {raw_A.a - offset_A_.a, raw_A.b - offset_A_.b, raw_A.c - offset_A_.c}; }

  /// Returns the largest |offset| of a block that has just ended, else 0.
  float learn(const Abc& raw_A) {
    sum_A_ = {sum_A_.a + raw_A.a, sum_A_.b + raw_A.b, sum_A_.c + raw_A.c};
    if (++count_ < block) return 0.0f;
    constexpr float share = 1.0f / block;
    offset_A_ = {sum_A_.a * share, sum_A_.b * share, sum_A_.c * share};
    known_ = true;
    restart();
    return largest_A();
  }

  /// Drops a block that was begun.
  void restart() {
    sum_A_ = {0.0f, 0.0f, 0.0f};
    count_ = 0;
  }

  /// Back to nothing learnt: an offset that was out of bounds must never be subtracted.
  void forget() { *this = {}; }

  bool known() const { return known_; }
  const Abc& offset_A() const { return offset_A_; }

 private:
  float largest_A() const {
    const float a = offset_A_.a < 0.0f ? -offset_A_.a : offset_A_.a;
    const float b = offset_A_.b < 0.0f ? -offset_A_.b : offset_A_.b;
    const float c = offset_A_.c < 0.0f ? -offset_A_.c : offset_A_.c;
    return a > b ? (a > c ? a : c) : (b > c ? b : c);
  }

  Abc offset_A_{0.0f, 0.0f, 0.0f}, sum_A_{0.0f, 0.0f, 0.0f};
  std::uint32_t count_ = 0;
  bool known_ = false;
};

}  // namespace firmware

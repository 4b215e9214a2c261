// SPDX-License-Identifier: MIT
// Bounds of floats as one comparison of integers: positive floats sort like their bits, and NaN lies above infinity, so
// that no NaN passes, quietly (no floating-point trap), in half the instructions. Pure functions, ISR.
#pragma once

#include <bit>
#include <cstdint>

namespace firmware {

constexpr std::uint32_t bits(float x) { return std::bit_cast<std::uint32_t>(x); }

/// |x| <= bound, for a bound >= 0.
constexpr bool within(float x, float bound) { return (bits(x) & 0x7FFF'FFFFu) <= bits(bound); }

/// low <= x <= high, for 0 <= low. Any range that is not (NaN, upside down) holds nothing.
class Range {
 public:
  constexpr Range() = default;
  constexpr Range(float low, float high) : low_(bits(low)), span_(bits(high) - bits(low)) {
    if (!(low >= 0.0f && low <= high)) *this = {};
  }
  constexpr bool holds(float x) const { return bits(x) - low_ <= span_; }

 private:
  std::uint32_t low_ = 0xFFFF'FFFFu, span_ = 0;  // one pattern, and that is a NaN
};

}  // namespace firmware

// SPDX-License-Identifier: MIT
#include "firmware/modulation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace {

using firmware::Abc;
using firmware::modulate;
using firmware::Modulated;

constexpr float bus_V = 48.0f, window = 0.04f;

Abc vector_V(double length_V, double rad) {
  const auto phase = [&](double shift) { return static_cast<float>(length_V * std::cos(rad - shift)); };
  return {phase(0), phase(2 * M_PI / 3), phase(-2 * M_PI / 3)};
}

struct Sorted {
  explicit Sorted(const Abc& x) : low(x.a), middle(x.b), high(x.c) {
    if (low > middle) std::swap(low, middle);
    if (middle > high) std::swap(middle, high);
    if (low > middle) std::swap(low, middle);
  }
  float low, middle, high;
};

TEST(Modulation, LineToLineVoltSecondsAreExactInsideTheHexagon) {
  int inside = 0;
  for (double length_V = 0.0; length_V < 32.0; length_V += 0.25) {
    for (double rad = 0.0; rad < 2 * M_PI; rad += 0.01) {
      const Abc asked = vector_V(length_V, rad);
      const Sorted order(asked);
      if (order.high - order.low > bus_V * 0.99999f || order.middle - order.low > bus_V * (1 - window)) continue;
      ++inside;
      const Modulated got = modulate(asked, bus_V, 1 - window);
      ASSERT_EQ(got.share, 1.0f);
      ASSERT_NEAR((got.ratio.a - got.ratio.b) * bus_V, asked.a - asked.b, 1e-5 * 48);
      ASSERT_NEAR((got.ratio.b - got.ratio.c) * bus_V, asked.b - asked.c, 1e-5 * 48);
    }
  }
  EXPECT_GT(inside, 50000);
}

TEST(Modulation, WithoutAWindowTheWholeHexagonIsReached) {
  for (double rad = 0.0; rad < 2 * M_PI; rad += 0.003) {
    const Modulated got = modulate(vector_V(500.0, rad), bus_V, firmware::full_bus);
    // Distance of a hexagon's side: its corners lie on the phases' axes, 2/3 bus away.
    const double within_side = std::fmod(rad, M_PI / 3) - M_PI / 6;
    const double radius_V = 48.0 / std::sqrt(3.0) / std::cos(within_side);
    ASSERT_NEAR(static_cast<double>(got.share) * 500.0, radius_V, 1e-3);
    ASSERT_NEAR((got.ratio.a - got.ratio.b) * bus_V, got.share * (vector_V(500.0, rad).a - vector_V(500.0, rad).b),
                1e-3);
  }
}

TEST(Modulation, RatiosAreRatiosAndTwoWindowsStayOpenWhateverIsAsked) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> exponent(-6.0f, 6.0f), side(-1.0f, 1.0f), bus(12.0f, 58.0f);
  for (int i = 0; i < 1'000'000; ++i) {
    const float size = std::pow(10.0f, exponent(random));
    const Abc asked{side(random) * size, side(random) * size, side(random) * size};
    const float usable = i % 2 == 0 ? 1 - window : firmware::full_bus;
    const Modulated got = modulate(asked, bus(random), usable);
    const Sorted order(got.ratio);
    ASSERT_GE(order.low, 0.0f);
    ASSERT_LE(order.high, 1.0f);
    ASSERT_LE(order.middle, usable + 1e-6f);
    ASSERT_GE(got.share, 0.0f);
    ASSERT_LE(got.share, 1.0f);
  }
}

TEST(Modulation, SmallVoltagesAreCentred) {
  const Modulated got = modulate({1.0f, -0.5f, -0.5f}, bus_V, 1 - window);
  const Sorted order(got.ratio);
  EXPECT_NEAR(order.low + order.high, 1.0, 1e-6);
}

TEST(Modulation, PulsesMoveDownNoFurtherThanTheWindowNeeds) {
  for (double length_V = 26.0; length_V < 27.5; length_V += 0.01) {
    const Modulated got = modulate(vector_V(length_V, 0.3), bus_V, 1 - window);
    const Sorted order(got.ratio);
    const double spread = static_cast<double>(order.high - order.low);
    const double wanted = std::min((1 + spread) / 2, std::max(1.0 - static_cast<double>(window), spread));
    ASSERT_NEAR(order.high, wanted, 1e-5) << length_V;
  }
}

TEST(Modulation, WhatDoesNotFitIsShortenedInItsOwnDirection) {
  for (double rad = 0.0; rad < 2 * M_PI; rad += 0.01) {
    const Abc asked = vector_V(80.0, rad);
    const Modulated got = modulate(asked, bus_V, 1 - window);
    EXPECT_LT(got.share, 0.41f);
    ASSERT_NEAR((got.ratio.a - got.ratio.b) * bus_V, got.share * (asked.a - asked.b), 1e-3);
    ASSERT_NEAR((got.ratio.c - got.ratio.b) * bus_V, got.share * (asked.c - asked.b), 1e-3);
  }
}

}  // namespace

// SPDX-License-Identifier: MIT
#include "firmware/transforms.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "firmware/rotor.hpp"
#include "tests/firmware/bench.hpp"

namespace {

using firmware::Abc;
using firmware::AlphaBeta;
using firmware::Dq;
using firmware::ElectricalAngle;
using firmware::SinCos;

ElectricalAngle angle(double rad) {
  const double turns = rad / (2 * M_PI);
  return {static_cast<std::uint32_t>((turns - std::floor(turns)) * 4294967296.0)};
}

TEST(SinCos, StaysWithinItsStatedErrorAllAround) {
  double worst = 0.0;
  for (std::uint32_t i = 0; i < (1u << 22); ++i) {
    const std::uint32_t turn = i << 10;
    const SinCos got = firmware::sin_cos({turn});
    const double rad = turn * (2 * M_PI / 4294967296.0);
    worst = std::max({worst, std::abs(static_cast<double>(got.sin) - std::sin(rad)),
                      std::abs(static_cast<double>(got.cos) - std::cos(rad))});
  }
  EXPECT_LT(worst, static_cast<double>(firmware::sin_cos_error));
  EXPECT_GT(worst, 1e-7) << "better than float can be: the test looks at the wrong thing";
}

TEST(Transforms, APhaseAmplitudeIsAVectorLengthAndPhaseALiesOnAlpha) {
  for (double rad = 0.0; rad < 6.3; rad += 0.1) {
    const auto phase = [&](double shift) { return static_cast<float>(3.0 * std::cos(rad - shift)); };
    const AlphaBeta x = firmware::clarke({phase(0), phase(2 * M_PI / 3), phase(-2 * M_PI / 3)});
    EXPECT_NEAR(x.alpha, 3.0 * std::cos(rad), 1e-6);
    EXPECT_NEAR(x.beta, 3.0 * std::sin(rad), 1e-6);
    const Dq on_the_vector = firmware::park(x, firmware::sin_cos(angle(rad)));
    EXPECT_NEAR(on_the_vector.d, 3.0, 4e-6);
    EXPECT_NEAR(on_the_vector.q, 0.0, 4e-6);
    const Dq behind = firmware::park(x, firmware::sin_cos(angle(rad - M_PI / 2)));  // the rotor a quarter turn behind
    EXPECT_NEAR(behind.q, 3.0, 4e-6);
  }
}

TEST(Transforms, ThereAndBackIsTheSame) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> any(-20.0f, 20.0f);
  for (int i = 0; i < 10000; ++i) {
    const Dq x{any(random), any(random)};
    const SinCos rotor = firmware::sin_cos({static_cast<std::uint32_t>(random())});
    const Dq back = firmware::park(firmware::clarke(firmware::inverse_clarke(firmware::unpark(x, rotor))), rotor);
    EXPECT_NEAR(back.d, x.d, 5e-5);
    EXPECT_NEAR(back.q, x.q, 5e-5);
  }
}

TEST(Transforms, PowerIsThreeHalvesOfTheDqProduct) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> any(-20.0f, 20.0f);
  for (int i = 0; i < 1000; ++i) {
    const Dq v{any(random), any(random)}, c{any(random), any(random)};
    const SinCos rotor = firmware::sin_cos({static_cast<std::uint32_t>(random())});
    const Abc pv = firmware::inverse_clarke(firmware::unpark(v, rotor));
    const Abc pc = firmware::inverse_clarke(firmware::unpark(c, rotor));
    EXPECT_NEAR(pv.a * pc.a + pv.b * pc.b + pv.c * pc.c, 1.5f * (v.d * c.d + v.q * c.q), 2e-3);
  }
}

TEST(Transforms, WhatAllPhasesShareFallsOut) {
  const AlphaBeta without = firmware::clarke({1.0f, -3.0f, 2.0f}), with = firmware::clarke({1.5f, -2.5f, 2.5f});
  EXPECT_NEAR(with.alpha, without.alpha, 1e-6);
  EXPECT_NEAR(with.beta, without.beta, 1e-6);
}

// ---- rotor ----------------------------------------------------------------------------------------------------------

double distance(ElectricalAngle got, double rad) {
  const auto error = static_cast<std::int32_t>(got.turn - angle(rad).turn);
  return std::abs(error * (2 * M_PI / 4294967296.0));
}

double wrapped(double rad) { return rad - 2 * M_PI * std::floor(rad / (2 * M_PI)); }

TEST(Rotor, AimsAtTheMiddleOfTheNextPeriod) {
  for (const double rad_per_s : {0.0, 3.0, -900.0, 2500.0}) {
    firmware::Rotor rotor(bench::parameters(), bench::rating);
    double mechanical = 1.0;
    firmware::RotorAngle seen{};
    for (int i = 0; i < 4000; ++i, mechanical += rad_per_s * bench::period_s)
      seen = rotor.follow(static_cast<float>(wrapped(mechanical)), 1);
    mechanical -= rad_per_s * bench::period_s;
    const double electrical = mechanical * 2;
    EXPECT_LT(distance(seen.at_sample, electrical), 5e-6) << rad_per_s;
    EXPECT_LT(distance(seen.at_output, electrical + 2 * rad_per_s * 1.5 * bench::period_s), 2e-4) << rad_per_s;
    EXPECT_NEAR(rotor.rad_per_s(), rad_per_s, 1e-3 * std::abs(rad_per_s) + 0.5);
  }
}

TEST(Rotor, TakesOffTheEncodersOffset) {
  firmware::AxisParameters p = bench::parameters();
  p.angle_offset_rad = -2.5f;
  firmware::Rotor rotor(p, bench::rating);
  EXPECT_LT(distance(rotor.follow(1.0f, 1).at_sample, 2.0 + 2.5), 5e-6);
}

TEST(Rotor, AnEncoderOf4096CountsLeavesTheSpeedQuietAndTheAngleAhead) {
  firmware::Rotor rotor(bench::parameters(), bench::rating);
  double mechanical = 0.0, worst_speed = 0.0;
  for (int i = 0; i < 20000; ++i, mechanical += 123.4 * bench::period_s) {
    const double count_rad = 2 * M_PI / 4096;
    (void)rotor.follow(static_cast<float>(std::floor(wrapped(mechanical) / count_rad) * count_rad), 1);
    if (i > 2000) worst_speed = std::max(worst_speed, std::abs(static_cast<double>(rotor.rad_per_s()) - 123.4));
  }
  EXPECT_LT(worst_speed, 12.0);  // half a count on the observer's gain is 10 rad/s
}

TEST(Rotor, KeepsItsSpeedOverAGap) {
  firmware::Rotor rotor(bench::parameters(), bench::rating);
  double mechanical = 0.0;
  const auto go = [&](std::uint32_t periods) {
    mechanical += 1000.0 * bench::period_s * periods;
    return rotor.follow(static_cast<float>(wrapped(mechanical)), periods);
  };
  for (int i = 0; i < 2000; ++i) (void)go(1);
  const firmware::RotorAngle seen = go(37);
  EXPECT_NEAR(rotor.rad_per_s(), 1000.0, 1.0);
  EXPECT_LT(distance(seen.at_sample, 2 * mechanical), 1e-5);
  (void)go(1);
  EXPECT_NEAR(rotor.rad_per_s(), 1000.0, 2.0);
}

TEST(Rotor, NoEncoderGarbageMakesTheSpeedRunAway) {
  firmware::Rotor rotor(bench::parameters(), bench::rating);
  std::mt19937 random(3);
  std::uniform_real_distribution<float> any(0.0f, 6.2831853f);
  const double most = 0.5 * M_PI * 20e3 / 2;
  for (int i = 0; i < 100000; ++i) {
    (void)rotor.follow(any(random), 1 + static_cast<std::uint32_t>(random() % 3));
    ASSERT_LE(std::abs(static_cast<double>(rotor.rad_per_s())), most * 1.000001);
  }
}

}  // namespace

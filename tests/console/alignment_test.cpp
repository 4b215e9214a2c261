// SPDX-License-Identifier: MIT
// The answers here come from a shaft of this file's own: torque, inertia, friction, cogging, a load, noise.
#include "console/alignment.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>

namespace {

using console::Alignment;
constexpr double pi = std::numbers::pi;

struct Shaft {
  int turns;         // electrical, of the magnet, in one of the shaft; negative against the encoder
  double ahead_rad;  // what the believed offset lacks
  double rad_per_s2_A, friction_rad_per_s2, cogging_rad_per_s2, load_rad_per_s2, noise_rad_per_s;
};

/// Pushes to and fro in twelve directions, as a board that believes `pole_pairs` makes them.
Alignment pushed(const Shaft& shaft, int pole_pairs, double current_A, std::mt19937& random) {
  std::normal_distribution<double> normal;
  Alignment seen;
  double angle_rad = std::uniform_real_distribution<double>(0, 2 * pi)(random), rad_per_s = 0, time_s = 0;
  constexpr double step_s = 1e-4;
  int tick = 0;
  const auto play = [&](double direction_rad, double level_A, double seconds) {
    for (int left = static_cast<int>(std::lround(seconds / step_s)); left > 0; --left, ++tick, time_s += step_s) {
      if (tick % 10 == 0)
        seen.take({time_s, static_cast<float>(level_A * std::cos(direction_rad)),
                   static_cast<float>(level_A * std::sin(direction_rad)),
                   static_cast<float>(rad_per_s + (rad_per_s == 0 ? 0 : shaft.noise_rad_per_s * normal(random))),
                   static_cast<float>(std::remainder(angle_rad, 2 * pi))});
      // Where the current points beside the magnet: the board turns it with the shaft as it believes.
      const double beside_rad = direction_rad + (pole_pairs - shaft.turns) * angle_rad + shaft.ahead_rad;
      const double drive = shaft.rad_per_s2_A * level_A * std::sin(beside_rad) * (shaft.turns < 0 ? -1 : 1) +
                           shaft.cogging_rad_per_s2 * std::sin(12 * angle_rad) + shaft.load_rad_per_s2;
      if (rad_per_s == 0 && std::fabs(drive) < shaft.friction_rad_per_s2) continue;
      const double way = rad_per_s != 0 ? rad_per_s : drive;
      const double next = rad_per_s + step_s * (drive - std::copysign(shaft.friction_rad_per_s2, way));
      rad_per_s = rad_per_s * next < 0 ? 0 : next;
      angle_rad += rad_per_s * step_s;
    }
  };
  for (int i = 0; i < 12; ++i) {
    const double direction_rad = 2 * pi * i / 12;
    play(direction_rad, current_A, 0.02);
    play(direction_rad, -current_A, 0.04);
    play(direction_rad, current_A, 0.02);
    play(0, 0, 0.05);
  }
  return seen;
}

/// A current that overcomes friction a few times, and a shaft that it turns by 30 degrees electrical at least.
Shaft drawn(std::mt19937& random) {
  const auto between = [&](double least, double most) {
    return std::uniform_real_distribution<double>(least, most)(random);
  };
  Shaft shaft{};
  shaft.turns = static_cast<int>(between(1, 22));
  shaft.ahead_rad = between(-pi, pi);
  shaft.rad_per_s2_A = std::pow(10, between(3, 4.5));
  shaft.friction_rad_per_s2 = between(0, 0.5) * shaft.rad_per_s2_A;
  shaft.cogging_rad_per_s2 = between(0, 0.2) * shaft.rad_per_s2_A;
  shaft.load_rad_per_s2 = between(-0.1, 0.1) * shaft.rad_per_s2_A;
  shaft.noise_rad_per_s = 0.3;
  return shaft;
}

double apart_rad(double a, double b) { return std::fabs(std::remainder(a - b, 2 * pi)); }

TEST(Alignment, FindsTheMagnetBehindFrictionCoggingAndALoad) {
  double worst_rad = 0, worst_sigmas = 0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    std::mt19937 random(seed);
    const Shaft shaft = drawn(random);
    const Alignment seen = pushed(shaft, shaft.turns, 1.0, random);
    const Alignment::Found found = seen.found();
    EXPECT_LT(found.sigma_rad, 0.2) << seed;
    EXPECT_EQ(seen.turns(shaft.turns), shaft.turns) << seed;
    const double off_rad = apart_rad(found.ahead_rad, shaft.ahead_rad);
    worst_rad = std::max(worst_rad, off_rad);
    worst_sigmas = std::max(worst_sigmas, off_rad / found.sigma_rad);
  }
  std::printf("of 200 shafts the worst is %.3f rad off, %.1f sigma\n", worst_rad, worst_sigmas);
  EXPECT_LT(worst_rad, 0.2);
  EXPECT_LT(worst_sigmas, 6);
}

TEST(Alignment, NamesAnEncoderThatCountsAgainstThePhases) {
  int named = 0;
  constexpr int of = 50;
  for (unsigned seed = 1; seed <= of; ++seed) {
    std::mt19937 random(seed);
    Shaft shaft = drawn(random);
    const int believed = shaft.turns;
    shaft.turns = -shaft.turns;
    const int turns = pushed(shaft, believed, 1.0, random).turns(believed);
    EXPECT_TRUE(turns < 0 || turns == believed) << seed << ": " << turns;
    named += turns == -believed ? 1 : 0;
  }
  std::printf("%d of %d named\n", named, of);
  EXPECT_GE(named, of * 4 / 5);  // most others are held where the field draws the shaft, and will not turn round
}

TEST(Alignment, NamesPolePairsThatAreOthers) {
  int named = 0;
  constexpr int of = 50;
  for (unsigned seed = 1; seed <= of; ++seed) {
    std::mt19937 random(seed);
    const Shaft shaft = drawn(random);
    const int turns = pushed(shaft, shaft.turns + 3, 1.0, random).turns(shaft.turns + 3);
    EXPECT_TRUE(turns == shaft.turns || turns == shaft.turns + 3) << seed << ": " << turns;
    named += turns == shaft.turns ? 1 : 0;
  }
  std::printf("%d of %d named\n", named, of);
  EXPECT_GE(named, of / 2);  // the others moved too little to tell
}

/// Speeds and angles at random, of which no number of turns is the reason.
TEST(Alignment, ChanceNamesNoPolePairs) {
  int named = 0;
  for (unsigned seed = 1; seed <= 500; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<float> normal;
    const int rows = 200 + static_cast<int>(random() % 100);
    Alignment seen;
    for (int i = 0; i < rows; ++i)
      seen.take({1e-3 * i, normal(random), normal(random), normal(random), 3 * normal(random)});
    named += seen.turns(1) == 1 ? 0 : 1;
  }
  EXPECT_EQ(named, 0);
}

TEST(Alignment, AShaftThatStandsTellsNothing) {
  std::mt19937 random(1);
  Shaft shaft = drawn(random);
  shaft.friction_rad_per_s2 = 3 * shaft.rad_per_s2_A;
  EXPECT_GT(pushed(shaft, shaft.turns, 1.0, random).found().sigma_rad, 1);
  EXPECT_GT(Alignment().found().sigma_rad, 1);
}

TEST(Alignment, WhatFollowsAGapIsNoAnswer) {
  std::mt19937 random(3);
  Alignment seen;
  for (int i = 0; i < 2000; ++i)  // 5 ms apart, at random
    seen.take({0.005 * i, static_cast<float>(random() % 100) * 0.01f, 0.5f, static_cast<float>(random() % 100), 0});
  EXPECT_GT(seen.found().sigma_rad, 1);
}

}  // namespace

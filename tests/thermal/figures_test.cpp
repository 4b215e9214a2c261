// SPDX-License-Identifier: MIT
// Indices, curves, board, losses and look-ahead against figures from outside.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "tests/thermal/reference.hpp"
#include "thermal/board_heat.hpp"
#include "thermal/indices.hpp"
#include "thermal/look_ahead.hpp"
#include "thermal/losses.hpp"
#include "thermal/motor_set.hpp"

namespace {

using thermal::Drive;
using thermal::HeatInput;
using thermal::Reading;

constexpr float endless = std::numeric_limits<float>::infinity();
const double times_s[] = {0.1, 0.3, 1, 3, 10, 30, 100, 300, 1000, 3000};

/// Reference values: closed form of the two-node motor by an independent program, ambient 25, limit 155 degC.
void expect_curve(const wire::Motor& m, const wire::Motor& rated, const double (&ratio)[10]) {
  for (int i = 0; i < 10; ++i) {
    const double r = thermal::current_to_limit_A(m, times_s[i], 25) / thermal::rated_current_A(rated, 25);
    EXPECT_NEAR(r, ratio[i], 0.01 * ratio[i]) << times_s[i] << " s";
  }
}

TEST(Indices, ThermalRatingsAreThoseOfTheSheetValues) {
  EXPECT_NEAR(thermal::direct_A(thermal::rated_current_A(reference::powermax(), 25)), 10.53, 0.01);
  EXPECT_NEAR(thermal::direct_A(thermal::rated_current_A(reference::ec16(), 25)), 2.22, 0.01);
}

TEST(Indices, ShortTermIndexSpansThreeToTwenty) {
  // R1, R2, tau_w, tau_m of the small EC-max and of the RE 50: the ends of the range.
  EXPECT_NEAR(thermal::short_term_index(reference::motor(1, 2.57, 23.5, 0.943, 390)), 3.1, 0.05);
  EXPECT_NEAR(thermal::short_term_index(reference::motor(1, 2.27, 3.81, 137, 406)), 19.2, 0.1);
  EXPECT_NEAR(thermal::forced_cooling_index(reference::powermax()), 6.03, 0.01);
}

TEST(Indices, OverloadCurvesAreWithinOnePercent) {
  const double powermax[] = {30.94, 18.23, 10.68, 7.29, 5.75, 4.74, 3.36, 2.24, 1.43, 1.09};
  const double ec16[] = {15.76, 9.42, 5.77, 4.26, 3.52, 2.77, 1.90, 1.33, 1.04, 1.00};
  const double water[] = {30.94, 18.23, 10.68, 7.29, 5.81, 5.23, 5.01, 5.00, 5.00, 5.00};
  expect_curve(reference::powermax(), reference::powermax(), powermax);
  expect_curve(reference::ec16(), reference::ec16(), ec16);
  wire::Motor cooled = reference::powermax();
  cooled.R2_K_per_W = 0.0954;
  expect_curve(cooled, reference::powermax(), water);
  EXPECT_NEAR(thermal::overload_ratio(reference::ec16(), 1, 25), 5.77, 0.06);
}

TEST(Indices, HousingAtTheLimitIsWithinHalfAKelvinOrOnePercent) {
  const double powermax[] = {25.2, 25.6, 26.9, 31.3, 48.2, 80.4, 117.1, 138.0, 147.9, 150.8};
  const double ec16[] = {25.3, 26.0, 28.4, 36.4, 62.4, 97.0, 127.3, 141.1, 146.3, 146.9};
  for (int i = 0; i < 10; ++i) {
    EXPECT_NEAR(thermal::housing_at_limit_degC(reference::powermax(), times_s[i], 25), powermax[i],
                std::max(0.5, 0.01 * powermax[i]));
    EXPECT_NEAR(thermal::housing_at_limit_degC(reference::ec16(), times_s[i], 25), ec16[i],
                std::max(0.5, 0.01 * ec16[i]));
  }
}

TEST(Indices, TheCurveAgreesWithTheReferenceIntegrator) {
  for (double t_s : {0.3, 10.0, 300.0}) {
    const double A = thermal::current_to_limit_A(reference::ec16(), t_s, 25);
    reference::TwoNodes truth{reference::ec16()};
    truth.advance(static_cast<reference::Real>(t_s), 20000, static_cast<reference::Real>(A * A), 25);
    EXPECT_NEAR(static_cast<double>(truth.degC[0]), 155.0, 1e-5);
    EXPECT_NEAR(static_cast<double>(truth.degC[1]), thermal::housing_at_limit_degC(reference::ec16(), t_s, 25), 1e-5);
  }
}

TEST(Board, OnePoleThroughSixAmperesForEverAndTwentyForFifteenSeconds) {
  // (20/6)^2 (1 - exp(-15/tau)) = 1
  const double tau_s = -15.0 / std::log(1.0 - 36.0 / 400.0);
  EXPECT_NEAR(static_cast<double>(thermal::BoardRating{}.tau_s), tau_s, 0.5);
  thermal::BoardHeat board({});
  for (int i = 0; i < 1450; ++i) board.tick(400, 0);
  EXPECT_LT(board.used_ratio(), 1.0f);
  for (int i = 0; i < 60; ++i) board.tick(400, 0);
  EXPECT_GT(board.used_ratio(), 1.0f);
}

TEST(Board, GovernedAloneItGivesTwentyAmperesForFourteenSecondsAndSettlesOnSix) {
  thermal::BoardHeat board({});
  thermal::GovernorSettings s;
  float A = 20, last = 20;
  double full_s = 0, steepest = 0;
  for (int i = 0; i < 200000; ++i) {
    board.tick(static_cast<double>(A * A), 0);
    last = A;
    A = board.allowed_A(0, s);
    steepest = std::max(steepest, static_cast<double>(last - A));
    if (A >= 20.0f) full_s += 0.01;
    EXPECT_LE(board.used_ratio(), 1.0001f);
  }
  EXPECT_GT(full_s, 14.0);
  EXPECT_NEAR(static_cast<double>(A), 6.0, 0.01);
  EXPECT_LE(steepest, 0.4);
}

TEST(Board, BothAxesShareIt) {
  thermal::BoardHeat board({});
  thermal::GovernorSettings s;
  float a = 20, b = 20;
  for (int i = 0; i < 200000; ++i) {
    board.tick(static_cast<double>(a * a), static_cast<double>(b * b));
    const float next_a = board.allowed_A(static_cast<double>(b * b), s),
                next_b = board.allowed_A(static_cast<double>(a * a), s);
    a = next_a, b = i < 100000 ? next_b : 0.0f;
    if (i == 99999) {
      EXPECT_NEAR(static_cast<double>(a), std::sqrt(18.0), 0.05);
      EXPECT_NEAR(static_cast<double>(b), std::sqrt(18.0), 0.05);
    }
    EXPECT_LE(board.used_ratio(), 1.02f);
  }
  EXPECT_NEAR(static_cast<double>(a), 6.0, 0.05) << "what the other does not use is free";
}

/// A stage that heats `times` as much as its model says, and a sensor as noisy as host-sim's.
TEST(Board, ASensorAheadOfTheModelHoldsBackWithoutSteps) {
  for (const double times : {1.0, 1.3, 2.0}) {
    for (const float most_A : {20.0f, 80.0f}) {
      const std::string what = std::to_string(times) + ", " + std::to_string(most_A);
      thermal::BoardRating rating;
      rating.continuous_A *= most_A / 20.0f;
      thermal::BoardHeat board(rating);
      thermal::GovernorSettings s;
      s.max_A = most_A;
      const double limit_A2 = static_cast<double>(rating.continuous_A * rating.continuous_A);
      std::mt19937 random(7);
      std::normal_distribution<float> noise_K(0.0f, 0.2f);
      double stage_A2 = 0;
      float A = most_A, least_A = most_A, steepest_A = 0;
      for (int i = 0; i < 60000; ++i) {
        stage_A2 += (times * static_cast<double>(A * A) - stage_A2) * thermal::estimator_dt_s / 159;
        const float degC = static_cast<float>(50 + 50 * stage_A2 / limit_A2);
        EXPECT_LT(degC, 101.0f) << what;
        board.tick(static_cast<double>(A * A), 0, {degC + noise_K(random), true});
        const float next_A = board.allowed_A(0, s);
        steepest_A = std::max(steepest_A, A - next_A);
        least_A = std::min(least_A, next_A);
        A = next_A;
      }
      EXPECT_LE(steepest_A, 0.02f * most_A) << what;
      EXPECT_GT(least_A, 0.85f * rating.continuous_A / std::sqrt(static_cast<float>(times))) << what;
    }
  }
}

TEST(Board, AReadingThatIsNoNumberIsNoReading) {
  thermal::BoardHeat board({});
  for (const float bad : {std::nanf(""), -std::numeric_limits<float>::infinity()}) {
    board.tick(0, 0, {bad, true});
    EXPECT_EQ(board.used_ratio(), 0.0f);
  }
  for (int i = 0; i < 500; ++i) board.tick(0, 0, {100.0f, true});
  EXPECT_GE(board.used_ratio(), 0.99f) << "deaf ever after";
}

TEST(Board, WhatIsUnknownCountsAsHot) {
  thermal::GovernorSettings s;
  for (double bad : {std::nan(""), -1.0, std::numeric_limits<double>::infinity()}) {
    thermal::BoardHeat board({});
    board.tick(bad, 0);
    EXPECT_GE(board.used_ratio(), 1.0f);
  }
  thermal::BoardHeat board({});
  board.tick(0, 0, {100.0f, true});
  EXPECT_GE(board.used_ratio(), 0.99f);
  EXPECT_LT(board.allowed_A(0, s), 7.0f);
  board.tick(0, 0, {-40.0f, true});
  EXPECT_GE(board.used_ratio(), 0.99f) << "the sensor may only raise";
  board.restore(std::nanf(""));
  EXPECT_EQ(board.used_ratio(), 1.0f);
  EXPECT_NEAR(board.allowed_A(std::nan(""), s), std::sqrt(18.0f), 1e-3f);
}

/// Ripple by brute force: the switched voltages of one PWM period, integrated.
double switched_ripple_A2(const wire::Abc& d, double V, double L, double Hz) {
  const int n = 200000;
  const double mean[3] = {static_cast<double>(d.a), static_cast<double>(d.b), static_cast<double>(d.c)};
  double x = 0, y = 0, sum2 = 0, sumx = 0, sumy = 0;
  for (int k = 0; k < n; ++k) {
    const double carrier = std::abs(2.0 * (k + 0.5) / n - 1.0);  // upper switch on while the carrier is below the duty
    double v[3];
    for (int p = 0; p < 3; ++p) v[p] = (carrier < mean[p] ? 1.0 : 0.0) - mean[p];
    x += V / L / Hz / n * (2 * v[0] - v[1] - v[2]) / 3;
    y += V / L / Hz / n * (v[1] - v[2]) / std::sqrt(3.0);
    sum2 += x * x + y * y, sumx += x, sumy += y;
  }
  return sum2 / n - (sumx * sumx + sumy * sumy) / n / n;
}

TEST(Losses, RippleAgreesWithTheSwitchedBridge) {
  for (const wire::Abc& d : {wire::Abc{0.7f, 0.5f, 0.3f}, wire::Abc{0.2f, 0.9f, 0.4f}, wire::Abc{0.45f, 0.5f, 0.95f},
                             wire::Abc{0.1f, 0.1f, 0.8f}, wire::Abc{0.6f, 0.05f, 0.55f}}) {
    const double truth = switched_ripple_A2(d, 48, 30e-6, 20000);
    const thermal::Switching by{48, 0, 30e-6f, 20000, 0};  // neither resistance nor dead time: ripple alone
    EXPECT_NEAR(static_cast<double>(thermal::unseen(d, {0, 0, 0}, {0, 0, 0}, by).of_heat_A2), truth,
                1e-3 * truth + 1e-4);
    EXPECT_GT(truth, 1.0);
  }
  const thermal::Switching real{48, 0.5f, 30e-6f, 20000, 5e-7f};
  EXPECT_EQ(thermal::unseen({0.5f, 0.5f, 0.5f}, {0, 0, 0}, {0, 0, 0}, real).of_heat_A2, 0.0f)
      << "equal duties drive nothing";
  EXPECT_LT(thermal::unseen({0.5f, 0.5f, 0.5f}, {0.03f, -0.03f, 0}, {0, 0, 0}, real).of_heat_A2, 0.01f)
      << "noise was taken for currents that dead time acts on";
}

TEST(Losses, BusPowerIsCopperLossAndNeverCools) {
  // Motoring: 10 A through 1 ohm at d = 0.5 of 48 V, so Ke w = 14 V and 5 A on the bus.
  EXPECT_NEAR(thermal::bus_power_W(0.5f, 48, 5, 0.07f, 200), 100.0f, 1e-3f);
  // Braking: -10 A, the motor gives back; d V = 4 V below Ke w = 14 V.
  const float d = 4.0f / 48.0f;
  EXPECT_NEAR(thermal::bus_power_W(d, 48, -10 * d, 0.07f, 200), 100.0f, 1e-3f);
  EXPECT_EQ(thermal::bus_power_W(0.5f, 48, 5, 0.07f, 1000), 0.0f) << "contradictory readings do not cool";
  EXPECT_TRUE(std::isnan(thermal::bus_power_W(0.5f, std::nanf(""), 5, 0.07f, 100)));
  EXPECT_TRUE(std::isfinite(thermal::bus_power_W(std::nanf(""), 48, 5, 0.07f, 100)));
}

const thermal::PhaseShares rotating{{0.5f, 0.5f, 0.5f}};

thermal::CoreEstimator soaked(const wire::Motor& m, float degC) {
  thermal::EstimatorSettings s;
  s.trust = thermal::exact_trust;
  s.margin_sigmas = 0;
  s.ambient_degC = 25;
  thermal::CoreEstimator core(thermal::three_phase_set(m), s);
  HeatInput<> idle;
  for (int i = 0; i < 60; ++i) core.tick(idle, {degC, true}, {25.0f, true});
  return core;
}

TEST(LookAhead, ThePaperJumpFitsFromColdAndNotFromEightyDegrees) {
  // 20 A of direct current for 0.25 s. The paper's figures with a current that must first rise: 119 and 186 degC.
  const thermal::Piece jump{0.25f, static_cast<float>(20 / std::sqrt(0.75))};
  const auto cold = soaked(reference::ec16(), 25), warm = soaked(reference::ec16(), 80);
  const thermal::LookAhead look(cold.network());
  const auto from_cold = look.play(cold, &jump, 1, rotating), from_warm = look.play(warm, &jump, 1, rotating);
  EXPECT_TRUE(from_cold.feasible);
  EXPECT_NEAR(from_cold.peak_degC, 119.0f, 2.0f);
  EXPECT_FALSE(from_warm.feasible);
  reference::TwoNodes pushed{reference::ec16(), {80, 80}};
  pushed.advance(0.25L, 1000, 400 / 0.75L, 25);
  EXPECT_NEAR(static_cast<double>(from_warm.peak_degC), static_cast<double>(pushed.degC[0]), 0.1);
  EXPECT_GT(from_warm.peak_degC, 180.0f);
  EXPECT_EQ(look.wait_s(cold, &jump, 1, rotating), 0.0f);

  const float wait_s = look.wait_s(warm, &jump, 1, rotating);
  reference::TwoNodes plant{reference::ec16(), {80, 80}};
  plant.advance(static_cast<reference::Real>(wait_s), 20000, 0, 25);
  plant.advance(0.25L, 1000, 400 / 0.75L, 25);
  EXPECT_NEAR(static_cast<double>(plant.degC[0]), 154.0, 1.5) << "after " << wait_s << " s of rest";
}

TEST(LookAhead, SecondsLeftAgreesWithTheReference) {
  for (const wire::Motor& m : {reference::ec16(), reference::powermax()}) {
    const auto core = soaked(m, 25);
    const thermal::LookAhead look(core.network());
    for (double t_s : {0.3, 3.0, 30.0, 300.0}) {
      const float A = static_cast<float>(thermal::current_to_limit_A(m, t_s, 25));
      EXPECT_NEAR(static_cast<double>(look.seconds_left(core, A, rotating)), t_s, 0.02 * t_s);
      EXPECT_NEAR(look.current_for_A(core, static_cast<float>(t_s), 2 * A, rotating), A, 0.01f * A);
    }
    const float rated_A = static_cast<float>(thermal::rated_current_A(m, 25));
    EXPECT_EQ(look.seconds_left(core, 0.9f * rated_A, rotating), std::numeric_limits<float>::infinity());
  }
}

TEST(Endurance, PublishesWhatALookAheadWouldHaveAnsweredAMomentAgo) {
  for (const wire::Motor& m : {reference::ec16(), reference::powermax()}) {
    for (double t_s : {5.0, 10.0, 25.0, 300.0}) {
      SCOPED_TRACE(t_s);
      const float A = static_cast<float>(thermal::current_to_limit_A(m, t_s, 25)), max_A = 4 * A;
      auto core = soaked(m, 25), before = core;
      thermal::Endurance endurance(core.network(), max_A);
      HeatInput<> load;
      for (int k = 0; k < 3; ++k) load[thermal::phase_drive(k)] = 0.5 * static_cast<double>(A * A);
      for (int ms = 0; ms < 3200; ++ms) {
        if (ms % 10 == 0) core.tick(load, {}, {25.0f, true});
        if (ms == 1600) before = core;
        if (ms % 4 == 0) endurance.go_on(core, 1);
      }
      const thermal::LookAhead look(core.network());
      const float most_s = look.seconds_left(before, A, rotating), least_s = look.seconds_left(core, A, rotating);
      EXPECT_LE(endurance.seconds_left(), most_s > 30 ? endless : 1.01f * most_s);
      EXPECT_GE(endurance.seconds_left(), least_s > 30 ? endless : 0.99f * least_s);
      EXPECT_LE(endurance.current_A(), look.current_for_A(before, 1, max_A, rotating));
      EXPECT_GE(endurance.current_A(), look.current_for_A(core, 1, max_A, rotating) - 0.02f * max_A);
    }
  }
}

TEST(Endurance, NothingMayFlowUntilItHasLookedNorWhereTheEstimateIsBroken) {
  const auto core = soaked(reference::ec16(), 25);
  thermal::Endurance endurance(core.network(), 20);
  EXPECT_EQ(endurance.current_A(), 0.0f);
  EXPECT_EQ(endurance.seconds_left(), 0.0f);
  auto hot = core;
  hot.start_hot();
  hot.raise_to(200);
  for (int ms = 0; ms < 1000; ++ms) endurance.go_on(core, 2);
  EXPECT_GT(endurance.current_A(), 5.0f);
  for (int ms = 0; ms < 1000; ++ms) endurance.go_on(hot, 2);
  EXPECT_EQ(endurance.current_A(), 0.0f);
  EXPECT_EQ(endurance.seconds_left(), 0.0f);
}

TEST(LookAhead, BeginsAtTheMarginNotAtTheEstimate) {
  thermal::CoreEstimator core(thermal::three_phase_set(reference::ec16()), {});
  core.raise_to(100);
  const float margin_degC = core.estimate().hottest_margin_degC();
  ASSERT_GT(margin_degC, 120.0f);
  const thermal::Piece rest{0.01f, 0};
  EXPECT_NEAR(thermal::LookAhead(core.network()).play(core, &rest, 1, rotating).peak_degC, margin_degC, 0.01f);
}

TEST(LookAhead, AStandingRotorLastsLess) {
  const auto core = soaked(reference::ec16(), 25);
  const thermal::LookAhead look(core.network());
  EXPECT_LT(look.seconds_left(core, 10, {{1.0f, 0.25f, 0.25f}}), 0.6f * look.seconds_left(core, 10, rotating));
}

TEST(LookAhead, HeatThatFollowsTheCurrentAtAnySpeedIsForeseenAndPowerOfThePastIsNot) {
  const auto peak_degC = [](thermal::Drive drive, double gain) {
    thermal::HeatSet<double> set = thermal::three_phase_set(reference::ec16());
    for (std::int8_t k = 0; k < 3; ++k) set.sources[set.source_count++] = {k, drive, gain, 0.0};
    thermal::EstimatorSettings s;
    s.trust = thermal::exact_trust;
    thermal::CoreEstimator core(set, s);
    thermal::HeatInput<> turning;
    thermal::set_speed(turning, 100);
    for (int i = 0; i < 60; ++i) {
      turning[thermal::Drive::power_W] = i == 59 ? 1 : 0;  // just now, from the bus
      core.tick(turning, {25.0f, true}, {25.0f, true});
    }
    const thermal::Piece push{0.2f, 5};
    return static_cast<double>(thermal::LookAhead(core.network()).play(core, &push, 1, rotating).peak_degC);
  };
  const double without = peak_degC(thermal::Drive::current_speed, 0);
  // 10 W for 0.2 s in a third of 1.13 J/K, whatever names them.
  const double expected_K = 10 * 0.2 / (1.13 / 3);
  EXPECT_NEAR(peak_degC(thermal::Drive::current_speed, 10.0 / (5 * 100)) - without, expected_K, 0.3 * expected_K);
  EXPECT_NEAR(peak_degC(thermal::Drive::current2_speed2, 10.0 / (25 * 1e4)) - without, expected_K, 0.3 * expected_K);
  EXPECT_NEAR(peak_degC(thermal::Drive::enabled, 10) - without, expected_K, 0.3 * expected_K) << "the bridge was off";
  EXPECT_NEAR(peak_degC(thermal::Drive::power_W, 10), without, 0.5) << "10 W for 10 ms";
}

TEST(LookAhead, ACurrentTheOtherWayHeatsAsMuch) {
  for (const thermal::Drive drive : {thermal::Drive::current_A, thermal::Drive::current_speed}) {
    thermal::HeatSet<double> set = thermal::three_phase_set(reference::ec16());
    for (std::int8_t k = 0; k < 3; ++k) set.sources[set.source_count++] = {k, drive, 1.0, 0.0};
    thermal::CoreEstimator core(set, {});
    thermal::HeatInput<> turning;
    thermal::set_speed(turning, 5);
    core.tick(turning, {25.0f, true}, {25.0f, true});
    const auto peak_degC = [&](float current_A) {
      const thermal::Piece push{0.5f, current_A};
      thermal::ProfileRun run;
      EXPECT_TRUE(run.begin(core, &push, 1, rotating));
      EXPECT_TRUE(run.go_on(core, 1000));
      return run.forecast().peak_degC;
    };
    EXPECT_EQ(peak_degC(-10), peak_degC(10));
  }
}

/// Asked while a fan on the shaft turns, of a motion that may stand.
TEST(LookAhead, NobodyPromisesThatAMotionIsCooledByTheSpeedOfNow) {
  thermal::HeatSet<double> set = thermal::three_phase_set(reference::ec16());
  set.links[set.link_count - 1].law = thermal::LinkLaw::speed;
  set.links[set.link_count - 1].k = 0.05;
  thermal::EstimatorSettings s;
  s.trust = thermal::exact_trust;
  s.margin_sigmas = 0;
  thermal::CoreEstimator core(set, s);
  thermal::HeatInput<> turning, standing;
  thermal::set_speed(turning, 1000);
  for (int i = 0; i < 60; ++i) core.tick(turning, {80, true}, {25.0f, true});
  constexpr double push_A = 2.5;
  const thermal::Piece push{60, static_cast<float>(push_A)};
  thermal::ProfileRun run;
  ASSERT_TRUE(run.begin(core, &push, 1, rotating));
  ASSERT_TRUE(run.go_on(core, 6001));
  for (int k = 0; k < 3; ++k) standing[thermal::phase_drive(k)] = 0.5 * push_A * push_A;
  standing[thermal::Drive::current_A2] = push_A * push_A;
  for (int i = 0; i < 6000; ++i) core.tick(standing, {}, {25.0f, true});
  EXPECT_GE(run.forecast().peak_degC, static_cast<float>(core.estimate().hottest_degC()) - 0.5f);
}

TEST(LookAhead, UnusableOrEndlessProfilesAreNotFeasible) {
  const auto core = soaked(reference::ec16(), 25);
  const thermal::LookAhead look(core.network());
  for (const thermal::Piece& p : {thermal::Piece{std::nanf(""), 1}, thermal::Piece{1, std::nanf("")},
                                  thermal::Piece{-1, 1}, thermal::Piece{1e9f, 0}, thermal::Piece{9e5f, 0}}) {
    EXPECT_FALSE(look.play(core, &p, 1, rotating).feasible);
  }
  const std::vector<thermal::Piece> many(100000, thermal::Piece{0.005f, 1});
  EXPECT_FALSE(look.play(core, many.data(), static_cast<int>(many.size()), rotating).feasible);
  const thermal::Piece impossible{3600, 19};
  EXPECT_EQ(look.wait_s(core, &impossible, 1, rotating), std::numeric_limits<float>::infinity());
}

}  // namespace

// SPDX-License-Identifier: MIT
// What the firmware adds to the heat of its samples, judged by what a bridge that switches every edge really did.
#include "thermal/losses.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/boards-host/driven_bench.hpp"
#include "tests/host-sim/plant_fixtures.hpp"
#include "thermal/motor_set.hpp"

namespace {

TEST(Losses, WhatSamplesHideOfTheHeatIsKnownFromTheDuty) {
  // Held against a bridge that switches every edge; the firmware's share of the heat is what samples say and unseen().
  double hidden = 0, least = 1, most = 1;
  for (const char* id : {"ec-16-40w", "ec-powermax-30-24v"}) {
    const wire::Motor sheet = plant_tests::sheet(id);
    host_sim::BridgeDesign design;
    design.switched = true;
    for (const double speed : {0.0, 0.3, 0.5, 0.9}) {  // of the speed at which the back-EMF takes 20 V of each phase
      for (const double current : {1.0, 1.25, 1.5, 2.0, 3.0, 7.0}) {  // times the rated one
        const double q_A = current * sheet.rated_current_A;
        const double rad_per_s = speed * 20 / sheet.pole_pairs / sheet.flux_linkage_Wb;
        const double turn_rad = rad_per_s * sheet.pole_pairs * plant_tests::period_s;
        plant_tests::Turning turning(sheet, design, rad_per_s);
        for (int n = 0; n < 3000; ++n) turning.period(q_A, 48);
        const double before_A2s = turning.true_A2s();
        double sampled_A2s = 0, unseen_A2s = 0;
        for (int n = 0; n < 2000; ++n) {
          const auto [sample_d_A, sample_q_A] = turning.sampled_dq();
          const double vector_A2 = sample_d_A * sample_d_A + sample_q_A * sample_q_A;
          const thermal::Chord chord = thermal::chord_of(static_cast<float>(turn_rad));
          const double along = static_cast<double>(chord.middle);
          const thermal::Switching by = {48, static_cast<float>(sheet.phase_resistance_ohm),
                                         static_cast<float>(sheet.inductance_d_H), static_cast<float>(design.pwm_Hz),
                                         static_cast<float>(design.dead_time_s)};
          const float bow_A =
              thermal::bow_of(static_cast<float>(turn_rad), static_cast<float>(sheet.flux_linkage_Wb), by.inductance_H);
          const wire::Abc middle_A = turning.phases_in_the_middle(along * sample_d_A, along * sample_q_A),
                          bent_A = turning.phases_in_the_middle(static_cast<double>(-bow_A), 0);
          const hal::Duty duty = turning.period(q_A, 48);
          sampled_A2s += vector_A2 * plant_tests::period_s;
          unseen_A2s += (static_cast<double>(thermal::unseen(duty.ratio, middle_A, bent_A, by).of_heat_A2) +
                         vector_A2 * static_cast<double>(chord.of_heat)) *
                        plant_tests::period_s;
        }
        const double true_A2s = turning.true_A2s() - before_A2s;
        // Furthest off, and too cold, where ripple turns the current round at an edge: dead time then acts at times.
        const double share = (sampled_A2s + unseen_A2s) / true_A2s;
        EXPECT_TRUE(share > 0.965 && share < 1.015)
            << share << ": " << id << " at " << speed << ", " << current << " times the rated current: samples alone "
            << sampled_A2s / true_A2s;
        hidden = std::max(hidden, 1 - sampled_A2s / true_A2s);
        least = std::min(least, share), most = std::max(most, share);
      }
    }
  }
  std::printf(
      "  samples alone miss up to %.0f %% of the heat; with the firmware's account %+.1f to %+.1f %% are left\n",
      100 * hidden, 100 * (least - 1), 100 * (most - 1));
  EXPECT_GT(hidden, 0.3) << "nothing was hidden, so nothing was shown";
}

/// A motor driven at a speed, asked for a current at each millisecond, of which the slow lane looks at each tenth: what
/// the firmware counted of the true heat.
template <class Asked>
double counted_share(double emf_V, Asked asked_A) {
  wire::Motor motor = plant_tests::small_motor();
  motor.copper_coefficient_per_K = 0;  // or heat would not be A^2 s
  host_sim::BenchDesign design = plant_tests::bench_design(motor);
  design.supply.can_sink = true;
  board_tests::DrivenBench driven(
      design, {firmware::parameters_from(motor, boards::dual_48V_20A, {48.0f, 0.0f}), thermal::three_phase_set(motor)});
  host_sim::Bench& bench = driven.bench;
  firmware::Driver& driver = driven.driver;
  bench.load(0).mode = host_sim::Load::Mode::imposed_speed;
  constexpr int armed_ms = 200, from_ms = 400, to_ms = 1000;
  double counted_A2s = 0, before_J = 0;
  for (int ms = 0; ms < to_ms; ++ms) {
    if (ms == armed_ms) (void)driver.axis(0).arm();
    if (ms > armed_ms) (void)driver.axis(0).set_current(asked_A(ms));
    if (ms == armed_ms) bench.load(0).speed_rad_per_s = emf_V / motor.pole_pairs / motor.flux_linkage_Wb;
    if (ms == from_ms) before_J = bench.energy().copper_J;
    if (driven.advance_ms() && ms > from_ms) counted_A2s += driver.axis(0).current2_A2() * 0.01;
  }
  EXPECT_EQ(driver.axis(0).mode(), firmware::Mode::running);
  return counted_A2s * 1.5 * motor.phase_resistance_ohm / (bench.energy().copper_J - before_J);
}

const float small_A = static_cast<float>(1.3 * plant_tests::small_motor().rated_current_A);

TEST(Losses, ADemandInStepWithTheSlowLaneHidesNoHeat) {
  for (int lead_ms = 0; lead_ms < 10; ++lead_ms) {
    // Reversed for a tenth of the time; 10 V is half of what 48 V reach.
    const double share = counted_share(10, [&](int ms) {
      return wire::Dq{0.0f, (ms + lead_ms) % 10 < 9 ? small_A : -small_A};
    });
    EXPECT_TRUE(share > 0.99 && share < 1.02) << share << " where it turns " << lead_ms << " ms before";
  }
}

/// Asked of a motor that turns, at the speed that it has: what the winding then becomes is no hotter than was said.
TEST(Losses, AQuestionAskedAtASpeedKnowsItsRipple) {
  wire::Motor motor = plant_tests::small_motor();
  host_sim::BenchDesign design = plant_tests::bench_design(motor);
  design.supply.can_sink = true;
  firmware::AxisSetup axis = {firmware::parameters_from(motor, boards::dual_48V_20A, {48.0f, 0.0f}),
                              thermal::three_phase_set(motor)};
  axis.estimator.trust = thermal::identified_trust;
  board_tests::DrivenBench driven(design, axis);
  host_sim::Bench& bench = driven.bench;
  firmware::Driver& driver = driven.driver;
  bench.load(0).mode = host_sim::Load::Mode::imposed_speed;
  constexpr int armed_ms = 200, asked_ms = 6000, to_ms = 36000;
  const float q_A = static_cast<float>(2 * motor.rated_current_A);
  thermal::ProfileRun run;
  double hottest_degC = 0;
  for (int ms = 0; ms < to_ms; ++ms) {
    if (ms == armed_ms) (void)driver.axis(0).arm();
    if (ms > armed_ms) (void)driver.axis(0).set_current({0.0f, q_A});
    if (ms == armed_ms) bench.load(0).speed_rad_per_s = 18 / motor.pole_pairs / motor.flux_linkage_Wb;
    driven.advance_ms();
    hottest_degC = std::max(hottest_degC, bench.truth(0).hottest_degC);
    if (ms != asked_ms) continue;
    const thermal::Piece piece{(to_ms - asked_ms) * 1e-3f, q_A};
    ASSERT_TRUE(driver.axis(0).ask(run, &piece, 1, {{0.5f, 0.5f, 0.5f}}));
    ASSERT_TRUE(run.go_on(driver.axis(0).core(), to_ms / 10));
  }
  EXPECT_EQ(driver.axis(0).mode(), firmware::Mode::running);
  EXPECT_GT(hottest_degC, 80) << "nothing was heated, so nothing was shown";
  EXPECT_GE(static_cast<double>(run.forecast().peak_degC), hottest_degC - 0.035 * (hottest_degC - design.start_degC))
      << "beyond what the account of the ripple may be off by";
}

TEST(Losses, WhatTheMagnetBendsBetweenTwoSamplesCountsWithItsSign) {
  for (const float d_A : {-2 * small_A, 2 * small_A}) {
    const double share = counted_share(15, [&](int) { return wire::Dq{d_A, 0.0f}; });
    EXPECT_TRUE(share > 0.99 && share < 1.02) << share << " with " << d_A << " A along the magnet";
  }
}

}  // namespace

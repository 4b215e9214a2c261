// SPDX-License-Identifier: MIT
// What a driver remembers of the life before a reset, whose length nobody knows.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/firmware/bench.hpp"

namespace {

using firmware::Driver;
using firmware::DriverMemory;

constexpr float nan_f = std::numeric_limits<float>::quiet_NaN();

void slow(Driver& driver, float housing_degC, int ticks) {
  const hal::AxisSlowSample axes[2] = {{{housing_degC, true}}, {{housing_degC, true}}};
  for (; ticks > 0; --ticks) driver.slow_tick({{30.0f, true}, 0.0f, true}, axes);
}

DriverMemory hot_memory() {
  const thermal::HeatMemory heat{4, {140, 120, 118, 60}, {6, 6, 6, 2}, 32};
  return {{{heat, {}}, {heat, {}}}, 0.7f};
}

double hottest(const Driver& driver, int axis) { return driver.axis(axis).core().estimate().hottest_degC(); }

TEST(Memory, WhatWasRememberedIsThereAgainAndNothingHasCooled) {
  Driver after(bench::driver_setup());
  after.restore(hot_memory());
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(hottest(after, i), 140.0, 1e-3);
    for (int k = 0; k < 3; ++k)
      EXPECT_GE(after.axis(i).core().estimate().sigma_K[k], 6.0f - 1e-3f) << "as unsure as before, at least";
    // A phase that was cooler may have been warmed by the others meanwhile, at most to their mean.
    EXPECT_NEAR(after.axis(i).core().estimate().degC[2], (140.0 + 120 + 118) / 3, 0.1);
  }
  EXPECT_NEAR(after.board_heat().used_ratio(), 0.7f, 1e-3f);
}

TEST(Memory, TheHousingMayRaiseARestoredWindingButItsColdDoesNotLowerIt) {
  const wire::Motor m = bench::motor();
  for (const float housing_degC : {25.0f, 60.0f, 150.0f}) {
    Driver driver(bench::driver_setup());
    driver.restore(hot_memory());
    slow(driver, housing_degC, 50);  // half a second, then the housing is heard
    const double h = static_cast<double>(housing_degC);
    EXPECT_GE(hottest(driver, 0), h - 0.2);
    // At least what is left of a winding that cooled all the while towards that very housing, less rounding.
    EXPECT_GT(hottest(driver, 0), h + (140 - h) * std::exp(-0.5 / (m.R1_K_per_W * m.C1_J_per_K)) - 0.5) << h;
  }
}

/// The winding seems cold again, and yet little is allowed: the report must show why.
TEST(Memory, TheReportShowsWhatIsDoubtedAfterAReset) {
  Driver driver(bench::driver_setup());
  driver.restore(hot_memory());
  float most_beside_K = 0.0f;
  for (int i = 0; i < 600; ++i) {
    slow(driver, 25.0f, 1);
    const firmware::Axis& axis = driver.axis(0);
    const thermal::Estimate& now = axis.core().estimate();
    int hottest = 0;
    for (int k = 1; k < 3; ++k)
      if (now.degC[k] > now.degC[hottest]) hottest = k;
    const float k_sigma_K = now.margin_degC[hottest] - static_cast<float>(now.degC[hottest]);
    ASSERT_NEAR(2.0f * axis.state().core_sigma_K, k_sigma_K, 1e-3f) << "all that the governor adds, at tick " << i;
    most_beside_K = std::fmax(most_beside_K, k_sigma_K - 2.0f * now.sigma_K[hottest]);
  }
  EXPECT_GT(most_beside_K, 10.0f) << "nothing was doubted, so nothing was shown";
}

TEST(Memory, EachValueThatIsNoTemperatureCountsAsTheLimit) {
  for (const float bad : {nan_f, std::numeric_limits<float>::infinity(), -1e9f, 1e30f}) {
    for (int node = 0; node < 4; ++node) {
      DriverMemory memory = hot_memory();
      memory.axes[0].heat.degC[node] = bad;
      Driver driver(bench::driver_setup());
      driver.restore(memory);
      EXPECT_GE(driver.axis(0).core().estimate().degC[node], 154.9) << "node " << node;
      memory = hot_memory();
      memory.axes[0].heat.sigma_K[node] = memory.axes[0].heat.ambient_degC = memory.board_used_ratio = bad;
      memory.axes[0].heat.late_K = bad;
      Driver other(bench::driver_setup());
      other.restore(memory);
      EXPECT_GE(hottest(other, 0), 139.9);
      EXPECT_GE(other.axis(0).core().estimate().sigma_K[0], 5.9f);
      EXPECT_EQ(other.board_heat().used_ratio(), 1.0f);
    }
  }
}

TEST(Memory, AnotherMotorsRecordAndNoRecordAtAllStartHot) {
  DriverMemory memory = hot_memory();
  memory.axes[0].heat.node_count = 2;
  Driver other(bench::driver_setup()), none(bench::driver_setup());
  other.restore(memory);
  none.start_hot();
  EXPECT_EQ(none.board_heat().used_ratio(), 1.0f);
  for (Driver* driver : {&other, &none}) {
    EXPECT_NEAR(hottest(*driver, 0), 145.0, 1e-6) << "limit minus 10 K";
    EXPECT_NEAR(driver->axis(0).core().estimate().hottest_margin_degC(), 155.0f, 0.01f);
    slow(*driver, 25.0f, 1);
    EXPECT_LT(driver->axis(0).state().allowance_A, 7.0f) << "no burst: at most what holds the limit for ever";
  }
}

/// A power stage whose own sensor read more than the limit has more than all of its heat used up.
TEST(Memory, APowerStageAboveItsLimitIsNoColderAfterAReset) {
  Driver before(bench::driver_setup());
  before.restore(hot_memory());
  const hal::AxisSlowSample axes[2] = {{{30.0f, true}}, {{30.0f, true}}};
  before.slow_tick({{125.0f, true}, 0.0f, true}, axes);
  const float used_ratio = before.board_heat().used_ratio();
  ASSERT_GT(used_ratio, 1.4f);
  Driver after(bench::driver_setup());
  after.restore(before.memory());
  EXPECT_NEAR(after.board_heat().used_ratio(), used_ratio, 1e-3f);
}

TEST(Memory, AFaultStaysLatchedThroughAResetUntilItIsCleared) {
  DriverMemory memory = hot_memory();
  memory.axes[1].fault = {wire::Fault::over_current, 1, 31.0f, 28.0f, 0.0f};
  memory.axes[0].fault = {wire::Fault::parameters, 0, 0.0f, 0.0f, 0.0f};  // judged anew at each start
  Driver driver(bench::driver_setup());
  driver.restore(memory);
  EXPECT_EQ(driver.axis(0).mode(), firmware::Mode::off);
  EXPECT_EQ(driver.axis(1).mode(), firmware::Mode::tripped);
  EXPECT_EQ(driver.axis(1).fault().fault, wire::Fault::over_current);
  EXPECT_EQ(driver.axis(1).fault().value, 31.0f);
  std::uint32_t sequence = bench::bring_up(driver.axis(1));
  EXPECT_EQ(driver.axis(1).mode(), firmware::Mode::tripped);
  (void)driver.axis(1).set_current({0.0f, 0.0f});
  ASSERT_EQ(driver.axis(1).clear(), wire::Status::done);
  (void)driver.axis(1).tick(bench::quiet_sample(sequence));
  EXPECT_EQ(driver.axis(1).mode(), firmware::Mode::off);
}

TEST(Memory, AFaultIsKeptBehindOneThatEachStartFindsAnew) {
  DriverMemory memory = hot_memory();
  memory.axes[0].fault = {wire::Fault::over_current, 0, 31.0f, 28.0f, 0.0f};
  Driver without_clock(bench::driver_setup());
  without_clock.axis(0).hold({wire::Fault::clock_lost});
  without_clock.restore(memory);
  EXPECT_EQ(without_clock.axis(0).fault().fault, wire::Fault::clock_lost);
  Driver next(bench::driver_setup());
  next.restore(without_clock.memory());
  EXPECT_EQ(next.axis(0).fault().fault, wire::Fault::over_current);

  std::uint32_t sequence = bench::bring_up(without_clock.axis(0));
  (void)without_clock.axis(0).set_current({0.0f, 0.0f});
  for (const wire::Fault left : {wire::Fault::over_current, wire::Fault::none}) {
    ASSERT_EQ(without_clock.axis(0).clear(), wire::Status::done);
    (void)without_clock.axis(0).tick(bench::quiet_sample(sequence++));
    EXPECT_EQ(without_clock.axis(0).fault().fault, left);
  }
  EXPECT_EQ(without_clock.axis(0).mode(), firmware::Mode::off);
}

}  // namespace

// SPDX-License-Identifier: MIT
// Setpoint, permit and mode: who may ask for what, and how much of it is granted.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "firmware/mode.hpp"
#include "firmware/permit.hpp"
#include "firmware/setpoint.hpp"
#include "tests/firmware/bench.hpp"

namespace {

using bench::inf;
using bench::nan;
using firmware::Event;
using firmware::Mode;
using wire::Limit;
using wire::Status;

struct Asking {
  Asking() {
    setpoint.configure(bench::parameters(), bench::rating);
    EXPECT_EQ(setpoint.set({0.0f, 0.0f}), Status::done);
  }
  firmware::Permitted permit(wire::Dq asked_A, float allowed_A, Limit why = Limit::core_hot, std::uint32_t age = 1,
                             float bus_V = 48.0f, float rad_per_s = 0.0f) {
    EXPECT_EQ(setpoint.set(asked_A), Status::done);
    setpoint.follow(1);
    return law.permit(setpoint, {allowed_A, why}, age, bus_V, rad_per_s);
  }
  firmware::Setpoint setpoint;
  firmware::Permit law{bench::parameters(), bench::rating};
};

float length(wire::Dq x) { return std::sqrt(x.d * x.d + x.q * x.q); }

TEST(Permit, TheVectorIsLimitedNotItsComponents) {
  Asking asking;
  std::mt19937 random(5);
  std::uniform_real_distribution<float> any(-1000.0f, 1000.0f), some(0.0f, 20.0f);
  for (int i = 0; i < 100000; ++i) {
    const wire::Dq asked{any(random), any(random)};
    const float allowed = some(random);
    const wire::Dq got = asking.permit(asked, allowed).current_A;
    ASSERT_LE(length(got), allowed * 1.00001f);
    ASSERT_NEAR(got.d * asked.q, got.q * asked.d, 1e-2f) << "the direction must stay";
  }
}

TEST(Permit, WhatFitsIsGrantedWithoutAReason) {
  Asking asking;
  const firmware::Permitted got = asking.permit({3.0f, -4.0f}, 5.0f);
  EXPECT_FLOAT_EQ(got.current_A.d, 3.0f);
  EXPECT_FLOAT_EQ(got.current_A.q, -4.0f);
  EXPECT_EQ(got.reason, Limit::none);
}

/// Both components fade, and the vector keeps its direction.
TEST(Permit, AFieldCurrentThatIsTooOldFadesToo) {
  Asking asking;
  (void)asking.permit({-8.0f, 6.0f}, 20.0f);
  for (int i = 0; i < 4000; ++i) asking.setpoint.follow(1);  // 0.2 s: half of the ramp behind the time-out
  const auto got = asking.law.permit(asking.setpoint, {20.0f, Limit::core_hot}, 1, 48.0f, 0.0f);
  EXPECT_NEAR(got.current_A.d, -4.0f, 0.01f);
  EXPECT_NEAR(got.current_A.q, 3.0f, 0.01f);
  EXPECT_EQ(got.reason, Limit::setpoint_old);
}

TEST(Permit, AnAllowanceThatIsBrokenAllowsNothing) {
  for (const float broken : {nan, -nan, -1.0f, 20.001f, std::numeric_limits<float>::infinity(), -1e-30f}) {
    Asking asking;
    const firmware::Permitted got = asking.permit({1.0f, 5.0f}, broken);
    EXPECT_EQ(length(got.current_A), 0.0f) << broken;
    EXPECT_NE(got.reason, Limit::none);
  }
}

TEST(Permit, AThermalLaneThatIsSilentLeavesSixtyPercentOfContinuous) {
  Asking asking;
  EXPECT_FLOAT_EQ(length(asking.permit({0.0f, 20.0f}, 20.0f, Limit::hardware, 600).current_A), 20.0f);
  const firmware::Permitted got = asking.permit({0.0f, 20.0f}, 20.0f, Limit::hardware, 601);
  EXPECT_FLOAT_EQ(length(got.current_A), 3.6f);
  EXPECT_EQ(got.reason, Limit::thermal_late);
}

TEST(Permit, AHighBusTakesBrakingAndALowBusTakesDriving) {
  // 48 V supply: braking from 50.88 to 54.24 V, driving from 36 down to 24 V.
  struct Row {
    float bus_V, q_A, rad_per_s, left_A;
    Limit reason;
  };
  const Row rows[] = {
      {50.8f, -20.0f, 100.0f, 20.0f, Limit::none},      {52.56f, -20.0f, 100.0f, 10.0f, Limit::bus_high},
      {52.56f, 20.0f, -100.0f, 10.0f, Limit::bus_high}, {52.56f, 20.0f, 100.0f, 20.0f, Limit::none},
      {56.0f, -20.0f, 100.0f, 0.0f, Limit::bus_high},   {30.0f, 20.0f, 100.0f, 10.0f, Limit::bus_low},
      {30.0f, -20.0f, 100.0f, 20.0f, Limit::none},      {30.0f, 20.0f, 0.0f, 10.0f, Limit::bus_low},
      {20.0f, 20.0f, 100.0f, 0.0f, Limit::bus_low},     {nan, 20.0f, 100.0f, 0.0f, Limit::bus_low},
  };
  for (const Row& row : rows) {
    Asking asking;
    const firmware::Permitted got = asking.permit({0.0f, row.q_A}, 20.0f, Limit::hardware, 1, row.bus_V, row.rad_per_s);
    EXPECT_NEAR(length(got.current_A), row.left_A, 1e-3) << row.bus_V << " V " << row.q_A << " A";
    EXPECT_EQ(got.reason, row.reason) << row.bus_V << " V " << row.q_A << " A";
  }
}

TEST(Permit, TheConfiguredLimitIsNamedAsSuch) {
  firmware::AxisParameters p = bench::parameters();
  p.current_limit_A = 7.0f;
  const firmware::Permit law(p, bench::rating);
  EXPECT_EQ(law.most().current_A, 7.0f);
  EXPECT_EQ(law.most().reason, Limit::configured);
  EXPECT_EQ(firmware::Permit(bench::parameters(), bench::rating).most().reason, Limit::hardware);
}

TEST(Setpoint, GarbageIsRefusedAndDoesNotCountAsFresh) {
  firmware::Setpoint s;
  s.configure(bench::parameters(), bench::rating);
  ASSERT_EQ(s.set({1.0f, 2.0f}), Status::done);
  s.follow(1);
  for (int i = 0; i < 3000; ++i) {
    for (const float bad : {nan, inf, -inf, 1e38f, -1000.1f}) {
      EXPECT_EQ(s.set({bad, 0.0f}), Status::not_a_current);
      EXPECT_EQ(s.set({0.0f, bad}), Status::not_a_current);
    }
    s.follow(1);
    ASSERT_EQ(s.current_A().q, 2.0f);
  }
  EXPECT_LT(s.share(), 1.0f);
}

TEST(Setpoint, AgesByMissedPeriodsToo) {
  firmware::Setpoint s;
  s.configure(bench::parameters(), bench::rating);
  ASSERT_EQ(s.set({1.0f, 0.0f}), Status::done);
  s.follow(1);
  for (int i = 0; i < 19; ++i) s.follow(100);
  EXPECT_EQ(s.share(), 1.0f);
  s.follow(100);  // 0.1 s
  EXPECT_LT(s.share(), 1.0f);
}

TEST(Setpoint, StaysGoneForEver) {
  firmware::Setpoint s;
  s.configure(bench::parameters(), bench::rating);
  ASSERT_EQ(s.set({1.0f, 0.0f}), Status::done);
  s.follow(1);
  for (int i = 0; i < 7000; ++i) s.follow(1);
  ASSERT_EQ(s.share(), 0.0f);
  for (int i = 0; i < 100; ++i) {
    s.follow(0x7FFFFFFFu);  // years
    ASSERT_EQ(s.share(), 0.0f);
  }
}

TEST(Mode, TheTableSaysWhatItMust) {
  constexpr Mode modes[] = {Mode::off, Mode::ready, Mode::running, Mode::tripped};
  constexpr Event events[] = {Event::arm, Event::disarm, Event::start, Event::stop, Event::trip, Event::clear};
  static_assert(std::size(modes) == firmware::mode_count && std::size(events) == firmware::event_count);
  for (const Mode mode : modes) {
    EXPECT_EQ(next(mode, Event::trip), Mode::tripped) << "a fault always opens the bridge";
    if (mode != Mode::tripped) {
      EXPECT_EQ(next(mode, Event::disarm), Mode::off);
    }
    for (const Event event : events) {
      const Mode to = next(mode, event);
      if (to == Mode::running && mode != Mode::running) {
        EXPECT_TRUE(mode == Mode::ready && event == Event::start) << "only an armed axis starts, only by a setpoint";
      }
      if (to == Mode::ready && mode == Mode::off) {
        EXPECT_EQ(event, Event::arm);
      }
      if (mode == Mode::tripped && to != Mode::tripped) {
        EXPECT_EQ(event, Event::clear);
        EXPECT_EQ(to, Mode::off) << "cleared is not armed";
      }
      if (to == Mode::tripped && mode != Mode::tripped) {
        EXPECT_EQ(event, Event::trip);
      }
    }
  }
  EXPECT_EQ(next(Mode::off, Event::arm), Mode::ready);
  EXPECT_EQ(next(Mode::ready, Event::start), Mode::running);
  EXPECT_EQ(next(Mode::running, Event::stop), Mode::ready);
  EXPECT_EQ(next(Mode::tripped, Event::clear), Mode::off);
}

}  // namespace

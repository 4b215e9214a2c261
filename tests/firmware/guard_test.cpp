// SPDX-License-Identifier: MIT
#include "firmware/guard.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/firmware/bench.hpp"

namespace {

using bench::inf;
using bench::nan;
using firmware::Guard;
using firmware::Verdict;
using wire::Fault;

/// A guard that has seen good samples up to number 10.
Guard warm() {
  Guard guard(bench::rating);
  for (std::uint32_t i = 0; i <= 10; ++i) EXPECT_EQ(guard.admits(bench::quiet_sample(i)).verdict, Verdict::fresh);
  return guard;
}

struct Case {
  const char* what;
  void (*spoil)(hal::AxisSample&);
  Fault fault;
  float value, threshold;
};

TEST(Guard, TripsAtOnceWithItsEvidence) {
  const Case cases[] = {
      {"a", [](auto& s) { s.current_A.a = 28.1f; }, Fault::over_current, 28.1f, 28.0f},
      {"b", [](auto& s) { s.current_A.b = -28.1f; }, Fault::over_current, -28.1f, 28.0f},
      {"c", [](auto& s) { s.current_A.c = 1e30f; }, Fault::over_current, 1e30f, 28.0f},
      {"bus high", [](auto& s) { s.bus_V = 58.1f; }, Fault::bus_over_voltage, 58.1f, 58.0f},
      {"bus low", [](auto& s) { s.bus_V = 11.9f; }, Fault::bus_under_voltage, 11.9f, 12.0f},
      {"bus gone", [](auto& s) { s.bus_V = -0.0f; }, Fault::bus_under_voltage, -0.0f, 12.0f},
      {"number jumped", [](auto& s) { s.sequence = 10 + 201; }, Fault::late_sample, 201 * 5e-5f, 200 * 5e-5f},
  };
  for (const Case& c : cases) {
    Guard guard = warm();
    hal::AxisSample s = bench::quiet_sample(11);
    c.spoil(s);
    EXPECT_EQ(guard.admits(s).verdict, Verdict::refused) << c.what;
    EXPECT_EQ(guard.found().fault, c.fault) << c.what;
    EXPECT_FLOAT_EQ(guard.found().value, c.value) << c.what;
    EXPECT_FLOAT_EQ(guard.found().threshold, c.threshold) << c.what;
  }
}

TEST(Guard, AdmitsWhatIsJustWithinItsBounds) {
  Guard guard = warm();
  hal::AxisSample s = bench::quiet_sample(11);
  s.current_A = {28.0f, -28.0f, 0.0f};
  s.bus_V = 58.0f;
  s.rotor_rad = 6.2831855f;
  EXPECT_EQ(guard.admits(s).verdict, Verdict::fresh);
  s.bus_V = 12.0f;
  s.rotor_rad = 0.0f;
  s.sequence = 11 + 200;
  const firmware::Sight sight = guard.admits(s);
  EXPECT_EQ(sight.verdict, Verdict::fresh);
  EXPECT_EQ(sight.periods, 200u);
}

TEST(Guard, NoFieldMayBeAnythingButANumber) {
  for (const float bad : {nan, -nan, inf, -inf}) {
    for (int field = 0; field < 5; ++field) {
      Guard guard = warm();
      hal::AxisSample s = bench::quiet_sample(11);
      float* fields[] = {&s.current_A.a, &s.current_A.b, &s.current_A.c, &s.bus_V, &s.rotor_rad};
      *fields[field] = bad;
      EXPECT_EQ(guard.admits(s).verdict, Verdict::refused) << field;
      EXPECT_EQ(guard.found().fault, Fault::not_finite) << field;
    }
  }
}

TEST(Guard, OneMissedSampleIsBridgedTheSecondTrips) {
  const auto invalid = [](std::uint32_t n) {
    hal::AxisSample s = bench::quiet_sample(n);
    s.valid = false;
    s.current_A.a = nan;  // means nothing
    return s;
  };
  Guard guard = warm();
  EXPECT_EQ(guard.admits(invalid(11)).verdict, Verdict::bridged);
  const firmware::Sight after = guard.admits(bench::quiet_sample(12));
  EXPECT_EQ(after.verdict, Verdict::fresh);
  EXPECT_EQ(after.periods, 2u) << "the missed period must not be lost";
  EXPECT_EQ(guard.admits(invalid(13)).verdict, Verdict::bridged);
  EXPECT_EQ(guard.admits(invalid(14)).verdict, Verdict::refused);
  EXPECT_EQ(guard.found().fault, Fault::invalid_sample);
}

TEST(Guard, ARepeatedNumberIsAnOldSample) {
  Guard guard = warm();
  EXPECT_EQ(guard.admits(bench::quiet_sample(10)).verdict, Verdict::bridged);
  EXPECT_EQ(guard.admits(bench::quiet_sample(10)).verdict, Verdict::refused);
  EXPECT_EQ(guard.found().fault, Fault::late_sample);
  EXPECT_FLOAT_EQ(guard.found().value, 1e-4f);
  EXPECT_FLOAT_EQ(guard.found().threshold, 1e-4f);
}

TEST(Guard, AnAngleOutsideTheTurnIsAnInvalidSample) {
  for (const float rad : {-0.001f, 6.29f, 1e30f}) {
    Guard guard = warm();
    hal::AxisSample s = bench::quiet_sample(11);
    s.rotor_rad = rad;
    EXPECT_EQ(guard.admits(s).verdict, Verdict::bridged);
    s.sequence = 12;
    EXPECT_EQ(guard.admits(s).verdict, Verdict::refused);
    EXPECT_EQ(guard.found().fault, Fault::invalid_sample);
  }
}

TEST(Guard, TheSequenceMayWrapAndMayStartAnywhere) {
  for (const std::uint32_t start : {0u, 1u, 500u, 0xFFFFFFF0u}) {
    Guard guard(bench::rating);
    for (std::uint32_t i = 0; i < 100; ++i) {
      const firmware::Sight sight = guard.admits(bench::quiet_sample(start + i));
      ASSERT_EQ(sight.verdict, Verdict::fresh) << start + i;
      ASSERT_EQ(sight.periods, 1u) << start + i;
    }
  }
}

TEST(Guard, PassesOnlyRatios) {
  Guard guard(bench::rating);
  EXPECT_TRUE(guard.passes({0.0f, 1.0f, 0.5f}));
  for (const float bad : {nan, inf, -inf, 1.0000001f, -1e-30f}) {
    EXPECT_FALSE(guard.passes({bad, 0.5f, 0.5f}));
    EXPECT_FALSE(guard.passes({0.5f, bad, 0.5f}));
    EXPECT_FALSE(guard.passes({0.5f, 0.5f, bad}));
    EXPECT_EQ(guard.found().fault, Fault::not_finite);
  }
}

TEST(Bits, ARangeHoldsWhatLiesWithinAndNothingElse) {
  const firmware::Range range(2.0f, 3.0f);
  for (const float good : {2.0f, 2.5f, 3.0f}) EXPECT_TRUE(range.holds(good)) << good;
  for (const float bad : {nan, -nan, inf, -inf, 0.0f, -2.5f, 1.9999999f, 3.0000003f})
    EXPECT_FALSE(range.holds(bad)) << bad;
  for (const firmware::Range& none : {firmware::Range(3.0f, 2.0f), firmware::Range(nan, 2.0f),
                                      firmware::Range(2.0f, nan), firmware::Range(-1.0f, 2.0f), firmware::Range()}) {
    for (const float x : {0.0f, 1.0f, 2.5f, -0.5f, inf, 1e30f}) EXPECT_FALSE(none.holds(x)) << x;
  }
}

TEST(Guard, WithoutARatingNothingIsAdmitted) {
  Guard guard;
  for (std::uint32_t i = 0; i < 10; ++i) EXPECT_NE(guard.admits(bench::quiet_sample(i)).verdict, Verdict::fresh);
}

}  // namespace

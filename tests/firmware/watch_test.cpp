// SPDX-License-Identifier: MIT
// What a look each millisecond makes of readings that agree with the motor, and of ones that do not.
#include "firmware/watch.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <random>

namespace {

using firmware::Watch;
using wire::Fault;

struct Drawn {
  Watch::Motor motor;
  Watch::Look look;
};

/// A motor somewhere in its range, whose voltage is all its own: v = R i + j w (L i + flux), `strange_V` more than
/// that.
Drawn drawn(std::mt19937& random, std::complex<double> strange_V = 0.0) {
  const auto between = [&](double low, double high) { return std::uniform_real_distribution(low, high)(random); };
  const double ohm = between(0.05, 1.0), henry = between(20e-6, 500e-6), flux_Wb = between(0.001, 0.01);
  const double w = between(-3000.0, 3000.0), share = between(0.3, 1.0);
  const std::complex<double> i(between(-10.0, 10.0), between(-20.0, 20.0)), j(0.0, 1.0);
  const std::complex<double> v = (ohm * i + j * w * (henry * i + flux_Wb) + strange_V) / share;
  Drawn out;
  out.motor = {static_cast<float>(ohm), static_cast<float>(henry), static_cast<float>(flux_Wb)};
  out.look = {.phase_A = {0.0f, 0.0f, 0.0f},
              .current_A = {static_cast<float>(i.real()), static_cast<float>(i.imag())},
              .asked_V = {static_cast<float>(v.real()), static_cast<float>(v.imag())},
              .electrical_rad_per_s = static_cast<float>(w),
              .bus_V = 48.0f,
              .share = static_cast<float>(share),
              .switches = true};
  return out;
}

/// What the last of `looks` alike says.
firmware::FaultRecord after(int looks, const Drawn& d) {
  Watch watch;
  firmware::FaultRecord record;
  for (int k = 0; k < looks && record.fault == Fault::none; ++k) record = watch.judge(d.look, d.motor);
  return record;
}

TEST(Watch, WhatIsLeftOverIsJustWhatTheMotorCannotHaveMade) {
  std::mt19937 random(11);
  for (int n = 0; n < 1000; ++n) {
    const double strange_V = 200.0;  // beyond every bound of these motors
    const Drawn d = drawn(random, std::polar(strange_V, 0.01 * n));
    const firmware::FaultRecord record = after(8, d);
    ASSERT_EQ(record.fault, Fault::motor_differs);
    ASSERT_NEAR(record.value, strange_V, 0.01);
    // 3 % of the bus; half of R and of L; a quarter of the flux.
    const double i_A = std::abs(d.look.current_A.d) + std::abs(d.look.current_A.q),
                 w = std::abs(d.look.electrical_rad_per_s);
    const double ohm = d.motor.ohm, henry = d.motor.inductance_H, flux_Wb = d.motor.flux_Wb;
    ASSERT_NEAR(record.threshold, 0.03 * 48.0 + 0.5 * (ohm + w * henry) * i_A + 0.25 * w * flux_Wb, 0.01);
  }
}

TEST(Watch, AMotorThatAnswersAsItShouldIsNeverDoubted) {
  std::mt19937 random(12);
  for (int n = 0; n < 1000; ++n) ASSERT_EQ(after(100, drawn(random)).fault, Fault::none);
}

TEST(Watch, ABridgeThatDoesNotSwitchAsksNothingOfTheMotor) {
  std::mt19937 random(13);
  Drawn d = drawn(random, 100.0);
  d.look.switches = false;
  EXPECT_EQ(after(100, d).fault, Fault::none);
}

TEST(Watch, ThreeCurrentsHaveNoSumButForGainsAndOffsets) {
  std::mt19937 random(14);
  for (int largest = 0; largest < 3; ++largest) {
    for (const float sign : {-1.0f, 1.0f}) {
      for (const float beyond_A : {-0.1f, 0.1f}) {
        Drawn d = drawn(random);
        // 20 A in one phase, which leaves 1.5 A and 6 % of it to gains and offsets; the other two share the rest.
        const float others_A = -10.0f + 0.5f * (1.5f + 0.06f * 20.0f + beyond_A);
        float phase_A[3] = {sign * others_A, sign * others_A, sign * others_A};
        phase_A[largest] = sign * 20.0f;
        d.look.phase_A = {phase_A[0], phase_A[1], phase_A[2]};
        EXPECT_EQ(after(2, d).fault, Fault::none);
        EXPECT_EQ(after(3, d).fault, beyond_A > 0 ? Fault::current_sum : Fault::none) << largest << ' ' << sign;
      }
    }
  }
}

/// An axis that was disarmed and armed again between two looks has its doubts yet, and may be well by now.
TEST(Watch, ALookThatAgreesIsNeverTheEvidence) {
  std::mt19937 random(16);
  for (int n = 0; n < 1000; ++n) {
    Drawn bad = drawn(random, 200.0);
    const Drawn good = drawn(random);
    if (n % 2 == 0) bad.look.phase_A = {20.0f, 0.0f, 0.0f};
    Watch watch;
    const auto judge = [&watch](const Drawn& d) { return watch.judge(d.look, d.motor).fault; };
    for (int k = n % 2 == 0 ? 1 : 0; k < 3; ++k) ASSERT_EQ(judge(bad), Fault::none);
    ASSERT_EQ(judge(good), Fault::none);
    ASSERT_EQ(judge(bad), Fault::none);
    ASSERT_NE(judge(bad), Fault::none);
    ASSERT_EQ(judge(good), Fault::none);
  }
}

TEST(Watch, ForgottenDoubtsDoNotCount) {
  std::mt19937 random(15);
  Drawn d = drawn(random, 200.0);
  d.look.phase_A = {20.0f, 0.0f, 0.0f};
  Watch watch;
  for (int k = 0; k < 100; ++k) {
    ASSERT_EQ(watch.judge(d.look, d.motor).fault, Fault::none);
    ASSERT_EQ(watch.judge(d.look, d.motor).fault, Fault::none);
    watch.forget();
  }
}

}  // namespace

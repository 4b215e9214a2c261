// SPDX-License-Identifier: MIT
#include "firmware/current_loop.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/firmware/bench.hpp"

namespace {

using firmware::CurrentLoop;
using firmware::Dq;

/// One R-L winding on a controller that acts at once, so that a closed form exists.
struct Winding {
  double R_ohm, L_H, i_A = 0.0;
  void run(double v_V, double dt_s) {
    const double decay = std::exp(-dt_s * R_ohm / L_H);
    i_A = i_A * decay + v_V / R_ohm * (1 - decay);
  }
};

TEST(CurrentLoop, AStepIsOnePoleAtTheBandwidth) {
  firmware::BoardRating fast = bench::rating;
  fast.pwm_Hz = 2e6f;  // so fast that sampling does not show
  const firmware::AxisParameters p = bench::parameters();
  CurrentLoop loop(p, fast);
  Winding winding{bench::motor().phase_resistance_ohm, bench::motor().inductance_q_H};
  const double w = 2 * M_PI * 1000.0, dt_s = 1 / 2e6;
  for (int k = 0; k < 2000; ++k) {
    ASSERT_NEAR(winding.i_A, 10.0 * (1 - std::exp(-w * k * dt_s)), 0.05) << k;
    const Dq error{0.0f, static_cast<float>(10.0 - winding.i_A)};
    // With zero speed the feed-forward is zero.
    const Dq v = loop.ask(error, {0.0f, static_cast<float>(winding.i_A)}, 0.0f);
    loop.settle(error, v, 1.0f);
    winding.run(static_cast<double>(v.q), dt_s);
  }
}

TEST(CurrentLoop, FeedForwardCancelsRotation) {
  const firmware::AxisParameters p = bench::parameters();
  const CurrentLoop loop(p, bench::rating);
  const float w = 1500.0f;
  const Dq i{-2.0f, 7.0f}, v = loop.ask({0.0f, 0.0f}, i, w);
  EXPECT_NEAR(v.d, -w * p.inductance_q_H * i.q, 1e-5);
  EXPECT_NEAR(v.q, w * (p.inductance_d_H * i.d + p.flux_linkage_Wb), 1e-4);
}

/// Asks for a current that the voltage cannot make, for a while, then for none. Periods until it is nearly gone.
int recovery_periods(bool honest) {
  CurrentLoop loop(bench::parameters(), bench::rating);
  Winding winding{bench::motor().phase_resistance_ohm, bench::motor().inductance_q_H};
  constexpr float most_V = 2.0f;  // 10 A at most; 20 A are asked
  for (int k = 0; k < 4000; ++k) {
    const double target_A = k < 2000 ? 20.0 : 0.0;
    const Dq error{0.0f, static_cast<float>(target_A - winding.i_A)};
    const Dq v = loop.ask(error, {0.0f, 0.0f}, 0.0f);
    const float share = std::fabs(v.q) > most_V ? most_V / std::fabs(v.q) : 1.0f;
    loop.settle(error, v, honest ? share : 1.0f);
    winding.run(static_cast<double>(v.q * share), bench::period_s);
    if (k >= 2000 && std::abs(winding.i_A) < 0.2) return k - 2000;
  }
  return 2000;
}

TEST(CurrentLoop, AntiWindupRecoversAtOnce) {
  EXPECT_LT(recovery_periods(true), 25);     // 2 V against 10 A in 32.5 uH take 5; then four time constants of 3.2
  EXPECT_GT(recovery_periods(false), 1000);  // told nothing, it stays wound up: this test can see the difference
}

}  // namespace

// SPDX-License-Identifier: MIT
#include "thermal/governor.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <thread>
#include <vector>

#include "tests/thermal/reference.hpp"
#include "thermal/losses.hpp"
#include "thermal/motor_set.hpp"

namespace {

using thermal::Drive;
using thermal::GovernorSettings;
using thermal::HeatInput;
using thermal::NodeBudget;

const float inf = std::numeric_limits<float>::infinity();

/// EC 16 with a 25 degC housing: 120 W hold at 155 degC.
const NodeBudget small_motor{155.0f, 1.13f, 120.4f, 1.133f, 0.926f};

/// Runs every `stride`-th float through both kernels on two threads; returns what broke, or nothing.
template <class Allowed>
std::string run_all_floats(const NodeBudget& node, const GovernorSettings& s, std::uint32_t stride, Allowed allow) {
  // Ordered by temperature: index 0 is -NaN's end, falling magnitudes of negative floats, then rising positive ones.
  auto nth = [](std::uint64_t n) {
    return n < 0x80000000u ? std::bit_cast<float>(static_cast<std::uint32_t>(0xFFFFFFFFu - n))
                           : std::bit_cast<float>(static_cast<std::uint32_t>(n - 0x80000000u));
  };
  std::string broken[2];
  auto half = [&](int part) {
    const std::uint64_t from = part == 0 ? 0 : 0x80000000u, to = from + 0x80000000u;
    float last_allowed = inf, last_ceiling = inf;
    for (std::uint64_t n = from; n < to; n += stride) {
      const float T = nth(n);
      const float allowed = allow(T, node, s), ceiling = thermal::ceiling_current_A(T, node, s);
      bool good = allowed >= 0.0f && allowed <= s.max_A && ceiling >= 0.0f && ceiling <= s.max_A;
      if (!(T >= s.coldest_degC) || T >= node.limit_degC + s.margin_K)
        good = good && allowed == 0.0f && ceiling == 0.0f;
      if (T >= s.coldest_degC) {
        good = good && allowed <= last_allowed && ceiling <= last_ceiling;
        last_allowed = allowed, last_ceiling = ceiling;
      }
      if (!good) {
        broken[part] =
            "at " + std::to_string(T) + " degC: " + std::to_string(allowed) + " and " + std::to_string(ceiling);
        return;
      }
    }
  };
  std::thread other(half, 0);
  half(1);
  other.join();
  return broken[0] + broken[1];
}

std::string run_all_floats(const NodeBudget& node, const GovernorSettings& s, std::uint32_t stride) {
  return run_all_floats(node, s, stride, [](float T, const NodeBudget& n, const GovernorSettings& g) {
    return thermal::allowed_current_A(T, n, g);
  });
}

#ifdef HOTCORE_TRAP_FLOATS  // the sanitizer build takes a sample
constexpr std::uint32_t every = 257;
#else
constexpr std::uint32_t every = 1;
#endif

TEST(Governor, EveryFloatIsSafeAndNoneRisesWithTemperature) { EXPECT_EQ(run_all_floats(small_motor, {}, every), ""); }

TEST(Governor, OtherMotorsAreSafeForASampleOfAllFloats) {
  GovernorSettings s;
  EXPECT_EQ(run_all_floats({155.0f, 0.38f, -20.0f, 0.7f, 0.9f}, s, 101), "") << "neighbours alone overheat it";
  EXPECT_EQ(run_all_floats({155.0f, 10.1f, 620.0f, 0.12f, 4.8f}, s, 101), "") << "200 W motor";
  EXPECT_EQ(run_all_floats({100.0f, 18.0f, 0.0f, 0.0f, 1.0f}, s, 101), "")
      << "limit of a node that current does not heat";
  EXPECT_EQ(run_all_floats({110.0f, 3.0f, 5.0f, 1e-5f, 0.6f}, s, 101), "") << "reached mostly through others";
  EXPECT_EQ(run_all_floats({155.0f, 1e-3f, 1e9f, 1e-9f, 1e-9f}, s, 101), "") << "absurd";
  s.max_A = 80.0f;
  EXPECT_EQ(run_all_floats({155.0f, 10.1f, 0.0f, 0.12f, 4.8f}, s, 101), "") << "80 A board, housing at the limit";
}

TEST(Governor, TheFloatRunFindsLimitersThatFailOpen) {
  auto finds = [](auto mutant) {
    return !run_all_floats(small_motor, {}, 101, [&](float T, const NodeBudget& n, const GovernorSettings& g) {
              return mutant(T, thermal::allowed_current_A(T, n, g));
            }).empty();
  };
  EXPECT_FALSE(finds([](float, float A) { return A; }));
  EXPECT_TRUE(finds([](float T, float A) { return std::isnan(T) ? 20.0f : A; }));
  EXPECT_TRUE(finds([](float T, float A) { return T < -60.0f ? 20.0f : A; }));
  EXPECT_TRUE(finds([](float T, float A) { return T > 1e9f ? 20.0f : A; }));
  EXPECT_TRUE(finds([](float T, float A) { return T > 120.0f && T < 120.1f ? A * 0.99f : A; }));
  EXPECT_TRUE(finds([](float T, float A) { return T > 100.0f && T < 100.1f ? -0.1f : A; }));
}

TEST(Governor, AnUnusableBudgetOrSettingAllowsNothing) {
  const float nan = std::nanf("");
  for (const NodeBudget& node :
       {NodeBudget{nan, 1, 100, 1, 1}, NodeBudget{155, nan, 100, 1, 1}, NodeBudget{155, 0, 100, 1, 1},
        NodeBudget{155, 1, 100, nan, 1}, NodeBudget{155, 1, 100, -1, 1}}) {
    EXPECT_EQ(thermal::allowed_current_A(25, node, {}), 0.0f);
    EXPECT_EQ(thermal::ceiling_current_A(25, node, {}), 0.0f);
  }
  EXPECT_LE(thermal::allowed_current_A(154.9f, {155, 1, nan, 1, 1}, {}), 3.0f);
  EXPECT_EQ(thermal::ceiling_current_A(25, {155, 1, nan, 1, 1}, {}), 0.0f);
  GovernorSettings s;
  s.max_A = nan;
  EXPECT_EQ(thermal::allowed_current_A(25, small_motor, s), 0.0f);
  s = {};
  s.soft_K = nan;
  for (const float degC : {25.0f, 154.9f, 157.0f}) EXPECT_EQ(thermal::allowed_current_A(degC, small_motor, s), 0.0f);
  EXPECT_EQ(thermal::sloped_allowance_A(5, nan, 20, 0.01f, {}), 0.0f);
  EXPECT_EQ(thermal::sloped_allowance_A(5, 20, nan, 0.01f, {}), 0.0f);
}

/// Closed loop: estimator and governor against the independent reference, true parameters.
struct Loop {
  wire::Motor m;
  thermal::HeatSet<double> set;
  thermal::CoreEstimator core;
  thermal::Governor governor;
  reference::ThreePhases plant;
  float allowance_A;
  double impulse_As = 0, steepest_A = 0, hottest_degC = 0;
  float last_A = -1;

  static thermal::EstimatorSettings exact() {
    thermal::EstimatorSettings s;
    s.trust = thermal::exact_trust;
    s.margin_sigmas = 0;
    return s;
  }
  static thermal::HeatSet<double> set_for(const wire::Motor& motor) { return thermal::three_phase_set(motor); }

  Loop(const wire::Motor& motor, float max_A, double start_degC, const thermal::EstimatorSettings& es = exact())
      : m(motor), set(set_for(motor)), core(set, es), governor(settings(max_A)), plant{motor} {
    for (auto& T : plant.degC) T = start_degC;
    HeatInput<> idle;
    idle[thermal::Boundary::coolant] = idle[thermal::Boundary::frame] = idle[thermal::Boundary::neighbour] = 25;
    for (int i = 0; i < 50; ++i) core.tick(idle, {static_cast<float>(start_degC), true}, {25.0f, true});
    allowance_A = governor.tick(core).current_A;
  }
  static GovernorSettings settings(float max_A) {
    GovernorSettings s;
    s.max_A = max_A;
    return s;
  }

  /// One 10 ms step at a demanded amplitude and electrical angle; the allowance computed before applies during it.
  void step(double demand_A, double angle_rad, bool rotating) {
    const double i = std::min<double>(demand_A, static_cast<double>(allowance_A));
    std::array<reference::Real, 3> A2;
    for (std::size_t k = 0; k < 3; ++k) {
      const double c = std::cos(angle_rad - 2.0943951023931953 * static_cast<double>(k));
      A2[k] = static_cast<reference::Real>(i * i * (rotating ? 0.5 : c * c));
    }
    plant.advance(0.01L, 4, A2, 25);
    HeatInput<> input;
    for (int k = 0; k < 3; ++k) {
      input.drive[static_cast<int>(Drive::phase_a_A2) + k] = static_cast<double>(A2[static_cast<std::size_t>(k)]);
    }
    input[Drive::current_A2] = i * i;
    core.tick(input, {static_cast<float>(plant.degC[3]), true}, {25.0f, true});
    allowance_A = governor.tick(core).current_A;
    impulse_As += i * 0.01;
    if (last_A >= 0) steepest_A = std::max(steepest_A, static_cast<double>(std::abs(allowance_A - last_A)));
    last_A = allowance_A;
    hottest_degC = std::max(hottest_degC, static_cast<double>(plant.hottest_degC()));
  }
};

/// Impulse of the time-optimal answer: full current until the winding is at its limit, then exactly what holds it.
double optimum_As(const wire::Motor& m, double max_A, double start_degC, double seconds) {
  reference::TwoNodes plant{m, {static_cast<reference::Real>(start_degC), static_cast<reference::Real>(start_degC)}};
  double impulse = 0;
  const double hot_ohm = 1.5 * m.phase_resistance_ohm * (1 + m.copper_coefficient_per_K * (m.winding_max_degC - 25));
  for (int i = 0; i < static_cast<int>(seconds * 1000 + 0.5); ++i) {
    double A = max_A;
    if (static_cast<double>(plant.degC[0]) >= m.winding_max_degC) {
      A = std::sqrt((m.winding_max_degC - static_cast<double>(plant.degC[1])) / m.R1_K_per_W / hot_ohm);
    }
    plant.advance(0.001L, 1, static_cast<reference::Real>(std::min(A, max_A) * std::min(A, max_A)), 25);
    impulse += std::min(A, max_A) * 0.001;
  }
  return impulse;
}

TEST(Governor, AQuarterSecondPushIsNotHeldBack) {
  for (double start_degC : {25.0, 45.0}) {
    Loop loop(reference::ec16(), 20, start_degC);
    for (int i = 0; i < 25; ++i) loop.step(20, 0, true);
    const double best = optimum_As(reference::ec16(), 20, start_degC, 0.25);
    RecordProperty("impulse_share_percent", static_cast<int>(100 * loop.impulse_As / best));
    EXPECT_GE(loop.impulse_As, 0.95 * best) << start_degC;
    EXPECT_LE(loop.hottest_degC, 155.5);
  }
}

TEST(Governor, ALongPushUsesTheWindingAndSettlesOnTheHoldingCurrent) {
  struct Case {
    wire::Motor m;
    float max_A;
    double seconds;
  };
  for (const Case& c :
       {Case{reference::ec16(), 20, 2}, Case{reference::ec16(), 20, 30}, Case{reference::powermax(), 80, 20}}) {
    Loop loop(c.m, c.max_A, 25);
    for (int i = 0; i < static_cast<int>(c.seconds * 100); ++i) loop.step(1e3, 0, true);
    const double best = optimum_As(c.m, static_cast<double>(c.max_A), 25, c.seconds);
    std::printf("  long push %g A %g s: %.1f %% of the optimum, hottest %.2f degC, steepest %.2f %% of peak in 10 ms\n",
                static_cast<double>(c.max_A), c.seconds, 100 * loop.impulse_As / best, loop.hottest_degC,
                100 * loop.steepest_A / static_cast<double>(c.max_A));
    EXPECT_GE(loop.impulse_As, 0.95 * best);
    EXPECT_LE(loop.hottest_degC, 155.5);
    EXPECT_GT(loop.hottest_degC, 153.5) << "capacity left unused";
    EXPECT_LE(loop.steepest_A, 0.02 * static_cast<double>(c.max_A) * 1.0001);
    const double hot_ohm = 1.5 * c.m.phase_resistance_ohm * (1 + 0.00393 * 130);
    const double hold_A = std::sqrt((155 - static_cast<double>(loop.plant.degC[3])) / c.m.R1_K_per_W / hot_ohm);
    EXPECT_NEAR(static_cast<double>(loop.allowance_A), hold_A, 0.02 * hold_A);
  }
}

TEST(Governor, ASheetsUncertaintyCostsCapacityButNeitherSlopeNorLimit) {
  struct Case {
    thermal::Trust trust;
    double R1_scale, C1_scale, ohm_scale;  // of the motor, of its sheet
    double least_share;                    // of the optimum impulse in 2 s, known parameters
  };
  for (const Case& c : {Case{thermal::sheet_trust, 1, 1, 1, 0.80}, Case{thermal::sheet_trust, 1.3, 1, 1, 0},
                        Case{thermal::sheet_trust, 1, 0.7, 1, 0}, Case{thermal::sheet_trust, 1, 1, 1.2, 0},
                        Case{thermal::sheet_trust, 1.3, 0.8, 1, 0}, Case{thermal::identified_trust, 1, 1, 1, 0.95},
                        Case{thermal::exact_trust, 1, 1, 1, 0.99}}) {
    thermal::EstimatorSettings es;
    es.trust = c.trust;
    Loop loop(reference::ec16(), 20, 25, es);
    loop.plant.m.R1_K_per_W *= c.R1_scale;
    loop.plant.m.C1_J_per_K *= c.C1_scale;
    loop.plant.m.phase_resistance_ohm *= c.ohm_scale;
    for (int i = 0; i < 200; ++i) loop.step(20, 0, true);
    const double share = loop.impulse_As / optimum_As(reference::ec16(), 20, 25, 2);
    std::printf(
        "  power known to %.0f %%, R1 x %.1f, C1 x %.1f, ohm x %.1f: %.1f %% of the optimum in 2 s, hottest %.1f degC, "
        "steepest %.2f A\n",
        static_cast<double>(100 * c.trust.power), c.R1_scale, c.C1_scale, c.ohm_scale, 100 * share, loop.hottest_degC,
        loop.steepest_A);
    EXPECT_GE(share, c.least_share);
    EXPECT_LE(loop.hottest_degC, 155.0 + (c.least_share > 0 ? 0.5 : 6.0));
    EXPECT_LE(loop.steepest_A, c.least_share > 0 ? 0.4001 : 1.0);
  }
}

TEST(Governor, AStalledRotorStaysWithinHalfAKelvinAtEveryAngle) {
  double worst = 0;
  for (int degrees = 0; degrees < 360; degrees += 10) {
    Loop loop(reference::ec16(), 20, 25);
    for (int i = 0; i < 500; ++i) loop.step(20, degrees * 0.017453292519943295, false);
    worst = std::max(worst, loop.hottest_degC - 155);
    EXPECT_LE(loop.steepest_A, 0.4001) << degrees;
  }
  EXPECT_LE(worst, 0.5);
  EXPECT_GT(worst, -3.0);
}

TEST(Governor, ARotorThatStallsAtTheLimitOvershootsLessThanThreeKelvin) {
  double worst = 0;
  for (int at = 0; at < 150; at += 7) {  // the stall may come anywhere in the push
    Loop loop(reference::ec16(), 20, 25);
    for (int i = 0; i < at; ++i) loop.step(20, 0, true);
    for (int i = 0; i < 200; ++i) loop.step(20, 0, false);
    worst = std::max(worst, loop.hottest_degC - 155);
  }
  std::printf("  stall in a push at any moment: worst overshoot %.2f K\n", worst);
  EXPECT_LE(worst, 3.0);
}

TEST(Governor, CreepingRotationStaysBelowThreeKelvin) {
  for (double Hz : {0.05, 0.3, 1.0, 3.0, 10.0, 33.0}) {
    Loop loop(reference::ec16(), 20, 25);
    for (int i = 0; i < 3000; ++i) loop.step(20, 6.283185307179586 * Hz * i * 0.01, false);
    EXPECT_LE(loop.hottest_degC, 158.0) << Hz;
  }
}

/// A motor as there may be one: time constants and resistances over two decades and more, each phase slow enough for
/// the slow lane (firmware/heat_parameters.cpp).
wire::Motor any_motor(std::mt19937& random) {
  const auto between = [&](double a, double b) {
    return std::exp(std::uniform_real_distribution<double>(std::log(a), std::log(b))(random));
  };
  const double R1 = between(0.01, 30), R2 = between(0.05, 100), winding_s = between(0.5, 30);
  wire::Motor m = reference::motor(1.0, R1, R2, winding_s, winding_s * between(8, 1000));
  m.winding_max_degC = std::uniform_real_distribution<double>(80, 200)(random);
  m.phase_resistance_ohm = between(0.5, 100) * 130 / (R1 + R2) / 600;  // 20 A make up to 100 times what it can stand
  const double fastest = (m.C1_J_per_K / 3 / 0.05 - 1 / (3 * R1)) / 2;
  m.phase_coupling_W_per_K = random() % 2 == 0 ? 0.0 : std::min(between(0.01, 3) / R1, fastest);
  return m;
}

TEST(Governor, NoDemandAndNoTurningOfAnyMotorPassesItsLimit) {
  double worst_K = -1e9;
  for (unsigned seed = 0; seed < 300; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> share(0, 1);
    Loop loop(any_motor(random), 20, 25);
    double demand_A = 20, angle_rad = 0, turning_rad_per_s = 0;
    int until = 0;
    for (int i = 0; i < 1500; ++i) {
      if (i >= until) {
        until = i + static_cast<int>(std::exp(5.7 * share(random)));
        switch (random() % 4) {
          case 0:
            angle_rad = 6.283185307179586 * share(random), turning_rad_per_s = 0;
            break;
          case 1:
            turning_rad_per_s = 0.01 * std::exp(10 * share(random));
            break;
          case 2:
            demand_A = random() % 2 == 0 ? 20 : 20 * share(random);
            break;
          default:
            angle_rad += 1.5707963267948966, turning_rad_per_s = 0;  // the current moves to the other axis
        }
      }
      loop.step(demand_A, angle_rad, turning_rad_per_s > 30);
      angle_rad += turning_rad_per_s * 0.01;
    }
    worst_K = std::max(worst_K, loop.hottest_degC - loop.m.winding_max_degC);
    EXPECT_LE(loop.hottest_degC, loop.m.winding_max_degC + 3) << "seed " << seed;
  }
  std::printf("  300 motors, demands and turnings at random: worst overshoot %.2f K\n", worst_K);
  EXPECT_GT(worst_K, -1) << "the limit was never near, so nothing was shown";
}

TEST(Governor, SensorNoiseMakesNoChatter) {
  Loop loop(reference::ec16(), 20, 25);
  std::mt19937 seed(7);
  std::normal_distribution<float> noise(0.0f, 0.1f);
  double sum = 0, sum2 = 0;
  int n = 0;
  float largest_step = 0, last = -1;
  for (int i = 0; i < 3000; ++i) {
    const float A = loop.allowance_A;
    HeatInput<> input;
    for (Drive phase : {Drive::phase_a_A2, Drive::phase_b_A2, Drive::phase_c_A2}) {
      input[phase] = static_cast<double>(A) * static_cast<double>(A) / 2;
    }
    loop.plant.advance(0.01L, 2, {A * A / 2, A * A / 2, A * A / 2}, 25);
    loop.core.tick(input, {static_cast<float>(loop.plant.degC[3]) + noise(seed), true});
    loop.allowance_A = loop.governor.tick(loop.core).current_A;
    if (i > 1500) {
      if (last >= 0) {
        const double d = static_cast<double>(loop.allowance_A - last);
        sum += d, sum2 += d * d, ++n;
        largest_step = std::max(largest_step, std::abs(loop.allowance_A - last));
      }
      last = loop.allowance_A;
    }
  }
  EXPECT_LE(largest_step, 0.05f);
  EXPECT_LE(std::sqrt(sum2 / n), 0.005);
}

/// A magnet beside an EC 16's winding, both on the housing.
struct MagnetPlant {
  double magnet_J_per_K, to_magnet, gain_W_per_A2, winding_degC = 25, magnet_degC = 25, housing_degC = 25;
  static constexpr double to_housing = 1 / 1.08, magnet_to_housing = 0.3, to_ambient = 0.18;
  void advance(double A2, double seconds) {
    for (double left_s = seconds; left_s > 1e-9; left_s -= 0.005) {
      const double ohm = 0.75 * (1 + 0.00393 * (winding_degC - 25)), over_magnet_K = winding_degC - magnet_degC,
                   over_housing_K = winding_degC - housing_degC, magnet_K = magnet_degC - housing_degC;
      winding_degC += 0.005 / 1.13 * (A2 * ohm - over_housing_K * to_housing - over_magnet_K * to_magnet);
      magnet_degC +=
          0.005 / magnet_J_per_K * (A2 * gain_W_per_A2 + over_magnet_K * to_magnet - magnet_K * magnet_to_housing);
      housing_degC += 0.005 / 18.0 *
                      (over_housing_K * to_housing + magnet_K * magnet_to_housing - (housing_degC - 25) * to_ambient);
    }
  }
};

TEST(Governor, AMagnetThatCurrentReachesThroughTheWindingIsHeldAtItsLimitWithoutChatter) {
  struct Case {
    double J_per_K, to_winding_W_per_K, gain_W_per_A2;
  };
  // The last one follows the winding within 0.3 s: the winding's own heat carries it over.
  for (const Case& c : {Case{3, 0.33, 0}, Case{3, 0.33, 1e-5}, Case{3, 0.33, 1e-3}, Case{3, 0.33, 1e-2},
                        Case{3, 0.33, 0.1}, Case{30, 0.33, 1e-2}, Case{0.5, 2, 3e-3}}) {
    using P = MagnetPlant;
    P plant{c.J_per_K, c.to_winding_W_per_K, c.gain_W_per_A2};
    const P cold = plant;
    thermal::HeatSet<double> set{};
    set.node_count = 3, set.link_count = 4, set.source_count = 2;
    set.nodes[0] = {1.13, 155}, set.nodes[1] = {18, inf}, set.nodes[2] = {c.J_per_K, 110};
    set.links[0] = {0, 1, thermal::LinkLaw::constant, P::to_housing, 0};
    set.links[1] = {0, 2, thermal::LinkLaw::constant, c.to_winding_W_per_K, 0};
    set.links[2] = {2, 1, thermal::LinkLaw::constant, P::magnet_to_housing, 0};
    set.links[3] = {1, thermal::boundary_end(thermal::Boundary::ambient), thermal::LinkLaw::constant, P::to_ambient, 0};
    set.sources[0] = {0, Drive::current_A2, 0.75, 0.00393};
    set.sources[1] = {2, Drive::current_A2, c.gain_W_per_A2, 0};
    set.housing = {1, 0, 0, 0};
    thermal::CoreEstimator core(set, Loop::exact());
    thermal::Governor governor(GovernorSettings{});
    std::mt19937 seed(3);
    std::normal_distribution<float> noise(0.0f, 0.1f);
    float allowance_A = 20, largest_step_A = 0;
    double hottest_degC = 0, sum_A = 0;
    for (int i = 0; i < 60000; ++i) {
      const double A2 = static_cast<double>(allowance_A) * static_cast<double>(allowance_A);
      plant.advance(A2, 0.01);
      HeatInput<> input;
      input[Drive::current_A2] = A2;
      core.tick(input, {static_cast<float>(plant.housing_degC) + noise(seed), true}, {25.0f, true});
      const float last_A = allowance_A;
      allowance_A = governor.tick(core).current_A;
      hottest_degC = std::max(hottest_degC, plant.magnet_degC);
      if (i < 30000) continue;
      largest_step_A = std::max(largest_step_A, std::abs(allowance_A - last_A));
      sum_A += static_cast<double>(allowance_A);
    }
    double none_A = 0, burns_A = 20;  // the largest steady current
    for (int i = 0; i < 12; ++i) {
      P steady = cold;
      const double middle_A = 0.5 * (none_A + burns_A);
      for (int s = 0; s < 3000 && steady.magnet_degC < 200; ++s) steady.advance(middle_A * middle_A, 1);
      (steady.magnet_degC < 110 ? none_A : burns_A) = middle_A;
    }
    std::printf(
        "  magnet of %g J/K, %g W/K to the winding, %g W/A^2: %.1f %% of the steady current, hottest %.2f degC, "
        "largest step %.4f A\n",
        c.J_per_K, c.to_winding_W_per_K, c.gain_W_per_A2, 100 * sum_A / 30000 / none_A, hottest_degC,
        static_cast<double>(largest_step_A));
    EXPECT_LE(largest_step_A, 0.05f);
    EXPECT_GE(sum_A / 30000, 0.97 * none_A);
    EXPECT_LE(hottest_degC, 110.5);
  }
}

TEST(Governor, ABrokenEstimateAllowsNothingAndSaysBlind) {
  Loop loop(reference::ec16(), 20, 25);
  loop.core.raise_to(400);
  EXPECT_EQ(loop.governor.tick(loop.core).current_A, 0.0f);
  thermal::HeatSet<double> set = thermal::three_phase_set(reference::ec16());
  set.nodes[0].max_degC = std::nanf("");  // validate() would refuse it
  thermal::CoreEstimator core(set, Loop::exact());
  EXPECT_EQ(thermal::Governor(GovernorSettings{}).tick(core).current_A, 0.0f);
}

TEST(Governor, NeighboursThatWillCoolANodeGiveItNoMoreThanItHas) {
  // 1 K of room and 3 K of neighbours that are colder than the limit: 0.1 and 0.3 of the most within soft_K.
  const NodeBudget magnet{100.0f, 0.1f, 3.0f, 0.0f, 1.0f};
  EXPECT_NEAR(thermal::allowed_current_A(99.0f, magnet, {}), (0.1f + 0.3f) * 20.0f, 0.01f);
}

TEST(Governor, WhatTurningAddsToCopperCountsAgainstTheCurrent) {
  thermal::HeatSet<double> set = thermal::three_phase_set(reference::ec16());
  const auto budget = [&] {
    thermal::CoreEstimator core(set, Loop::exact());
    HeatInput<> input;
    input[Drive::current_A] = 4;
    thermal::set_speed(input, 100);
    core.tick(input, {25.0f, true});
    return thermal::node_budget(core, 0, {{0.5f, 0.5f, 0.5f}});
  };
  const NodeBudget plain = budget();
  set.sources[set.source_count++] = {0, Drive::current2_speed2, 1e-5, 0.0};  // 0.1 W for each A^2 at that speed
  const NodeBudget turning = budget();
  EXPECT_NEAR(turning.gain_W_per_A2, plain.gain_W_per_A2 + 0.1f, 1e-4f);
  EXPECT_NEAR(turning.hold_W, plain.hold_W, 1e-3f) << "and is not taken off twice";
}

/// More than the winding can give away: the bridge may switch now and then only, and each time it heats.
TEST(Governor, WhatHeatsWhileTheBridgeSwitchesIsCountedBeforeItDoes) {
  for (const double switching_W : {8.0, 20.0, 40.0}) {
    thermal::HeatSet<double> set = thermal::three_phase_set(reference::ec16());
    for (std::int8_t k = 0; k < 3; ++k) set.sources[set.source_count++] = {k, Drive::enabled, switching_W / 3, 0.0};
    thermal::CoreEstimator core(set, Loop::exact());
    thermal::Governor governor(Loop::settings(20));
    float allowance_A = 20;
    double hottest_degC = 0;
    for (int i = 0; i < 60000; ++i) {
      HeatInput<> input;
      for (int k = 0; k < 3; ++k)
        input[thermal::phase_drive(k)] = 0.5 * static_cast<double>(allowance_A) * static_cast<double>(allowance_A);
      input[Drive::enabled] = allowance_A > 0 ? 1 : 0;
      hottest_degC = std::max(hottest_degC, core.tick(input, {}, {25.0f, true}).hottest_degC());
      allowance_A = governor.tick(core).current_A;
    }
    EXPECT_LE(hottest_degC, 155.5) << switching_W;
    EXPECT_GT(hottest_degC, 150) << "the limit was never near, so nothing was shown";
  }
}

TEST(Governor, WithoutCurrentEachPhaseCountsAsTheHottest) {
  const auto shares = thermal::phase_shares({});
  for (float k : shares.k) EXPECT_EQ(k, 1.0f);
  HeatInput<> input;
  input[Drive::phase_a_A2] = 100, input[Drive::phase_b_A2] = input[Drive::phase_c_A2] = 25;
  EXPECT_FLOAT_EQ(thermal::phase_shares(input).k[0], 1.0f);
  EXPECT_FLOAT_EQ(thermal::phase_shares(input).k[1], 0.25f);
  input[Drive::phase_a_A2] = std::nan("");
  EXPECT_EQ(thermal::phase_shares(input).k[1], 1.0f);
}

}  // namespace

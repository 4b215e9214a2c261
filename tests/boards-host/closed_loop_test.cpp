// SPDX-License-Identifier: MIT
// The firmware on simulated boards, judged by what the simulated windings really did.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "boards/host/run_scene.hpp"
#include "boards/host/scene.hpp"
#include "host-sim/plant/heat.hpp"
#include "thermal/core_estimator.hpp"
#include "thermal/losses.hpp"
#include "thermal/motor_set.hpp"
#include "wire/pc/motor_file.hpp"

namespace {

using boards::host::Limiter;
using boards::host::Result;
using boards::host::Row;
using boards::host::Scene;
using boards::host::Trace;

constexpr double overshoot_K = 3;  // of the true winding, no fault, true parameters (safety.md)
constexpr double share_of_optimum = 0.95;

Result play(const std::string& name, const std::vector<std::string>& overrides = {},
            std::vector<Limiter> limiters = {Limiter::governor}) {
  Scene scene = boards::host::read_scene(name, HOTCORE_SOURCE_DIR "/host-sim/scenes", overrides);
  scene.limiters = std::move(limiters);
  return boards::host::run_scene(scene, {.motor_folder = HOTCORE_SOURCE_DIR "/boards/motors"});
}

void expect_cool_and_unbroken(const Result& result, const std::string& what) {
  for (const Trace& trace : result.traces) {
    EXPECT_LE(trace.hottest_true_degC, result.winding_max_degC + overshoot_K) << what << ", axis " << trace.axis;
    EXPECT_GT(trace.impulse_As, 0) << what << ": nothing was delivered, so nothing was shown";
    for (const Row& row : trace.rows) ASSERT_EQ(row.fault, wire::Fault::none) << what << " at " << row.time_s << " s";
  }
}

/// While something is asked for: the smallest allowance, and its largest fall between two rows.
struct Allowed {
  double least_A = 1e9, steepest_A = 0;
};
Allowed allowed_in(const Trace& trace) {
  Allowed a;
  for (std::size_t i = 1; i < trace.rows.size(); ++i) {
    const Row &before = trace.rows[i - 1], &now = trace.rows[i];
    if (now.demand_A == 0 || before.demand_A == 0) continue;
    a.least_A = std::min(a.least_A, now.allowance_A);
    a.steepest_A = std::max(a.steepest_A, before.allowance_A - now.allowance_A);
  }
  return a;
}

TEST(ClosedLoop, NoFaultFreeSceneBurnsAWinding) {
  for (const char* name : {"jump", "get-up", "stall", "hold", "walk-loaded", "water-cooled"})
    expect_cool_and_unbroken(play(name), name);
}

TEST(ClosedLoop, ABlockedRotorIsSafeAtEveryAngle) {
  double hottest_degC = 0;
  for (int k = 0; k < 36; ++k) {
    const std::string angle = "shaft.angle_rad=" + std::to_string(k * 2 * M_PI / 36);
    const Result result = play("stall", {angle, "seconds=6", "seed=" + std::to_string(k)});
    expect_cool_and_unbroken(result, angle);
    hottest_degC = std::max(hottest_degC, result.traces[0].hottest_true_degC);
  }
  RecordProperty("hottest_degC", std::to_string(hottest_degC));
  EXPECT_GT(hottest_degC, 150) << "the limit was never reached, so nothing was shown";
}

/// There the ripple of a bridge that holds zero amperes is more than a small motor can stand for ever.
TEST(ClosedLoop, AFreeRotorAtTheVoltagesEndIsNotBurntByRipple) {
  Scene scene =
      boards::host::read_scene("stall", HOTCORE_SOURCE_DIR "/host-sim/scenes", {"seconds=60", "start_degC=152"});
  scene.shaft.kind = boards::host::Shaft::Kind::free;
  scene.demands = {{0, 0.5, 60, 2, 0, 0}};
  const Result result = boards::host::run_scene(scene, {.motor_folder = HOTCORE_SOURCE_DIR "/boards/motors"});
  expect_cool_and_unbroken(result, "free");
  EXPECT_GT(result.traces[0].hottest_true_degC, 154) << "the limit was never reached, so nothing was shown";
}

TEST(ClosedLoop, TheLargeMotorIsSafeWhenBlockedOnTheLargeBoard) {
  for (const char* motor : {"motor=ec-powermax-30-24v", "motor=ec-powermax-30-48v"}) {
    for (int k = 0; k < 6; ++k) {
      Scene scene = boards::host::read_scene(
          "stall", HOTCORE_SOURCE_DIR "/host-sim/scenes",
          {motor, "board=h8-17.5d", "seconds=8", "shaft.angle_rad=" + std::to_string(k * 0.17)});
      scene.demands[0].current_A = 80;
      const Result result = boards::host::run_scene(scene, {.motor_folder = HOTCORE_SOURCE_DIR "/boards/motors"});
      expect_cool_and_unbroken(result, motor);
    }
  }
}

/// What both axes brake at once has to stay in the bus' own capacitors: the current loops take their time, so it passes
/// the end of derating, but not the trip. 1700 rad/s is nearly the fastest that 48 V can turn this motor.
TEST(ClosedLoop, BothAxesBrakingOnASupplyThatTakesNothingBackDoNotTrip) {
  double highest_V = 0;
  for (const double speed_rad_per_s : {600.0, 1200.0, 1600.0, 1700.0}) {
    Scene scene = boards::host::read_scene("jump", HOTCORE_SOURCE_DIR "/host-sim/scenes",
                                           {"motor=ec-powermax-30-48v", "seconds=0.6"});
    scene.supply_sinks = false;
    scene.shaft = {};
    scene.shaft.kind = boards::host::Shaft::Kind::imposed;
    scene.shaft.speed_amplitude_rad_per_s = speed_rad_per_s;  // from rest, where the offsets are learnt
    scene.shaft.frequency_Hz = 0.5;
    scene.demands.clear();
    for (int axis = 0; axis < 2; ++axis) {
      scene.demands.push_back({axis, 0.4, 0.5, 15.0, 0, 0});
      scene.demands.push_back({axis, 0.5, 0.6, -20.0, 0, 0});
    }
    const Result result = boards::host::run_scene(scene, {.motor_folder = HOTCORE_SOURCE_DIR "/boards/motors"});
    for (const Trace& trace : result.traces) {
      for (const Row& row : trace.rows) {
        highest_V = std::max(highest_V, row.bus_V);
        ASSERT_EQ(row.fault, wire::Fault::none) << speed_rad_per_s << " rad/s at " << row.time_s << " s";
      }
    }
  }
  RecordProperty("highest_V", std::to_string(highest_V));
  EXPECT_GT(highest_V, 1.13 * 48) << "nothing was derated, so nothing was shown";
  EXPECT_LT(highest_V, 58.0);
}

TEST(ClosedLoop, JumpGivesThreeHundredWattsAndNearlyAllOfTheOptimum) {
  const Result result = play("jump");
  EXPECT_GT(result.traces[0].peak_shaft_W, 300);
  EXPECT_LT(result.traces[0].hottest_true_degC, result.winding_max_degC);
  EXPECT_GE(result.traces[0].impulse_As, share_of_optimum * result.optimal_impulse_As);
}

TEST(ClosedLoop, JumpBurnsTheWindingUnderAHousingLimitAndIsImpossibleUnderARatedLimit) {
  const Result result = play("jump", {}, {Limiter::housing, Limiter::rated});
  EXPECT_GT(result.traces[0].hottest_true_degC, result.winding_max_degC + 30);
  EXPECT_LT(result.traces[1].peak_shaft_W, 40);
}

TEST(ClosedLoop, GetUpComesDownSmoothlyWhereTheHardCutDropsTheRobot) {
  const Result result = play("get-up", {"log_Hz=100"}, {Limiter::governor, Limiter::hard_cut});
  const Trace& ours = result.traces[0];
  EXPECT_GE(ours.impulse_As, share_of_optimum * result.optimal_impulse_As);
  EXPECT_LT(result.traces[1].impulse_As, 0.8 * result.optimal_impulse_As);
  const Allowed allowed = allowed_in(ours);
  EXPECT_LT(allowed.steepest_A, 0.02 * 20) << "the allowance may fall by 2 % of the peak in 10 ms";
  EXPECT_GT(allowed.least_A, 8) << "what the winding can hold at 300 rad/s is about 9 A";
  bool fell = false;
  for (const Row& row : result.traces[1].rows)
    fell = fell || (row.demand_A > 0 && std::abs(row.iq_now_A) < 1 && row.time_s > 0.5);
  EXPECT_TRUE(fell) << "the paper's cut takes all current away";
}

/// The power stage of a large board is a large one too, and a board that is warm holds back without steps.
TEST(ClosedLoop, ACooledMotorGetsOfALargeBoardAllThatItsWindingCanStand) {
  const Result result = play("water-cooled", {"log_Hz=100"});
  const Trace& ours = result.traces[0];
  EXPECT_GE(ours.impulse_As, share_of_optimum * result.optimal_impulse_As);
  const Allowed allowed = allowed_in(ours);
  EXPECT_LE(allowed.steepest_A, 0.02 * 80) << "the allowance may fall by 2 % of the peak in 10 ms";
  EXPECT_GT(allowed.least_A, 31.2 * 0.9);
}

TEST(ClosedLoop, NotKnowingTheMotorCostsImpulseNotTheMotor) {
  const Result exact = play("get-up"), sheet = play("get-up", {"trust=sheet"});
  expect_cool_and_unbroken(sheet, "trust=sheet");
  EXPECT_LT(sheet.traces[0].hottest_true_degC, exact.traces[0].hottest_true_degC - 10);
  EXPECT_LT(sheet.traces[0].impulse_As, exact.traces[0].impulse_As);
}

/// Sensor set B: a driver that reports no phase currents, only what it draws from the bus.
TEST(ClosedLoop, BusReadingsAloneFollowTheWindingOnTheHotSide) {
  const Result result = play("get-up", {"log_Hz=100", "seconds=3.5"});
  const wire::pc::MotorFile file = wire::pc::read_motor("ec-16-40w", HOTCORE_SOURCE_DIR "/boards/motors");
  const wire::Motor known = host_sim::true_sheet(file.motor, host_sim::heat_from_sheet(file.motor));
  thermal::CoreEstimator core(thermal::two_resistor_set(known), {.trust = thermal::exact_trust});
  const auto as_float = [](double x) { return static_cast<float>(x); };
  const float Ke_Vs = as_float(std::sqrt(3.0) * known.pole_pairs * known.flux_linkage_Wb);
  for (const Row& row : result.traces[0].rows) {
    thermal::HeatInput<> input;
    input[thermal::Drive::power_W] = static_cast<double>(thermal::bus_power_W(
        as_float(row.depth_ratio), as_float(row.bus_V), as_float(row.bus_A), Ke_Vs, as_float(row.speed_rad_per_s)));
    const double estimate_degC =
        core.tick(input, {as_float(row.housing_degC), true}, {as_float(row.ambient_degC), true}).hottest_degC();
    if (row.time_s < 0.6) continue;  // the first reading of the housing has to be heard
    EXPECT_GT(estimate_degC, row.true_winding_degC - 5) << "at " << row.time_s << " s";
    EXPECT_LT(estimate_degC, row.true_winding_degC + 40) << "at " << row.time_s << " s";
  }
}

TEST(ClosedLoop, TheSameSeedGivesTheSameLogAndAnotherSeedAnother) {
  const auto log = [](const std::string& seed) {
    const Result result = play("jump", {seed});
    return boards::host::csv(result, result.traces[0]);
  };
  const std::string once = log("seed=11");
  EXPECT_EQ(once, log("seed=11"));
  EXPECT_NE(once.substr(once.find('\n')), log("seed=12").substr(once.find('\n')));
}

}  // namespace

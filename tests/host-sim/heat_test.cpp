// SPDX-License-Identifier: MIT
#include "host-sim/plant/heat.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "host-sim/plant/stove.hpp"
#include "tests/host-sim/plant_fixtures.hpp"

namespace {

using host_sim::HeatDetail;
using host_sim::HeatDrive;
using host_sim::HeatOptions;
using host_sim::HiddenEffects;
using host_sim::Place;
using host_sim::Stove;
using host_sim::TwoResistor;

HeatDrive copper(double watts) {
  HeatDrive drive;
  drive.copper_W.fill(watts / 3);
  return drive;
}

void run(Stove& stove, const HeatDrive& drive, double seconds, double step_s = 0.02) {
  for (int n = 0; n < seconds / step_s; ++n) stove.advance(step_s, drive);
}

TEST(Heat, ReductionGivesTheSheetBack) {
  for (const char* id : {"ec-16-40w", "ec-powermax-30-24v"}) {
    const wire::Motor sheet = plant_tests::sheet(id);
    for (const double rotor : {0.0, 0.08}) {
      HeatOptions options;
      options.rotor_share_of_C2 = rotor;
      const TwoResistor seen = host_sim::reduced(host_sim::heat_from_sheet(sheet, options));
      EXPECT_NEAR(seen.R1_K_per_W, sheet.R1_K_per_W, 1e-9 * sheet.R1_K_per_W);
      EXPECT_NEAR(seen.R2_K_per_W, sheet.R2_K_per_W, 1e-9 * sheet.R2_K_per_W);
      EXPECT_NEAR(seen.C1_J_per_K, sheet.C1_J_per_K, 1e-6 * sheet.C1_J_per_K);
      EXPECT_NEAR(seen.C2_J_per_K, sheet.C2_J_per_K, 1e-6 * sheet.C2_J_per_K);
      EXPECT_NEAR(seen.phase_coupling_W_per_K, 0.1 / sheet.R1_K_per_W, 1e-9);
    }
  }
}

TEST(Heat, ReductionNoticesAChangeOfAnyPart) {  // a reduction that echoes the sheet would pass the test above
  const HeatDetail detail = host_sim::heat_from_sheet(plant_tests::small_motor());
  const TwoResistor before = host_sim::reduced(detail);
  HeatDetail changed = detail;
  changed.teeth_to_yoke_W_per_K *= 0.5;
  EXPECT_NEAR(host_sim::reduced(changed).R1_K_per_W, before.R1_K_per_W * 1.04, 1e-9);
  changed = detail;
  changed.phase_J_per_K *= 1.1;
  EXPECT_NEAR(host_sim::reduced(changed).C1_J_per_K / before.C1_J_per_K, 1.1, 0.02);
  changed = detail;
  changed.frame_J_per_K *= 2;
  EXPECT_GT(host_sim::reduced(changed).C2_J_per_K, 1.15 * before.C2_J_per_K);
}

TEST(Heat, SheetCouplingOverridesTheDefault) {
  wire::Motor sheet = plant_tests::small_motor();
  sheet.phase_coupling_W_per_K = 0.3;
  EXPECT_NEAR(host_sim::reduced(host_sim::heat_from_sheet(sheet)).phase_coupling_W_per_K, 0.3, 1e-9);
  EXPECT_NEAR(host_sim::true_sheet(sheet, host_sim::heat_from_sheet(sheet)).phase_coupling_W_per_K, 0.3, 1e-9);
}

TEST(Stove, SettlesWhereTheSheetSays) {
  const wire::Motor sheet = plant_tests::small_motor();
  Stove stove(host_sim::heat_from_sheet(sheet), {}, 1);
  run(stove, copper(4), 12 * 294, 0.05);
  EXPECT_NEAR(stove.degC(Place::housing), 25 + 4 * sheet.R2_K_per_W, 0.01);
  EXPECT_NEAR(stove.winding_degC(), 25 + 4 * (sheet.R1_K_per_W + sheet.R2_K_per_W), 0.01);
}

TEST(Stove, LiquidCoolingSettlesAtItsOwnResistance) {
  const wire::Motor sheet = plant_tests::low_inductance_motor();
  HeatOptions options;
  options.coolant_R2_K_per_W = 0.0954;  // thermal.md: 200 W motor, five times
  Stove stove(host_sim::heat_from_sheet(sheet, options), {}, 1);
  run(stove, copper(400), 600);
  EXPECT_NEAR(stove.winding_degC(), 25 + 400 * (0.209 + 0.0954), 0.05);
}

TEST(Stove, WindingRisesWithTheSheetsTimeConstants) {
  const wire::Motor sheet = plant_tests::low_inductance_motor();
  Stove stove(host_sim::heat_from_sheet(sheet), {}, 1);
  const double tau_s = sheet.R1_K_per_W * sheet.C1_J_per_K, watts = 200;
  run(stove, copper(watts), 0.1 * tau_s, 0.001);
  EXPECT_NEAR(stove.winding_degC() - 25, watts * 0.1 * tau_s / sheet.C1_J_per_K,
              0.06 * watts * 0.1 * tau_s / sheet.C1_J_per_K);
  run(stove, copper(watts), 0.9 * tau_s, 0.001);
  const double gap_K = stove.winding_degC() - stove.degC(Place::housing);
  EXPECT_NEAR(gap_K / (watts * sheet.R1_K_per_W), 1 - std::exp(-1.0), 0.05);
}

TEST(Stove, StoredPlusOutflowIsHeatIn) {
  const HeatDetail detail = host_sim::heat_from_sheet(plant_tests::small_motor());
  HiddenEffects hidden;
  hidden.convection_exponent = 0.25;
  hidden.radiation_W_per_K = 0.02;
  hidden.third_mass_J_per_K = 10;
  hidden.hot_spot_J_per_K = 0.3;
  hidden.hot_spot_share = 0.3;
  hidden.constant_heat_W = 1;
  Stove stove(detail, hidden, 1);
  const double start_J = stove.stored_J();
  run(stove, copper(8), 500, 0.05);
  EXPECT_NEAR(stove.stored_J() - start_J + stove.outflow_J(), stove.heat_J(), 1e-9 * stove.heat_J());
  EXPECT_NEAR(stove.hidden_J(), 500, 1e-6);
}

TEST(Stove, OneMillisecondAndFiftyAgree) {
  const HeatDetail detail = host_sim::heat_from_sheet(plant_tests::small_motor());
  Stove fine(detail, {}, 1), coarse(detail, {}, 1);
  for (int n = 0; n < 200; ++n) {
    const HeatDrive drive = copper(n % 40 < 3 ? 200 : 2);
    for (int part = 0; part < 50; ++part) fine.advance(0.001, drive);
    coarse.advance(0.05, drive);
    ASSERT_NEAR(fine.winding_degC(), coarse.winding_degC(), 1e-3);
  }
}

TEST(Stove, ConvectionExponentMatchesItsClosedForm) {
  wire::Motor sheet = plant_tests::small_motor();
  HeatOptions options;
  options.frame_share_of_cooling = 0.01;  // nearly all from the housing
  HiddenEffects hidden;
  hidden.convection_exponent = 0.25;
  Stove stove(host_sim::heat_from_sheet(sheet, options), hidden, 1);
  run(stove, copper(4), 4000, 0.05);
  // G (dT/20)^0.25 dT = P
  EXPECT_NEAR(stove.degC(Place::housing) - 25, std::pow(4 * sheet.R2_K_per_W * std::pow(20, 0.25), 1 / 1.25), 0.05);
}

/// The plain board's view in this test's own words: three phases and a housing, straight Euler at 1 ms.
struct PlainObserver {
  TwoResistor r;
  double ohm, coefficient_per_K;
  std::array<double, 4> T{};
  void advance(double h_s, const std::array<double, 3>& squared_A2) {
    for (int part = 0; part < std::lround(h_s / 0.001); ++part) {
      std::array<double, 4> watts{};
      for (int k = 0; k < 3; ++k) {
        const int next = (k + 1) % 3;
        watts[k] += squared_A2[k] * ohm * (1 + coefficient_per_K * (T[k] - 25));
        const double down_W = (T[k] - T[3]) / (3 * r.R1_K_per_W),
                     across_W = r.phase_coupling_W_per_K * (T[k] - T[next]);
        watts[k] -= down_W + across_W;
        watts[next] += across_W;
        watts[3] += down_W;
      }
      watts[3] -= (T[3] - 25) / r.R2_K_per_W;
      for (int k = 0; k < 3; ++k) T[k] += 0.001 * watts[k] / (r.C1_J_per_K / 3);
      T[3] += 0.001 * watts[3] / r.C2_J_per_K;
    }
  }
  double hottest() const { return std::max({T[0], T[1], T[2]}); }
};

struct Gap {
  double above_K = 0, below_K = 0;  // plant over observer, observer over plant
};

/// Heats to the limit with a multiple of the rated amplitude and holds there, as the observer sees it.
Gap follow(const wire::Motor& sheet, const HeatOptions& options, double amplitude_A, int angle_of_36, double start_degC,
           double coupling_factor = 1) {
  const HeatDetail detail = host_sim::heat_from_sheet(sheet, options);
  Stove stove(detail, {}, 1);
  stove.soak(start_degC);
  PlainObserver observer{host_sim::reduced(detail), sheet.phase_resistance_ohm, sheet.copper_coefficient_per_K, {}};
  observer.r.phase_coupling_W_per_K *= coupling_factor;
  observer.T.fill(start_degC);
  Gap gap;
  for (int n = 0; n < 3000; ++n) {
    const double left_K = sheet.winding_max_degC - observer.hottest();
    const double amps = amplitude_A * std::clamp(left_K / 2, 0.0, 1.0);
    HeatDrive drive;
    std::array<double, 3> squared_A2;
    for (int k = 0; k < 3; ++k) {
      const double along = std::cos(2 * host_sim::pi * (angle_of_36 / 36.0 - k / 3.0));
      squared_A2[k] = amps * amps * (angle_of_36 < 0 ? 0.5 : along * along);
      drive.copper_W[k] = squared_A2[k] * stove.phase_ohm(k, 0);
    }
    stove.advance(0.01, drive);
    observer.advance(0.01, squared_A2);
    gap.above_K = std::max(gap.above_K, stove.hottest_degC() - observer.hottest());
    gap.below_K = std::max(gap.below_K, observer.hottest() - stove.hottest_degC());
  }
  return gap;
}

double rated_A(const wire::Motor& m) {
  const double rise_K = m.winding_max_degC - 25;
  return std::sqrt(rise_K / ((m.R1_K_per_W + m.R2_K_per_W) * 1.5 * m.phase_resistance_ohm *
                             (1 + m.copper_coefficient_per_K * rise_K)));
}

TEST(Stove, HottestWindingStaysWithinTwoKelvinOfAPlainObserver) {
  Gap worst;
  for (const char* id : {"ec-16-40w", "ec-powermax-30-24v"}) {
    const wire::Motor sheet = plant_tests::sheet(id);
    for (const double times : {2.0, 5.0, 9.0}) {
      for (int angle = -1; angle < 36; angle += angle < 0 ? 1 : 3) {
        const Gap gap = follow(sheet, {}, times * rated_A(sheet), angle, times > 5 ? 80 : 25);
        worst.above_K = std::max(worst.above_K, gap.above_K);
        worst.below_K = std::max(worst.below_K, gap.below_K);
      }
    }
  }
  RecordProperty("plant_above_observer_mK", static_cast<int>(1000 * worst.above_K));
  RecordProperty("observer_above_plant_mK", static_cast<int>(1000 * worst.below_K));
  std::printf("plant over plain observer %.2f K, observer over plant %.2f K\n", worst.above_K, worst.below_K);
  EXPECT_LT(worst.above_K, 2);
  EXPECT_LT(worst.below_K, 2.5);
}

TEST(Stove, AnObserverWithTooTightPhasesMissesTheHotOne) {  // so that the test above can fail
  const wire::Motor sheet = plant_tests::small_motor();
  EXPECT_GT(follow(sheet, {}, 5 * rated_A(sheet), 0, 25, 100).above_K, 10);
}

TEST(Stove, StalledPhaseStandsAboveTheMeanByTheClosedForm) {
  const wire::Motor sheet = plant_tests::small_motor();
  const HeatDetail detail = host_sim::heat_from_sheet(sheet);
  Stove stove(detail, {}, 1);
  HeatDrive drive;
  drive.copper_W = {4 * 2 / 3., 4 / 6., 4 / 6.};
  run(stove, drive, 60);
  const TwoResistor r = host_sim::reduced(detail);
  const double expected_K = 4 / 3. / (1 / (3 * r.R1_K_per_W) + 3 * r.phase_coupling_W_per_K);
  EXPECT_NEAR(stove.degC(Place::phase_a) - stove.winding_degC(), expected_K, 1e-3);
  EXPECT_NEAR(stove.degC(Place::phase_b), stove.degC(Place::phase_c), 1e-9);
}

}  // namespace

// SPDX-License-Identifier: MIT
#include "host-sim/plant/bench.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "tests/host-sim/plant_fixtures.hpp"

namespace {

using host_sim::Bench;
using host_sim::BenchDesign;
using host_sim::EnergyLedger;
using host_sim::Load;
using plant_tests::period_s;

constexpr hal::Duty released = {{0, 0, 0}, false};

double spent_J(const EnergyLedger& e) {
  return e.supply_loss_J + e.capacitor_J + e.bridge_J + e.copper_J + e.iron_J + e.friction_J + e.shaft_J + e.short_J +
         e.field_J + e.kinetic_J;
}

/// Accelerates and brakes both axes against loads; returns the worst imbalance of the whole plant over what was
/// supplied.
double worst_imbalance(BenchDesign design, int periods) {
  for (host_sim::AxisDesign& axis : design.axes) {
    axis.motor.hysteresis_Nm = 3e-4;
    axis.motor.eddy_Nm_s = 3e-7;
    axis.motor.coulomb_Nm = 2e-4;
  }
  Bench bench(design, 3);
  for (int i = 0; i < 2; ++i) {
    bench.load(i).inertia_kg_m2 = 3e-7;
    bench.load(i).viscous_Nm_s = 1e-5;
  }
  const double start_J = spent_J(bench.energy());
  double worst_J = 0;
  for (int n = 0; n < periods; ++n) {
    std::array<hal::Duty, 2> duty;
    for (int i = 0; i < 2; ++i) {
      const host_sim::Motor& motor = bench.motor(i);
      const double emf_V = motor.design().pole_pairs * motor.speed_rad_per_s() * motor.flux_linkage_Wb();
      duty[i] = plant_tests::vector_duty(motor, 0, std::clamp(emf_V + ((n / 1500 + i) % 2 ? -3 : 4), -20.0, 20.0),
                                         bench.bus_V());
    }
    bench.advance_period(duty);
    worst_J = std::max(worst_J, std::fabs(spent_J(bench.energy()) - start_J - bench.energy().supply_J));
  }
  return worst_J / bench.energy().supply_J;
}

TEST(Bench, ElectricalInIsShaftPlusHeatPlusStoredToOneInAMillion) {
  BenchDesign design = plant_tests::bench_design(plant_tests::small_motor());
  EXPECT_LT(worst_imbalance(design, 20000), 1e-6);
  design.bridge.switched = true;
  EXPECT_LT(worst_imbalance(design, 6000), 1e-6);
  design = plant_tests::bench_design(plant_tests::low_inductance_motor());
  design.supply.can_sink = true;
  EXPECT_LT(worst_imbalance(design, 20000), 1e-6);
  design.bridge.switched = true;
  EXPECT_LT(worst_imbalance(design, 6000), 1e-6);
}

TEST(Bench, EveryJouleOfLossArrivesInAStove) {
  BenchDesign design = plant_tests::bench_design(plant_tests::small_motor());
  design.axes[0].motor.eddy_Nm_s = 1e-6;
  Bench bench(design, 3);
  const double stored_J = bench.stove(0).stored_J();
  bench.load(0).viscous_Nm_s = 1e-5;
  for (int n = 0; n < 20000; ++n) {
    bench.advance_period({plant_tests::vector_duty(bench.motor(0), 0, 6, bench.bus_V()), released});
  }
  const EnergyLedger e = bench.energy();
  EXPECT_NEAR(bench.stove(0).heat_J(), e.copper_J + e.iron_J + e.friction_J, 1e-9 * e.copper_J);
  EXPECT_NEAR(bench.stove(0).stored_J() - stored_J + bench.stove(0).outflow_J(), bench.stove(0).heat_J(),
              1e-9 * bench.stove(0).heat_J());
  EXPECT_GT(e.iron_J, 0);
}

TEST(Bench, BrakingAgainstASupplyThatCannotSinkPumpsTheBus) {
  Bench bench(plant_tests::bench_design(plant_tests::small_motor()), 1);
  bench.load(0).inertia_kg_m2 = 1e-5;
  for (int n = 0; n < 8000; ++n) {
    bench.advance_period({plant_tests::vector_duty(bench.motor(0), 0, 12, bench.bus_V()), released});
  }
  ASSERT_GT(bench.truth(0).speed_rad_per_s, 1000);
  const double supply_J = bench.energy().supply_J, capacitor_J = bench.energy().capacitor_J;
  const double kinetic_J = bench.energy().kinetic_J;
  for (int n = 0; n < 400; ++n) {
    const double emf_V = bench.motor(0).speed_rad_per_s() * bench.motor(0).flux_linkage_Wb();
    bench.advance_period({plant_tests::vector_duty(bench.motor(0), 0, 0.6 * emf_V, bench.bus_V()), released});
  }
  EXPECT_GT(bench.bus_V(), 50);
  EXPECT_NEAR(bench.energy().supply_J, supply_J, 0.1);  // it gave nothing more but the first instant
  EXPECT_LT(bench.energy().capacitor_J - capacitor_J, kinetic_J - bench.energy().kinetic_J);
}

TEST(Bench, StalledRotorHeatsOnePhaseLikeTheCosineSquared) {
  BenchDesign design = plant_tests::bench_design(plant_tests::small_motor());
  for (auto& axis : design.axes) axis.motor.copper_coefficient_per_K = axis.heat.copper_coefficient_per_K = 0;
  Bench bench(design, 1);
  bench.load(0).mode = Load::Mode::locked;
  // Current vector on phase a: i_a = i, i_b = i_c = -i/2: heats 4 : 1 : 1, two thirds of all in one phase.
  for (int n = 0; n < 200; ++n) bench.advance_period({hal::Duty{{0.6f, 0.5f, 0.5f}, true}, released});
  const auto before = bench.motor(0).work().copper_J;
  for (int n = 0; n < 2000; ++n) bench.advance_period({hal::Duty{{0.6f, 0.5f, 0.5f}, true}, released});
  const auto after = bench.motor(0).work().copper_J;
  EXPECT_NEAR((after[0] - before[0]) / (after[1] - before[1]), 4, 0.01);
  EXPECT_GT(bench.truth(0).phase_degC[0], bench.truth(0).phase_degC[1] + 1);
  EXPECT_EQ(bench.truth(0).hottest_degC, bench.truth(0).phase_degC[0]);
}

TEST(Bench, ResistanceRisesAsTheWindingWarms) {
  BenchDesign design = plant_tests::bench_design(plant_tests::small_motor());
  design.bridge.dead_time_s = 0;  // its error does not warm
  Bench bench(design, 1);
  bench.load(0).mode = bench.load(1).mode = Load::Mode::locked;
  bench.stove(0).soak(125);
  for (int n = 0; n < 200; ++n) {
    const hal::Duty duty = {{0.52f, 0.49f, 0.49f}, true};
    bench.advance_period({duty, duty});
  }
  const double ratio = bench.truth(1).current_A[0] / bench.truth(0).current_A[0];
  const double bridge_ohm = 0.01;  // does not warm here
  EXPECT_NEAR(ratio, (0.5 * 1.393 + bridge_ohm) / (0.5 + bridge_ohm), 0.01);
}

TEST(Bench, SameSeedSameBitsOtherSeedOtherNoise) {
  const BenchDesign design = plant_tests::bench_design(plant_tests::small_motor());
  Bench one(design, 42), two(design, 42), other(design, 43);
  int different = 0;
  for (int n = 0; n < 2000; ++n) {
    const std::array<hal::Duty, 2> duty = {plant_tests::vector_duty(one.motor(0), 0, 3, 48),
                                           hal::Duty{{0.51f, 0.5f, 0.49f}, true}};
    one.advance_period(duty);
    two.advance_period(duty);
    other.advance_period(duty);
    ASSERT_EQ(std::memcmp(one.raw(0).current_counts.data(), two.raw(0).current_counts.data(), 6), 0);
    ASSERT_EQ(one.truth(1).hottest_degC, two.truth(1).hottest_degC);
    different += one.raw(0).current_counts != other.raw(0).current_counts;
  }
  EXPECT_GT(different, 500);
  EXPECT_EQ(one.truth(0).hottest_degC, other.truth(0).hottest_degC);  // noise is in the sensors, not in the plant
}

TEST(Bench, HiddenEffectsReachTheRawValues) {
  BenchDesign design = plant_tests::bench_design(plant_tests::small_motor());
  design.sensors.current_noise_A = design.sensors.ntc_noise_K = 0;
  design.axes[0].hidden.current_offset_A = 2;
  design.axes[0].hidden.sensor_offset_K = 5;
  design.axes[1].hidden.current_gain = 1.25;
  design.axes[1].hidden.neighbour_W_per_K = 5;
  Bench bench(design, 1);
  bench.load(1).mode = Load::Mode::locked;
  bench.stove(0).soak(90);
  for (int n = 0; n < 4000; ++n) bench.advance_period({released, hal::Duty{{0.6f, 0.5f, 0.5f}, true}});
  const host_sim::SensorDesign& s = design.sensors;
  EXPECT_NEAR(bench.raw(0).current_counts[0], 2048 - 2 / s.current_A_per_count, 0.51);
  EXPECT_NEAR(bench.raw(0).current_counts[1], 2048 + 1 / s.current_A_per_count, 0.51);
  EXPECT_NEAR(bench.raw(0).housing_counts,
              host_sim::ntc_counts(s.housing, bench.truth(0).housing_degC + 5, s.adc_full_scale), 1);
  EXPECT_NEAR(bench.raw(1).current_counts[0], 2048 + bench.truth(1).current_A[0] / 1.25 / s.current_A_per_count, 0.51);
  EXPECT_GT(bench.truth(1).housing_degC, 27);  // 5 W/K from a neighbour at 90 degC for 0.2 s
}

/// Joules that a hidden effect and the copper took in 0.2 s at 1500 rad/s.
struct Hidden {
  double effect_J, copper_J;
};
Hidden turning_heat(const BenchDesign& design, double q_V) {
  Bench bench(design, 1);
  bench.load(0).mode = Load::Mode::imposed_speed;
  bench.load(0).speed_rad_per_s = 1500;
  bench.motor(0).place(0, 1500);
  for (int n = 0; n < 4000; ++n)
    bench.advance_period({plant_tests::vector_duty(bench.motor(0), 0, q_V, bench.bus_V()), released});
  return {bench.stove(0).hidden_J(), bench.energy().copper_J};
}

TEST(Bench, HiddenHeatGoesBySquaresWithTheRippleAndByMagnitudesWithoutIt) {
  BenchDesign design = plant_tests::bench_design(plant_tests::small_motor());
  for (auto& axis : design.axes) axis.heat.copper_coefficient_per_K = 0;
  const double emf_V = 1500 * design.axes[0].motor.pole_pairs * design.axes[0].motor.flux_linkage_Wb;
  const double winding_ohm = 1.5 * design.axes[0].heat.phase_resistance_ohm;
  design.axes[0].hidden.board_heat_ohm = 1;
  const Hidden square = turning_heat(design, emf_V + 0.5);
  EXPECT_NEAR(square.effect_J, square.copper_J / winding_ohm, 0.02 * square.effect_J);
  design.axes[0].hidden = {};
  design.axes[0].hidden.load_friction_W_s_per_A = 1e-3;
  const Hidden friction = turning_heat(design, emf_V + 0.5);
  const double all_A = std::sqrt(friction.copper_J / winding_ohm / 0.2);  // ripple included
  EXPECT_LT(friction.effect_J, 0.8 * 1e-3 * 1500 * all_A * 0.2);
  EXPECT_GT(friction.effect_J, 0.2 * 1e-3 * 1500 * all_A * 0.2);
}

TEST(Bench, PowerStageMeetsItsRatedRiseAndPole) {
  const host_sim::BridgeDesign bridge;
  const auto stage = host_sim::power_stage_from_rating(bridge, 48);
  EXPECT_EQ(stage.tau_s, 159);
  // 20 A for 15 s against 6 A for ever: the same rise if loss went with the square; the linear part makes it milder.
  const auto loss_W = [&](double amps) {
    return 1.5 * bridge.on_resistance_ohm * amps * amps +
           3 * 2 / host_sim::pi * amps * bridge.pwm_Hz *
               (48 * bridge.overlap_s + 2 * bridge.diode_V * bridge.dead_time_s);
  };
  EXPECT_NEAR(2 * stage.R_K_per_W * loss_W(6), 60, 1e-9);
  EXPECT_LT(2 * stage.R_K_per_W * loss_W(20) * (1 - std::exp(-15 / 159.0)), 60);
}

TEST(Bench, AShortBetweenLeadsShowsInTheSensorsAndOnTheBus) {
  Bench bench(plant_tests::bench_design(plant_tests::small_motor()), 1);
  bench.load(0).mode = Load::Mode::locked;
  bench.bridge(0).short_from = 0;
  bench.bridge(0).short_to = 2;
  bench.advance_period({hal::Duty{{0.52f, 0.5f, 0.48f}, true}, released});
  EXPECT_GT(bench.raw(0).current_counts[0], 3500);
  EXPECT_LT(bench.raw(0).current_counts[2], 600);
  EXPECT_LT(bench.bus_V(), 48);
}

}  // namespace

// SPDX-License-Identifier: MIT
#include "host-sim/plant/bridge.hpp"

#include <gtest/gtest.h>

#include <random>

#include "host-sim/plant/supply.hpp"
#include "tests/host-sim/plant_fixtures.hpp"

namespace {

using host_sim::Bridge;
using host_sim::BridgeDesign;
using host_sim::Load;
using host_sim::Motor;
using host_sim::MotorDesign;
using host_sim::Supply;
using host_sim::SupplyDesign;
using plant_tests::period_s;

MotorDesign smooth_motor() {  // a longer time constant, so that ripple is a triangle
  MotorDesign design = host_sim::motor_from_sheet(plant_tests::small_motor());
  design.inductance_d_H = design.inductance_q_H = 1e-3;
  return design;
}

struct Locked {
  Locked(const MotorDesign& design, const BridgeDesign& bridge_design)
      : motor(design, period_s), bridge(bridge_design) {
    motor.load.mode = Load::Mode::locked;
    ohm.fill(design.phase_resistance_ohm);
    motor.set_resistance(ohm, bridge_design.on_resistance_ohm);
  }
  void run(const hal::Duty& duty, double bus_V, int periods) {
    for (int n = 0; n < periods; ++n) bridge.advance(motor, duty, bus_V, ohm);
  }
  Motor motor;
  Bridge bridge;
  std::array<double, 3> ohm;
};

TEST(Bridge, RippleOfOnePhaseAgainstTwoIsTheTextbookTriangle) {
  // d (1-d) 2/3 V T / L peak to peak in the switching phase, its square over twelve is the mean square.
  for (const double d : {0.1, 0.5, 0.8}) {
    const double peak_to_peak = 2.0 / 3 * d * (1 - d);
    const auto share = host_sim::ripple_share({d, 0, 0});
    EXPECT_NEAR(share.square[0], peak_to_peak * peak_to_peak / 12, 1e-15);
    EXPECT_NEAR(share.square[1], share.square[0] / 4, 1e-15);
  }
  const auto none = host_sim::ripple_share({0.5, 0.5, 0.5}).square;
  EXPECT_EQ(none[0] + none[1] + none[2], 0);
}

TEST(Bridge, SwitchedBridgeShowsTheRippleHeatThatTheAveragedOneComputes) {
  for (const std::array<float, 3> ratio : {std::array{0.55f, 0.5f, 0.42f}, {0.9f, 0.3f, 0.5f}, {0.2f, 0.8f, 0.8f}}) {
    std::array<double, 2> heat_J{}, mean_heat_J{};
    for (const bool switched : {false, true}) {
      BridgeDesign design;
      design.dead_time_s = 0;
      design.switched = switched;
      Locked bench(smooth_motor(), design);
      bench.motor.set_resistance({0.5, 0.5, 0.5}, 0.01);
      bench.run({{ratio[0], ratio[1], ratio[2]}, true}, 48, 400);
      const auto before = bench.motor.work();
      const auto ripple_before = bench.bridge.work();
      bench.run({{ratio[0], ratio[1], ratio[2]}, true}, 48, 100);
      for (int k = 0; k < 3; ++k) {
        mean_heat_J[switched] += bench.motor.work().copper_J[k] - before.copper_J[k];
        heat_J[switched] += bench.bridge.work().ripple_J[k] - ripple_before.ripple_J[k];
      }
      heat_J[switched] += mean_heat_J[switched];
    }
    const double ripple_J = heat_J[0] - mean_heat_J[0];
    EXPECT_GT(ripple_J, 0);
    EXPECT_NEAR(heat_J[1] - mean_heat_J[0], ripple_J, 0.01 * ripple_J);
  }
}

TEST(Bridge, ASampleMissesOfTheHeatWhatItMissesOfItOnTheSwitchedBridge) {
  // The paper's motor: a period of 50 us beside L/R of 60 us, so that the sample in the zero vector is not the mean.
  double largest_miss = 0;
  for (const double dead_time_s : {0.0, 500e-9}) {
    for (const double rad_per_s : {0.0, 1000.0, 2000.0, 3500.0}) {
      for (const double q_A : {1.0, 2.0, 4.0, 6.0, 15.0}) {
        std::array<double, 2> share{};  // of the heat, that the square of the samples is
        for (const bool switched : {false, true}) {
          BridgeDesign design;
          design.dead_time_s = dead_time_s;
          design.switched = switched;
          plant_tests::Turning turning(plant_tests::small_motor(), design, rad_per_s);
          for (int n = 0; n < 3000; ++n) turning.period(q_A, 48);
          const double before_A2s = turning.true_A2s();
          double sampled_A2s = 0;
          for (int n = 0; n < 2000; ++n) {
            const std::array<double, 3> a = turning.sampled_A();
            sampled_A2s += (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]) / 1.5 * period_s;
            turning.period(q_A, 48);
          }
          share[switched] = sampled_A2s / (turning.true_A2s() - before_A2s);
        }
        // Where ripple turns the current round at an edge, dead time acts at times: the averaged bridge knows how far,
        // not when.
        const bool turned_round = dead_time_s > 0 && q_A < (rad_per_s > 1500 ? 5 : 1.5);
        EXPECT_NEAR(share[0], share[1], turned_round ? 0.015 : 0.003)
            << dead_time_s << " s, " << rad_per_s << " rad/s, " << q_A << " A";
        largest_miss = std::max(largest_miss, 1 - share[1]);
      }
    }
  }
  EXPECT_GT(largest_miss, 0.1) << "nothing was missed, so nothing was shown";
}

TEST(Bridge, RippleHeatOfALowInductanceMotorIsOfTheSizeTheDesignStates) {
  // thermal.md: +90 % at 30 uH for 48 V and 20 kHz beside the copper heat of a working current; here the absolute:
  // amperes.
  BridgeDesign design;
  Locked bench(host_sim::motor_from_sheet(plant_tests::small_motor()), design);
  bench.run({{0.7f, 0.5f, 0.3f}, true}, 48, 1);
  const double ripple_A2 = bench.bridge.work().ripple_A2s[0] / period_s;
  EXPECT_GT(std::sqrt(ripple_A2), 1);
  EXPECT_LT(std::sqrt(ripple_A2), 10);
}

TEST(Bridge, DeadTimeErrsByDutyTimesBusAgainstTheCurrentAndTheDiodesAddTheirDrop) {
  for (const bool switched : {false, true}) {
    BridgeDesign design;
    design.switched = switched;
    design.diode_V = switched ? 1.5 : 3;  // large, to be seen
    design.overlap_s = 0;
    Locked bench(smooth_motor(), design);
    bench.run({{0.6f, 0.45f, 0.45f}, true}, 48, 600);
    // Currents + - -: the error vector is (+1, -1, -1) dead V, 4/3 of it on phase a against its star.
    const double dead_V = design.dead_time_s * design.pwm_Hz * (48 + 2 * design.diode_V);
    const double wanted_V = 2.0 / 3 * (static_cast<double>(0.6f) - static_cast<double>(0.45f)) * 48;
    const double expected_A = (wanted_V - 4.0 / 3 * dead_V) / (0.5 + design.on_resistance_ohm);
    EXPECT_NEAR(bench.motor.current_A()[0], expected_A, 0.003 * expected_A) << switched;
    EXPECT_GT(std::fabs(wanted_V / (0.5 + design.on_resistance_ohm) - expected_A), 0.1 * expected_A);
  }
}

TEST(Bridge, DeadTimeLetsACurrentEndAndKeepsNoOscillationUp) {
  Locked bench(host_sim::motor_from_sheet(plant_tests::small_motor()), BridgeDesign{});
  bench.run({{0.52f, 0.5f, 0.5f}, true}, 48, 100);
  ASSERT_GT(bench.motor.current_A()[0], 0.1);
  bench.run({{0.5f, 0.5f, 0.5f}, true}, 48, 100);
  for (int n = 0; n < 4; ++n) {
    bench.run({{0.5f, 0.5f, 0.5f}, true}, 48, 1);
    EXPECT_NEAR(bench.motor.current_A()[0], 0, 1e-3);
  }
}

TEST(Bridge, SwitchedAndAveragedAgreeOnATurningMotor) {
  std::array<double, 2> speed_rad_per_s{}, copper_J{}, bus_J{};
  for (const bool switched : {false, true}) {
    BridgeDesign design;
    design.switched = switched;
    Motor motor(host_sim::motor_from_sheet(plant_tests::small_motor()), period_s);
    motor.load.inertia_kg_m2 = 2e-6;
    motor.load.viscous_Nm_s = 3e-5;
    motor.set_resistance({0.5, 0.5, 0.5}, design.on_resistance_ohm);
    Bridge bridge(design);
    for (int n = 0; n < 6000; ++n)
      bridge.advance(motor, plant_tests::vector_duty(motor, 0, 8, 24), 24, {0.5, 0.5, 0.5});
    speed_rad_per_s[switched] = motor.speed_rad_per_s();
    for (int k = 0; k < 3; ++k) copper_J[switched] += motor.work().copper_J[k] + bridge.work().ripple_J[k];
    bus_J[switched] = bridge.work().bus_J;
  }
  EXPECT_GT(speed_rad_per_s[0], 500);
  EXPECT_NEAR(speed_rad_per_s[0], speed_rad_per_s[1], 0.01 * speed_rad_per_s[1]);
  EXPECT_NEAR(copper_J[0], copper_J[1], 0.03 * copper_J[1]);
  EXPECT_NEAR(bus_J[0], bus_J[1], 0.015 * bus_J[1]);
}

TEST(Bridge, AnOpenPhaseCarriesNothingAndTheOthersOpposite) {
  for (const bool switched : {false, true}) {
    BridgeDesign design;
    design.switched = switched;
    Locked bench(smooth_motor(), design);
    bench.bridge.open_phases = 2;
    bench.run({{0.6f, 0.5f, 0.4f}, true}, 24, 50);
    EXPECT_NEAR(bench.motor.current_A()[1], 0, 1e-9);
    EXPECT_GT(bench.motor.current_A()[0], 1);
    EXPECT_NEAR(bench.motor.current_A()[0], -bench.motor.current_A()[2], 1e-9);
  }
}

TEST(Bridge, ReleasedBridgeLetsTheCurrentDecayThroughDiodesIntoTheBus) {
  Locked bench(smooth_motor(), BridgeDesign{});
  bench.run({{0.6f, 0.45f, 0.45f}, true}, 24, 400);
  const double start_A = bench.motor.current_A()[0], field_J = bench.motor.field_J(),
               before_J = bench.bridge.work().bus_J;
  const double heat_before_J = bench.bridge.work().heat_J, motor_before_J = bench.motor.work().copper_J[0];
  ASSERT_GT(start_A, 3);
  // Against bus and diodes: L di/dt = -(2/3)(V + 2 Vd) and resistance.
  bench.run({{0, 0, 0}, false}, 24, 1);
  const double slope_A = 2.0 / 3 * (24 + 2 * 0.8) / 1e-3 * period_s;
  EXPECT_NEAR(bench.motor.current_A()[0], start_A - slope_A - start_A * 0.51 / 1e-3 * period_s, 0.05);
  bench.run({{0, 0, 0}, false}, 24, 20);
  EXPECT_EQ(bench.motor.current_squared_A2(), 0);
  const double returned_J = before_J - bench.bridge.work().bus_J;
  EXPECT_GT(returned_J, 0.5 * field_J);
  EXPECT_LT(returned_J, field_J);
  EXPECT_GT(bench.bridge.work().heat_J, heat_before_J);
  EXPECT_GT(bench.motor.work().copper_J[0], motor_before_J);
}

TEST(Bridge, ATurningMotorRectifiesOnlyAboveTheBus) {
  for (const double speed_rad_per_s : {2000.0, 6000.0}) {  // line voltage peaks of 15 and 45 V
    Locked bench(host_sim::motor_from_sheet(plant_tests::small_motor()), BridgeDesign{});
    bench.motor.load.mode = Load::Mode::imposed_speed;
    bench.motor.load.speed_rad_per_s = speed_rad_per_s;
    bench.run({{0, 0, 0}, false}, 24, 400);
    if (speed_rad_per_s < 3000) {
      EXPECT_EQ(bench.bridge.work().bus_J, 0);
    } else {
      EXPECT_LT(bench.bridge.work().bus_J, -1);   // gives to the bus
      EXPECT_LT(bench.motor.work().shaft_J, -1);  // taken from the shaft
      double loss_J = bench.bridge.work().heat_J;
      for (int k = 0; k < 3; ++k) loss_J += bench.motor.work().copper_J[k] + bench.motor.work().series_J[k];
      EXPECT_NEAR(-bench.motor.work().shaft_J, loss_J - bench.bridge.work().bus_J + bench.motor.field_J(),
                  1e-3 * loss_J);
    }
  }
}

/// Also where the back-EMF just reaches the diodes: a current that would end where it began takes no time away.
TEST(Bridge, AReleasedMotorTurnsOnAtEverySpeed) {
  int rectifying = 0, quiet = 0;
  for (double speed_rad_per_s = 3100; speed_rad_per_s < 3700; speed_rad_per_s += 5) {
    Locked bench(host_sim::motor_from_sheet(plant_tests::small_motor()), BridgeDesign{});
    bench.motor.load.mode = Load::Mode::imposed_speed;
    bench.motor.load.speed_rad_per_s = speed_rad_per_s;
    constexpr int periods = 400;
    bench.run({{0, 0, 0}, false}, 24, periods);
    const double turned_rad = bench.motor.angle_rad() + 2 * host_sim::pi * static_cast<double>(bench.motor.turns());
    EXPECT_NEAR(turned_rad, speed_rad_per_s * periods * period_s, 1e-6) << speed_rad_per_s;
    bench.bridge.work().bus_J < 0 ? ++rectifying : ++quiet;
  }
  EXPECT_GT(rectifying, 10);
  EXPECT_GT(quiet, 10);
}

/// Also where a third lead just reaches its diode while the current in the other two ends.
TEST(Bridge, AReleasedMotorTurnsOnWhateverCurrentItHad) {
  std::mt19937_64 seed(1);
  std::uniform_real_distribution<double> speed(1900, 2200);  // back-EMF peaks of a third of the bus and of two diodes
  std::uniform_real_distribution<float> ratio(0.4f, 0.6f);
  std::uniform_int_distribution<int> length(1, 60);
  for (int n = 0; n < 4000; ++n) {
    Locked bench(host_sim::motor_from_sheet(plant_tests::small_motor()), BridgeDesign{});
    bench.motor.load.mode = Load::Mode::imposed_speed;
    bench.motor.load.speed_rad_per_s = speed(seed);
    const int driven = length(seed), off = 20;
    bench.run({{ratio(seed), ratio(seed), ratio(seed)}, true}, 24, driven);
    bench.run({{0, 0, 0}, false}, 24, off);
    EXPECT_EQ(bench.motor.current_squared_A2(), 0) << n;
    const double turned_rad = bench.motor.angle_rad() + 2 * host_sim::pi * static_cast<double>(bench.motor.turns());
    ASSERT_NEAR(turned_rad, bench.motor.load.speed_rad_per_s * (driven + off) * period_s, 1e-6) << n;
  }
}

TEST(Supply, ANonSinkingSupplyRisesByExactlyTheReturnedEnergy) {
  SupplyDesign design;
  Supply supply(design);
  double returned_J = 0;
  for (int n = 0; n < 1000; ++n) {
    supply.advance(period_s, -1e-3 * (n % 7));
    returned_J += 1e-3 * (n % 7);
  }
  const double expected_V = std::sqrt(48.0 * 48 + 2 * returned_J / design.capacitor_F);
  EXPECT_GT(expected_V, 80);
  EXPECT_NEAR(supply.bus_V(), expected_V, 1e-9);
  EXPECT_EQ(supply.work().given_J, 0);
}

TEST(Supply, ASinkingSupplyTakesItBack) {
  SupplyDesign design;
  design.can_sink = true;
  Supply supply(design);
  for (int n = 0; n < 1000; ++n) supply.advance(period_s, -5e-3);  // 100 W
  EXPECT_NEAR(supply.supply_A(), -100.0 / 48, 0.01);
  EXPECT_NEAR(supply.bus_V(), 48 + 0.02 * 100 / 48, 1e-3);
}

TEST(Supply, JoulesBalanceThroughEveryTransition) {
  for (const bool can_sink : {false, true}) {
    SupplyDesign design;
    design.can_sink = can_sink;
    design.resistance_ohm = 0.3;
    Supply supply(design);
    const double start_J = supply.stored_J();
    double load_J = 0;
    host_sim::Random random(5);
    for (int n = 0; n < 20000; ++n) {
      const double step_J = random.uniform(-0.02, 0.03);
      supply.advance(period_s, step_J);
      load_J += step_J;
      ASSERT_NEAR(supply.work().given_J - supply.work().loss_J, supply.stored_J() - start_J + load_J, 1e-9 + 1e-10 * n);
    }
    EXPECT_GT(supply.work().loss_J, 0);
  }
}

TEST(Supply, SagsToTheClosedFormUnderLoad) {
  SupplyDesign design;
  design.resistance_ohm = 0.2;
  Supply supply(design);
  for (int n = 0; n < 2000; ++n) supply.advance(period_s, 500 * period_s);  // 500 W
  const double volts = 0.5 * (48 + std::sqrt(48.0 * 48 - 4 * 0.2 * 500));
  EXPECT_NEAR(supply.bus_V(), volts, 1e-6);
}

}  // namespace

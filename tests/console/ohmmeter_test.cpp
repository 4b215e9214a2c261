// SPDX-License-Identifier: MIT
#include "console/ohmmeter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "console/heat_experiment.hpp"
#include "tests/boards-host/driven_bench.hpp"
#include "tests/host-sim/plant_fixtures.hpp"
#include "thermal/motor_set.hpp"

namespace {

/// A bridge whose dead time adds a voltage of its own, which hangs on the current and not on the winding.
class Bench {
 public:
  double winding_ohm = 0.5;
  double permitted_share = 1;  // of what is asked for

  std::vector<console::Ohmmeter::Reading> flow(console::Ohmmeter& meter, double A, double seconds) {
    std::vector<console::Ohmmeter::Reading> readings;
    for (double until_s = time_s_ + seconds; time_s_ < until_s; time_s_ += 0.002) {
      const double i = permitted_share * A, added_V = 0.05 + 0.1 / (1 + i);
      const double settled = since_s_ > 0.02 ? 1 : 0.5;  // no reading may be of the step
      since_s_ = A == last_A_ ? since_s_ + 0.002 : 0;
      last_A_ = A;
      const auto V = static_cast<float>((winding_ohm + leads_ohm) * i + (i > 0 ? added_V : 0));
      if (const auto r = meter.take({time_s_, static_cast<float>(i), static_cast<float>(i * settled), 2 * V, 0.5f}))
        readings.push_back(*r);
    }
    return readings;
  }
  std::vector<double> cold(console::Ohmmeter& meter) {
    for (int k = 0; k < 3; ++k) {
      for (const double A : {4.0, 6.0, 4.0, 0.0}) flow(meter, A, 0.12);
    }
    for (int k = 0; k < 2; ++k) flow(meter, 4, 0.12), flow(meter, 0, 0.5);
    return meter.cold();
  }

  static constexpr double leads_ohm = 0.02;

 private:
  double time_s_ = 0, since_s_ = 0, last_A_ = 0;
};

TEST(Ohmmeter, ReadsTheWindingBesideDeadTimeAndLeads) {
  Bench bench;
  console::Ohmmeter meter(4, 6, Bench::leads_ohm);
  const auto cold_ohm = bench.cold(meter);
  ASSERT_EQ(cold_ohm.size(), 2u);
  // What dead time adds falls with the current, by 3 mV from 4 to 6 A here: 0.3 % of the winding.
  EXPECT_NEAR(cold_ohm.front(), 0.5, 0.01);
  for (const double warmer : {1.0, 1.2, 1.5}) {
    bench.winding_ohm = 0.5 * warmer;
    const auto readings = bench.flow(meter, 4, 0.25);
    bench.flow(meter, 0, 0.1);
    ASSERT_GE(readings.size(), 2u);
    for (const auto& reading : readings) EXPECT_NEAR(reading.ohm - cold_ohm.front(), 0.5 * (warmer - 1), 1e-4);
  }
}

TEST(Ohmmeter, TellsTheMomentThatItRead) {
  Bench bench;
  console::Ohmmeter meter(4, 6, Bench::leads_ohm);
  (void)bench.cold(meter);
  const double begun_s = 3 * 0.48 + 2 * 0.62;
  const auto readings = bench.flow(meter, 4, 0.12);
  ASSERT_EQ(readings.size(), 1u);
  EXPECT_NEAR(readings.front().time_s - begun_s, 0.07, 0.01);
}

TEST(Ohmmeter, OfACurrentThatIsLimitedOrAnotherItReadsNothing) {
  Bench bench;
  console::Ohmmeter meter(4, 6, Bench::leads_ohm);
  (void)bench.cold(meter);
  EXPECT_TRUE(bench.flow(meter, 6, 0.5).empty());
  EXPECT_TRUE(bench.flow(meter, 3.9, 0.5).empty());
  bench.permitted_share = 0.97;
  EXPECT_TRUE(bench.flow(meter, 4, 0.5).empty());
}

TEST(Ohmmeter, WithoutTheLargerCurrentItKnowsNoWinding) {
  Bench bench;
  console::Ohmmeter meter(4, 6, Bench::leads_ohm);
  for (int k = 0; k < 3; ++k) bench.flow(meter, 4, 0.12), bench.flow(meter, 0, 0.5);
  EXPECT_TRUE(meter.cold().empty());
}

TEST(Ohmmeter, LeadsThatLeaveNoWindingAreNotBelieved) {
  Bench bench;
  console::Ohmmeter meter(4, 6, 0.6);
  EXPECT_TRUE(bench.cold(meter).empty());
}

/// What the ohmmeter builds on, held against a bridge that switches every edge, with dead time and ripple.
TEST(Ohmmeter, AtOneCurrentOnlyTheWindingMovesVoltsOverAmperes) {
  for (const char* id : {"ec-16-40w", "ec-powermax-30-24v"}) {
    const wire::Motor motor = plant_tests::sheet(id);
    host_sim::BenchDesign design = plant_tests::bench_design(motor);
    design.bridge.switched = true;
    const auto probe_A = static_cast<float>(console::probe_share * motor.rated_current_A / wire::direct_per_amplitude);
    const auto volts_over_amperes = [&](double soaked_degC) {
      board_tests::DrivenBench driven(design, {firmware::parameters_from(motor, boards::dual_48V_20A, {48.0f, 0.0f}),
                                               thermal::three_phase_set(motor)});
      firmware::Driver& driver = driven.driver;
      driven.bench.soak(soaked_degC);
      driven.bench.load(0).mode = host_sim::Load::Mode::locked;
      console::Ohmmeter meter(probe_A, 2 * probe_A, 0);
      (void)meter.cold();
      for (int ms = 0; ms < 600; ++ms) {
        if (ms == 300) (void)driver.axis(0).arm();
        if (ms > 400) (void)driver.axis(0).set_current({probe_A, 0});
        driven.advance_ms();
        if (ms % 2 != 0) continue;
        const firmware::FastView fast = driver.axis(0).fast();
        if (const auto r = meter.take({1e-3 * ms, fast.permitted_A.d, fast.current_A.d, fast.voltage_V.d, 1.0f}))
          return r->ohm;
      }
      return std::nan("");
    };
    const double warmer_K = 105, moved_ohm = volts_over_amperes(25 + warmer_K) - volts_over_amperes(25);
    const double winding_ohm = motor.phase_resistance_ohm * motor.copper_coefficient_per_K * warmer_K;
    EXPECT_NEAR(moved_ohm / winding_ohm, 1, 0.04) << id;
    std::printf("  %s: reads %+.1f %% of what its winding is warmer by\n", id, 100 * (moved_ohm / winding_ohm - 1));
  }
}

}  // namespace

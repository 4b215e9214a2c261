// SPDX-License-Identifier: MIT
// The walk as a whole: both lanes, modes, faults, against the bench's motor.
#include "firmware/axis.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "tests/firmware/bench.hpp"

namespace firmware {

/// Damages what no sample can reach, as a flipped bit would.
struct AxisProbe {
  static const thermal::HeatInput<>& heat(const Axis& axis) { return axis.input_; }
  static constexpr int targets = 6;
  static void damage(Axis& axis, int target, float value) {
    switch (target) {
      case 0:
        axis.allowance_.current_A = value;
        break;
      case 1:
        axis.current_loop_ = CurrentLoop(with(value), bench::rating);
        break;
      case 2:
        axis.rotor_ = Rotor(with(value), bench::rating);
        break;
      case 3:
        axis.usable_ratio_ = value;
        break;
      case 4:
        axis.dead_time_ = DeadTime(value, 20e3f, 0.1f);
        break;
      default:
        axis.last_.ratio.a = value;
        break;
    }
  }
  static void flip_mode(Axis& axis, unsigned bit) {
    axis.mode_ = static_cast<Mode>(static_cast<unsigned>(axis.mode_) ^ 1u << bit);
  }
  static void raise_trip_level(Axis& axis) { axis.rating_.trip_A *= 4.0f; }
  static AxisParameters with(float value) {
    AxisParameters p = bench::parameters();
    p.phase_resistance_ohm = p.flux_linkage_Wb = p.rotor_bandwidth_Hz = value;
    return p;
  }
};

}  // namespace firmware

namespace {

using bench::nan;
using firmware::AxisProbe;
using firmware::Mode;
using wire::Fault;
using wire::Limit;
using wire::Status;

/// A driver whose first axis runs a bench motor; the second stays off unless a test uses it.
struct Rig {
  explicit Rig(const firmware::DriverSetup& setup = bench::driver_setup()) : driver(setup) {}

  void run(int periods) {
    for (int i = 0; i < periods; ++i) {
      tick(motor.sample());
      if (ticks % 20 == 0) driver.watch();
      if (ticks % 200 == 0 && slow_lane_alive)
        driver.slow_tick({{stage_degC, true}, 0.0f, false}, {{{housing_degC, housing_ok}}, {{25.0f, true}}});
      if (ticks % 20 == 0) driver.look_ahead();
    }
  }
  void tick(const hal::AxisSample& sample) {
    duty = axis().tick(sample);
    motor.run(duty);
    ++ticks;
  }
  /// One period with a sample that a test has spoilt.
  template <class Spoil>
  void spoilt(Spoil spoil) {
    hal::AxisSample sample = motor.sample();
    spoil(sample);
    tick(sample);
  }
  void bring_up() {
    run(2400);
    ASSERT_EQ(axis().arm(), Status::done);
    run(1);
    ASSERT_EQ(axis().mode(), Mode::ready);
  }
  void hold(wire::Dq current_A, int periods) {
    for (int i = 0; i < periods; i += 100) {
      ASSERT_EQ(axis().set_current(current_A), Status::done);
      run(std::min(100, periods - i));
    }
  }
  firmware::Axis& axis() { return driver.axis(0); }

  firmware::Driver driver;
  bench::Motor motor;
  hal::Duty duty{};
  int ticks = 0;
  float housing_degC = 25.0f, stage_degC = 25.0f;
  bool housing_ok = true, slow_lane_alive = true;
};

struct Running : testing::Test, Rig {
  void SetUp() override {
    bring_up();
    hold({0.0f, 5.0f}, 1000);
    ASSERT_EQ(axis().mode(), Mode::running);
  }
};

// ---- current --------------------------------------------------------------------------------------------------------

TEST(Axis, ReachesTheAskedCurrentAtStandstillAndAtSpeed) {
  for (const double rad_per_s : {0.0, 300.0, -600.0}) {
    Rig rig;
    rig.bring_up();
    rig.motor.rad_per_s = rad_per_s;
    rig.hold({0.0f, 0.0f}, 2000);
    rig.hold({1.0f, 5.0f}, 2000);
    // Means over 0.1 s: where a phase current crosses zero, dead time leaves a tenth of an ampere for some periods.
    double id_A = 0.0, iq_A = 0.0;
    constexpr int periods = 2000;
    for (int i = 0; i < periods; ++i) {
      ASSERT_EQ(rig.axis().set_current({1.0f, 5.0f}), Status::done);
      rig.run(1);
      id_A += rig.motor.id_A / periods;
      iq_A += rig.motor.iq_A / periods;
    }
    EXPECT_NEAR(id_A, 1.0, 0.02) << rad_per_s;
    EXPECT_NEAR(iq_A, 5.0, 0.02) << rad_per_s;
    EXPECT_EQ(rig.axis().mode(), Mode::running);
  }
}

TEST(Axis, AStepRisesAtTheBandwidthAndHardlyOvershoots) {
  Rig rig;
  rig.bring_up();
  rig.hold({0.0f, 0.0f}, 200);
  ASSERT_EQ(rig.axis().set_current({0.0f, 10.0f}), Status::done);
  double peak_A = 0.0;
  int to_63 = -1;
  for (int i = 0; i < 200; ++i) {
    rig.run(1);
    peak_A = std::max(peak_A, rig.motor.iq_A);
    if (to_63 < 0 && rig.motor.iq_A > 6.32) to_63 = i + 1;
  }
  // 1 / (2 pi 1 kHz) = 3.2 periods, and 1.5 of delay; phase margin 63 degrees.
  EXPECT_GE(to_63, 3);
  EXPECT_LE(to_63, 6);
  EXPECT_LT(peak_A, 11.2);
  EXPECT_NEAR(rig.motor.iq_A, 10.0, 0.1);
}

TEST(Axis, TheDutyIsAimedAtTheAngleAtWhichItActs) {
  firmware::DriverSetup setup = bench::driver_setup();
  setup.rating.dead_time_s = 0.0f;
  Rig rig(setup);
  rig.motor.dead_time_s = 0.0;
  rig.bring_up();
  for (int i = 0; i <= 120; ++i) {
    rig.motor.rad_per_s = 10.0 * i;
    rig.hold({0.0f, 0.0f}, 100);
  }
  rig.hold({0.0f, 0.0f}, 2000);
  double d_V = 0.0, q_V = 0.0;
  for (int i = 0; i < 2000; ++i) {
    rig.hold({0.0f, 0.0f}, 1);
    d_V += static_cast<double>(rig.axis().fast().voltage_V.d) / 2000;
    q_V += static_cast<double>(rig.axis().fast().voltage_V.q) / 2000;
  }
  // At no current the voltage is the back-EMF, all of it on q. Aimed 1.5 periods too early, 18 % of it would lie on d.
  EXPECT_NEAR(q_V, 1200 * 2 * bench::motor().flux_linkage_Wb, 0.1);
  EXPECT_NEAR(d_V, 0.0, 0.1);
}

TEST(Axis, ARestartRemembersNoVoltage) {
  Rig rig;
  rig.bring_up();
  rig.hold({0.0f, 15.0f}, 1000);
  rig.axis().disarm();
  rig.run(10);
  ASSERT_EQ(rig.axis().arm(), Status::done);
  rig.run(1);
  double worst_A = 0.0;
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(rig.axis().set_current({0.0f, 0.0f}), Status::done);
    rig.run(1);
    worst_A = std::max(worst_A, std::abs(rig.motor.iq_A));
  }
  EXPECT_EQ(rig.axis().mode(), Mode::running);
  EXPECT_LT(worst_A, 0.5);
}

double worst_ripple_A(float told_dead_time_s) {
  firmware::DriverSetup setup = bench::driver_setup();
  setup.rating.dead_time_s = told_dead_time_s;  // the bench's bridge has 500 ns either way
  Rig rig(setup);
  rig.bring_up();
  rig.motor.rad_per_s = 400.0;
  rig.hold({0.0f, 3.0f}, 2000);
  double squares = 0.0;
  for (int i = 0; i < 2000; ++i) {
    EXPECT_EQ(rig.axis().set_current({0.0f, 3.0f}), Status::done);
    rig.run(1);
    squares += (std::pow(rig.motor.iq_A - 3.0, 2) + std::pow(rig.motor.id_A, 2)) / 2000;
  }
  return std::sqrt(squares);
}

TEST(Axis, DeadTimeCompensationTakesMostOfTheDistortion) {
  EXPECT_LT(worst_ripple_A(500e-9f), 0.4 * worst_ripple_A(0.0f));
}

TEST(Axis, AtTheVoltageLimitItSaysSoAndComesBack) {
  Rig rig;
  rig.bring_up();
  for (int i = 0; i <= 165; ++i) {  // up to a back-EMF of 26.3 V: 1.4 V is left of 48 / sqrt 3, 7 A
    rig.motor.rad_per_s = 10.0 * i;
    rig.hold({0.0f, 0.0f}, 100);
  }
  rig.hold({0.0f, 15.0f}, 2000);
  EXPECT_EQ(rig.axis().fast().limit, Limit::voltage);
  EXPECT_LT(rig.motor.iq_A, 12.0);
  rig.hold({0.0f, 0.0f}, 40);
  EXPECT_NEAR(rig.motor.iq_A, 0.0, 0.5) << "wound up";
  EXPECT_EQ(rig.axis().mode(), Mode::running);
}

/// 20 A asked of a small slotless motor at rest, whose 2 ohm take 13.6 A from 48 V: mean and ripple, A rms.
std::pair<double, double> at_the_voltage_limit_A(double electrical_time_constant_s) {
  firmware::DriverSetup setup = bench::driver_setup();
  wire::Motor short_one = bench::motor();
  short_one.phase_resistance_ohm = 2.0;
  short_one.inductance_d_H = short_one.inductance_q_H = 2.0 * electrical_time_constant_s;
  setup.axes[0].parameters = firmware::parameters_from(short_one, bench::rating, {48.0f, 0.0f});
  Rig rig(setup);
  rig.motor.sheet = short_one;
  rig.bring_up();
  rig.hold({0.0f, 20.0f}, 1000);
  double mean_A = 0.0, mean_A2 = 0.0;
  for (int i = 0; i < 1000; ++i) {
    rig.hold({0.0f, 20.0f}, 1);
    mean_A += rig.motor.iq_A / 1000;
    mean_A2 += rig.motor.iq_A * rig.motor.iq_A / 1000;
  }
  EXPECT_EQ(rig.axis().fast().limit, Limit::voltage);
  return {mean_A, std::sqrt(std::fmax(0.0, mean_A2 - mean_A * mean_A))};
}

TEST(Axis, AWindingThatIsDoneWithinAPeriodDoesNotSwingAboutTheVoltageLimit) {
  for (const double time_constant_s : {60e-6, 20e-6, 10e-6}) {
    const auto [mean_A, ripple_A] = at_the_voltage_limit_A(time_constant_s);
    EXPECT_NEAR(mean_A, 13.58, 0.02) << time_constant_s;
    EXPECT_LT(ripple_A, 0.05) << time_constant_s;
  }
}

TEST_F(Running, NoSettingOfTheSetpointPassesThePeak) {
  for (const wire::Dq asked : {wire::Dq{0.0f, 500.0f}, wire::Dq{-700.0f, 700.0f}, wire::Dq{19.0f, 19.0f}}) {
    hold(asked, 400);
    const wire::Dq permitted = axis().fast().permitted_A;
    EXPECT_LE(std::hypot(permitted.d, permitted.q), 20.0001f);
    EXPECT_LE(std::hypot(motor.id_A, motor.iq_A), 20.3);
    EXPECT_EQ(axis().fast().limit, Limit::hardware);
  }
}

// ---- faults ---------------------------------------------------------------------------------------------------------

TEST_F(Running, EveryTripOpensTheBridgeAtOnceAndKeepsItsEvidence) {
  spoilt([](auto& s) { s.current_A.b = -28.5f; });
  EXPECT_FALSE(duty.on);
  EXPECT_EQ(axis().mode(), Mode::tripped);
  run(2000);
  const firmware::FaultRecord record = axis().fault();
  EXPECT_EQ(record.fault, Fault::over_current);
  EXPECT_EQ(record.axis, 0);
  EXPECT_FLOAT_EQ(record.value, -28.5f);
  EXPECT_FLOAT_EQ(record.threshold, 28.0f);
  EXPECT_NEAR(record.age_s, 0.1f, 1e-4f);
  EXPECT_EQ(axis().state().fault.fault, Fault::over_current);
  // A second fault must not paint over the first.
  spoilt([](auto& s) { s.bus_V = 99.0f; });
  EXPECT_EQ(axis().fault().fault, Fault::over_current);
}

TEST_F(Running, EachFaultHasAnAgeOfItsOwn) {
  spoilt([](auto& s) { s.current_A.b = -28.5f; });
  run(2000);
  ASSERT_EQ(axis().set_current({0.0f, 0.0f}), Status::done);
  ASSERT_EQ(axis().clear(), Status::done);
  run(1);
  ASSERT_EQ(axis().arm(), Status::done);
  run(1);
  spoilt([](auto& s) { s.current_A.b = -28.5f; });
  ASSERT_EQ(axis().mode(), Mode::tripped);
  run(20);
  EXPECT_NEAR(axis().fault().age_s, 0.001f, 1e-4f);
}

TEST_F(Running, NothingMovesAfterAFaultWithoutAClearAndAZeroSetpoint) {
  spoilt([](auto& s) { s.bus_V = 60.0f; });
  hold({0.0f, 5.0f}, 400);
  EXPECT_EQ(axis().mode(), Mode::tripped);
  EXPECT_EQ(axis().arm(), Status::tripped);
  EXPECT_EQ(axis().clear(), Status::setpoint_not_zero);
  run(10);
  EXPECT_EQ(axis().mode(), Mode::tripped);
  ASSERT_EQ(axis().set_current({0.0f, 0.0f}), Status::done);
  EXPECT_EQ(axis().clear(), Status::done);
  // The setpoint moves before the tick obeys: the clear must fall.
  ASSERT_EQ(axis().set_current({0.0f, 5.0f}), Status::done);
  run(10);
  EXPECT_EQ(axis().mode(), Mode::tripped);
  ASSERT_EQ(axis().set_current({0.0f, 0.0f}), Status::done);
  EXPECT_EQ(axis().clear(), Status::done);
  hold({0.0f, 5.0f}, 1);
  EXPECT_EQ(axis().mode(), Mode::tripped);
  ASSERT_EQ(axis().set_current({0.0f, 0.0f}), Status::done);
  EXPECT_EQ(axis().clear(), Status::done);
  run(1);
  EXPECT_EQ(axis().mode(), Mode::off);
  EXPECT_EQ(axis().fault().fault, Fault::none);
  ASSERT_EQ(axis().set_current({0.0f, 5.0f}), Status::done);
  EXPECT_EQ(axis().arm(), Status::done);
  run(100);
  EXPECT_EQ(axis().mode(), Mode::ready) << "a setpoint from before arming must not move it";
  EXPECT_FALSE(duty.on);
  hold({0.0f, 5.0f}, 2);
  EXPECT_EQ(axis().mode(), Mode::running);
}

TEST_F(Running, OneMissedSampleGoesOnTwoOpenTheBridge) {
  spoilt([](auto& s) { s.valid = false; });
  EXPECT_TRUE(duty.on);
  run(1);
  EXPECT_EQ(axis().mode(), Mode::running);
  spoilt([](auto& s) { s.valid = false; });
  spoilt([](auto& s) { s.valid = false; });
  EXPECT_FALSE(duty.on);
  EXPECT_EQ(axis().fault().fault, Fault::invalid_sample);
}

TEST_F(Running, WhatAMissedSampleHoldsIsNotLookedAt) {
  const hal::Duty before = duty;
  spoilt([](auto& s) {
    s.valid = false;
    s.current_A = {nan, 1e38f, -nan};
    s.rotor_rad = nan;
  });
  EXPECT_TRUE(duty.on);
  EXPECT_EQ(duty.ratio.a, before.ratio.a);
  EXPECT_EQ(duty.ratio.b, before.ratio.b);
  run(10);
  EXPECT_EQ(axis().mode(), Mode::running);
}

TEST(Axis, AnArmedAxisTripsBeforeItRuns) {
  Rig rig;
  rig.bring_up();
  rig.spoilt([](auto& s) { s.bus_V = 70.0f; });
  EXPECT_EQ(rig.axis().mode(), Mode::tripped);
  EXPECT_EQ(rig.axis().fault().fault, Fault::bus_over_voltage);
}

TEST(Axis, DamagedMemoryNeverMakesADutyThatIsNone) {
  for (int target = 0; target < AxisProbe::targets; ++target) {
    for (const float value : {nan, -nan, std::numeric_limits<float>::infinity(), 1e38f, -1e38f}) {
      Rig rig;
      rig.bring_up();
      rig.motor.rad_per_s = 300.0;
      rig.hold({1.0f, 5.0f}, 1000);
      AxisProbe::damage(rig.axis(), target, value);
      for (int i = 0; i < 400; ++i) {
        (void)rig.axis().set_current({1.0f, 5.0f});
        if (i == 100) {
          AxisProbe::damage(rig.axis(), target, value);
          rig.spoilt([](auto& s) { s.valid = false; });
        } else {
          rig.run(1);
        }
        for (const float ratio : {rig.duty.ratio.a, rig.duty.ratio.b, rig.duty.ratio.c})
          ASSERT_TRUE(ratio >= 0.0f && ratio <= 1.0f) << "target " << target << " value " << value << " tick " << i;
      }
    }
  }
}

TEST(Axis, AModeThatFlipsTripsWithinAMillisecond) {
  for (const Mode mode : {Mode::off, Mode::ready, Mode::running, Mode::tripped}) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      Rig rig;
      rig.run(2400);
      if (mode == Mode::ready || mode == Mode::running) rig.bring_up();
      if (mode == Mode::running) rig.hold({0.0f, 5.0f}, 400);
      if (mode == Mode::tripped) rig.axis().hold({Fault::over_current});
      ASSERT_EQ(rig.axis().mode(), mode);
      AxisProbe::flip_mode(rig.axis(), bit);
      (void)rig.axis().set_current({0.0f, 5.0f});
      rig.run(21);
      EXPECT_EQ(rig.axis().mode(), Mode::tripped) << firmware::text_of(mode) << " bit " << bit;
      EXPECT_EQ(rig.axis().fault().fault, Fault::memory_changed);
      EXPECT_FALSE(rig.duty.on);
    }
  }
}

TEST_F(Running, NoSetOfParametersVouchesForALimitThatFlipped) {
  AxisProbe::raise_trip_level(axis());
  run(201);
  EXPECT_EQ(axis().mode(), Mode::tripped);
  EXPECT_EQ(axis().fault().fault, Fault::memory_changed);
  (void)axis().set_current({0.0f, 0.0f});
  ASSERT_EQ(axis().clear(), Status::done);
  run(1);
  driver.configure(0, bench::axis_setup(), firmware::HeatModel::unchanged);
  run(2400);
  EXPECT_EQ(axis().arm(), Status::done);
  for (int i = 0; i < 10; ++i) {
    (void)axis().set_current({0.0f, 5.0f});
    run(100);
    EXPECT_FALSE(duty.on);
  }
  EXPECT_EQ(axis().mode(), Mode::tripped);
}

TEST_F(Running, DisarmOpensTheBridgeAtTheNextTick) {
  axis().disarm();
  run(1);
  EXPECT_FALSE(duty.on);
  EXPECT_EQ(axis().mode(), Mode::off);
}

/// A bridged sample goes on as it was only where what went on still may.
TEST_F(Running, DisarmOpensTheBridgeAtTheNextTickAlsoWithoutASample) {
  axis().disarm();
  spoilt([](auto& s) { s.valid = false; });
  EXPECT_FALSE(duty.on);
  EXPECT_EQ(axis().mode(), Mode::off);
}

TEST_F(Running, WhatAllowsNothingOpensTheBridgeAtTheNextTickAlsoWithoutASample) {
  run(200 - ticks % 200);
  for (int i = 0; i < 100; ++i)  // a board does not take its allowance away at once
    driver.slow_tick({{150.0f, true}, 0.0f, false}, {{{25.0f, true}}, {{25.0f, true}}});
  ASSERT_EQ(axis().state().allowance_A, 0.0f);
  spoilt([](auto& s) { s.valid = false; });
  EXPECT_FALSE(duty.on);
  EXPECT_EQ(axis().mode(), Mode::ready);
}

/// The speed is not a parameter: without it the voltage would be aimed and fed forward as at standstill.
TEST_F(Running, AnotherSetDoesNotForgetHowFastTheRotorTurns) {
  motor.rad_per_s = 600.0;
  hold({0.0f, 0.0f}, 1000);
  axis().disarm();
  run(2);
  driver.configure(0, bench::driver_setup().axes[0], firmware::HeatModel::unchanged);
  ASSERT_EQ(axis().arm(), Status::done);
  run(1);
  driver.slow_tick({{25.0f, true}, 0.0f, false}, {{{25.0f, true}}, {{25.0f, true}}});
  ASSERT_EQ(axis().mode(), Mode::ready);
  EXPECT_NEAR(axis().fast().rad_per_s, 600.0f, 6.0f);
  double worst_A = 0.0;
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(axis().set_current({0.0f, 0.0f}), Status::done);
    run(1);
    worst_A = std::max(worst_A, std::abs(motor.iq_A));
  }
  EXPECT_EQ(axis().mode(), Mode::running);
  EXPECT_LT(worst_A, 0.5) << "as after any restart";
}

TEST(Axis, WhileOffABadSampleOnlyKeepsItFromArming) {
  Rig rig;
  rig.motor.bus_V = 5.0;
  rig.run(3000);
  EXPECT_EQ(rig.axis().mode(), Mode::off);
  EXPECT_EQ(rig.axis().arm(), Status::sample_refused);
  rig.motor.bus_V = 48.0;
  rig.run(100);
  EXPECT_EQ(rig.axis().arm(), Status::offset_unknown);
  rig.run(2000);
  EXPECT_EQ(rig.axis().arm(), Status::done);
}

TEST(Axis, NoBitPatternInASampleMakesADutyThatIsNone) {
  std::mt19937 random(6);
  Rig rig;
  rig.bring_up();
  int tripped = 0, ran = 0;
#ifdef HOTCORE_TRAP_FLOATS
  constexpr int rounds = 100'000;
#else
  constexpr int rounds = 1'000'000;
#endif
  for (int i = 0; i < rounds; ++i) {
    hal::AxisSample sample = rig.motor.sample();
    float* fields[] = {&sample.current_A.a, &sample.current_A.b, &sample.current_A.c, &sample.bus_V, &sample.rotor_rad};
    // Most of the time one field, so that the walk gets past the guard; sometimes all of them.
    const auto spoil = [&](float& x) {
      x = random() % 2 == 0 ? std::bit_cast<float>(static_cast<std::uint32_t>(random()))
                            : static_cast<float>(random() % 60) - 30.0f;
    };
    if (random() % 4 == 0) spoil(*fields[random() % 5]);
    if (random() % 64 == 0)
      for (float* field : fields) spoil(*field);
    if (random() % 64 == 0) sample.sequence = static_cast<std::uint32_t>(random());
    if (random() % 64 == 0) sample.valid = false;
    const hal::Duty duty = rig.axis().tick(sample);
    for (const float ratio : {duty.ratio.a, duty.ratio.b, duty.ratio.c}) {
      ASSERT_GE(ratio, 0.0f) << i;
      ASSERT_LE(ratio, 1.0f) << i;
    }
    rig.motor.id_A = rig.motor.iq_A = 0.0;
    if (i % 200 == 0) {
      rig.driver.slow_tick({{25.0f, true}, 0.0f, false}, {{{25.0f, true}}, {{25.0f, true}}});
      AxisProbe::damage(rig.axis(), 0, 20.0f);  // such currents look hot, and nothing would be allowed again
    }
    ran += duty.on;
    if (rig.axis().mode() == Mode::tripped) {
      ++tripped;
      ASSERT_FALSE(duty.on);
      (void)rig.axis().set_current({0.0f, 0.0f});
      (void)rig.axis().clear();
    }
    if (rig.axis().mode() == Mode::off) (void)rig.axis().arm();
    (void)rig.axis().set_current(
        {static_cast<float>(random() % 40) - 20.0f, static_cast<float>(random() % 40) - 20.0f});
    if (rig.axis().mode() == Mode::tripped) (void)rig.axis().set_current({0.0f, 0.0f});
  }
  EXPECT_GT(tripped, rounds / 100);
  EXPECT_GT(ran, rounds / 20) << "the fuzz must get past the guard to mean anything";
}

// ---- what a look shows and no sample does ---------------------------------------------------------------------------

struct Watched : Running {
  /// Milliseconds of spoilt samples until it trips, at most `most`.
  template <class Spoil>
  int trips_after_ms(wire::Dq current_A, int most, Spoil spoil) {
    for (int ms = 1; ms <= most; ++ms) {
      EXPECT_EQ(axis().set_current(current_A), Status::done);
      for (int i = 0; i < 20; ++i) spoilt(spoil);
      driver.watch();
      spoilt(spoil);  // obeys
      if (axis().mode() == Mode::tripped) return ms;
    }
    return -1;
  }
};

TEST_F(Watched, ACurrentSensorThatIsDeadOrStuckOpensTheBridge) {
  for (const double angle_rad : {0.4, 0.8, 1.2}) {  // phase a carries -4, -6 and -4 A
    for (const float stuck_A : {0.0f, 3.0f}) {
      Rig::motor.angle_rad = angle_rad;
      hold({0.0f, 6.0f}, 1000);
      const int ms = trips_after_ms({0.0f, 6.0f}, 20, [=](hal::AxisSample& s) { s.current_A.a = stuck_A; });
      EXPECT_GE(ms, 0) << angle_rad << ' ' << stuck_A;
      EXPECT_LE(ms, 5) << angle_rad << ' ' << stuck_A;
      ASSERT_EQ(axis().set_current({0.0f, 0.0f}), Status::done);
      ASSERT_EQ(axis().clear(), Status::done);
      run(2400);
      ASSERT_EQ(axis().arm(), Status::done);
      run(1);
    }
  }
}

TEST_F(Watched, WhatContradictsStaysLatchedWithItsEvidence) {
  ASSERT_EQ(trips_after_ms({0.0f, 6.0f}, 20, [](hal::AxisSample& s) { s.current_A.a += 3.0f; }), 3);
  EXPECT_FALSE(duty.on);
  const firmware::FaultRecord record = axis().fault();
  EXPECT_EQ(record.fault, Fault::current_sum);
  EXPECT_NEAR(record.value, 3.0f, 0.01f);
  EXPECT_GT(record.threshold, 1.5f);
  EXPECT_LT(record.threshold, 2.2f);
  hold({0.0f, 0.0f}, 400);
  EXPECT_EQ(axis().mode(), Mode::tripped);
}

TEST_F(Watched, APhaseThatCarriesNothingOpensTheBridge) {
  Rig::motor.angle_rad = 0.5;
  hold({0.0f, 5.0f}, 1000);
  const int ms = trips_after_ms({0.0f, 5.0f}, 20, [](hal::AxisSample& s) {
    s.current_A.a = 0.0f;  // and the other two are one current
    s.current_A.b = 0.5f * (s.current_A.b - s.current_A.c);
    s.current_A.c = -s.current_A.b;
  });
  EXPECT_GE(ms, 0);
  EXPECT_LE(ms, 10);
}

TEST_F(Watched, SamplesOfAMotorAtRestOpenTheBridgeOfOneThatIsDriven) {
  const int ms = trips_after_ms({0.0f, 5.0f}, 20, [](hal::AxisSample& s) { s.current_A = {0.0f, 0.0f, 0.0f}; });
  EXPECT_GE(ms, 0);
  EXPECT_LE(ms, 10);
  EXPECT_EQ(axis().fault().fault, Fault::motor_differs);
}

TEST_F(Watched, AnEncoderThatStandsWhileTheRotorTurnsOpensTheBridge) {
  Rig::motor.rad_per_s = 400.0;
  hold({0.0f, 5.0f}, 2000);
  const float stands_rad = Rig::motor.sample().rotor_rad;
  const int ms = trips_after_ms({0.0f, 5.0f}, 60, [=](hal::AxisSample& s) { s.rotor_rad = stands_rad; });
  EXPECT_GE(ms, 0);
  EXPECT_LE(ms, 50);
}

TEST_F(Watched, GainsApartOffsetsAndNoiseTripNothing) {
  std::mt19937 random(5);
  std::normal_distribution<float> noise_A(0.0f, 0.1f);
  for (const double rad_per_s : {0.0, 40.0, 700.0}) {
    Rig::motor.rad_per_s = rad_per_s;
    hold({0.0f, 0.0f}, 400);
    EXPECT_EQ(trips_after_ms({0.0f, 19.5f}, 1000,
                             [&](hal::AxisSample& s) {
                               s.current_A.a = 1.03f * s.current_A.a + 0.2f + noise_A(random);
                               s.current_A.b = 0.97f * s.current_A.b + 0.2f + noise_A(random);
                               s.current_A.c = 0.97f * s.current_A.c + 0.2f + noise_A(random);
                             }),
              -1)
        << rad_per_s;
  }
}

TEST_F(Watched, OneSpoiltLookInFourTripsNothing) {
  for (int ms = 0; ms < 1000; ++ms) {
    ASSERT_EQ(axis().set_current({0.0f, 5.0f}), Status::done);
    run(20 - ticks % 20 - 1);
    if (ms % 4 == 0)
      spoilt([](hal::AxisSample& s) { s.current_A.a += 8.0f; });
    else
      run(1);
    driver.watch();
  }
  EXPECT_EQ(axis().mode(), Mode::running);
}

TEST_F(Watched, WhatIsAtRestIsNotDoubted) {
  axis().disarm();
  EXPECT_EQ(trips_after_ms({0.0f, 5.0f}, 50, [](hal::AxisSample& s) { s.current_A.a += 5.0f; }), -1);
  EXPECT_EQ(axis().mode(), Mode::off);
}

// ---- setpoint time-out ----------------------------------------------------------------------------------------------

TEST_F(Running, SilenceOfTheHostRampsToZeroAndOpensTheBridge) {
  ASSERT_EQ(axis().set_current({0.0f, 10.0f}), Status::done);
  int ramp_begins = 0, opens = 0;
  for (int i = 1; i <= 8000 && opens == 0; ++i) {
    run(1);
    if (ramp_begins == 0 && i > 1 && axis().fast().permitted_A.q < 9.999f) ramp_begins = i;
    if (ramp_begins != 0 && duty.on) {
      EXPECT_EQ(axis().fast().limit, Limit::setpoint_old);
    }
    if (!duty.on) opens = i;
  }
  EXPECT_NEAR(ramp_begins * bench::period_s, 0.1, 0.005);
  EXPECT_NEAR(opens * bench::period_s, 0.3, 0.005);
  EXPECT_EQ(axis().mode(), Mode::ready);
  hold({0.0f, 1.0f}, 2);
  EXPECT_EQ(axis().mode(), Mode::running) << "an armed axis wakes with the next setpoint";
}

// ---- two axes -------------------------------------------------------------------------------------------------------

std::vector<hal::Duty> first_axis_beside(bool busy_neighbour) {
  firmware::Driver driver(bench::driver_setup());
  bench::Motor motors[2];
  motors[1].angle_rad = 3.0;
  std::vector<hal::Duty> duties;
  for (int i = 0; i < 12000; ++i) {
    for (int k = 0; k < 2; ++k) {
      firmware::Axis& axis = driver.axis(k);
      hal::AxisSample sample = motors[k].sample();
      if (k == 1 && busy_neighbour && i > 9000 && i % 7 == 0) sample.current_A.a = nan;
      const hal::Duty duty = axis.tick(sample);
      motors[k].run(duty);
      if (k == 0) duties.push_back(duty);
      if (i == 2500 && (k == 0 || busy_neighbour)) {
        EXPECT_EQ(axis.arm(), Status::done);
      }
      if (i > 2500 && i % 50 == 0 && (k == 0 || busy_neighbour)) {
        EXPECT_EQ(axis.set_current({0.0f, k == 0 ? 2.0f : (i / 500 % 2 == 0 ? -4.0f : 4.0f)}), Status::done);
      }
    }
    if (i % 200 == 199) driver.slow_tick({{25.0f, true}, 0.0f, false}, {{{25.0f, true}}, {{25.0f, true}}});
  }
  EXPECT_EQ(driver.axis(0).mode(), Mode::running);
  EXPECT_EQ(driver.axis(1).mode(), busy_neighbour ? Mode::tripped : Mode::off);
  return duties;
}

TEST(Axis, HowLongTheLoadMayGoOnIsSaidBeforeItsLimitComes) {
  wire::Motor sheet = bench::motor();
  sheet.R1_K_per_W = 2.0, sheet.C1_J_per_K = 5.0;  // 20 A in 7 s
  firmware::DriverSetup setup = bench::driver_setup();
  setup.axes[0].heat = thermal::three_phase_set(sheet);
  Rig rig(setup);
  rig.bring_up();
  rig.motor.rad_per_s = 50;
  rig.hold({0.0f, 2.0f}, 40000);
  EXPECT_EQ(rig.axis().state().time_left_s, bench::inf);
  EXPECT_EQ(rig.axis().state().allowance_1s_A, bench::rating.peak_A);
  rig.hold({0.0f, 20.0f}, 30000);
  const float told_s = rig.axis().state().time_left_s;
  ASSERT_GT(told_s, 1.5f);
  float went_s = 0.0f;
  for (; rig.axis().state().limit != Limit::core_hot && went_s < 30.0f; went_s += 0.01f) {
    rig.hold({0.0f, 20.0f}, 200);
    if (rig.axis().state().time_left_s < 0.5f) {
      EXPECT_LT(rig.axis().state().allowance_1s_A, 20.0f);
    }
  }
  constexpr float answer_s = 0.8f, braking_s = 0.6f;  // as old as what is told may be; from peak to holding current
  EXPECT_LT(went_s, told_s);
  EXPECT_GT(went_s, told_s - answer_s - braking_s);
  std::printf("told %.2f s, held back after %.2f s\n", static_cast<double>(told_s), static_cast<double>(went_s));
}

TEST(Driver, AnAxisDoesNotFeelTheOtherOneMoveOrTrip) {
  const std::vector<hal::Duty> alone = first_axis_beside(false), beside = first_axis_beside(true);
  ASSERT_EQ(alone.size(), beside.size());
  for (std::size_t i = 0; i < alone.size(); ++i) {
    ASSERT_EQ(alone[i].on, beside[i].on) << i;
    ASSERT_EQ(alone[i].ratio.a, beside[i].ratio.a) << i;
    ASSERT_EQ(alone[i].ratio.b, beside[i].ratio.b) << i;
    ASSERT_EQ(alone[i].ratio.c, beside[i].ratio.c) << i;
  }
}

TEST(Driver, TheSharedPowerStageHoldsBothBack) {
  firmware::Driver driver(bench::driver_setup());
  bench::Motor motors[2];
  for (int i = 0; i < 3 * 20000; ++i) {
    for (int k = 0; k < 2; ++k) {
      motors[k].run(driver.axis(k).tick(motors[k].sample()));
      if (i == 2500) {
        EXPECT_EQ(driver.axis(k).arm(), Status::done);
      }
      if (i > 2500 && i % 100 == 0) (void)driver.axis(k).set_current({0.0f, 6.0f});
    }
    // The stage's own sensor says that it is at its limit.
    if (i % 200 == 199) driver.slow_tick({{100.0f, true}, 0.0f, false}, {{{25.0f, true}}, {{25.0f, true}}});
  }
  for (int k = 0; k < 2; ++k) {
    EXPECT_EQ(driver.axis(k).state().limit, Limit::board_hot);
    EXPECT_LT(driver.axis(k).state().allowance_A, 4.5f);  // 6 / sqrt 2 each
    EXPECT_GT(driver.axis(k).state().allowance_A, 3.9f);
  }
}

TEST(Driver, AnAxisGetsOfThePowerStageWhatTheOtherLeaves) {
  for (const float continuous_A : {6.0f, 8.0f}) {
    firmware::DriverSetup setup = bench::driver_setup();
    setup.rating.continuous_A = continuous_A;
    firmware::Driver driver(setup);
    bench::Motor motors[2];
    const float asked_A[2] = {20.0f, 1.0f};  // as it gets all that there is, the model stays where the sensor is
    for (int i = 0; i < 3 * 20000; ++i) {
      for (int k = 0; k < 2; ++k) {
        motors[k].run(driver.axis(k).tick(motors[k].sample()));
        if (i == 2500) (void)driver.axis(k).arm();
        if (i > 2500 && i % 100 == 0) (void)driver.axis(k).set_current({0.0f, asked_A[k]});
      }
      // The stage's own sensor says that it is at its limit.
      if (i % 200 == 199) driver.slow_tick({{100.0f, true}, 0.0f, false}, {{{25.0f, true}}, {{25.0f, true}}});
    }
    const float all_A2 = continuous_A * continuous_A;
    EXPECT_NEAR(driver.axis(0).state().allowance_A, std::sqrt(all_A2 - 1.0f), 0.1f);
    EXPECT_NEAR(driver.axis(1).state().allowance_A, std::sqrt(0.5f * all_A2), 0.1f) << "half, whatever the other takes";
  }
}

TEST(Driver, WhatTheOtherTakesAtOnceComesDownInSmallSteps) {
  firmware::Driver driver(bench::driver_setup());
  bench::Motor motors[2];
  float last_A = 0.0f, steepest_A = 0.0f;
  for (int i = 0; i < 3 * 20000; ++i) {
    for (int k = 0; k < 2; ++k) {
      motors[k].run(driver.axis(k).tick(motors[k].sample()));
      if (i == 2500) (void)driver.axis(k).arm();
      if (i > 2500 && i % 100 == 0 && (k == 0 || i > 40000)) (void)driver.axis(k).set_current({0.0f, 6.0f});
    }
    if (i % 200 != 199) continue;
    driver.slow_tick({{100.0f, true}, 0.0f, false}, {{{25.0f, true}}, {{25.0f, true}}});
    const float now_A = driver.axis(0).state().allowance_A;
    if (i > 30000) steepest_A = std::max(steepest_A, last_A - now_A);
    last_A = now_A;
  }
  EXPECT_NEAR(last_A, 4.24f, 0.3f) << "it came down to its half";
  EXPECT_LE(steepest_A, 0.02f * bench::rating.peak_A * 1.001f);
}

/// An axis without a housing sensor beside one whose housing stays at 90 degC, where what it is bolted to is as warm as
/// the hotter of both.
TEST(Driver, AMotorThatItsNeighbourHeatsIsNotTakenForColder) {
  enum class Seen { reading, estimate };
  for (const thermal::Boundary warm : {thermal::Boundary::neighbour, thermal::Boundary::frame}) {
    for (const Seen seen : {Seen::reading, Seen::estimate}) {
      firmware::DriverSetup setup = bench::driver_setup();
      thermal::HeatSet<double>& heat = setup.axes[0].heat = thermal::two_resistor_set(bench::motor());
      heat.nodes[1].capacity_J_per_K = 20.0;
      heat.links[heat.link_count++] = {1, thermal::boundary_end(warm), thermal::LinkLaw::constant, 0.3, 0.0};
      setup.axes[0].senses_housing = false;
      setup.axes[1].heat.nodes[3].capacity_J_per_K = 1e6;
      firmware::Driver driver(setup);
      const double J_per_K = 20.0 + heat.nodes[0].capacity_J_per_K;
      double housing_degC = 40.0;  // the ambient believed
      for (int i = 0; i < 20000; ++i) {
        driver.slow_tick({}, {{{0.0f, false}}, {{90.0f, seen == Seen::reading || i < 100}}});
        housing_degC += 0.01 / J_per_K * (0.3 * (90.0 - housing_degC) - (housing_degC - 40.0) / 7.4);
        if (i > 200) {
          EXPECT_GT(static_cast<double>(driver.axis(0).state().housing_degC), housing_degC - 1.0) << i;
        }
      }
      EXPECT_GT(housing_degC, 70.0) << "or nothing was shown";
    }
  }
}

// ---- heat -----------------------------------------------------------------------------------------------------------

TEST_F(Running, TheSlowLaneGetsTheSquareOfTheCurrent) {
  hold({0.0f, 5.0f}, 1000);
  // 25 A2, and the ripple of 48 V on 32.5 uH at 20 kHz, which at standstill is small.
  EXPECT_NEAR(axis().current2_A2(), 25.0, 0.6);
}

TEST_F(Running, RippleHeatsAndRubsNothing) {
  motor.rad_per_s = 400;
  hold({0.0f, 5.0f}, 2000);
  const thermal::HeatInput<>& heat = firmware::AxisProbe::heat(axis());
  EXPECT_NEAR(heat[thermal::Drive::current_A], 5.0, 0.1);
  EXPECT_NEAR(heat[thermal::Drive::current_speed], 5.0 * 400, 0.1 * 400);
  EXPECT_GT(heat[thermal::Drive::current_A2], 25.0 + 1.0);
}

TEST(Axis, RippleIsThatOfTheMeanOfBothInductances) {
  const auto ripple_A2 = [](double d_H, double q_H) {
    firmware::DriverSetup setup = bench::driver_setup();
    setup.axes[0].parameters.inductance_d_H = static_cast<float>(d_H);
    setup.axes[0].parameters.inductance_q_H = static_cast<float>(q_H);
    Rig rig(setup);
    rig.motor.sheet.inductance_d_H = d_H, rig.motor.sheet.inductance_q_H = q_H;
    rig.bring_up();
    rig.motor.rad_per_s = 400;
    rig.hold({0.0f, 5.0f}, 4000);
    return rig.axis().state().unseen.of_heat_A2 - rig.axis().state().unseen.of_mean_A2;
  };
  const float wide_d = ripple_A2(50e-6, 20e-6), wide_q = ripple_A2(20e-6, 50e-6);
  EXPECT_GT(wide_d, 1.0f);
  EXPECT_NEAR(wide_d, wide_q, 0.1f * wide_q);
}

TEST(Axis, WhileItOnlyWaitsTurningIsNoHeat) {
  Rig rig;
  rig.bring_up();
  rig.motor.rad_per_s = 400;
  rig.run(2000);
  ASSERT_EQ(rig.axis().mode(), Mode::ready);
  EXPECT_EQ(rig.axis().state().unseen.of_heat_A2, 0.0f);
}

TEST(Axis, AnotherSetAllowsNothingBeforeTheSlowLaneHasSeenIt) {
  Rig rig;
  rig.bring_up();
  rig.axis().disarm();
  rig.run(200);
  ASSERT_GT(rig.axis().state().allowance_A, 10.0f);
  rig.slow_lane_alive = false;
  for (const firmware::HeatModel heat : {firmware::HeatModel::unchanged, firmware::HeatModel::changed}) {
    rig.driver.configure(0, bench::axis_setup(), heat);
    rig.run(2400);
    ASSERT_EQ(rig.axis().arm(), Status::done);
    rig.run(1);
    rig.hold({0.0f, 5.0f}, 200);
    EXPECT_EQ(rig.axis().mode(), Mode::ready);
    EXPECT_EQ(rig.axis().fast().permitted_A.q, 0.0f);
    EXPECT_EQ(rig.axis().fast().limit, Limit::thermal_late);
    rig.axis().disarm();
    rig.run(1);
  }
}

/// Zero amperes are held by a bridge that switches, and its ripple heats.
TEST_F(Running, ABridgeIsOpenWhileNothingIsAllowedAndGoesOnAfterwards) {
  for (const float asked_A : {5.0f, 0.0f}) {
    stage_degC = 101.5f;  // but little too hot: it is believed to be cool enough within 4 s
    hold({0.0f, asked_A}, 40000);
    ASSERT_EQ(axis().state().allowance_A, 0.0f);
    EXPECT_FALSE(duty.on);
    EXPECT_EQ(axis().mode(), Mode::ready);
    EXPECT_EQ(axis().fast().limit, Limit::board_hot) << "why it stands must be told";
    stage_degC = 25.0f;
    hold({0.0f, asked_A}, 80000);
    EXPECT_TRUE(duty.on);
    EXPECT_EQ(axis().mode(), Mode::running);
  }
}

TEST_F(Running, OnceStoppedForWantOfSamplesItShowsNoCurrent) {
  motor.rad_per_s = 400;
  hold({0.0f, 5.0f}, 2000);
  run(200 - ticks % 200);  // the slow lane has just taken all samples
  ASSERT_GT(axis().state().unseen.of_heat_A2, 0.5f);
  for (int i = 0; i < 100; ++i) spoilt([](auto& s) { s.valid = false; });
  ASSERT_EQ(axis().mode(), Mode::tripped);
  for (int i = 0; i < 3; ++i) driver.slow_tick({{25.0f, true}, 0.0f, false}, {{{25.0f, true}}, {{25.0f, true}}});
  EXPECT_EQ(axis().state().unseen.of_heat_A2, 0.0f);
  EXPECT_EQ(axis().state().heating_A, 0.0f);
}

TEST_F(Running, LostTimeIsChargedHotterThanTheLastSample) {
  hold({0.0f, 5.0f}, 200 - ticks % 200 + 100);  // the middle of a slow period
  const double before_A2 = axis().current2_A2();
  motor.sequence += 60;  // 3 ms without a sample
  hold({0.0f, 5.0f}, 100);
  EXPECT_EQ(axis().mode(), Mode::running);
  // 60 of 260 periods count 1.21 times 25 A2 in every phase, which is twice the vector a real motor could have.
  EXPECT_GT(axis().current2_A2(), before_A2 * 1.1);
}

/// What an axis that is off makes of 14 s of a current that flows all the same, its slow lane called every so many
/// periods.
std::unique_ptr<firmware::Driver> after_current(int every, const hal::AxisSample& flowing) {
  auto out = std::make_unique<firmware::Driver>(bench::driver_setup());
  firmware::Driver& driver = *out;
  std::uint32_t sequence = bench::bring_up(driver.axis(0));
  driver.axis(0).disarm();
  for (int i = 1; i <= 280000; ++i) {
    hal::AxisSample sample = flowing;
    sample.sequence = sequence++;
    (void)driver.axis(0).tick(sample);
    if (i % every == 0) driver.slow_tick({{0.0f, false}, 0.0f, false}, {{{25.0f, true}}, {{25.0f, true}}});
  }
  return out;
}

TEST_F(Running, TimeWithoutSamplesIsTimeAllTheSame) {
  hold({0.0f, 5.0f}, 200 - ticks % 200);
  int steps = 0;
  for (int i = 0; i < 20; ++i) {
    motor.sequence += 190;  // of 390 periods
    hold({0.0f, 5.0f}, 200);
    steps += axis().elapsed_steps();
  }
  EXPECT_EQ(axis().mode(), Mode::running);
  EXPECT_NEAR(steps, 39, 1);
}

TEST(Axis, ASlowLaneThatIsLateLosesNoTime) {
  hal::AxisSample flowing = bench::quiet_sample(0);
  flowing.current_A = {5, -2.5f, -2.5f};
  const auto on_time = after_current(200, flowing);
  for (const int every : {220, 280, 298}) {
    const auto late = after_current(every, flowing);
    const auto rise_K = [](const firmware::Driver& d) { return d.axis(0).core().estimate().hottest_degC() - 25; };
    EXPECT_GT(rise_K(*late), 0.98 * rise_K(*on_time)) << every;
    EXPECT_GT(late->board_heat().used_ratio(), 0.98f * on_time->board_heat().used_ratio()) << every;
  }
}

/// 4 s of a slow lane that is late by 20 ms each other time, when a current flows; on time: the same current.
double rise_of_bursts_K(bool on_time) {
  firmware::Driver driver(bench::driver_setup());
  std::uint32_t sequence = bench::bring_up(driver.axis(0));
  driver.axis(0).disarm();
  for (int i = 0; i < 80000; ++i) {
    hal::AxisSample sample = bench::quiet_sample(sequence++);
    const int in_cycle = i % 800;
    if (in_cycle >= 200) sample.current_A = {20, -10, -10};
    (void)driver.axis(0).tick(sample);
    if (on_time ? in_cycle % 200 == 199 : in_cycle == 199 || in_cycle == 799)
      driver.slow_tick({{0.0f, false}, 0.0f, false}, {{{25.0f, true}}, {{25.0f, true}}});
  }
  return driver.axis(0).core().estimate().hottest_degC() - 25;
}

TEST(Axis, ASlowLaneThatIsLateWhileItGetsHotLosesNoHeat) {
  EXPECT_GT(rise_of_bursts_K(false), 0.98 * rise_of_bursts_K(true));
}

/// 3 s of a slow lane that needs a little more than a step and a half, a little less, and so on: rounded to two steps
/// and to one. A current flows whenever it needs more, or whenever it needs less.
std::unique_ptr<firmware::Driver> after_bursts_in_step(bool on_time, bool in_the_longer) {
  auto driver = std::make_unique<firmware::Driver>(bench::driver_setup());
  std::uint32_t sequence = bench::bring_up(driver->axis(0));
  driver->axis(0).disarm();
  for (int i = 0; i < 60000; ++i) {
    hal::AxisSample sample = bench::quiet_sample(sequence++);
    const int in_cycle = i % 600;
    if ((in_cycle < 310) == in_the_longer) sample.current_A = {10, -5, -5};
    (void)driver->axis(0).tick(sample);
    if (on_time ? in_cycle % 200 == 199 : in_cycle == 309 || in_cycle == 599)
      driver->slow_tick({{0.0f, false}, 0.0f, false}, {{{25.0f, true}}, {{25.0f, true}}});
  }
  return driver;
}

TEST(Axis, ASlowLaneThatIsLateInStepWithTheCurrentLosesNoHeat) {
  const auto rise_K = [](const firmware::Driver& d) { return d.axis(0).core().estimate().hottest_degC() - 25; };
  for (const bool in_the_longer : {false, true}) {
    const auto late = after_bursts_in_step(false, in_the_longer), on_time = after_bursts_in_step(true, in_the_longer);
    EXPECT_GT(rise_K(*late), 0.98 * rise_K(*on_time)) << in_the_longer;
    EXPECT_LT(rise_K(*late), 1.05 * rise_K(*on_time)) << in_the_longer << ": nor finds any";
    EXPECT_GT(late->board_heat().used_ratio(), 0.98f * on_time->board_heat().used_ratio()) << in_the_longer;
  }
}

/// A shaft that somebody swings 50 times a second. What it does when the slow lane comes is not what it did.
TEST(Axis, ASwingInStepWithTheSlowLaneHidesNoHeatOfSpeedAndCoolsNoMore) {
  constexpr double swing_Hz = 50, fastest_rad_per_s = 600, pi = 3.141592653589793;
  const auto input_at = [&](double phase_rad) {
    firmware::Driver driver(bench::driver_setup());
    for (int i = 1; i <= 4000; ++i) {
      hal::AxisSample sample = bench::quiet_sample(static_cast<std::uint32_t>(i));
      const double swing_rad = fastest_rad_per_s / (2 * pi * swing_Hz);
      sample.rotor_rad =
          static_cast<float>(3 + swing_rad * std::sin(2 * pi * swing_Hz * i * bench::period_s + phase_rad));
      (void)driver.axis(0).tick(sample);
      if (i % 20 == 0) driver.watch();
      if (i % 200 == 0) driver.slow_tick({{0.0f, false}, 0.0f, false}, {{{25.0f, true}}, {{25.0f, true}}});
    }
    return driver.axis(0).core().input();
  };
  for (int k = 0; k < 8; ++k) {
    const thermal::HeatInput<> input = input_at(k * pi / 8);
    const double mean = 2 / pi * fastest_rad_per_s, mean2 = 0.5 * fastest_rad_per_s * fastest_rad_per_s;
    EXPECT_NEAR(input[thermal::Drive::speed_rad_per_s], mean, 0.05 * mean) << k;
    EXPECT_NEAR(input[thermal::Drive::speed2_rad2_per_s2], mean2, 0.05 * mean2) << k;
    EXPECT_LE(input[thermal::Drive::speed_to_0_8], std::pow(mean, 0.8)) << k;
  }
}

TEST(Axis, WhatFlowsThroughTheDiodesBesideARefusedSampleHeats) {
  hal::AxisSample flowing = bench::quiet_sample(0);
  flowing.current_A = {5, -2.5f, -2.5f};
  const double admitted_degC = after_current(200, flowing)->axis(0).core().estimate().hottest_degC();
  hal::AxisSample over_voltage = flowing, blind = flowing;
  over_voltage.bus_V = 60;
  blind.valid = false;
  for (const hal::AxisSample& sample : {over_voltage, blind})
    EXPECT_GT(after_current(200, sample)->axis(0).core().estimate().hottest_degC(), admitted_degC - 0.5);
}

/// The loop drives three times the current through a phase that seems to carry none.
TEST(Axis, APhaseWhoseSensorIsDeadIsNoColderThanItIs) {
  for (const float gain : {0.0f, 0.5f}) {
    Rig rig;
    rig.bring_up();
    rig.motor.angle_rad = 0.5;  // of two pole pairs: most of the current is that of phase a
    for (int i = 0; i < 4000; ++i) {
      ASSERT_EQ(rig.axis().set_current({0.0f, 5.0f}), Status::done);
      rig.spoilt([&](hal::AxisSample& s) { s.current_A.a *= gain; });
      if (rig.ticks % 200 == 0) rig.driver.slow_tick({{25.0f, true}, 0.0f, false}, {{{25.0f, true}}, {{25.0f, true}}});
    }
    ASSERT_EQ(rig.axis().mode(), Mode::running);
    const float a_A = rig.motor.phases().a;
    EXPECT_GT(std::fabs(a_A), 1.1f * 5.0f) << gain;
    EXPECT_GE(rig.axis().core().input()[thermal::Drive::phase_a_A2], static_cast<double>(0.98f * a_A * a_A)) << gain;
  }
}

TEST(Axis, AStalledMotorIsHeldByItsCoreLimitBelowIt) {
  // A winding as small as an EC 16's: 20 A would take it through its limit in half a second.
  wire::Motor small = bench::motor();
  small.phase_resistance_ohm = 0.5;
  small.C1_J_per_K = 1.13;
  small.R1_K_per_W = 1.08;
  firmware::DriverSetup setup = bench::driver_setup();
  setup.axes[0] = {firmware::parameters_from(small, bench::rating, {48.0f, 0.0f}), thermal::three_phase_set(small)};
  Rig rig(setup);
  rig.motor.sheet = small;
  rig.bring_up();
  float hottest_degC = 0.0f, least_A = 20.0f;
  for (int i = 0; i < 200; ++i) {
    rig.hold({0.0f, 20.0f}, 200);
    for (const float degC : rig.axis().state().core_degC) hottest_degC = std::max(hottest_degC, degC);
    least_A = std::min(least_A, rig.axis().state().allowance_A);
  }
  EXPECT_EQ(rig.axis().state().limit, Limit::core_hot);
  EXPECT_LT(hottest_degC, 155.0f);
  EXPECT_GT(hottest_degC, 110.0f) << "the governor should use what the winding can stand";
  EXPECT_NEAR(rig.motor.iq_A, rig.axis().state().allowance_A, 0.2);
  EXPECT_LT(least_A, 12.0f);
}

TEST_F(Running, AThermalLaneThatDiesLeavesSixtyPercentOfContinuous) {
  hold({0.0f, 10.0f}, 400);
  slow_lane_alive = false;
  hold({0.0f, 10.0f}, 700);
  EXPECT_EQ(axis().fast().limit, Limit::thermal_late);
  EXPECT_NEAR(motor.iq_A, 3.6, 0.1);
  slow_lane_alive = true;
  hold({0.0f, 10.0f}, 400);
  EXPECT_NEAR(motor.iq_A, 10.0, 0.2);
}

TEST_F(Running, ALostHousingSensorIsGentleAndNamed) {
  hold({0.0f, 10.0f}, 400);
  housing_ok = false;
  float last_A = axis().state().allowance_A;
  for (int i = 0; i < 100; ++i) {
    hold({0.0f, 10.0f}, 200);
    EXPECT_GT(axis().state().allowance_A, last_A - 0.45f) << "no step that would make a robot fall";
    last_A = axis().state().allowance_A;
  }
  EXPECT_FLOAT_EQ(last_A, 3.6f);
  EXPECT_EQ(axis().state().limit, Limit::blind);
  EXPECT_NE(axis().state().estimate_flags & thermal::housing_missing, 0u);
  housing_ok = true;
  hold({0.0f, 10.0f}, 20000);
  EXPECT_GT(axis().state().allowance_A, 10.0f);
}

TEST(Axis, WithoutAHousingSensorByDesignItGoesOnTheModel) {
  firmware::DriverSetup setup = bench::driver_setup();
  setup.axes[0].senses_housing = false;
  Rig rig(setup);
  rig.housing_ok = false;
  rig.bring_up();
  rig.hold({0.0f, 10.0f}, 20000);
  EXPECT_NEAR(rig.motor.iq_A, 10.0, 0.2);
  EXPECT_NEAR(rig.axis().state().housing_degC, 40.0f, 1.0f);
}

// ---- offsets --------------------------------------------------------------------------------------------------------

TEST(Axis, LearnsTheCurrentOffsetWhileOff) {
  Rig rig;
  for (int i = 0; i < 2100; ++i) rig.spoilt([](auto& s) { s.current_A = {0.3f, -0.2f, 0.1f}; });
  EXPECT_NEAR(rig.axis().current_offset_A().a, 0.3f, 1e-5f);
  EXPECT_NEAR(rig.axis().current_offset_A().b, -0.2f, 1e-5f);
  EXPECT_NEAR(rig.axis().fast().current_A.d, 0.0f, 1e-5f);
}

TEST(Axis, AnOffsetBeyondItsBoundTrips) {
  Rig rig;
  for (int i = 0; i < 2100; ++i) rig.spoilt([](auto& s) { s.current_A.c = -0.6f; });
  EXPECT_EQ(rig.axis().mode(), Mode::tripped);
  EXPECT_EQ(rig.axis().fault().fault, Fault::current_offset);
  EXPECT_NEAR(rig.axis().fault().value, 0.6f, 1e-4f);
  EXPECT_EQ(rig.axis().current_offset_A().c, 0.0f) << "a broken sensor's offset must not be used";
}

TEST(Axis, LearnsNothingFromAMotorThatIsDrivenByHand) {
  Rig rig;
  rig.motor.rad_per_s = 2000.0;  // 32 V of back-EMF, line to line 55 V: the diodes conduct
  for (int i = 0; i < 5000; ++i) rig.spoilt([](auto& s) { s.current_A.a = 3.0f; });
  EXPECT_EQ(rig.axis().current_offset_A().a, 0.0f);
  EXPECT_EQ(rig.axis().mode(), Mode::off);
  EXPECT_EQ(rig.axis().arm(), Status::offset_unknown);
}

// ---- setting up -----------------------------------------------------------------------------------------------------

// ---- control mode ---------------------------------------------------------------------------------------------------

TEST(Axis, TorqueModeMakesTheTorqueThatWasAskedFor) {
  Rig rig;
  rig.run(2400);
  ASSERT_EQ(rig.axis().control(), wire::ControlMode::current) << "every start";
  EXPECT_EQ(rig.axis().set_torque(0.0f, 0.1f), Status::other_mode);
  ASSERT_EQ(rig.axis().choose(wire::ControlMode::torque), Status::done);
  EXPECT_EQ(rig.axis().set_current({0.0f, 1.0f}), Status::other_mode);
  ASSERT_EQ(rig.axis().arm(), Status::done);
  EXPECT_EQ(rig.axis().choose(wire::ControlMode::current), Status::mode_in_use) << "posted is as good as armed";
  rig.run(1);
  const auto settle = [&](float torque_Nm) {
    for (int i = 0; i < 2000; i += 100) {
      ASSERT_EQ(rig.axis().set_torque(0.0f, torque_Nm), Status::done);
      rig.run(100);
    }
  };
  for (const float torque_Nm : {0.05f, -0.12f}) {
    settle(torque_Nm);
    EXPECT_EQ(rig.axis().mode(), Mode::running);
    EXPECT_EQ(rig.axis().choose(wire::ControlMode::current), Status::mode_in_use);
    // The sheet's 27.6 mN m/A is of line current; per ampere of amplitude it is sqrt(3)/2 of that.
    const double made_Nm = rig.motor.iq_A * 27.6e-3 * std::sqrt(3.0) / 2;
    EXPECT_NEAR(made_Nm, static_cast<double>(torque_Nm), 0.02 * 0.12) << rig.motor.iq_A;
  }
}

/// More than anybody allows is cut to what is allowed, in amperes: a limit taken before the conversion would let
/// 1 / 0.024 times as much through.
TEST(Axis, InTorqueModeEveryLimitIsOneOfCurrent) {
  Rig rig;
  rig.run(2400);
  ASSERT_EQ(rig.axis().choose(wire::ControlMode::torque), Status::done);
  ASSERT_EQ(rig.axis().arm(), Status::done);
  rig.run(1);
  float most_A = 0.0f;
  for (int i = 0; i < 4000; ++i) {
    ASSERT_EQ(rig.axis().set_torque(0.0f, 10.0f), Status::done);  // 418 A
    rig.run(1);
    most_A = std::max(most_A, std::hypot(rig.axis().fast().permitted_A.d, rig.axis().fast().permitted_A.q));
    ASSERT_LE(most_A, bench::rating.peak_A);
    ASSERT_LE(rig.axis().fast().permitted_A.q, rig.axis().state().allowance_A + bench::rating.peak_A * 0.02f);
  }
  EXPECT_GT(most_A, 0.9f * bench::rating.peak_A);
  EXPECT_NE(rig.axis().fast().limit, wire::Limit::none);
  const wire::Dq before = rig.axis().fast().permitted_A;
  for (const float torque_Nm : {std::nanf(""), INFINITY, 25.0f}) {  // the last one: beyond 1000 A
    EXPECT_EQ(rig.axis().set_torque(0.0f, torque_Nm), Status::not_a_current);
  }
  EXPECT_EQ(rig.axis().set_torque(std::nanf(""), 0.01f), Status::not_a_current);
  rig.run(1);
  EXPECT_NEAR(rig.axis().fast().permitted_A.q, before.q, 1.0f) << "what is refused changes nothing";
}

TEST(Axis, WithoutAFluxLinkageThereIsNoTorqueMode) {
  for (const float flux_Wb : {firmware::unset, 0.0f}) {
    firmware::DriverSetup setup = bench::driver_setup();
    setup.axes[0].parameters.flux_linkage_Wb = flux_Wb;
    firmware::Driver driver(setup);
    (void)driver.axis(0).tick(bench::quiet_sample(1));
    EXPECT_EQ(driver.axis(0).choose(wire::ControlMode::torque), Status::parameters_unset) << flux_Wb;
    EXPECT_EQ(driver.axis(0).control(), wire::ControlMode::current);
  }
  // Taken back while torque mode stands: nothing is asked for any more, not even zero.
  Rig rig;
  rig.run(2400);
  ASSERT_EQ(rig.axis().choose(wire::ControlMode::torque), Status::done);
  firmware::AxisSetup setup = bench::axis_setup();
  setup.parameters.flux_linkage_Wb = firmware::unset;
  rig.driver.configure(0, setup, firmware::HeatModel::unchanged);
  rig.run(1);
  EXPECT_EQ(rig.axis().set_torque(0.0f, 0.0f), Status::not_a_current);
  EXPECT_EQ(rig.axis().arm(), Status::parameters_unset);
}

TEST(Axis, AnIncompleteSetRefusesToArm) {
  firmware::DriverSetup setup = bench::driver_setup();
  setup.axes[0].parameters.flux_linkage_Wb = wire::unset;
  Rig rig(setup);
  rig.run(3000);
  EXPECT_EQ(rig.axis().mode(), Mode::off);
  EXPECT_EQ(rig.axis().arm(), Status::parameters_unset);
  EXPECT_FALSE(rig.duty.on);
}

TEST(Axis, AContradictorySetTripsAndCannotBeCleared) {
  const auto check = [](const firmware::DriverSetup& setup, float id) {
    Rig rig(setup);
    rig.run(300);
    EXPECT_EQ(rig.axis().mode(), Mode::tripped);
    EXPECT_EQ(rig.axis().fault().fault, Fault::parameters);
    EXPECT_EQ(rig.axis().fault().threshold, id);
    EXPECT_EQ(rig.axis().clear(), Status::parameter_refused) << "or a person is told that it is cleared";
    rig.run(300);
    EXPECT_EQ(rig.axis().mode(), Mode::tripped);
    (void)rig.axis().arm();
    (void)rig.axis().set_current({0.0f, 1.0f});
    rig.run(300);
    EXPECT_EQ(rig.axis().mode(), Mode::tripped);
    EXPECT_EQ(rig.axis().state().allowance_A, 0.0f);
    EXPECT_FALSE(rig.duty.on);
  };
  firmware::DriverSetup setup = bench::driver_setup();
  setup.axes[0].parameters.current_limit_A = 25.0f;
  check(setup, 0x0111);
  setup = bench::driver_setup();
  setup.axes[0].heat.nodes[0].capacity_J_per_K = -1.0;
  check(setup, 0.0f);
  setup = bench::driver_setup();
  setup.rating.trip_A = 10.0f;  // below the peak
  check(setup, 0.0f);
}

}  // namespace

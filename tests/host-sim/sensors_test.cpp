// SPDX-License-Identifier: MIT
#include "host-sim/plant/sensors.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "tests/host-sim/plant_fixtures.hpp"

namespace {

using host_sim::Bench;
using host_sim::BenchDesign;
using host_sim::Channel;
using host_sim::FaultKind;
using host_sim::Load;
using host_sim::SensorDesign;
using plant_tests::period_s;

constexpr std::array<hal::Duty, 2> both_released = {hal::Duty{{0, 0, 0}, false}, hal::Duty{{0, 0, 0}, false}};

BenchDesign quiet() {
  BenchDesign design = plant_tests::bench_design(plant_tests::small_motor());
  design.sensors.current_noise_A = design.sensors.bus_noise_V = design.sensors.bus_noise_A =
      design.sensors.ntc_noise_K = 0;
  return design;
}

/// Spins axis 0 at an imposed speed, released.
void spin(Bench& bench, double speed_rad_per_s, double seconds) {
  bench.load(0).mode = Load::Mode::imposed_speed;
  bench.load(0).speed_rad_per_s = speed_rad_per_s;
  for (int n = 0; n < seconds / period_s; ++n) bench.advance_period(both_released);
}

TEST(Converter, RoundsAndClampsAndReadsNonsenseAsBroken) {
  EXPECT_EQ(host_sim::to_counts(1234.4, 4095), 1234);
  EXPECT_EQ(host_sim::to_counts(1234.6, 4095), 1235);
  EXPECT_EQ(host_sim::to_counts(-3, 4095), 0);
  EXPECT_EQ(host_sim::to_counts(1e9, 4095), 4095);
  EXPECT_EQ(host_sim::to_counts(std::numeric_limits<double>::quiet_NaN(), 4095), 0);
}

TEST(Ntc, CountsFallWithTemperatureAndInvertByTheStatedNumbers) {
  const host_sim::NtcDesign ntc;
  double last = 4096;
  for (double degC = -40; degC <= 200; degC += 0.5) {
    const double counts = host_sim::ntc_counts(ntc, degC, 4095);
    ASSERT_LT(counts, last);
    last = counts;
    // The way back as a board would write it from SensorDesign alone.
    const double r_ohm = ntc.pull_up_ohm * counts / (4095 - counts);
    EXPECT_NEAR(1 / (1 / 298.15 + std::log(r_ohm / ntc.r25_ohm) / ntc.beta_K) - 273.15, degC, 1e-9);
  }
  EXPECT_NEAR(host_sim::ntc_counts(ntc, 25, 4095), 4095 / 2.0, 1e-9);
}

TEST(CurrentChain, CountsStandForAmperesWithGainAndOffset) {
  BenchDesign design = quiet();
  design.sensors.current_gain[1] = 0.9;
  design.sensors.current_offset_A[2] = 0.5;
  Bench bench(design, 1);
  EXPECT_EQ(bench.raw(0).current_counts[0], 2048);
  EXPECT_NEAR(bench.raw(0).current_counts[2], 2048 + 0.5 / design.sensors.current_A_per_count, 0.5);
  bench.load(0).mode = Load::Mode::locked;
  const std::array<hal::Duty, 2> push = {hal::Duty{{0.5f, 0.6f, 0.4f}, true}, both_released[1]};
  for (int n = 0; n < 50; ++n) bench.advance_period(push);
  const auto amps = bench.truth(0).current_A;
  EXPECT_GT(amps[1], 3);
  EXPECT_NEAR(bench.raw(0).current_counts[1], 2048 + 0.9 * amps[1] / design.sensors.current_A_per_count, 0.51);
  EXPECT_EQ(bench.raw(1).current_counts[0], 2048);  // the other axis sees nothing
}

TEST(CurrentChain, SaturatesAtBothRails) {
  Bench bench(quiet(), 1);
  bench.load(0).mode = Load::Mode::locked;
  const std::array<hal::Duty, 2> shove = {hal::Duty{{0, 1, 0.5f}, true}, both_released[1]};
  for (int n = 0; n < 50; ++n) bench.advance_period(shove);
  ASSERT_GT(bench.truth(0).current_A[1], 41);
  EXPECT_EQ(bench.raw(0).current_counts[1], 4095);
  EXPECT_EQ(bench.raw(0).current_counts[0], 0);
}

TEST(Encoder, CountsTurnsWrapsAndLatchesTheIndexBothWays) {
  Bench bench(quiet(), 1);
  const double speed_rad_per_s = 1000;
  spin(bench, speed_rad_per_s, 0.2);  // 31.8 turns: past 65536 counts
  const double turned = 0.2 * speed_rad_per_s / (2 * host_sim::pi);
  EXPECT_NEAR(bench.raw(0).encoder_counts, std::fmod(turned * 4096, 65536), 2);
  EXPECT_EQ(bench.raw(0).index_pulses, 31u);
  EXPECT_EQ(bench.raw(0).index_latch % 4096, 0);
  spin(bench, -speed_rad_per_s, 0.25);
  EXPECT_NEAR(bench.raw(0).encoder_counts, 65536 - std::fmod(0.05 * 1000 / (2 * host_sim::pi) * 4096, 65536), 3);
  EXPECT_EQ(bench.raw(0).index_latch % 4096, 0);
  EXPECT_EQ(bench.raw(1).encoder_counts, 0);
}

TEST(Encoder, LatchesTheSameZeroFromBothSides) {
  Bench bench(quiet(), 1);
  const double turn_s = 2 * host_sim::pi / 1000;
  spin(bench, 1000, 1.5 * turn_s);
  EXPECT_EQ(bench.raw(0).index_latch, 4096);
  spin(bench, 1000, 1.0 * turn_s);
  EXPECT_EQ(bench.raw(0).index_latch, 2 * 4096);
  spin(bench, -1000, 1.0 * turn_s);
  EXPECT_EQ(bench.raw(0).index_latch, 2 * 4096);
  spin(bench, -1000, 1.0 * turn_s);
  EXPECT_EQ(bench.raw(0).index_latch, 4096);
}

TEST(BusChain, ReadsVoltsAndTheAmperesThatTheBridgesTake) {
  const BenchDesign design = quiet();
  Bench bench(design, 1);
  bench.load(0).mode = Load::Mode::locked;
  for (int n = 0; n < 400; ++n) bench.advance_period({hal::Duty{{0.7f, 0.4f, 0.4f}, true}, both_released[1]});
  double supply_A = bench.supply_A();
  ASSERT_GT(supply_A, 3);
  const host_sim::BoardRaw& raw = bench.board_raw();
  EXPECT_NEAR((raw.bus_current_counts - design.sensors.bus_zero_counts) * design.sensors.bus_A_per_count, supply_A,
              0.05);
  EXPECT_NEAR(raw.bus_voltage_counts * design.sensors.bus_V_per_count, bench.bus_V(), 0.01);
  // The filter: a millisecond after the current has stopped a third of the reading is left.
  for (int n = 0; n < 20; ++n) bench.advance_period(both_released);
  EXPECT_NEAR((raw.bus_current_counts - design.sensors.bus_zero_counts) * design.sensors.bus_A_per_count / supply_A,
              std::exp(-1), 0.15);
}

TEST(Encoder, ThatDoesNotKnowZeroLearnsItAtTheIndex) {
  BenchDesign design = quiet();
  design.encoder_knows_zero = false;
  design.start_angle_rad[0] = 2;
  Bench bench(design, 1);
  EXPECT_EQ(bench.raw(0).encoder_counts, 0);
  spin(bench, 1000, 0.01);
  // The counter at mechanical zero is what the latch says: angle = (counts - latch) / 4096 turns.
  const int past = static_cast<std::int16_t>(bench.raw(0).encoder_counts - bench.raw(0).index_latch);
  const double told_rad = past * 2 * host_sim::pi / 4096;
  EXPECT_NEAR(std::remainder(told_rad - bench.truth(0).angle_rad, 2 * host_sim::pi), 0, 0.004);
}

TEST(Hall, ShowsSixSectorsInOrder) {
  Bench bench(quiet(), 1);
  std::vector<int> seen;
  bench.load(0).mode = Load::Mode::imposed_speed;
  bench.load(0).speed_rad_per_s = 500;
  while (bench.motor(0).turns() < 1) {
    bench.advance_period(both_released);
    if (seen.empty() || seen.back() != bench.raw(0).hall) seen.push_back(bench.raw(0).hall);
  }
  EXPECT_EQ(std::set<int>(seen.begin(), seen.end()), (std::set<int>{1, 2, 3, 4, 5, 6}));
  for (std::size_t i = 1; i < seen.size(); ++i) {
    EXPECT_EQ(__builtin_popcount(static_cast<unsigned>(seen[i] ^ seen[i - 1])), 1);
  }
}

TEST(Faults, EachKindDoesWhatItsNameSays) {
  struct Case {
    FaultKind kind;
    double value, expected_A;
  };
  const Case cases[] = {{FaultKind::gain, 0.5, 2},    {FaultKind::offset, 0.5, 4.5}, {FaultKind::drift, 10, 4.5},
                        {FaultKind::fixed, 2048, 0},  {FaultKind::stuck, 0, 0},      {FaultKind::slow, 0.05, 2.5},
                        {FaultKind::delayed, 0.1, 0}, {FaultKind::off, 0, -40},      {FaultKind::delayed, 0.03, 4}};
  for (const Case& c : cases) {
    host_sim::FaultTable table;
    host_sim::Random random(3);
    table.add({.axis = 0, .channel = Channel::current_a, .kind = c.kind, .value = c.value});
    double counts = 0;
    for (int n = 0; n <= 1000; ++n) {  // 50 ms; 4 A from the second sample on
      const double time_s = n * period_s;
      const double seen_A = table.bend(0, Channel::current_a, n == 0 ? 0 : 4, time_s, random);
      counts = table.replace(0, Channel::current_a, 2048 + seen_A * 2048 / 40, 4095, time_s, random);
      EXPECT_EQ(table.bend(1, Channel::current_a, 4, time_s, random), 4);
      EXPECT_EQ(table.bend(0, Channel::current_b, 4, time_s, random), 4);
    }
    EXPECT_NEAR((counts - 2048) * 40 / 2048, c.expected_A, 0.05) << static_cast<int>(c.kind);
  }
}

TEST(Faults, BeginAndEndWhenTheySay) {
  Bench bench(quiet(), 1);
  const auto cold = bench.raw(0).housing_counts;
  bench.faults().add(
      {.axis = 0, .channel = Channel::housing, .kind = FaultKind::offset, .value = 30, .from_s = 0.01, .to_s = 0.02});
  for (int n = 0; n < 100; ++n) bench.advance_period(both_released);
  EXPECT_EQ(bench.raw(0).housing_counts, cold);
  for (int n = 0; n < 200; ++n) bench.advance_period(both_released);
  EXPECT_LT(bench.raw(0).housing_counts, cold - 500);
  for (int n = 0; n < 200; ++n) bench.advance_period(both_released);
  EXPECT_EQ(bench.raw(0).housing_counts, cold);
}

TEST(Faults, MissingConversionsSwapsAndFrozenEncodersReachTheRawValues) {
  Bench bench(quiet(), 1);
  bench.faults().add({.axis = 0, .channel = Channel::conversion, .kind = FaultKind::off, .from_s = 0.01, .to_s = 0.02});
  spin(bench, 700, 0.012);
  const auto sequence = bench.raw(0).sequence;
  const auto counts = bench.raw(0).encoder_counts;
  spin(bench, 700, 0.005);
  EXPECT_EQ(bench.raw(0).sequence, sequence);
  EXPECT_EQ(bench.raw(0).encoder_counts, counts);
  spin(bench, 700, 0.005);
  EXPECT_GT(bench.raw(0).sequence, sequence);

  bench.faults().clear();
  bench.faults().add({.axis = 0, .channel = Channel::encoder, .kind = FaultKind::stuck});
  spin(bench, 700, 0.001);
  const auto frozen = bench.raw(0).encoder_counts;
  spin(bench, 700, 0.01);
  EXPECT_EQ(bench.raw(0).encoder_counts, frozen);

  bench.faults().clear();
  bench.faults().add({.axis = 1, .channel = Channel::encoder, .kind = FaultKind::swapped, .other_axis = 0});
  spin(bench, 700, 0.001);
  EXPECT_EQ(bench.raw(1).encoder_counts, bench.raw(0).encoder_counts);
  EXPECT_NE(bench.raw(0).encoder_counts, 0);
}

}  // namespace

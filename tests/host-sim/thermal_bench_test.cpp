// SPDX-License-Identifier: MIT
#include "host-sim/plant/thermal_bench.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <set>

#include "host-sim/plant/hidden_causes.hpp"
#include "tests/host-sim/plant_fixtures.hpp"

namespace {

using host_sim::Demand;
using host_sim::Excitation;
using host_sim::HiddenCause;
using host_sim::LogNoise;
using host_sim::ThermalDesign;
using host_sim::ThermalSample;

constexpr double rate_Hz = 20;

ThermalDesign quiet_design() {
  ThermalDesign design;
  design.sheet = plant_tests::small_motor();
  design.noise = LogNoise::none();
  return design;
}

double full_speed() { return host_sim::full_speed_rad_per_s(plant_tests::small_motor(), 24); }

std::vector<Demand> demands(Excitation kind, std::uint64_t seed = 7, double length_s = 600) {
  return host_sim::make_excitation(kind, plant_tests::small_motor(), full_speed(), length_s, rate_Hz, seed);
}

std::vector<ThermalSample> log_of(const ThermalDesign& design, const std::vector<Demand>& wanted,
                                  std::uint64_t seed = 1) {
  return host_sim::record(design, wanted, rate_Hz, 10, seed);
}

double mean(const std::vector<ThermalSample>& log, double ThermalSample::*field) {
  double sum = 0;
  for (const ThermalSample& s : log) sum += s.*field;
  return sum / static_cast<double>(log.size());
}

TEST(ThermalBench, SameSeedSameLogOtherSeedOtherNoise) {
  ThermalDesign design = quiet_design();
  design.noise = LogNoise{};
  design.noise.winding_every_s = 30;
  const auto wanted = demands(Excitation::robot_duty);
  const auto one = log_of(design, wanted, 5), two = log_of(design, wanted, 5), other = log_of(design, wanted, 6);
  ASSERT_EQ(one.size(), 6000u);
  int differing = 0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    ASSERT_EQ(one[i].housing_degC, two[i].housing_degC);
    ASSERT_EQ(one[i].current_A, two[i].current_A);
    ASSERT_EQ(one[i].winding_degC, two[i].winding_degC);
    differing += one[i].housing_degC != other[i].housing_degC;
  }
  EXPECT_GT(differing, 3000);
  EXPECT_NE(demands(Excitation::robot_duty, 7)[4000].current_A, demands(Excitation::robot_duty, 8)[4000].current_A);
}

TEST(ThermalBench, NoEffectOfAnyAmountZeroIsTheSameLog) {
  const auto wanted = demands(Excitation::robot_duty);
  const auto clean = log_of(quiet_design(), wanted);
  host_sim::HiddenScale scale{plant_tests::small_motor(), 2, 8, full_speed(), 600};
  for (const HiddenCause& cause : host_sim::hidden_causes()) {
    ThermalDesign design = quiet_design();
    host_sim::Random random(3);
    cause.apply(design.hidden, scale, 0, random);
    const auto log = log_of(design, wanted);
    // A mass of zero is absent; everything else must not move a bit.
    for (std::size_t i = 0; i < log.size(); i += 97) {
      ASSERT_EQ(log[i].housing_degC, clean[i].housing_degC) << cause.id;
      ASSERT_EQ(log[i].current_A, clean[i].current_A) << cause.id;
      if (std::string(cause.id) != "hot_spot") {
        ASSERT_EQ(log[i].true_winding_degC, clean[i].true_winding_degC) << cause.id;
      }
    }
  }
}

/// Sign of the change in the mean: winding, housing reading, logged current.
struct Direction {
  int winding, housing, current;
};

TEST(ThermalBench, EachEffectMovesTheLogItsWay) {
  const std::map<std::string, Direction> expected = {
      {"speed_loss_linear", {1, 1, 0}},
      {"speed_loss_quadratic", {1, 1, 0}},
      {"windage", {1, 1, 0}},
      {"winding_eddy", {1, 1, 0}},
      {"ac_copper_loss", {1, 1, 0}},
      {"load_friction", {1, 1, 0}},
      {"copper_coefficient", {1, 1, 0}},
      {"bridge_loss", {1, 1, 0}},
      {"constant_heat", {1, 1, 0}},
      {"board_heat", {1, 1, 0}},
      {"stall_imbalance", {1, 1, 0}},
      {"speed_cooling", {-1, -1, 0}},
      {"natural_convection", {-1, -1, 0}},
      {"radiation", {-1, -1, 0}},
      {"cooling_change", {1, 1, 0}},
      {"third_mass", {-1, -1, 0}},
      {"hot_spot", {-1, -1, 0}},
      {"neighbour_heat", {-1, -1, 0}},
      {"frame_conduction", {-1, -1, 0}},
      {"current_offset", {0, 0, -1}},
      {"sensor_lag", {0, -1, 0}},
      {"sensor_offset", {0, 1, 0}},
      {"sensor_gain", {0, 1, 0}},
      {"sensor_placement", {0, 1, 0}},
      {"ambient_drift", {1, 1, 0}},
      {"clock_delay", {-1, -1, 0}},
      {"latent_heat", {-1, -1, 0}},
      {"gusts", {-1, -1, 0}},
      {"contact_temperature", {1, 0, 0}},
      {"grease", {1, 1, 0}},
      {"thermostat_fan", {-1, -1, 0}},
      {"curing", {-1, 0, 0}},
      {"overload_iron", {1, 1, 0}},
  };
  ASSERT_EQ(expected.size(), host_sim::hidden_causes().size());
  // Steady walking with bursts, warm enough for every law; the neighbour and the frame stay cool, heat flows to them.
  std::vector<Demand> wanted;
  const double rated_A = host_sim::rated_amplitude_A(plant_tests::small_motor());
  for (int n = 0; n < 900 * 20; ++n) {
    const bool holding = n % 400 < 60;
    wanted.push_back({(n % 200 < 6 ? 2.0 : 0.8) * rated_A, holding ? 0.0 : 0.6 * full_speed(), true, 25, 25});
  }
  ThermalDesign design = quiet_design();
  design.sheet.winding_max_degC = 1000;  // no protection: it would hide directions
  const auto clean = log_of(design, wanted);
  host_sim::HiddenScale scale{plant_tests::small_motor(), rated_A, 7.5, full_speed(), 900};
  for (const HiddenCause& cause : host_sim::hidden_causes()) {
    ThermalDesign with = design;
    host_sim::Random random(3);
    cause.apply(with.hidden, scale, 0.4, random);
    const auto log = log_of(with, wanted);
    const Direction want = expected.at(cause.id);
    const auto check = [&](int sign, double change, double floor, const char* what) {
      if (sign == 0) {
        EXPECT_LT(std::fabs(change), floor) << cause.id << ' ' << what;
      } else {
        EXPECT_GT(sign * change, floor) << cause.id << ' ' << what;
      }
    };
    // A contact changes the housing only through the warmer copper's resistance.
    const bool contact = std::string(cause.id) == "contact_temperature" || std::string(cause.id) == "curing";
    check(want.winding, mean(log, &ThermalSample::true_winding_degC) - mean(clean, &ThermalSample::true_winding_degC),
          0.05, "winding");
    check(want.housing, mean(log, &ThermalSample::housing_degC) - mean(clean, &ThermalSample::housing_degC),
          contact ? 1.0 : 0.05, "housing");
    check(want.current, mean(log, &ThermalSample::current_A) - mean(clean, &ThermalSample::current_A), 0.01, "current");
  }
}

TEST(ThermalBench, SensorsErrAsTheirNoiseIsStated) {
  ThermalDesign design = quiet_design();
  design.noise = LogNoise{};
  design.noise.winding_every_s = 30;
  std::vector<Demand> idle(20 * 1200, Demand{.current_A = 0.5});
  const auto log = log_of(design, idle);
  double square = 0, step = 0, current2 = 0;
  int readings = 0;
  for (std::size_t i = 0; i < log.size(); ++i) {
    const double error_K = log[i].housing_degC - log[i].true_housing_degC;
    square += error_K * error_K;
    step = std::max(step, std::fabs(log[i].housing_degC * 10 - std::round(log[i].housing_degC * 10)));
    const double ratio = log[i].current_A / log[i].true_current_A - 1;
    current2 += ratio * ratio;
    readings += log[i].winding_degC.has_value();
  }
  const double n = static_cast<double>(log.size());
  EXPECT_NEAR(std::sqrt(square / n), std::sqrt(0.2 * 0.2 + 0.05 * 0.05 + 0.01 / 12), 0.01);
  EXPECT_LT(step, 1e-9);
  EXPECT_NEAR(std::sqrt(current2 / n), 0.01, 0.0005);
  EXPECT_EQ(readings, 40);
}

TEST(ThermalBench, ProtectionKeepsTheWindingBelowItsLimitInEveryExcitation) {
  for (const char* id : {"ec-16-40w", "ec-powermax-30-24v"}) {
    for (const Excitation kind : {Excitation::one_step, Excitation::robot_duty, Excitation::designed}) {
      for (std::uint64_t seed = 1; seed <= 5; ++seed) {
        ThermalDesign design = quiet_design();
        design.sheet = plant_tests::sheet(id);
        const auto wanted = host_sim::make_excitation(
            kind, design.sheet, host_sim::full_speed_rad_per_s(design.sheet, 24), 1200, rate_Hz, seed);
        double hottest_degC = 0;
        for (const ThermalSample& s : log_of(design, wanted))
          hottest_degC = std::max(hottest_degC, s.true_hottest_degC);
        EXPECT_LT(hottest_degC, 156) << id << static_cast<int>(kind) << ' ' << seed;
        EXPECT_GT(hottest_degC, 50) << id << static_cast<int>(kind) << ' ' << seed;
      }
    }
  }
}

TEST(ThermalBench, DesignedExcitationCrossesCurrentWithSpeedAndRobotDutyTiesThem) {
  const auto correlation = [](const std::vector<Demand>& log) {
    double x = 0, y = 0, xx = 0, yy = 0, xy = 0, n = 0;
    for (const Demand& d : log) {
      const double a = std::fabs(d.current_A), b = std::fabs(d.speed_rad_per_s);
      x += a;
      y += b;
      xx += a * a;
      yy += b * b;
      xy += a * b;
      ++n;
    }
    return (n * xy - x * y) / std::sqrt((n * xx - x * x) * (n * yy - y * y));
  };
  EXPECT_LT(std::fabs(correlation(demands(Excitation::designed, 3, 1200))), 0.3);
  double tied = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed)
    tied += correlation(demands(Excitation::robot_duty, seed, 1200)) / 10;
  EXPECT_GT(tied, 0.35);
}

TEST(ThermalBench, DesignedExcitationPulsesByTheTimeConstantOfTheSheetsWinding) {
  const auto longest_pulse_s = [](double times) {
    wire::Motor sheet = plant_tests::small_motor();
    sheet.C1_J_per_K *= times;
    const double strong_A = 3 * host_sim::rated_amplitude_A(sheet);
    double longest_s = 0, pulse_s = 0;
    for (const Demand& d : host_sim::make_excitation(Excitation::designed, sheet, full_speed(), 1200, rate_Hz, 3)) {
      pulse_s = std::fabs(d.current_A) > strong_A ? pulse_s + 1 / rate_Hz : 0;
      longest_s = std::max(longest_s, pulse_s);
    }
    return longest_s;
  };
  const double winding_s = plant_tests::small_motor().R1_K_per_W * plant_tests::small_motor().C1_J_per_K;
  EXPECT_GT(longest_pulse_s(1), winding_s);
  EXPECT_NEAR(longest_pulse_s(2) / longest_pulse_s(1), 2, 0.1);
}

TEST(HiddenCauses, IdsAreUniqueAndEffectsAreDrawnToSize) {
  std::set<std::string> ids;
  const auto wanted = demands(Excitation::designed, 5, 1200);
  for (const HiddenCause& cause : host_sim::hidden_causes()) {
    EXPECT_TRUE(ids.insert(cause.id).second) << cause.id;
    const auto drawn = host_sim::draw_effect(cause, quiet_design(), wanted, rate_Hz, full_speed(), 3, 11);
    EXPECT_NEAR(drawn.error_K, 3, 0.4) << cause.id;
  }
  EXPECT_THROW(host_sim::hidden_cause("no such thing"), std::invalid_argument);
  EXPECT_LT(host_sim::unrefitted_error_K(quiet_design(), wanted, rate_Hz), 1e-12);
}

TEST(HiddenCauses, SecondEffectIsAddedToTheFirstAndSizedAlone) {
  const auto wanted = demands(Excitation::robot_duty, 5, 300);
  const auto draw = [&](const char* id, const ThermalDesign& design) {
    return host_sim::draw_effect(host_sim::hidden_cause(id), design, wanted, rate_Hz, full_speed(), 2, 4);
  };
  ThermalDesign design = quiet_design();
  const auto alone = draw("radiation", design);
  design.hidden = draw("windage", design).hidden;
  const auto both = draw("radiation", design);
  EXPECT_EQ(both.amount, alone.amount);
  EXPECT_GT(both.hidden.windage_W_s3, 0);
  EXPECT_EQ(both.hidden.radiation_W_per_K, alone.hidden.radiation_W_per_K);
}

TEST(HiddenCauses, BothSignsAreDrawnWhereBothExist) {
  const auto wanted = demands(Excitation::robot_duty, 5, 300);
  std::set<bool> signs;
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    signs.insert(host_sim::draw_effect(host_sim::hidden_cause("sensor_offset"), quiet_design(), wanted, rate_Hz,
                                       full_speed(), 2, seed)
                     .amount > 0);
  }
  EXPECT_EQ(signs.size(), 2u);
}

}  // namespace

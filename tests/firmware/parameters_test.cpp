// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <cstddef>
#include <string>

#include "firmware/axis_parameters.hpp"
#include "firmware/heat_parameters.hpp"
#include "tests/firmware/bench.hpp"

namespace {

using firmware::AxisParameters;
using firmware::Finding;

constexpr int count = static_cast<int>(std::size(firmware::axis_dictionary));

/// Where each parameter lives, in the dictionary's order.
float* fields(AxisParameters& p, int index) {
  float* all[] = {
#define PARAM(id, name, unit, fallback, min, max, doc) &p.name##_##unit,
#include "firmware/axis.params"
#undef PARAM
  };
  return all[index];
}

TEST(Parameters, ASetFromASheetIsComplete) {
  const Finding found = validate(bench::parameters(), bench::rating);
  EXPECT_EQ(found.id, 0) << "value " << found.value;
}

TEST(Parameters, WhatWasNeverGivenIsNamed) {
  EXPECT_EQ(validate(AxisParameters{}, bench::rating).id, 0x0101);
  for (int i = 0; i < count; ++i) {
    AxisParameters p = bench::parameters();
    *fields(p, i) = wire::unset;
    const Finding found = validate(p, bench::rating);
    EXPECT_EQ(found.id, firmware::axis_dictionary[i].id);
    EXPECT_TRUE(found.missing);
  }
}

TEST(Parameters, WhatIsOutOfRangeIsNamed) {
  for (int i = 0; i < count; ++i) {
    const wire::ParameterInfo& info = firmware::axis_dictionary[i];
    const float step = 0.01f * (info.max - info.min);
    for (const float bad : {info.min - step, info.max + step, std::numeric_limits<float>::infinity()}) {
      AxisParameters p = bench::parameters();
      *fields(p, i) = bad;
      const Finding found = validate(p, bench::rating);
      EXPECT_EQ(found.id, info.id) << info.name << " = " << bad;
      EXPECT_FALSE(found.missing);
    }
  }
}

TEST(Parameters, AWindingThatIsTooFastForTheSlowLaneIsRefused) {
  const firmware::HeatParameters good = firmware::heat_parameters_from(bench::motor(), thermal::sheet_trust);
  EXPECT_EQ(validate(good).id, 0);
  firmware::HeatParameters fast = good;
  fast.C1_J_per_K = 0.45f / good.R1_K_per_W;
  EXPECT_EQ(validate(fast).id, 0x0203);
  fast = good;
  fast.phase_coupling_W_per_K = 100.0f;
  EXPECT_EQ(validate(fast).id, 0x0207);
}

TEST(Parameters, APhaseIsAsFastAsItsTwoNeighboursAndItsThirdOfR1MakeIt) {
  firmware::HeatParameters p = firmware::heat_parameters_from(bench::motor(), thermal::sheet_trust);
  const float own_W_per_K = 1.0f / (3.0f * p.R1_K_per_W), bound_W_per_K = p.C1_J_per_K / 3.0f / 0.05f;  // at 50 ms
  p.phase_coupling_W_per_K = 0.99f * 0.5f * (bound_W_per_K - own_W_per_K);
  EXPECT_EQ(validate(p).id, 0);
  p.phase_coupling_W_per_K = 1.01f * 0.5f * (bound_W_per_K - own_W_per_K);
  EXPECT_EQ(validate(p).id, 0x0207);
}

TEST(Parameters, AnAmbientThatLeavesAWindingNothingIsRefused) {
  firmware::HeatParameters p = firmware::heat_parameters_from(bench::motor(), thermal::sheet_trust);
  p.winding_max_degC = 60;
  p.ambient_degC = 59;
  EXPECT_EQ(validate(p).id, 0);
  p.ambient_degC = 60;
  EXPECT_EQ(validate(p).id, 0x020C);
}

TEST(Parameters, EachThermalParameterArrivesWhereItCounts) {
  firmware::HeatParameters p = firmware::heat_parameters_from(bench::motor(), {0.11f, 0.12f, 0.13f});
  p.margin_sigmas_count = 3, p.ambient_degC = 35, p.ambient_sigma_K = 6, p.housing_noise_K = 0.7f;
  p.housing_lag_s = 20, p.housing_offset_K = -4;
  const thermal::EstimatorSettings s = firmware::estimator_settings(p);
  EXPECT_EQ(s.trust.power, 0.11f);
  EXPECT_EQ(s.trust.inner_resistance, 0.12f);
  EXPECT_EQ(s.trust.cooling, 0.13f);
  EXPECT_EQ(s.margin_sigmas, 3.0f);
  EXPECT_EQ(s.ambient_degC, 35.0f);
  EXPECT_EQ(s.ambient_sigma_K, 6.0f);
  EXPECT_EQ(s.housing_noise_K, 0.7f);
  const thermal::HeatSet<double> set = firmware::heat_set(p, 0.2f);
  EXPECT_EQ(set.housing.lag_s, 20.0);
  EXPECT_EQ(set.housing.offset_K, -4.0);
}

TEST(Parameters, ContradictionsAreFound) {
  struct Row {
    float AxisParameters::*field;
    float value;
    int id;
  };
  const Row rows[] = {
      {&AxisParameters::pole_pairs_count, 2.5f, 0x0105},
      {&AxisParameters::current_limit_A, 20.5f, 0x0111},   // above the board's peak
      {&AxisParameters::bus_low_end_V, 11.0f, 0x011B},     // below the board's trip: it would never be reached
      {&AxisParameters::bus_low_start_V, 20.0f, 0x011A},   // below its own end
      {&AxisParameters::bus_high_start_V, 30.0f, 0x0118},  // below where driving is derated
      {&AxisParameters::bus_high_end_V, 50.0f, 0x0119},    // below its own start
      {&AxisParameters::bus_high_end_V, 58.5f, 0x0119},    // above the board's trip
  };
  for (const Row& row : rows) {
    AxisParameters p = bench::parameters();
    p.*row.field = row.value;
    EXPECT_EQ(validate(p, bench::rating).id, row.id) << row.value;
  }
}

/// Ten samples a time constant, exactly: also at a rate at which the dictionary's own bounds are too wide.
TEST(Parameters, ABandwidthIsAtMostATenthOfThePwm) {
  firmware::BoardRating slow = bench::rating;
  slow.pwm_Hz = 10e3f;
  AxisParameters p = bench::parameters();
  p.current_bandwidth_Hz = p.rotor_bandwidth_Hz = 0.1f * slow.pwm_Hz;
  EXPECT_EQ(validate(p, slow).id, 0);
  p.current_bandwidth_Hz = 1001.0f;
  EXPECT_EQ(validate(p, slow).id, 0x0112);
  p.current_bandwidth_Hz = 1000.0f, p.rotor_bandwidth_Hz = 1001.0f;
  EXPECT_EQ(validate(p, slow).id, 0x0113);
}

TEST(Parameters, AListThatContradictsItselfDoesNotPass) {
  using wire::ParameterInfo;
  using wire::Unit;
  constexpr ParameterInfo good[] = {{1, "a", Unit::A, 1.0f, 0.0f, 2.0f, ""},
                                    {2, "b", Unit::A, wire::unset, 0.0f, 2.0f, ""}};
  constexpr ParameterInfo repeated[] = {{1, "a", Unit::A, 1.0f, 0.0f, 2.0f, ""},
                                        {1, "b", Unit::A, 1.0f, 0.0f, 2.0f, ""}};
  constexpr ParameterInfo outside[] = {{1, "a", Unit::A, 3.0f, 0.0f, 2.0f, ""}};
  constexpr ParameterInfo empty[] = {{1, "a", Unit::A, 1.0f, 2.0f, 0.0f, ""}};
  static_assert(wire::well_declared(good));
  static_assert(!wire::well_declared(repeated) && !wire::well_declared(outside) && !wire::well_declared(empty));
}

TEST(Parameters, TheDictionaryTellsNameUnitAndSense) {
  for (const wire::ParameterInfo& info : firmware::axis_dictionary) {
    EXPECT_GT(std::string(info.name).size(), 2u);
    EXPECT_GT(std::string(wire::text_of(info.unit)).size(), 0u);
    EXPECT_GT(std::string(info.doc).size(), 10u) << info.name;
  }
  EXPECT_STREQ(wire::text_of(wire::Unit::count), "count") << "texts and units stand in the same order";
}

TEST(Parameters, DeratingFollowsTheSupplyAndStaysInsideTheBoard) {
  for (const float supply_V : {18.0f, 24.0f, 36.0f, 48.0f, 52.0f}) {
    const AxisParameters p = firmware::parameters_from(bench::motor(), bench::rating, {supply_V, 0.0f});
    EXPECT_EQ(validate(p, bench::rating).id, 0) << supply_V;
    EXPECT_GT(p.bus_high_start_V, supply_V);
    EXPECT_LT(p.bus_low_start_V, supply_V);
  }
}

TEST(Rating, WhatCannotBeMeantIsRefused) {
  EXPECT_TRUE(plausible(bench::rating));
  float firmware::BoardRating::*const all[] = {
      &firmware::BoardRating::pwm_Hz,       &firmware::BoardRating::peak_A,
      &firmware::BoardRating::continuous_A, &firmware::BoardRating::trip_A,
      &firmware::BoardRating::bus_min_V,    &firmware::BoardRating::bus_max_V,
      &firmware::BoardRating::dead_time_s,  &firmware::BoardRating::sampling_window_s};
  for (const auto field : all) {
    for (const float bad : {wire::unset, -1.0f, 1e9f, std::numeric_limits<float>::infinity()}) {
      firmware::BoardRating rating = bench::rating;
      rating.*field = bad;
      EXPECT_FALSE(plausible(rating)) << bad;
    }
  }
}

}  // namespace

// SPDX-License-Identifier: MIT
#include "firmware/parameter_store.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>
#include <vector>

#include "tests/firmware/bench.hpp"

namespace {

using firmware::Driver;
using firmware::ParameterSet;
using firmware::ParameterStore;
using wire::Status;

/// Two areas of flash: bits only fall, and the power may go in any word.
struct Flash {
  explicit Flash(std::size_t bytes = 4 * ParameterStore::slot_bytes)
      : cells{std::vector<std::uint8_t>(bytes, 0xFF), std::vector<std::uint8_t>(bytes, 0xFF)} {}

  std::span<const std::uint8_t> area(int which) const { return cells[which]; }
  bool program(int which, std::size_t byte, std::span<const std::uint32_t> words) {
    for (const std::uint32_t word : words) {
      if (words_left == 0) return false;
      if (words_left > 0) --words_left;
      for (std::size_t k = 0; k < 4; ++k) {
        const auto meant = static_cast<std::uint8_t>(word >> 8 * k);
        const std::uint8_t torn = words_left == 0 ? static_cast<std::uint8_t>(tear >> 8 * k) : std::uint8_t{0};
        cells[which][byte + k] &= static_cast<std::uint8_t>(meant | torn);
      }
      byte += 4;
    }
    return true;
  }
  bool erase(int which) {
    if (!erases) return false;
    ++erased;
    std::fill(cells[which].begin(), cells[which].end(), std::uint8_t{0xFF});
    return true;
  }

  std::vector<std::uint8_t> cells[2];
  int words_left = -1;  // negative: the power stays
  std::uint32_t tear = 0x5A5A5A5A;
  int erased = 0;
  bool erases = true;
};
static_assert(hal::Store<Flash>);

firmware::AxisSet sheet_set() {
  return {bench::parameters(), firmware::heat_parameters_from(bench::motor(), thermal::sheet_trust)};
}

std::uint8_t code(Status s) { return static_cast<std::uint8_t>(s); }

/// A store with a driver, both axes staged from the sheet and in force.
struct Bench {
  Flash flash;
  ParameterStore store{bench::rating};
  Driver driver{{bench::rating, {{}, {}}}};

  Bench() { (void)store.start(flash); }
  void stage(const firmware::AxisSet& set, int axis) {
    for (int i = 0; i < firmware::parameter_count; ++i) {
      const wire::Assignment one{{firmware::parameter_info(i)->id, static_cast<std::uint8_t>(axis)},
                                 firmware::parameter_value(set, i)};
      ASSERT_EQ(store.stage(one).status, 0) << firmware::parameter_info(i)->name;
    }
  }
  void put_in_force() {
    stage(sheet_set(), 0);
    stage(sheet_set(), 1);
    ASSERT_EQ(store.commit(driver).status, 0);
    tick(1);
  }
  void tick(int times) {
    for (; times > 0; --times) {
      ++sequence;
      for (int i = 0; i < 2; ++i) (void)driver.axis(i).tick(bench::quiet_sample(sequence));
    }
  }
  std::uint32_t sequence = 0;
};

TEST(ParameterStore, TheDictionaryHoldsBothListsWithRisingIds) {
  int last = 0;
  for (int i = 0; i < firmware::parameter_count; ++i) {
    const wire::ParameterInfo* info = firmware::parameter_info(i);
    ASSERT_NE(info, nullptr);
    EXPECT_GT(info->id, last);
    last = info->id;
    EXPECT_TRUE(firmware::parameter_flags(i) & wire::needs_disarmed);
    const bool whole = std::string(info->name) == "pole_pairs" || std::string(info->name) == "housing_sensor";
    EXPECT_EQ((firmware::parameter_flags(i) & wire::whole_number) != 0, whole) << info->name;
  }
  EXPECT_EQ(firmware::parameter_info(firmware::parameter_count), nullptr);
  EXPECT_EQ(firmware::parameter_info(-1), nullptr);
}

TEST(ParameterStore, NoSetGetsPastTheHardwareLimits) {
  const struct {
    std::uint16_t id;
    float value;
  } beyond[] = {{0x0111, 20.5f}, {0x0119, 58.5f}, {0x011B, 11.5f}};  // peak current, highest and lowest bus voltage
  for (const auto& one : beyond) {
    Bench b;
    b.put_in_force();
    ASSERT_EQ(b.store.stage({{one.id, 0}, one.value}).status, 0) << "the dictionary is for every board";
    EXPECT_EQ(b.store.commit(b.driver).status, code(Status::parameter_refused));
    EXPECT_EQ(b.store.commit(b.driver).id, one.id);
  }
}

TEST(ParameterStore, WhatIsCommittedIsWhatTheSheetBuilds) {
  Bench b;
  b.put_in_force();
  EXPECT_EQ(b.driver.axis(0).mode(), firmware::Mode::off);
  b.tick(2100);
  EXPECT_EQ(b.driver.axis(0).arm(), Status::done);
  const auto built = firmware::setup_from(b.store.in_force().axes[0]).heat,
             meant = thermal::three_phase_set(bench::motor());
  ASSERT_EQ(built.link_count, meant.link_count);
  for (int i = 0; i < built.link_count; ++i)
    EXPECT_NEAR(built.links[i].conductance_W_per_K, meant.links[i].conductance_W_per_K, 1e-6);
  for (int i = 0; i < built.source_count; ++i) EXPECT_NEAR(built.sources[i].gain, meant.sources[i].gain, 1e-7);
}

TEST(ParameterStore, ASetIsRefusedAsAWholeAndNothingChanges) {
  Bench b;
  b.put_in_force();
  const std::uint16_t bus_low_start = 0x011A;
  ASSERT_EQ(b.store.stage({{0x0201, 0}, 0.5f}).status, 0);          // right by itself
  ASSERT_EQ(b.store.stage({{bus_low_start, 1}, 20.0f}).status, 0);  // below its own end
  const wire::Answer answer = b.store.commit(b.driver);
  EXPECT_EQ(answer.status, code(Status::parameter_refused));
  EXPECT_EQ(answer.axis, 1);
  EXPECT_EQ(answer.id, bus_low_start);
  EXPECT_NEAR(b.store.in_force().axes[0].heat.R1_K_per_W, 0.209f, 1e-6f);
  EXPECT_TRUE(b.store.uncommitted());
  EXPECT_EQ(b.store.load(wire::LoadFrom::in_force).status, 0);
  EXPECT_FALSE(b.store.uncommitted());
}

/// Also of the thermal ones, each by its own name.
TEST(ParameterStore, TheFirstThermalParameterThatIsWrongIsNamed) {
  Bench b;
  b.put_in_force();
  ASSERT_EQ(b.store.stage({{0x0203, 1}, wire::unset}).status, 0);  // C1
  wire::Answer answer = b.store.commit(b.driver);
  EXPECT_EQ(answer.status, code(Status::parameters_unset));
  EXPECT_EQ(answer.axis, 1);
  EXPECT_EQ(answer.id, 0x0203);
  b.stage(sheet_set(), 1);
  ASSERT_EQ(b.store.stage({{0x0205, 1}, 50.0f}).status, 0);  // winding_max
  ASSERT_EQ(b.store.stage({{0x020C, 1}, 60.0f}).status, 0);  // ambient
  answer = b.store.commit(b.driver);
  EXPECT_EQ(answer.status, code(Status::parameter_refused));
  EXPECT_EQ(answer.id, 0x020C);
}

/// Half a set makes no heat model, whichever half it is.
TEST(ParameterStore, NoHeatModelIsBuiltOfHalfASet) {
  firmware::AxisSet no_resistance = sheet_set(), no_heat = sheet_set();
  no_resistance.drive.phase_resistance_ohm = wire::unset;
  no_heat.heat.R1_K_per_W = wire::unset;
  for (const firmware::AxisSet& set : {no_resistance, no_heat}) EXPECT_EQ(firmware::setup_from(set).heat.node_count, 0);
}

TEST(ParameterStore, UnknownIdsAxesAndValuesOutOfRangeAreRefusedOneByOne) {
  Bench b;
  float value;
  EXPECT_EQ(b.store.get({0x0999, 0}, value), Status::unknown_parameter);
  EXPECT_EQ(b.store.get({0x0101, 2}, value), Status::unknown_parameter);
  EXPECT_EQ(b.store.stage({{0x0101, wire::no_axis}, 1.0f}).status, code(Status::unknown_parameter));
  for (int i = 0; i < firmware::parameter_count; ++i) {
    const wire::ParameterInfo& info = *firmware::parameter_info(i);
    for (const float bad : {info.min - 0.01f * (info.max - info.min), std::numeric_limits<float>::infinity()})
      EXPECT_EQ(b.store.stage({{info.id, 0}, bad}).status, code(Status::parameter_refused)) << info.name;
    EXPECT_EQ(b.store.stage({{info.id, 0}, wire::unset}).status == 0, wire::is_unset(info.fallback)) << info.name;
  }
}

TEST(ParameterStore, AnAxisThatWasNeverGivenIsLeftAloneAndAHalfGivenOneIsRefused) {
  Bench b;
  b.stage(sheet_set(), 0);
  EXPECT_EQ(b.store.commit(b.driver).status, 0);
  b.tick(2100);
  EXPECT_EQ(b.driver.axis(0).arm(), Status::done);
  EXPECT_EQ(b.driver.axis(1).arm(), Status::parameters_unset);
  Bench half;
  half.stage(sheet_set(), 0);
  ASSERT_EQ(half.store.stage({{0x0101, 1}, 0.2f}).status, 0);
  EXPECT_EQ(half.store.commit(half.driver).status, code(Status::parameters_unset));
}

TEST(ParameterStore, NothingIsCommittedOrSavedWhileAnAxisIsArmedOrAboutToBe) {
  Bench b;
  b.put_in_force();
  b.tick(2100);
  ASSERT_EQ(b.driver.axis(1).arm(), Status::done);
  for (int i = 0; i < 2; ++i) {  // posted only, then obeyed
    EXPECT_EQ(b.store.commit(b.driver).status, code(Status::not_disarmed));
    EXPECT_EQ(b.store.save(b.driver, b.flash).status, code(Status::not_disarmed));
    b.tick(1);
  }
  b.driver.axis(1).disarm();
  b.tick(1);
  EXPECT_EQ(b.store.save(b.driver, b.flash).status, 0);
}

TEST(ParameterStore, WhatFlipsInASetIsNeitherCommittedNorSaved) {
  const auto flip = [](const firmware::ParameterSet& set) {  // R1 a quarter, which is in its range
    auto& word = const_cast<float&>(set.axes[1].heat.R1_K_per_W);
    word = std::bit_cast<float>(std::bit_cast<std::uint32_t>(word) ^ 1u << 24);
  };
  Bench b;
  b.put_in_force();
  flip(b.store.staged());
  EXPECT_EQ(b.store.stage({{0x0203, 0}, 5.0f}).status, code(Status::memory_changed));
  EXPECT_EQ(b.store.commit(b.driver).status, code(Status::memory_changed));
  b.store.take_back();
  EXPECT_EQ(b.store.commit(b.driver).status, 0);
  b.tick(1);

  ASSERT_EQ(b.store.save(b.driver, b.flash).status, 0);
  flip(b.store.in_force());
  EXPECT_EQ(b.store.save(b.driver, b.flash).status, code(Status::memory_changed));
  b.store.take_back();
  EXPECT_EQ(b.store.commit(b.driver).status, code(Status::memory_changed)) << "what is taken back flipped as well";
  EXPECT_EQ(b.store.load(wire::LoadFrom::saved).status, 0);
  EXPECT_EQ(b.store.commit(b.driver).status, 0);
  EXPECT_TRUE(b.store.whole());
}

TEST(ParameterStore, TheTemperaturesSurviveACommit) {
  Bench b;
  b.put_in_force();
  thermal::HeatMemory hot{4, {120, 110, 100, 60}, {4, 4, 4, 2}, 30};
  b.driver.axis(0).restore({hot, {}});
  ASSERT_EQ(b.store.stage({{0x0203, 0}, 5.0f}).status, 0);  // C1: another motor's
  ASSERT_EQ(b.store.commit(b.driver).status, 0);
  EXPECT_NEAR(b.driver.axis(0).core().estimate().hottest_degC(), 120.0, 0.1);
}

/// Whatever is committed, in any order: a set that is taken away and comes back, other limits, other masses.
TEST(ParameterStore, NoOrderOfCommitsCoolsAnEstimate) {
  std::mt19937 seed{20};
  const auto drawn = [&seed](float from, float to) { return std::uniform_real_distribution<float>(from, to)(seed); };
  for (int run = 0; run < 50; ++run) {
    Bench b;
    b.put_in_force();
    b.driver.axis(0).restore({{4, {150, 140, 130, 90}, {4, 4, 4, 2}, 40}, {}});
    const thermal::CoreEstimator& core = b.driver.axis(0).core();
    const double winding_degC = core.estimate().hottest_degC(), housing_degC = core.estimate().housing_degC;
    for (int step = 0; step < 6; ++step) {
      if (drawn(0, 1) < 0.3f) {
        ASSERT_EQ(b.store.load(wire::LoadFrom::defaults).status, 0);
      } else {
        b.stage(sheet_set(), 0);
        ASSERT_EQ(b.store.stage({{0x0203, 0}, drawn(3, 30)}).status, 0);    // C1
        ASSERT_EQ(b.store.stage({{0x0205, 0}, drawn(90, 250)}).status, 0);  // winding_max
        ASSERT_EQ(b.store.stage({{0x020B, 0}, drawn(0, 5)}).status, 0);     // margin_sigmas
        ASSERT_EQ(b.store.stage({{0x020C, 0}, drawn(-20, 80)}).status, 0);  // ambient
        ASSERT_EQ(b.store.stage({{0x020E, 0}, drawn(0, 1) < 0.5f ? 0.0f : 1.0f}).status, 0);
        ASSERT_EQ(b.store.stage({{0x0220, 0}, drawn(0, 1) < 0.5f ? 0.0f : 30.0f}).status, 0);  // third_mass
      }
      ASSERT_EQ(b.store.commit(b.driver).status, 0);
      b.tick(1);
    }
    b.stage(sheet_set(), 0);
    ASSERT_EQ(b.store.commit(b.driver).status, 0);
    EXPECT_GE(core.estimate().hottest_degC(), winding_degC - 1e-3) << run;
    EXPECT_GE(core.estimate().housing_degC, housing_degC - 1e-3) << run;
  }
}

/// In a room of 25 degC, which the housing proved though 40 degC are believed without it.
TEST(ParameterStore, AnUnrelatedParameterTouchesNoEstimateAndAnotherModelIsBegunHot) {
  const firmware::AxisSetup setup = firmware::setup_from(sheet_set());
  struct Change {
    std::uint16_t id;
    float value;
    bool heat;
  };
  for (const Change change : {Change{0x0111, 12.0f, false}, Change{0x0201, 0.25f, true}, Change{0x0101, 0.6f, true}}) {
    Bench saved;
    saved.put_in_force();
    ASSERT_EQ(saved.store.save(saved.driver, saved.flash).status, 0);
    ParameterStore store(bench::rating);
    ASSERT_EQ(store.start(saved.flash).status, 0);
    Driver driver({bench::rating, {setup, setup}});
    std::uint32_t sequence = 0;
    const auto live = [&](int slow_ticks) {
      for (int i = 0; i < 200 * slow_ticks; ++i) {
        ++sequence;
        for (int a = 0; a < 2; ++a) (void)driver.axis(a).tick(bench::quiet_sample(sequence));
        if (i % 200 == 199) driver.slow_tick({{25.0f, true}, 0.0f, true}, {{{25.0f, true}}, {{25.0f, true}}});
      }
    };
    live(100);
    const auto estimate = [&](int axis) { return driver.axis(axis).core().estimate(); };
    const thermal::Estimate before[] = {estimate(0), estimate(1)};
    ASSERT_LT(before[0].hottest_degC(), 26.0);

    ASSERT_EQ(store.stage({{change.id, 0}, change.value}).status, 0);
    ASSERT_EQ(store.commit(driver).status, 0);
    EXPECT_EQ(estimate(1).hottest_degC(), before[1].hottest_degC()) << "of the other axis nothing was asked";
    if (change.heat) {
      EXPECT_GE(estimate(0).hottest_degC(), 40.0) << change.id;
      continue;
    }
    EXPECT_EQ(estimate(0).hottest_degC(), before[0].hottest_degC());
    EXPECT_EQ(estimate(0).sigma_K[0], before[0].sigma_K[0]);
    live(1);
    EXPECT_EQ(driver.axis(0).state().allowance_A, change.value);
  }
}

TEST(ParameterStore, ASavedSetIsInForceAfterTheNextStart) {
  Bench b;
  b.put_in_force();
  EXPECT_TRUE(b.store.unsaved());
  ASSERT_EQ(b.store.save(b.driver, b.flash).status, 0);
  EXPECT_FALSE(b.store.unsaved());
  EXPECT_EQ(b.store.saved_serial(), 1u);
  ParameterStore next(bench::rating);
  EXPECT_EQ(next.start(b.flash).status, 0);
  for (int i = 0; i < firmware::parameter_count; ++i)
    EXPECT_EQ(firmware::parameter_value(next.in_force().axes[1], i), firmware::parameter_value(sheet_set(), i));
  EXPECT_FALSE(next.unsaved());
}

/// Value by value: the last set or the one before it, never a mix of the two.
TEST(ParameterStore, APowerCutInEachWordLeavesTheLastSetOrTheOneBefore) {
  int kept_old = 0, kept_new = 0;
  for (const std::uint32_t tear : {0x00000000u, 0xFFFFFFFFu, 0x5A5A5A5Au, 0x13371234u}) {
    constexpr int all_words = ParameterStore::record_words + 1;  // the last that is written may still be torn
    for (int cut = 0; cut <= all_words; ++cut) {
      Bench b;
      b.put_in_force();
      ASSERT_EQ(b.store.save(b.driver, b.flash).status, 0);
      const ParameterSet before = b.store.in_force();
      for (int i = 0; i < firmware::parameter_count; ++i) {  // every value differs in the second set
        const wire::ParameterInfo& info = *firmware::parameter_info(i);
        if (firmware::parameter_flags(i) & wire::whole_number) continue;
        if (i >= ParameterStore::most_saved) continue;  // no more are saved
        for (std::uint8_t axis = 0; axis < 2; ++axis) {
          const float old = firmware::parameter_value(before.axes[axis], i);
          ASSERT_EQ(b.store.stage({{info.id, axis}, old != 0.0f ? 0.999f * old : 0.01f * info.max}).status, 0);
        }
      }
      ASSERT_EQ(b.store.commit(b.driver).status, 0);
      b.tick(1);
      const ParameterSet after = b.store.in_force();
      b.flash.words_left = cut;
      b.flash.tear = tear;
      (void)b.store.save(b.driver, b.flash);
      b.flash.words_left = -1;
      ParameterStore next(bench::rating);
      ASSERT_EQ(next.start(b.flash).status, 0) << "cut in word " << cut;
      const bool is_new = next.saved_serial() == 2;
      (is_new ? kept_new : kept_old)++;
      const ParameterSet& meant = is_new ? after : before;
      for (int axis = 0; axis < 2; ++axis) {
        for (int i = 0; i < firmware::parameter_count; ++i)
          ASSERT_EQ(firmware::parameter_value(next.in_force().axes[axis], i),
                    firmware::parameter_value(meant.axes[axis], i))
              << "cut in word " << cut << ", " << firmware::parameter_info(i)->name;
      }
      if (cut < all_words - 1) {
        EXPECT_FALSE(is_new && tear != 0) << cut;
      } else {
        EXPECT_EQ(is_new, cut == all_words || tear == 0) << cut;
      }
      // And the next save goes beside the torn one.
      Driver driver{{bench::rating, {{}, {}}}};
      ASSERT_EQ(next.save(driver, b.flash).status, 0);
    }
  }
  EXPECT_GT(kept_old, 300);
  EXPECT_GE(kept_new, 4);
}

TEST(ParameterStore, RoomIsMadeAtTheStartAndNeverInBetween) {
  Bench b;
  b.put_in_force();
  int saved = 0;
  while (b.store.save(b.driver, b.flash).status == 0) ++saved;
  EXPECT_EQ(saved, 8) << "two areas of four slots";
  EXPECT_EQ(b.store.save(b.driver, b.flash).status, code(Status::no_room));
  EXPECT_EQ(b.flash.erased, 0);
  ParameterStore next(bench::rating);
  EXPECT_EQ(next.start(b.flash).status, 0);
  EXPECT_EQ(b.flash.erased, 1);
  EXPECT_EQ(next.saved_serial(), 8u) << "the newest is never in the area that is erased";
  EXPECT_EQ(next.save(b.driver, b.flash).status, 0);
}

TEST(ParameterStore, TheNewestCountsWhereverItStandsAndAnEraseThatFailsLosesNothing) {
  Bench b;
  b.put_in_force();
  while (b.store.save(b.driver, b.flash).status == 0) {
  }
  b.flash.erases = false;
  ParameterStore stuck(bench::rating);
  EXPECT_EQ(stuck.start(b.flash).status, 0);
  EXPECT_EQ(stuck.saved_serial(), 8u);
  EXPECT_EQ(stuck.save(b.driver, b.flash).status, code(Status::no_room));
  b.flash.erases = true;
  ParameterStore next(bench::rating);
  EXPECT_EQ(next.start(b.flash).status, 0);
  EXPECT_EQ(next.save(b.driver, b.flash).status, 0);  // before the older ones of the other area
  ParameterStore last(bench::rating);
  EXPECT_EQ(last.start(b.flash).status, 0);
  EXPECT_EQ(last.saved_serial(), 9u);
}

/// An erase takes a second, in which the power may go: then part of the area is erased and part still holds what it
/// held, or something that can be neither written nor read.
TEST(ParameterStore, AnAreaThatWasHalfErasedIsErasedAgain) {
  for (const std::size_t erased_slots : {1u, 2u, 3u}) {
    for (const std::uint8_t rest : {std::uint8_t{0x00}, std::uint8_t{0x5A}}) {
      Bench b;
      b.put_in_force();
      for (int i = 0; i < 5; ++i) ASSERT_EQ(b.store.save(b.driver, b.flash).status, 0);
      std::vector<std::uint8_t>& half = b.flash.cells[0];  // the newest record is in the other one
      std::fill(half.begin(), half.end(), rest);
      std::fill_n(half.begin(), erased_slots * ParameterStore::slot_bytes, std::uint8_t{0xFF});
      ParameterStore next(bench::rating);
      ASSERT_EQ(next.start(b.flash).status, 0);
      ASSERT_EQ(next.saved_serial(), 5u);
      for (int save = 1; save <= 7; ++save)
        ASSERT_EQ(next.save(b.driver, b.flash).status, 0) << erased_slots << " slots, save " << save;
    }
  }
}

/// What was said to be saved is there after the next start, also behind a slot that took no word.
TEST(ParameterStore, ASaveBehindOneThatFailedIsFoundAgain) {
  Bench b;
  b.put_in_force();
  ASSERT_EQ(b.store.save(b.driver, b.flash).status, 0);
  b.flash.words_left = 0;
  ASSERT_EQ(b.store.save(b.driver, b.flash).status, code(Status::not_written));
  b.flash.words_left = -1;
  ASSERT_EQ(b.store.save(b.driver, b.flash).status, 0);
  ParameterStore next(bench::rating);
  ASSERT_EQ(next.start(b.flash).status, 0);
  EXPECT_EQ(next.saved_serial(), 2u);
  EXPECT_EQ(next.save(b.driver, b.flash).status, 0);
}

TEST(ParameterStore, WhatWasStagedIsTakenBackToTheSavedOrToTheDefaults) {
  Bench b;
  b.put_in_force();
  EXPECT_EQ(b.store.load(wire::LoadFrom::saved).status, code(Status::nothing_saved));
  EXPECT_FALSE(b.store.uncommitted()) << "what is refused stages nothing";
  EXPECT_TRUE(b.store.unsaved());
  ASSERT_EQ(b.store.save(b.driver, b.flash).status, 0);
  EXPECT_FALSE(b.store.unsaved());

  ASSERT_EQ(b.store.stage({{0x0111, 1}, 12.0f}).status, 0);
  ASSERT_EQ(b.store.commit(b.driver).status, 0);
  b.tick(1);
  EXPECT_TRUE(b.store.unsaved());
  ASSERT_EQ(b.store.load(wire::LoadFrom::saved).status, 0);
  EXPECT_TRUE(b.store.uncommitted());
  ASSERT_EQ(b.store.commit(b.driver).status, 0);
  b.tick(1);
  EXPECT_FALSE(b.store.unsaved());

  ASSERT_EQ(b.store.load(wire::LoadFrom::defaults).status, 0);
  ASSERT_EQ(b.store.commit(b.driver).status, 0);
  b.tick(1);
  EXPECT_EQ(b.driver.axis(0).arm(), Status::parameters_unset);
}

/// What was found beside the two resistors is saved where there is any of it, on either axis, and back at its default
/// it is forgotten.
TEST(ParameterStore, WhatWasFoundBesideTwoResistorsIsSavedUpToFive) {
  Bench b;
  b.put_in_force();
  const auto commit = [&](std::uint16_t id, std::uint8_t axis, float value) {
    ASSERT_EQ(b.store.stage({{id, axis}, value}).status, 0);
    ASSERT_EQ(b.store.commit(b.driver).status, 0);
    b.tick(1);
  };
  const auto after_a_reset = [&] {
    ParameterStore next(bench::rating);
    EXPECT_EQ(next.start(b.flash).status, 0);
    return next.in_force();
  };
  for (std::uint16_t id = 0x0213; id < 0x0218; ++id) commit(id, id % 2, 1e-3f);
  ASSERT_EQ(b.store.save(b.driver, b.flash).status, 0);
  EXPECT_EQ(after_a_reset().axes[1].heat.constant_heat_W, 1e-3f);
  EXPECT_EQ(after_a_reset().axes[0].heat.constant_heat_W, 0.0f);
  EXPECT_EQ(after_a_reset().axes[1].heat.load_friction_Nm_per_A, 1e-3f);
  commit(0x0218, 0, 1e-3f);
  EXPECT_EQ(b.store.save(b.driver, b.flash).status, code(Status::too_much_found));
  commit(0x0213, 1, 0.0f);
  ASSERT_EQ(b.store.save(b.driver, b.flash).status, 0);
  EXPECT_EQ(after_a_reset().axes[1].heat.constant_heat_W, 0.0f);
  EXPECT_EQ(after_a_reset().axes[0].heat.board_heat_ohm, 1e-3f);
}

TEST(ParameterStore, AStoreTooSmallForARecordHoldsNone) {
  Bench b;
  b.put_in_force();
  Flash tiny(8);
  ParameterStore next(bench::rating);
  EXPECT_EQ(next.start(tiny).status, code(Status::nothing_saved));
  EXPECT_EQ(next.saved_serial(), 0u);
  EXPECT_EQ(b.store.save(b.driver, tiny).status, code(Status::no_room));
}

TEST(ParameterStore, AnOlderRecordIsMigratedAndANewerOneRefused) {
  Bench b;
  b.put_in_force();
  ASSERT_EQ(b.store.save(b.driver, b.flash).status, 0);
  const auto saved = [&](auto&& change) {
    std::vector<std::uint32_t> words(firmware::parameter_record_words(ParameterStore::always_saved));
    std::memcpy(words.data(), b.flash.cells[0].data(), 4 * words.size());
    change(words);
    firmware::seal(words, words[0], 7);
    Flash other;
    std::memcpy(other.cells[0].data(), words.data(), 4 * words.size());
    ParameterStore store(bench::rating);
    const wire::Answer answer = store.start(other);
    return std::pair(answer, store.in_force());
  };
  constexpr std::uint32_t all = ParameterStore::always_saved, values_at = 6 + (all + 1) / 2;
  // One that knew only some of the parameters: ids and values of the electrical list.
  const auto [older, migrated] = saved([](std::vector<std::uint32_t>& w) {
    constexpr std::uint32_t n = 16;
    std::vector<std::uint32_t> less(w.begin(), w.begin() + 4);
    less.insert(less.end(), {1, n});
    less.insert(less.end(), w.begin() + 6, w.begin() + 6 + n / 2);
    for (std::uint32_t axis = 0; axis < 2; ++axis)
      less.insert(less.end(), w.begin() + values_at + axis * all, w.begin() + values_at + axis * all + n);
    w = less;
  });
  EXPECT_EQ(older.status, code(Status::parameters_unset)) << "what it lacks has no default: named, and not armed";
  EXPECT_EQ(older.id, 0x011B) << "the first that the older firmware did not know";
  EXPECT_EQ(migrated.axes[1].drive.inductance_d_H, sheet_set().drive.inductance_d_H);
  EXPECT_EQ(migrated.axes[1].heat.trust_power_share, 0.2f);
  const auto [newer_version, none] = saved([](std::vector<std::uint32_t>& w) { w[4] = 2; });
  EXPECT_EQ(newer_version.status, code(Status::newer_record));
  EXPECT_TRUE(wire::is_unset(none.axes[0].drive.phase_resistance_ohm)) << "nothing of it is used";
  const auto [newer_id, nothing] = saved([](std::vector<std::uint32_t>& w) { w[6] = 0x0999'0101; });
  EXPECT_EQ(newer_id.status, code(Status::newer_record));
  EXPECT_EQ(newer_id.id, 0x0999);
  EXPECT_TRUE(wire::is_unset(nothing.axes[0].drive.phase_resistance_ohm));
  const auto [inconsistent, kept] = saved([](std::vector<std::uint32_t>& w) {
    const float bad = 30.0f;  // current_limit: above the board's peak, under a right CRC
    std::memcpy(&w[values_at + 6], &bad, 4);
  });
  EXPECT_EQ(inconsistent.status, code(Status::parameter_refused));
  EXPECT_EQ(inconsistent.id, 0x0111);
}

}  // namespace

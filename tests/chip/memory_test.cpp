// SPDX-License-Identifier: MIT
// What must survive on the image: heat through resets and power cuts in the middle of a burst, parameters through a cut
// in any word of a save. A small motor (40 W, 20 A heat its winding by 100 K in a quarter of a second) that the
// estimator knows well, so that a start that forgets would burn it.
#include <algorithm>
#include <cmath>

#include "boards/h8-15d/heat_keeper.hpp"
#include "tests/chip/image.hpp"

namespace image_tests {
namespace {

using boards::Pcb;
using namespace host_sim::chip;

constexpr double limit_degC = 155;
constexpr double heard_s = 0.7;  // until the housing was heard: before that the estimate is wide and the push short
constexpr h8_15d::DoorOrder stage = h8_15d::order_stage, commit = h8_15d::order_commit, save = h8_15d::order_save;

std::unique_ptr<Pcb> small_motors(double warm_up_s = 0) {
  Options o;
  o.motor = "ec-16-40w";
  o.offset_A = 0.0;
  auto pcb = std::make_unique<Pcb>(design_of(o), 1);
  pcb->flash_image(image);
  firmware::AxisSet set[2];
  setup_of(o, set);
  for (firmware::AxisSet& s : set) {
    s.heat.trust_power_share = thermal::identified_trust.power;
    s.heat.trust_inner_share = thermal::identified_trust.inner_resistance;
    s.heat.trust_cooling_share = thermal::identified_trust.cooling;
  }
  pcb->flash_parameters(set);
  for (int i = 0; i < 2; ++i) pcb->bench.load(i).mode = host_sim::Load::Mode::locked;
  pcb->power_on(1);
  pcb->run_for(warm_up_s);
  return pcb;
}

double estimated_degC(const Pcb& pcb) {
  const auto& state = pcb.door().axis[0];
  return std::max({state.core_degC[0], state.core_degC[1], state.core_degC[2]});
}

/// Asks for 20 A on axis 0 and returns the hottest true winding on the way.
double push(Pcb& pcb, double seconds) {
  double hottest = -300;
  for (int k = static_cast<int>(seconds / 0.002 + 0.5); k > 0; --k) {
    pcb.set_current(0, 0.0f, 20.0f);
    pcb.run_for(0.002);
    hottest = std::max(hottest, pcb.bench.truth(0).hottest_degC);
  }
  return hottest;
}

/// On, under the same push, to the middle between two slow ticks. What flows within one is not in its estimate yet, and
/// the next is not saved before it is worked out: 10 ms of 20 A are 4 K.
void push_to_between_ticks(Pcb& pcb) {
  const std::uint32_t tick = pcb.door().slow_ticks;
  for (int k = 0; k < 60 && pcb.door().slow_ticks == tick; ++k) pcb.run_for(0.2e-3);
  push(pcb, 0.004);
}

/// The supply goes: gates off, last words; then nothing for a while, in which the motors cool by themselves.
void lose_power(Pcb& pcb, double off_s, bool keep_backup, std::uint32_t seed) {
  pcb.chip.set_supply(2.8);
  pcb.run_for(0.0015);
  const hal::Duty open{{0.5f, 0.5f, 0.5f}, false};
  for (int k = static_cast<int>(off_s * 20e3); k > 0; --k) pcb.bench.advance_period({open, open});
  pcb.chip.set_supply(3.3);
  pcb.power_on(seed, keep_backup);
}

void spoil_backup(Pcb& pcb) {
  for (std::size_t i = 0; i < 4096; ++i) pcb.chip.backup_ram()[i] = static_cast<std::uint8_t>(37 * i + 1);
}

TEST(SlowMemory, AResetInAnyPlaceOfABurstForgetsNoHeat) {
  NEEDS_IMAGE(image);
  for (const int hang : {0, 16 + 18}) {  // main loop: IWDG; fast lane: WWDG
    auto pcb = small_motors(heard_s);
    ASSERT_TRUE(pcb->arm());
    push(*pcb, hang == 0 ? 0.14 : 0.17);
    push_to_between_ticks(*pcb);
    const double before = estimated_degC(*pcb);
    ASSERT_GT(before, 80.0);
    pcb->chip.core().hang(hang);
    for (int i = 0; i < 400 && pcb->chip.resets() == 0; ++i) push(*pcb, 0.002);
    ASSERT_EQ(pcb->chip.resets(), 1);
    pcb->chip.core().unhang();
    pcb->run_for(0.025);
    EXPECT_EQ(pcb->door().restored, 1u);
    EXPECT_GT(estimated_degC(*pcb), before - 2.0);
    ASSERT_TRUE(pcb->arm());
    EXPECT_LE(push(*pcb, 1.0), limit_degC + 2.0);
    EXPECT_EQ(pcb->chip.troubles().count(), 0u) << pcb->chip.report_text();
  }
}

TEST(SlowMemory, APowerCutOf2sInABurstForgetsNoHeatWithOrWithoutABattery) {
  NEEDS_IMAGE(image);
  for (const bool battery : {true, false}) {
    auto pcb = small_motors(heard_s);
    ASSERT_TRUE(pcb->arm());
    push(*pcb, 0.2);
    push_to_between_ticks(*pcb);
    const double before = estimated_degC(*pcb);
    lose_power(*pcb, 2.0, battery, 7);
    pcb->run_for(0.02);
    EXPECT_EQ(pcb->door().restored, battery ? 1u : 2u);
    EXPECT_GT(estimated_degC(*pcb), before - 2.0) << "time off is unknown: nothing has cooled";
    ASSERT_TRUE(pcb->arm());
    EXPECT_LE(push(*pcb, 1.5), limit_degC + 2.0);
    EXPECT_EQ(pcb->chip.troubles().count(), 0u) << pcb->chip.report_text();
  }
}

TEST(SlowMemory, TwentyQuickPowerCyclesDoNotAddUpToABurntWinding) {
  NEEDS_IMAGE(image);
  auto pcb = small_motors(heard_s);
  ASSERT_TRUE(pcb->arm());
  double hottest = push(*pcb, 0.3), pushed_s = 0;
  lose_power(*pcb, 0.05, false, 99);
  for (std::uint32_t cycle = 0; cycle < 20; ++cycle) {
    if (pcb->arm(0.3)) {
      hottest = std::max(hottest, push(*pcb, 0.1));
      pushed_s += 0.1;
    }
    lose_power(*pcb, 0.05, false, 100 + cycle);
  }
  EXPECT_LE(hottest, limit_degC + 2.0);
  EXPECT_GT(hottest, 100.0) << "it was really pushed";
  EXPECT_GT(pushed_s, 1.0);
  EXPECT_EQ(pcb->chip.troubles().count(), 0u) << pcb->chip.report_text();
}

TEST(Memory, ASpoiltBackupMemoryFallsBackOnTheJournalWhichCountsForOneStartOnly) {
  NEEDS_IMAGE(image);
  auto pcb = small_motors(heard_s);
  ASSERT_TRUE(pcb->arm());
  push(*pcb, 0.2);
  push_to_between_ticks(*pcb);
  const double before = estimated_degC(*pcb);
  pcb->chip.set_supply(2.8);
  pcb->run_for(0.0015);
  spoil_backup(*pcb);
  pcb->chip.set_supply(3.3);
  pcb->power_on(3, true);
  pcb->run_for(0.025);
  EXPECT_EQ(pcb->door().restored, 2u);
  EXPECT_GT(estimated_degC(*pcb), before - 2.0);
  // Spoilt again without a new record in the journal: the old one must not be believed twice.
  spoil_backup(*pcb);
  pcb->power_on(4, true);
  pcb->run_for(0.025);
  EXPECT_EQ(pcb->door().restored, 0u);
  EXPECT_NEAR(estimated_degC(*pcb), limit_degC - 10, 3.0);
}

TEST(SlowMemory, WithNothingRememberedTheStartIsHotAndAHotMotorStaysWhole) {
  NEEDS_IMAGE(image);
  auto pcb = small_motors(heard_s);
  ASSERT_TRUE(pcb->arm());
  push(*pcb, 0.4);
  ASSERT_GT(pcb->bench.truth(0).hottest_degC, 120.0);
  spoil_backup(*pcb);
  pcb->power_on(9, true);  // and the journal's record is used up
  pcb->run_for(0.025);
  EXPECT_EQ(pcb->door().restored, 0u);
  EXPECT_NEAR(estimated_degC(*pcb), limit_degC - 10, 3.0);
  ASSERT_TRUE(pcb->arm());
  EXPECT_LE(push(*pcb, 1.5), limit_degC + 5.0);
  pcb->run_for(20.0);
  EXPECT_GT(pcb->door().axis[0].allowance_A, 10.0f) << "a sensor that lagged would have warmed by now";
}

TEST(Memory, APowerCutInEachWordOfTheJournalEndsInThatRecordOrInAHotStart) {
  NEEDS_IMAGE(image);
  constexpr auto all = static_cast<int>(h8_15d::HeatKeeper::record_words);
  int whole = 0, hot = 0;
  for (int cut = 1; cut <= all + 1; ++cut) {
    auto pcb = small_motors();
    pcb->run_for(0.03);
    const auto words = pcb->chip.flash.words_programmed();
    pcb->chip.set_supply(2.8);
    for (int i = 0; i < 4000 && pcb->chip.flash.words_programmed() < words + static_cast<std::uint64_t>(cut); ++i)
      pcb->chip.run_for(1e-6);
    if (cut <= all) pcb->chip.flash.power_lost(pcb->chip.now() - from_s(8e-6), 1234u + static_cast<std::uint32_t>(cut));
    pcb->chip.set_supply(3.3);
    pcb->power_on(6);  // VBAT gone too: only the journal remembers
    pcb->run_for(0.02);
    const std::uint32_t restored = pcb->door().restored;
    (restored == 2 ? whole : hot)++;
    EXPECT_NEAR(estimated_degC(*pcb), restored == 2 ? 40.0 : limit_degC - 10, 3.0) << "cut in word " << cut;
    if (cut > all) {
      EXPECT_EQ(restored, 2u);
    }
  }
  EXPECT_GE(whole, 1);
  EXPECT_GE(hot, all - 2);
}

TEST(Memory, ParametersAreSavedOnlyDisarmedAndAreInForceAfterARestart) {
  NEEDS_IMAGE(image);
  auto pcb = small_motors();
  ASSERT_TRUE(pcb->arm());
  const auto words = pcb->chip.flash.words_programmed();
  EXPECT_EQ(pcb->order(commit).status, static_cast<int>(wire::Status::not_disarmed));
  EXPECT_EQ(pcb->order(save).status, static_cast<int>(wire::Status::not_disarmed));
  EXPECT_EQ(pcb->chip.flash.words_programmed(), words);
  for (int i = 0; i < 2; ++i) {
    pcb->wish(i, h8_15d::wish_disarm);
    pcb->run_for(0.01);
  }
  EXPECT_EQ(pcb->order(stage, {{0x0111, 1}, 30.0f}).status, 0);
  EXPECT_EQ(pcb->order(commit).status, static_cast<int>(wire::Status::parameter_refused)) << "above the board's peak";
  EXPECT_EQ(pcb->order(stage, {{0x0111, 1}, 7.0f}).status, 0);
  EXPECT_EQ(pcb->order(commit).status, 0);
  EXPECT_EQ(pcb->order(save).status, 0);
  EXPECT_EQ(pcb->chip.resets(), 0) << "the watchdogs outlive it";
  pcb->power_on(2);
  pcb->run_for(0.03);
  EXPECT_EQ(pcb->door().saved_serial, 2u);
  EXPECT_EQ(pcb->order(h8_15d::order_get, {{0x0111, 1}, 0.0f}).status, 0);
  EXPECT_EQ(pcb->door().order_value, 7.0f);
  ASSERT_TRUE(pcb->arm());
  EXPECT_EQ(pcb->chip.troubles().count(), 0u) << pcb->chip.report_text();
}

TEST(Memory, ASaveMayTakeLongerThanTheWatchdogWaits) {
  NEEDS_IMAGE(image);
  auto pcb = small_motors();
  pcb->run_for(0.02);
  pcb->chip.flash.word_s = 300e-6;  // a word takes 100 us at most: as if there were three times as many
  pcb->post(save);
  pcb->run_for(0.04);  // the watchdog waits for 19 ms
  EXPECT_EQ(pcb->door().saved_serial, 2u);
  EXPECT_EQ(pcb->chip.resets(), 0);
}

TEST(SlowMemory, APowerCutInEachWordOfAParameterSaveLeavesTheLastSetOrTheOneBefore) {
  NEEDS_IMAGE(image);
  constexpr int all = firmware::parameter_record_words(firmware::ParameterStore::always_saved);
  int kept_old = 0, kept_new = 0;
  for (int cut = 1; cut <= all + 1; ++cut) {
    auto pcb = small_motors();
    pcb->run_for(0.02);
    const firmware::ParameterSet before = pcb->saved_parameters();
    firmware::ParameterSet after = before;
    after.axes[0].drive.current_limit_A = 7.0f;  // among the first values, and
    after.axes[1].heat.housing_noise_K = 0.7f;   // among the last
    ASSERT_EQ(pcb->order(stage, {{0x0111, 0}, 7.0f}).status, 0);
    ASSERT_EQ(pcb->order(stage, {{0x020F, 1}, 0.7f}).status, 0);
    ASSERT_EQ(pcb->order(commit).status, 0);
    const auto words = pcb->chip.flash.words_programmed();
    pcb->post(save);
    for (int i = 0; i < 6000 && pcb->chip.flash.words_programmed() < words + static_cast<std::uint64_t>(cut); ++i)
      pcb->chip.run_for(1e-6);
    if (cut <= all) pcb->chip.flash.power_lost(pcb->chip.now() - from_s(8e-6), 77u * static_cast<std::uint32_t>(cut));
    pcb->power_on(6);
    pcb->run_for(0.02);
    EXPECT_EQ(pcb->door().parameters.status, 0) << "cut in word " << cut;
    const bool is_new = pcb->door().saved_serial == 2;
    (is_new ? kept_new : kept_old)++;
    const firmware::ParameterSet found = pcb->saved_parameters(), meant = is_new ? after : before;
    for (int axis = 0; axis < 2; ++axis) {
      for (int i = 0; i < firmware::parameter_count; ++i)
        ASSERT_EQ(firmware::parameter_value(found.axes[axis], i), firmware::parameter_value(meant.axes[axis], i))
            << "cut in word " << cut << ", " << firmware::parameter_info(i)->name;
    }
    ASSERT_EQ(pcb->order(h8_15d::order_get, {{0x020F, 1}, 0.0f}).status, 0);
    EXPECT_EQ(pcb->door().order_value, is_new ? 0.7f : 0.5f) << "the image itself means the same";
    if (cut > all) {
      EXPECT_TRUE(is_new);
    }
  }
  EXPECT_GE(kept_old, all - 6);
  EXPECT_GE(kept_new, 1);
}

TEST(Memory, WithoutItsCrystalTheImageSaysWhyItWillNotArmAndKeepsTheHeat) {
  NEEDS_IMAGE(image);
  auto pcb = small_motors();
  ASSERT_TRUE(pcb->arm());
  push(*pcb, 0.15);
  const double before = estimated_degC(*pcb);
  pcb->chip.stop_hse();
  EXPECT_FALSE(pcb->duty(0).on || pcb->duty(1).on);
  pcb->run_for(0.1);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(pcb->door().axis[i].fault.fault, wire::Fault::clock_lost);
    EXPECT_EQ(pcb->door().axis[i].mode, firmware::Mode::tripped);
    pcb->wish(i, h8_15d::wish_clear);
    pcb->run_for(0.02);
    pcb->wish(i, h8_15d::wish_arm);
    pcb->run_for(0.02);
    EXPECT_EQ(pcb->door().axis[i].mode, firmware::Mode::tripped) << "nobody can talk it into arming";
    EXPECT_FALSE(pcb->chip.port('B').drives_high(i == 0 ? 9 : 2));
  }
  EXPECT_EQ(pcb->door().restored, 1u);
  EXPECT_GT(estimated_degC(*pcb), before - 30.0) << "0.1 s of cooling by the model";
  EXPECT_EQ(pcb->chip.troubles().count(), 0u) << pcb->chip.report_text();
}

}  // namespace
}  // namespace image_tests

// SPDX-License-Identifier: MIT
// The chip model is strict: each of these is something that silicon forgives silently and the model must not. The tests
// touch registers the way an image does, over the bus, so no image is needed.
#include <gtest/gtest.h>

#include "host-sim/chip/chip.hpp"

namespace host_sim::chip {
namespace {

constexpr std::uint32_t rcc = 0x40023800, gpioa = 0x40020000, tim1 = 0x40010000, tim8 = 0x40010400, adc1 = 0x40012000,
                        flash_r = 0x40023C00, iwdg = 0x40003000, wwdg = 0x40002C00, pwr = 0x40007000,
                        backup = 0x40024000;

// An image of two instructions at its start: `b .`. Time passes, nothing else.
struct Bench : ::testing::Test {
  Bench() {
    const std::uint32_t vectors[3] = {0x20010000, 0x08000009, 0xE7FEE7FE};
    chip.flash.load(0x08000000, vectors, sizeof vectors);
    chip.power_on();
  }
  void write(std::uint32_t address, std::uint32_t value) { chip.bus_write(address, value, 4); }
  std::uint32_t read(std::uint32_t address) { return chip.bus_read(address, 4); }
  void clocks_on() {
    write(rcc + 0x30, 0x00100007);
    write(rcc + 0x30, 0x00140007);
    write(rcc + 0x40, 1u << 28 | 1u << 11 | 6);
    write(rcc + 0x44, 1u << 14 | 7u << 8 | 3);
  }
  // TIM1 at 16 MHz, centre-aligned with 800 counts a half, channel 4 on the way up.
  void start_timer(std::uint32_t bdtr = 0x1000 | 0x2000 | 20) {
    chip.set_pin({'B', 12}, false);
    write(tim1 + 0x2C, 800);
    write(tim1 + 0x30, 1);
    write(tim1 + 0x18, 0x6868);
    write(tim1 + 0x1C, 0x7868);
    write(tim1 + 0x20, 0x1555);
    write(tim1 + 0x40, 790);
    write(tim1 + 0x14, 1);
    write(tim1 + 0x10, 0);
    write(tim1 + 0x44, bdtr);
    write(tim1 + 0x00, 0x40 | 1);
  }
  testing::AssertionResult complains(const std::string& part) {
    if (chip.troubles().mention(part)) return testing::AssertionSuccess();
    return testing::AssertionFailure() << "no word about '" << part << "'; said:\n" << chip.report_text();
  }
  Chip chip;
};

TEST_F(Bench, SaysNothingAboutAFirmwareThatDoesNothing) {
  chip.run_for(0.01);
  EXPECT_EQ(chip.troubles().count(), 0u) << chip.report_text();
  EXPECT_GT(chip.core().instructions(), 100'000u);
}

TEST_F(Bench, CountsWhatWasExecutedHoweverOftenItIsLookedAt) {
  // r1 = 0x20000000; for (r0 = 1;; ++r0) *r1 = r0: three instructions, then six a turn.
  const std::uint16_t code[] = {0x2000, 0x2120, 0x0609, 0x3001, 0xBF00, 0xBF00, 0xBF00, 0x6008, 0xE7F9, 0xBF00};
  chip.flash.load(0x08000008, code, sizeof code);
  chip.power_on();
  for (int k = 0; k < 20'000; ++k) chip.run_for(10e-9);
  const std::uint32_t turns = chip.core().word(0x20000000);
  EXPECT_GT(turns, 500u);
  EXPECT_EQ(chip.core().instructions(), 3u + 6u * turns);
}

TEST_F(Bench, ARegisterWithoutItsClockIsAMistake) {
  write(tim1 + 0x2C, 100);
  EXPECT_TRUE(complains("TIM1: write with its clock off"));
  read(gpioa + 0x10);
  EXPECT_TRUE(complains("GPIOA: read with its clock off"));
}

TEST_F(Bench, AReservedBitIsAMistake) {
  clocks_on();
  write(tim1 + 0x04, 2);
  EXPECT_TRUE(complains("reserved bit of CR2"));
}

TEST_F(Bench, AnUnknownAddressOrRegisterIsAMistake) {
  read(0x40005400);
  EXPECT_TRUE(complains("no peripheral"));
  clocks_on();
  read(tim1 + 0x80);
  EXPECT_TRUE(complains("does not exist or is not modelled"));
}

TEST_F(Bench, AHalfWordAccessIsAMistake) {
  clocks_on();
  chip.bus_write(gpioa + 0x18, 1, 2);
  EXPECT_TRUE(complains("not one aligned word"));
}

TEST_F(Bench, TooFewWaitStatesAndTooFastBusesAreMistakes) {
  write(rcc + 0x00, 0x00010083);
  chip.run_for(0.002);
  ASSERT_TRUE(read(rcc) >> 17 & 1);
  write(rcc + 0x04, 0x20000000 | 7u << 24 | 1u << 22 | 168u << 6 | 4);
  write(rcc + 0x00, 0x01010083);
  chip.run_for(0.001);
  write(rcc + 0x08, 2);
  EXPECT_TRUE(complains("too few flash wait states"));
  EXPECT_TRUE(complains("APB1 above 42 MHz"));
  EXPECT_NEAR(chip.rcc.tree().hclk_Hz, 168e6, 1);
}

TEST_F(Bench, TheClockIsNotSwitchedBeforeItIsReady) {
  write(rcc + 0x08, 1);
  EXPECT_TRUE(complains("before HSERDY"));
}

TEST_F(Bench, OutputsNeedMainOutputEnableAndDeadTime) {
  clocks_on();
  start_timer();
  write(tim1 + 0x34, 400);
  chip.run_for(0.001);
  EXPECT_FALSE(chip.tim1.leg(0).upper_driven);
  write(tim1 + 0x44, 0x9000 | 0x2000);
  EXPECT_TRUE(complains("no dead time"));
  chip.run_for(0.001);
  EXPECT_TRUE(chip.tim1.leg(0).upper_driven && chip.tim1.leg(0).lower_driven);
  EXPECT_NEAR(chip.tim1.leg(0).upper_ratio, 0.5, 1e-9);
}

TEST_F(Bench, ABreakOpensTheOutputsWithoutAnyInstruction) {
  clocks_on();
  write(gpioa + 0x400, 0x00000280 | 2u << 24);
  write(gpioa + 0x424, 1u << 16);
  start_timer(0x9000 | 0x2000 | 20);
  chip.run_for(0.001);
  ASSERT_TRUE(chip.tim1.main_output());
  const auto before = chip.core().instructions();
  chip.set_pin({'B', 12}, true);
  EXPECT_FALSE(chip.tim1.main_output());
  EXPECT_EQ(chip.core().instructions(), before);
  chip.set_pin({'B', 12}, false);
  chip.run_for(0.001);
  EXPECT_FALSE(chip.tim1.main_output()) << "AOE = 0: it must not come back by itself";
}

TEST_F(Bench, LockedBitsStayUntilReset) {
  clocks_on();
  write(tim1 + 0x44, 0x1000 | 0x100 | 40);
  write(tim1 + 0x44, 0x1000 | 0x100 | 5);
  EXPECT_TRUE(complains("LOCK protects"));
  EXPECT_NEAR(chip.tim1.dead_time_s(), 40 / 16e6, 1e-9);
}

TEST_F(Bench, UpdatesComeOncePerPeriodAtTheTop) {  // RM0090 17.3.3: RCR = 1 written before the start
  clocks_on();
  start_timer();
  write(tim1 + 0x34, 600);
  chip.run_for(49e-6);
  EXPECT_EQ(chip.tim1.leg(0).upper_ratio, 0);
  EXPECT_FALSE(read(tim1 + 0x10) & 1);
  chip.run_for(2e-6);
  EXPECT_TRUE(read(tim1 + 0x10) & 1) << "the top is 50 us after the start";
  write(tim1 + 0x10, 0);
  chip.run_for(60e-6);
  EXPECT_FALSE(read(tim1 + 0x10) & 1) << "nothing at the bottom";
}

TEST_F(Bench, AnArmedAdcWithoutARunningTimerIsAMistake) {
  clocks_on();
  write(adc1 + 0x08, 1u << 20 | 1);
  chip.run_for(0.002);
  EXPECT_TRUE(complains("its timer does not run"));
}

TEST_F(Bench, InjectedResultsAreReadOnceAndFresh) {
  clocks_on();
  write(adc1 + 0x08, 1u << 20 | 1);
  start_timer();
  chip.run_for(0.0002);
  EXPECT_GE(chip.adc1.injected_done(), 1u);
  read(adc1 + 0x3C);
  EXPECT_EQ(chip.troubles().count(), 0u) << chip.report_text();
  read(adc1 + 0x3C);
  EXPECT_TRUE(complains("no new conversion"));
}

TEST_F(Bench, FlashNeedsItsKeysItsWidthAndADisarmedBridge) {
  write(flash_r + 0x10, 0x201);
  EXPECT_TRUE(complains("while locked"));
  chip.flash_write(0x08040000, 1, 4);
  EXPECT_TRUE(complains("without unlocking"));
  write(flash_r + 0x04, 0x45670123);
  write(flash_r + 0x04, 0xCDEF89AB);
  write(flash_r + 0x10, 0x001);
  chip.flash_write(0x08040000, 1, 4);
  EXPECT_TRUE(complains("parallelism"));
  write(flash_r + 0x10, 0x201);
  chip.flash_write(0x08040000, 0x1234FFFF, 4);
  EXPECT_EQ(chip.flash.word(0x08040000), 0x1234FFFFu);
  chip.flash_write(0x08040000, 0xFFFFFFFF, 4);
  EXPECT_TRUE(complains("rise from 0 to 1"));
  clocks_on();
  start_timer(0x9000 | 0x2000 | 20);
  chip.flash_write(0x08040004, 0, 4);
  EXPECT_TRUE(complains("while a bridge is driven"));
}

TEST_F(Bench, AWordThatWasBeingWrittenWhenThePowerWentIsLost) {
  write(flash_r + 0x04, 0x45670123);
  write(flash_r + 0x04, 0xCDEF89AB);
  write(flash_r + 0x10, 0x201);
  chip.flash_write(0x08040000, 0x00000000, 4);
  chip.flash.power_lost(chip.now() - 10, 77);
  EXPECT_NE(chip.flash.word(0x08040000), 0u);
  EXPECT_NE(chip.flash.word(0x08040000), 0xFFFFFFFFu);
}

TEST_F(Bench, TheIndependentWatchdogResetsAndPinsFloat) {
  clocks_on();
  write(gpioa, 0xA8000000 | 1u << 4);
  write(gpioa + 0x18, 1u << 2);
  ASSERT_TRUE(chip.port('A').drives_high(2));
  write(iwdg, 0x5555);
  write(iwdg + 0x08, 99);
  write(iwdg, 0xCCCC);
  chip.run_for(100 * 4 / 32e3 - 0.001);
  EXPECT_EQ(chip.resets(), 0);
  chip.run_for(0.002);
  EXPECT_EQ(chip.resets(), 1);
  EXPECT_FALSE(chip.port('A').drives_high(2));
  EXPECT_EQ(chip.port('A').mode(2), PinMode::input);
  EXPECT_TRUE(read(rcc + 0x74) >> 29 & 1) << "IWDGRSTF";
}

TEST_F(Bench, TheWindowWatchdogBitesLateAndEarly) {
  clocks_on();
  write(wwdg + 0x04, 0x50);
  write(wwdg, 0xC0 | 0x3F);
  write(wwdg, 0xC0 | 0x3F);  // T = 0x7F is above W = 0x50: too early
  chip.run_for(1e-5);
  EXPECT_EQ(chip.resets(), 1);
  EXPECT_TRUE(complains("before its window"));
  clocks_on();
  write(wwdg, 0xC0 | 0x01);
  chip.run_for(3 * 4096 / 16e6);
  EXPECT_EQ(chip.resets(), 2);
  EXPECT_EQ(chip.last_reset(), ResetCause::wwdg);
}

TEST_F(Bench, TheBackupMemoryNeedsItsClockAndTheDoorOpen) {
  write(backup, 1);
  EXPECT_TRUE(complains("backup SRAM: write with its clock off"));
  clocks_on();
  write(backup, 1);
  EXPECT_TRUE(complains("DBP is 0"));
  write(pwr, 0x4100);
  write(backup, 0x600DCAFE);
  EXPECT_EQ(read(backup), 0x600DCAFEu);
  write(pwr + 4, 0x200);
  chip.power_off();
  chip.power_on(99, true);
  clocks_on();
  EXPECT_EQ(read(backup), 0x600DCAFEu) << "BRE was set and VBAT stayed";
}

TEST_F(Bench, AStoppedCrystalBreaksTheBridgeOnlyIfTheClockIsWatched) {
  clocks_on();
  write(rcc, 0x00010083);
  chip.run_for(0.002);
  write(rcc, 0x00090083);
  start_timer(0x9000 | 0x2000 | 20);
  ASSERT_TRUE(chip.tim1.main_output());
  chip.stop_hse();
  EXPECT_FALSE(chip.tim1.main_output());
  EXPECT_TRUE(chip.nvic.pending(nmi));
}

}  // namespace
}  // namespace host_sim::chip

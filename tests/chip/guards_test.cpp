// SPDX-License-Identifier: MIT
// What goes wrong on a board while both bridges run: a lane hangs, a sensor or a converter fails, counts are lost. The
// image has to open its gates in the time that the safety figures allow, and must not drive before it is ready.
#include <cmath>
#include <cstring>
#include <string>

#include "tests/chip/image.hpp"

namespace image_tests {
namespace {

using boards::Pcb;
using namespace host_sim::chip;
constexpr std::uint32_t adc3_cr2 = 0x40012208, tim3_cnt = 0x40000424;

std::unique_ptr<Pcb> driving(const Options& o = {}) {
  auto pcb = board(o);
  EXPECT_TRUE(pcb->arm());
  hold(*pcb, 4.0f, 4.0f, 0.03);
  EXPECT_TRUE(pcb->duty(0).on && pcb->duty(1).on);
  return pcb;
}

/// Seconds until both bridges are open, setpoints kept alive; `limit_s` if they are not.
double opens_after_s(Pcb& pcb, double limit_s) {
  const double start_s = to_s(pcb.chip.now());
  double said_s = start_s;
  while (pcb.duty(0).on || pcb.duty(1).on) {
    pcb.run_for(2e-6);
    const double now_s = to_s(pcb.chip.now());
    if (now_s - start_s > limit_s) return limit_s;
    if (now_s - said_s < 0.01) continue;
    for (int i : {0, 1}) pcb.set_current(i, 0.0f, 4.0f);
    said_s = now_s;
  }
  return to_s(pcb.chip.now()) - start_s;
}

TEST(Guards, GateDriversStayOffUntilTheImageIsReady) {
  NEEDS_IMAGE(image);
  auto pcb = board();
  const auto enabled = [&] { return pcb->chip.port('B').drives_high(9) || pcb->chip.port('B').drives_high(2); };
  while (pcb->door().magic != h8_15d::Door::open && to_s(pcb->chip.now()) < 0.1) {
    ASSERT_FALSE(enabled()) << to_s(pcb->chip.now());
    pcb->run_for(20e-6);
  }
  EXPECT_TRUE(enabled());
}

// Hang of a lane, or of any handler: whatever is more urgent still runs, and a watchdog that it does not feed bites.
TEST(SlowGuards, AHangAnywhereEndsInAResetWithOpenGates) {
  NEEDS_IMAGE(image);
  struct Hang {
    const char* where;
    int exception;
    double limit_s;
    ResetCause cause;
  };
  for (const Hang& h :
       {Hang{"fast lane", 16 + 18, 2e-3, ResetCause::wwdg}, Hang{"index of axis 0", 16 + 9, 2e-3, ResetCause::wwdg},
        Hang{"index of axis 1", 16 + 23, 2e-3, ResetCause::wwdg},
        Hang{"hard fault", hard_fault, 2e-3, ResetCause::wwdg}, Hang{"millisecond", systick, 35e-3, ResetCause::iwdg},
        Hang{"main loop with the slow lane", 0, 35e-3, ResetCause::iwdg}}) {
    auto pcb = driving();
    EXPECT_TRUE(pcb->door().reset_flags >> 27 & 1) << "PORRSTF, the first start";
    pcb->chip.iwdg.set_lsi_Hz(17e3);  // the slowest
    pcb->chip.bus_write(0x40003000, 0xAAAA, 4);
    pcb->chip.core().hang(h.exception);
    if (h.exception) pcb->chip.nvic.pend(h.exception);
    const double start_s = to_s(pcb->chip.now());
    while (pcb->chip.resets() == 0 && to_s(pcb->chip.now()) < start_s + 0.1) pcb->run_for(50e-6);
    EXPECT_EQ(pcb->chip.last_reset(), h.cause) << h.where;
    EXPECT_LE(to_s(pcb->chip.now()) - start_s, h.limit_s + 50e-6) << h.where;
    EXPECT_FALSE(pcb->duty(0).on || pcb->duty(1).on) << h.where;
    EXPECT_EQ(pcb->chip.port('B').mode(9), PinMode::input) << "reset leaves the enable to its resistor: " << h.where;
    pcb->chip.core().unhang();
    pcb->run_for(0.05);
    const std::uint32_t flags = pcb->door().reset_flags;
    EXPECT_EQ(flags >> 29 & 3, h.cause == ResetCause::iwdg ? 1u : 2u) << h.where;
    EXPECT_FALSE(flags >> 27 & 1) << "the first start's cause was forgotten: " << h.where;
    EXPECT_TRUE(pcb->arm()) << "and starts anew";
  }
}

TEST(Guards, AFaultOfTheCoreOpensTheGatesBeforeTheWatchdogDoes) {
  NEEDS_IMAGE(image);
  auto pcb = driving();
  pcb->chip.nvic.pend(hard_fault);
  EXPECT_LT(opens_after_s(*pcb, 1e-3), 5e-6);
  EXPECT_FALSE(pcb->chip.port('B').drives_high(9) || pcb->chip.port('B').drives_high(2));
}

// The analog watchdog speaks before the fast lane has computed anything: 250 of its 800 instructions are 1.5 us.
TEST(Guards, OverCurrentOpensTheBridgeBeforeTheFastLaneHasComputed) {
  NEEDS_IMAGE(image);
  for (int axis : {0, 1}) {
    auto pcb = driving();
    pcb->chip.adc1.force(axis == 0 ? 0 : 10, 4090);
    const auto samples = pcb->chip.adc1.injected_done();
    while (pcb->duty(axis).on && pcb->chip.adc1.injected_done() < samples + 3) pcb->run_for(0.1e-6);
    EXPECT_FALSE(pcb->duty(axis).on);
    const double top_s = to_s(pcb->chip.now() - pcb->chip.timer(axis).last_overflow());
    EXPECT_LT(top_s, 2.2e-6 + 1.5e-6) << "two conversions of 15 cycles behind the top, then";
    EXPECT_TRUE(pcb->duty(1 - axis).on);
    for (int k = 0; k < 400; ++k) {  // while the core bridges the first bad sample and finds the second
      pcb->run_for(0.5e-6);
      ASSERT_FALSE(pcb->duty(axis).on) << "again, " << 0.5 * k << " us later";
    }
    hold(*pcb, 4.0f, 4.0f, 0.02);
    EXPECT_EQ(pcb->door().axis[axis].mode, firmware::Mode::tripped);
    EXPECT_FALSE(pcb->duty(axis).on);
  }
}

TEST(Guards, ACurrentSensorThatDiesIsFoundByTheOthers) {
  NEEDS_IMAGE(image);
  for (int axis : {0, 1}) {
    auto pcb = driving();
    pcb->set_current(axis, 4.0f, 0.0f);              // along phase a, where the rotor stands
    pcb->chip.adc1.force(axis == 0 ? 0 : 10, 2048);  // reads nothing
    const double begin_s = to_s(pcb->chip.now());
    while (pcb->duty(axis).on && to_s(pcb->chip.now()) < begin_s + 0.1) pcb->run_for(1e-4);  // setpoints live so long
    EXPECT_LT(to_s(pcb->chip.now()) - begin_s, 0.02);
    hold(*pcb, 4.0f, 4.0f, 0.02);
    EXPECT_EQ(pcb->door().axis[axis].fault.fault, wire::Fault::current_sum);
    EXPECT_TRUE(pcb->duty(1 - axis).on);
  }
}

TEST(Guards, AConverterThatStaysOutOpensTheGates) {  // after two periods
  NEEDS_IMAGE(image);
  auto pcb = driving();
  pcb->chip.mutate({.name = "ADC3 goes out",
                    .on_write =
                        [](std::uint32_t at, std::uint32_t& value) {
                          if (at == adc3_cr2) value &= ~1u;
                          return true;
                        },
                    .on_read = {},
                    .redirect = {}});
  EXPECT_LT(opens_after_s(*pcb, 1e-2), 150e-6);
  EXPECT_FALSE(pcb->chip.troubles().mention("no new conversion")) << "what was not converted is not read";
}

TEST(Guards, TwoConvertersThatDisagreeOnTheBusOpenTheGates) {
  NEEDS_IMAGE(image);
  auto pcb = driving();
  pcb->chip.adc3.force(3, 3200);
  EXPECT_LT(opens_after_s(*pcb, 1e-2), 150e-6);
}

TEST(Guards, AReferenceThatIsOffByTenPercentOpensTheGates) {  // then every other reading is off as well
  NEEDS_IMAGE(image);
  auto pcb = driving();
  pcb->chip.adc1.force(17, 1502 * 10 / 9);
  EXPECT_LT(opens_after_s(*pcb, 0.1), 0.02);
  EXPECT_NEAR(pcb->door().vdda_V, 2.97, 0.01);
}

/// Of the application's, by the image's symbol table.
std::uint8_t* part(Pcb& pcb, const std::string& name) {
  const std::uint32_t place = pcb.chip.symbol("application_storage") + pcb.chip.symbol("part " + name);
  return pcb.chip.core().ram() + (place - Core::ram_base);
}

TEST(Guards, AFlippedZeroOfAnEncoderOpensItsBridge) {
  NEEDS_IMAGE(image);
  for (const int axis : {0, 1}) {
    auto pcb = driving();
    part(*pcb, "stage_.encoder_zero_")[4 * axis + 1] ^= 4;  // a quarter of a turn
    hold(*pcb, 4.0f, 4.0f, 0.01);
    EXPECT_FALSE(pcb->duty(axis).on);
    EXPECT_TRUE(pcb->duty(1 - axis).on);
  }
}

// The sums are compared before; what flips then would pass for the result.
TEST(Guards, ATemperatureThatFlipsInTheMiddleOfTheSlowLaneComesBack) {
  NEEDS_IMAGE(image);
  auto pcb = driving();
  const float before_degC = pcb->door().axis[0].core_degC[0];
  const double until_s = to_s(pcb->chip.now()) + 0.02;
  const auto works = [&] {
    return pcb->chip.function_at(pcb->chip.pc()).find("Uncertainty4step") != std::string::npos;
  };
  while (!works() && to_s(pcb->chip.now()) < until_s) pcb->run_for(1e-6);
  ASSERT_TRUE(works());
  std::uint8_t* const at = part(*pcb, "driver_.axes_[0].core_.degC_");
  double degC;
  std::memcpy(&degC, at, sizeof degC);
  ASSERT_NEAR(degC, static_cast<double>(before_degC), 1.0) << "axis 0 comes first";
  at[6] ^= at[6] & 0x40 ? 0x40 : 0x10;  // of the exponent: a sixteenth above 32 degC, half below
  std::memcpy(&degC, at, sizeof degC);
  ASSERT_LT(degC, static_cast<double>(before_degC) - 5.0);
  hold(*pcb, 4.0f, 4.0f, 0.02);
  EXPECT_GT(pcb->door().axis[0].core_degC[0], before_degC - 1.0f);
}

TEST(Guards, AnEncoderThatLostCountsIsFoundAtTheIndex) {
  NEEDS_IMAGE(image);
  Options o;
  o.locked = false;
  auto pcb = driving(o);
  hold(*pcb, 4.0f, 4.0f, 0.05);
  pcb->chip.bus_write(tim3_cnt, pcb->chip.bus_read(tim3_cnt, 4) + 40, 4);  // 3.5 degrees: no other check sees it
  EXPECT_TRUE(pcb->duty(0).on);
  pcb->run_for(1e-3);
  for (int k = 0; k < 40 && pcb->duty(0).on; ++k) hold(*pcb, 4.0f, 4.0f, 0.01);
  EXPECT_FALSE(pcb->duty(0).on);
  EXPECT_TRUE(pcb->duty(1).on);
}

TEST(Guards, ThermistorsAndForceSensorsAreReadAsTheyAreWired) {
  NEEDS_IMAGE(image);
  auto pcb = board();
  const auto counts = [](double degC) {
    return static_cast<int>(host_sim::ntc_counts(host_sim::SensorDesign{}.housing, degC, 4095) + 0.5);
  };
  pcb->chip.adc1.force(4, counts(60));
  pcb->chip.adc1.force(5, counts(40));
  pcb->run_for(0.6);  // the estimators begin with the first steady reading
  EXPECT_NEAR(pcb->door().axis[0].housing_degC, 60, 0.2);
  EXPECT_NEAR(pcb->door().axis[1].housing_degC, 40, 0.2);
  for (int i : {0, 1}) EXPECT_NEAR(pcb->door().force_V[i], 100 * 3.3 / 4096, 1e-3);
  pcb->chip.adc2.force(13, 1024 + 500);
  pcb->run_for(0.02);
  EXPECT_NEAR(pcb->door().bus_A, 500 * 3.3 / 4096 / (0.001 * 40), 0.05);
}

TEST(Guards, WhatIsNotReadAnyMoreIsNeitherATemperatureNorAReference) {
  NEEDS_IMAGE(image);
  auto pcb = driving();
  EXPECT_FALSE(pcb->door().axis[0].estimate_flags & thermal::housing_missing);
  pcb->chip.adc1.lose_regular();
  EXPECT_LT(opens_after_s(*pcb, 0.2), 0.12);
  hold(*pcb, 4.0f, 4.0f, 0.15);
  for (int i : {0, 1}) EXPECT_TRUE(pcb->door().axis[i].estimate_flags & thermal::housing_missing) << i;
}

TEST(Guards, AnOpenOrShortedThermistorIsNoTemperature) {
  NEEDS_IMAGE(image);
  for (const int counts : {4095, 0}) {
    auto pcb = driving();
    EXPECT_EQ(pcb->door().axis[1].estimate_flags & thermal::housing_missing, 0u);
    pcb->chip.adc1.force(5, counts);
    hold(*pcb, 4.0f, 4.0f, 0.15);
    EXPECT_NE(pcb->door().axis[1].estimate_flags & thermal::housing_missing, 0u) << counts;
    EXPECT_EQ(pcb->door().axis[0].estimate_flags & thermal::housing_missing, 0u) << counts;
  }
}

}  // namespace
}  // namespace image_tests

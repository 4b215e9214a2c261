// SPDX-License-Identifier: MIT
// Deliberate mistakes in the driver. Each changes what the driver writes to one register (or reads from it) on its way
// over the bus, which is what a mistake in its source does, and needs no compiler. The examination below, the same that
// the healthy image passes, has to notice. The table is printed; at least 95 % must be caught.
#include <cstdio>
#include <functional>
#include <vector>

#include "tests/chip/image.hpp"

namespace image_tests {
namespace {

using host_sim::chip::Mutation;
using host_sim::chip::ResetCause;
using host_sim::chip::to_s;

constexpr std::uint32_t rcc = 0x40023800, flash_acr = 0x40023C00, gpioa = 0x40020000, gpiob = 0x40020400,
                        tim1 = 0x40010000, tim8 = 0x40010400, tim3 = 0x40000400, adc1 = 0x40012000, adc2 = 0x40012100,
                        adc3 = 0x40012200, iwdg = 0x40003000, wwdg = 0x40002C00, pwr = 0x40007000, exti = 0x40013C00,
                        syscfg = 0x40013800;

/// Bits cleared and set in whatever is written to one address.
Mutation bits(const char* name, std::uint32_t address, std::uint32_t clear, std::uint32_t set = 0) {
  Mutation m;
  m.name = name;
  m.on_write = [=](std::uint32_t at, std::uint32_t& value) {
    if (at == address) value = (value & ~clear) | set;
    return true;
  };
  return m;
}
/// The same at this offset of all three ADCs.
Mutation adc_bits(const char* name, std::uint32_t offset, std::uint32_t clear, std::uint32_t set = 0) {
  Mutation m;
  m.name = name;
  m.on_write = [=](std::uint32_t at, std::uint32_t& value) {
    if (at == adc1 + offset || at == adc2 + offset || at == adc3 + offset) value = (value & ~clear) | set;
    return true;
  };
  return m;
}
Mutation lost(const char* name, std::uint32_t address, std::uint32_t only_value = 0) {
  Mutation m;
  m.name = name;
  m.on_write = [=](std::uint32_t at, std::uint32_t& value) {
    return at != address || (only_value && value != only_value);
  };
  return m;
}
Mutation exchanged(const char* name, std::uint32_t one, std::uint32_t other) {
  Mutation m;
  m.name = name;
  m.redirect = [=](std::uint32_t at) { return at == one ? other : at == other ? one : at; };
  return m;
}
Mutation custom(const char* name, std::function<void(std::uint32_t, std::uint32_t&)> change) {
  Mutation m;
  m.name = name;
  m.on_write = [=](std::uint32_t at, std::uint32_t& value) {
    change(at, value);
    return true;
  };
  return m;
}

Mutation misread(const char* name, std::uint32_t address, std::function<std::uint32_t(std::uint32_t)> change) {
  Mutation m;
  m.name = name;
  m.on_read = [=](std::uint32_t at, std::uint32_t value) { return at == address ? change(value) : value; };
  return m;
}

std::vector<Mutation> mutations() {
  return {
      bits("clock of TIM1 off", rcc + 0x44, 1u << 0),
      bits("clock of TIM8 off", rcc + 0x44, 1u << 1),
      bits("clock of ADC2 off", rcc + 0x44, 1u << 9),
      bits("clock of SYSCFG off", rcc + 0x44, 1u << 14),
      bits("clock of GPIOB off", rcc + 0x30, 1u << 1),
      bits("clock of the backup memory off", rcc + 0x30, 1u << 18),
      bits("clock of TIM3 off", rcc + 0x40, 1u << 1),
      bits("clock of PWR off", rcc + 0x40, 1u << 28),
      bits("PLLN halved", rcc + 0x04, 0x1FFu << 6, 84u << 6),
      bits("PLLQ = 4", rcc + 0x04, 0xFu << 24, 4u << 24),
      bits("two flash wait states", flash_acr, 7, 2),
      bits("APB1 undivided", rcc + 0x08, 7u << 10),
      bits("clock security off", rcc + 0x00, 1u << 19),
      bits("FPU closed", 0xE000ED88, 0xFFFFFFFF),
      bits("vector table elsewhere", 0xE000ED08, 0, 0x200),
      bits("MOE never set on TIM1", tim1 + 0x44, 1u << 15),
      bits("MOE never set on TIM8", tim8 + 0x44, 1u << 15),
      bits("no dead time on TIM1", tim1 + 0x44, 0xFF),
      bits("dead time halved on TIM8", tim8 + 0x44, 0xFF, 42),
      bits("break input off on TIM8", tim8 + 0x44, 1u << 12),
      bits("break polarity turned on TIM1", tim1 + 0x44, 0, 1u << 13),
      bits("AOE set on TIM1", tim1 + 0x44, 0, 1u << 14),
      bits("LOCK never set on TIM8", tim8 + 0x44, 3u << 8),
      bits("TIM1 edge-aligned", tim1 + 0x00, 3u << 5),
      bits("TIM8 compares on the way down", tim8 + 0x00, 3u << 5, 1u << 5),
      bits("TIM1 updates twice a period", tim1 + 0x30, 0xFF),
      bits("TIM8 not a slave", tim8 + 0x08, 7),
      bits("TIM8 gated instead of triggered", tim8 + 0x08, 7, 5),
      bits("TIM8 listens to ITR1", tim8 + 0x08, 0, 1u << 4),
      bits("TIM1 gives no trigger", tim1 + 0x04, 7u << 4),
      bits("TIM1 triggers at its start: both axes at once", tim1 + 0x04, 7u << 4, 1u << 4),
      bits("TIM1 reload one bit short", tim1 + 0x2C, 8),
      bits("ADC trigger of axis 0 in the middle of the slope", tim1 + 0x40, 0xFFFF, 2100),
      bits("channel 4 of TIM8 off", tim8 + 0x20, 1u << 12),
      bits("CH1N of TIM1 off", tim1 + 0x20, 1u << 2),
      bits("polarity of CH2 turned on TIM8", tim8 + 0x20, 0, 1u << 5),
      bits("PWM mode 2 on phase a of axis 0", tim1 + 0x18, 0, 1u << 4),
      bits("no preload on phase b of axis 1", tim8 + 0x18, 1u << 11),
      exchanged("compare registers of phases a and b exchanged", tim1 + 0x34, tim1 + 0x38),
      exchanged("compare registers of phases b and c exchanged on axis 1", tim8 + 0x38, tim8 + 0x3C),
      exchanged("results of ADC1 and ADC2 exchanged", adc1 + 0x3C, adc2 + 0x3C),
      exchanged("results of bus voltage and bus current exchanged", adc1 + 0x40, adc2 + 0x40),
      custom("phase a of the axes exchanged",
             [](std::uint32_t at, std::uint32_t& v) {
               if (at != adc1 + 0x38) return;
               const std::uint32_t first = v >> 10 & 31;
               v = (v & ~(31u << 10)) | (first == 0 ? 10u : 0u) << 10;
             }),
      custom("bus voltage from a thermistor",
             [](std::uint32_t at, std::uint32_t& v) {
               if (at == adc1 + 0x38) v = (v & ~(31u << 15)) | 4u << 15;
             }),
      custom("axes triggered by each other's timer",
             [](std::uint32_t at, std::uint32_t& v) {
               if ((at & 0xFFFFFCFF) != adc1 + 0x08 || !(v >> 20 & 3)) return;
               v = (v & ~(15u << 16)) | ((v >> 16 & 15) == 0 ? 14u : 0u) << 16;
             }),
      bits("ADC1 triggered by TIM1_TRGO", adc1 + 0x08, 0xFu << 16, 1u << 16),
      adc_bits("falling edge of the trigger", 0x08, 3u << 20, 2u << 20),
      bits("ADC3 never switched on", adc3 + 0x08, 1),
      bits("results of ADC3 left-aligned", adc3 + 0x08, 0, 1u << 11),
      adc_bits("no scan", 0x04, 1u << 8),
      bits("sequence of one instead of two on ADC2", adc2 + 0x38, 3u << 20),
      bits("ADC clock 42 MHz", 0x40012304, 3u << 16),
      bits("reference off", 0x40012304, 1u << 23),
      adc_bits("phase currents sampled for 480 cycles", 0x10, 0, 0x1FF),
      bits("no interrupt at the end of conversion", adc1 + 0x04, 1u << 7),
      adc_bits("analog watchdog off", 0x04,
               1u << 22),  // survives here: the guard trips on the same sample, later (guards_test)
      adc_bits("analog watchdog far too tight", 0x24, 0xFFF, 2060),
      bits("encoder counts one input only", tim3 + 0x08, 7, 1),
      misread("encoder turns backwards", tim3 + 0x24, [](std::uint32_t v) { return (4096 - v) & 4095; }),
      bits("encoder with a quarter of the lines", tim3 + 0x2C, 0xC00),
      bits("encoder pin on a foreign function", gpiob + 0x20, 0xFu << 16, 1u << 16),
      bits("index from another port", syscfg + 0x08, 0xF000),
      bits("index interrupt masked", exti + 0x00, 1u << 8),
      bits("gate driver enable left an input", gpiob + 0x00, 3u << 18),
      bits("high gate of phase a on a foreign function", gpioa + 0x24, 0xF, 2),
      bits("low gate of phase c of axis 1 not connected", gpiob + 0x00, 3u << 2),
      bits("a shunt's pin left digital", gpioa + 0x00, 3u << 0),
      lost("IWDG never started", iwdg, 0xCCCC),
      bits("IWDG far too slow", iwdg + 0x08, 0, 0xFFF),
      lost("IWDG without its key", iwdg, 0x5555),
      bits("WWDG never started", wwdg, 1u << 7),
      bits("WWDG three times too slow", wwdg, 0, 0x3F),
      bits("supply watch off", pwr, 1u << 4),
      bits("supply interrupt masked", exti + 0x00, 1u << 16),
      bits("backup memory locked", pwr, 1u << 8),
      bits("interrupt of the ADC never enabled", 0xE000E100, 1u << 18),
      bits("priority of the ADC in the bits that do not exist", 0xE000E400 + 18, 0xFF, 2),
      bits("SysTick twice as fast", 0xE000E014, 0xFFFFFF, 83999),
  };
}

#define EXAMINE(condition) \
  if (!(condition)) return #condition

Options examined() {
  Options o;
  o.locked = false;
  return o;
}

std::unique_ptr<boards::Pcb> mutant(const Mutation& mutation) {
  auto pcb = std::make_unique<boards::Pcb>(design_of(examined()), 1);
  pcb->flash_image(image);
  firmware::AxisSet setup[2];
  setup_of(examined(), setup);
  pcb->flash_parameters(setup);
  for (int i = 0; i < 2; ++i) pcb->bench.load(i).inertia_kg_m2 = 1e-5;
  pcb->chip.mutate(mutation);
  pcb->power_on();
  return pcb;
}

/// What is wrong with this image, or nothing.
std::string examine(const Mutation& mutation) {
  {
    auto pcb = mutant(mutation);
    EXAMINE(pcb->arm(0.2));
    EXAMINE(pcb->chip.troubles().count() == 0);
    const auto slow = pcb->door().slow_ticks;
    hold(*pcb, 5.0f, -5.0f, 0.05);
    EXAMINE(std::abs(static_cast<int>(pcb->door().slow_ticks - slow) - 5) <= 1);
    EXAMINE(std::abs(mean_iq_A(*pcb, 0, 5.0f, -5.0f) - 5.0) < 0.2);
    EXAMINE(std::abs(mean_iq_A(*pcb, 1, 5.0f, -5.0f) + 5.0) < 0.2);
    EXAMINE(pcb->bench.truth(0).speed_rad_per_s > 100 && pcb->bench.truth(1).speed_rad_per_s < -100);
    EXAMINE(std::abs(pcb->door().axis[0].fast.bus_V - 48.0f) < 1.0f);
    EXAMINE(std::abs(pcb->door().axis[0].housing_degC - 25.0f) < 20.0f);  // still coming down from the cautious start
    EXAMINE(pcb->chip.core().lane(16 + 9).calls > 0 && pcb->chip.core().lane(16 + 23).calls > 0);
    EXAMINE((pcb->chip.tim1.peek(0x44) >> 8 & 3) && (pcb->chip.tim8.peek(0x44) >> 8 & 3));
    EXAMINE(pcb->door().lost_samples[0] + pcb->door().lost_samples[1] <= 1);
    EXAMINE(pcb->chip.resets() == 0);
    EXAMINE(pcb->chip.troubles().count() == 0);
    pcb->set_fault_pin(1, true);
    EXAMINE(!pcb->duty(1).on && pcb->duty(0).on);
    pcb->set_fault_pin(1, false);
    hold(*pcb, 5.0f, -5.0f, 0.01);
    EXAMINE(!pcb->duty(1).on && pcb->duty(0).on);
    pcb->set_fault_pin(0, true);
    EXAMINE(!pcb->duty(0).on);
    pcb->set_fault_pin(0, false);
    hold(*pcb, 5.0f, -5.0f, 0.01);
    EXAMINE(!pcb->duty(0).on);
  }
  {  // lost crystal
    auto pcb = mutant(mutation);
    EXAMINE(pcb->arm(0.2));
    hold(*pcb, 2.0f, 2.0f, 0.01);
    pcb->chip.stop_hse();
    EXAMINE(!pcb->duty(0).on && !pcb->duty(1).on);
  }
  for (const int lane : {0, 16 + 18}) {  // hangs
    auto pcb = mutant(mutation);
    pcb->chip.iwdg.set_lsi_Hz(17e3);
    EXAMINE(pcb->arm(0.2));
    pcb->chip.core().hang(lane);
    pcb->run_for(lane == 0 ? 0.0355 : 0.0021);
    EXAMINE(pcb->chip.resets() >= 1);
  }
  {  // sag of the logic supply
    auto pcb = mutant(mutation);
    EXAMINE(pcb->arm(0.2));
    hold(*pcb, 2.0f, 2.0f, 0.01);
    pcb->chip.set_supply(2.8);
    pcb->run_for(0.0005);
    EXAMINE(!pcb->duty(0).on && !pcb->duty(1).on);
    EXAMINE(pcb->chip.flash.words_programmed() > 0);
  }
  return "";
}

TEST(Mutation, TheHealthyImagePassesTheExamination) {
  NEEDS_IMAGE(image);
  EXPECT_EQ(examine({}), "");
}

TEST(SlowMutation, TheExaminationCatches95PercentOfTheMistakes) {
  NEEDS_IMAGE(image);
  const std::vector<Mutation> all = mutations();
  ASSERT_GE(all.size(), 40u);
  std::size_t caught = 0;
  for (const Mutation& mutation : all) {
    const std::string found = examine(mutation);
    caught += !found.empty();
    std::printf("%-58s %s\n", mutation.name.c_str(), found.empty() ? "SURVIVED" : ("caught: " + found).c_str());
  }
  std::printf("%zu of %zu mistakes caught\n", caught, all.size());
  EXPECT_GE(static_cast<double>(caught), 0.95 * static_cast<double>(all.size()));
}

}  // namespace
}  // namespace image_tests

// SPDX-License-Identifier: MIT
#include "boards/h8-15d/hardware.hpp"

#include <initializer_list>

namespace h8_15d {
namespace {

/// Polls until the bits are up; bounded, about `loops` x 5 instructions.
bool wait_for(std::uint32_t address, std::uint32_t bits, std::uint32_t loops) {
  for (std::uint32_t i = 0; i < loops; ++i) {
    if ((reg(address) & bits) == bits) return true;
  }
  return false;
}

enum Mode : std::uint32_t { input = 0, output = 1, alternate = 2, analog = 3 };  // 8.4.1
enum Pull : std::uint32_t { none = 0, up = 1, down = 2 };                        // 8.4.4

void shape(Pin p, Mode mode, Pull pull = none, std::uint32_t af = 0, std::uint32_t speed = 0) {
  const std::uint32_t port = gpio::base(p.port);
  const auto n = static_cast<std::uint32_t>(p.number);
  const std::uint32_t afr = port + gpio::afrl + (n >= 8 ? 4 : 0), shift = 4 * (n % 8);
  reg(afr) = (reg(afr) & ~(0xFu << shift)) | af << shift;  // before MODER: no glitch of a foreign function
  reg(port + gpio::ospeedr) = (reg(port + gpio::ospeedr) & ~(3u << 2 * n)) | speed << 2 * n;
  reg(port + gpio::pupdr) = (reg(port + gpio::pupdr) & ~(3u << 2 * n)) | pull << 2 * n;
  reg(port + gpio::moder) = (reg(port + gpio::moder) & ~(3u << 2 * n)) | mode << 2 * n;
}

}  // namespace

bool bring_up_clocks() {
  set(rcc::cr, bit(16));                                            // HSEON
  if (!wait_for(rcc::cr, bit(17), 40'000)) return false;            // HSERDY: 12 ms at 16 MHz
  reg(flash::acr) = bit(10) | bit(9) | bit(8) | flash_wait_states;  // DCEN ICEN PRFTEN LATENCY
  if ((reg(flash::acr) & 7) != flash_wait_states) return false;     // 3.5.1: read back before speeding up
  reg(rcc::cfgr) = 4u << 13 | 5u << 10;                             // PPRE2 = /2, PPRE1 = /4
  reg(rcc::pllcfgr) =
      (reg(rcc::pllcfgr) & 0xF0BC8000) | pll_q << 24 | bit(22) | (pll_p / 2 - 1) << 16 | pll_n << 6 | pll_m;
  set(rcc::cr, bit(24));  // PLLON
  if (!wait_for(rcc::cr, bit(25), 40'000)) return false;
  reg(rcc::cfgr) = reg(rcc::cfgr) | 2u;                    // SW = PLL
  if (!wait_for(rcc::cfgr, 2u << 2, 1'000)) return false;  // SWS
  set(rcc::cr, bit(19));                                   // CSSON: a lost crystal breaks the bridges
  return true;
}

void bring_up_pins() {
  set(rcc::ahb1enr, bit(0) | bit(1) | bit(2) | bit(3));  // GPIOA..D
  for (const AxisPins& a : pins) {
    write_pin(a.enable, false);
    shape(a.enable, output);
  }
  for (const AxisPins& a : pins) {
    for (const Pin p : a.high) shape(p, alternate, down, a.bridge_af, 1);
    for (const Pin p : a.low) shape(p, alternate, down, a.bridge_af, 1);
    shape(a.fault, alternate, up, a.fault_af);
    shape(a.encoder_a, alternate, up, a.encoder_af);
    shape(a.encoder_b, alternate, up, a.encoder_af);
    shape(a.index, input, down);
    for (const Pin p : a.hall) shape(p, input, up);
  }
  for (const Pin p : analog_pins) shape(p, analog);
  shape(led, output);
  shape(force_select, output);
}

void bring_up_supply_watch() {
  set(rcc::apb1enr, bit(28));      // PWREN
  set(rcc::apb2enr, bit(14));      // SYSCFGEN
  set(pwr::cr, 7u << 5 | bit(4));  // PLS = 2.9 V, PVDE
  set(exti::rtsr, bit(16));        // PVDO rises when the supply falls, 12.2.5
  reg(exti::pr) = bit(16);
  set(exti::imr, bit(16));
}

void bring_up_backup_ram() {
  set(pwr::cr, bit(8));        // DBP
  set(rcc::ahb1enr, bit(18));  // BKPSRAMEN
  set(pwr::csr, bit(9));       // BRE: the regulator that keeps it on VBAT
}

void bring_up_encoders() {
  set(rcc::apb1enr, bit(1) | bit(2));  // TIM3EN, TIM4EN
  for (const std::uint32_t t : {tim::tim3, tim::tim4}) {
    reg(t + tim::ccmr1) = 3u << 12 | 1u << 8 | 3u << 4 | 1u;  // TI1, TI2 as inputs, filter of 8 clocks (95 ns)
    reg(t + tim::arr) = encoder_counts - 1;
    reg(t + tim::smcr) = 3;  // both edges of both inputs, 18.3.12
    reg(t + tim::cr1) = 1;
  }
  reg(syscfg::exticr1) = (reg(syscfg::exticr1) & ~0xF000u) | 1u << 12;  // EXTI3 = PB3
  reg(syscfg::exticr3) = (reg(syscfg::exticr3) & ~0xFu) | 1u;           // EXTI8 = PB8
  set(exti::rtsr, bit(3) | bit(8));
  reg(exti::pr) = bit(3) | bit(8);
  set(exti::imr, bit(3) | bit(8));
}

void bring_up_usb_pins() {
  set(rcc::ahb2enr, bit(7));  // OTGFSEN
  shape(usb_dm, alternate, none, 10, 2);
  shape(usb_dp, alternate, none, 10, 2);
}

void bring_up_cycle_counter() {
  set(system::demcr, bit(24));  // TRCENA
  reg(system::dwt_cyccnt) = 0;
  reg(system::dwt_ctrl) = 1;
}

void bring_up_interrupts(std::uint32_t core_Hz) {
  reg(system::aircr) = 0x05FA0300;  // PRIGROUP 3: all four bits preempt
  for (const Priority p : {pvd_irq, index0_irq, index1_irq, adc_irq, usb_irq}) {
    byte_reg(system::nvic_ipr + static_cast<std::uint32_t>(p.irq)) = static_cast<std::uint8_t>(p.level << 4);
    let_in(p);
  }
  byte_reg(system::shpr3_systick) = systick_level << 4;
  reg(system::systick_rvr) = core_Hz / 1000 - 1;
  reg(system::systick_cvr) = 0;
  reg(system::systick_csr) = 7;  // core clock, interrupt, on
}

void wait_for_supply() {
  while (reg(pwr::csr) & bit(2)) {  // PVDO
  }
  reg(exti::pr) = bit(16);
}

void start_watchdogs(bool fast_lane) {
  reg(iwdg::kr) = 0x5555;
  reg(iwdg::pr) = 0;  // LSI / 4
  reg(iwdg::rlr) = iwdg_reload;
  reg(iwdg::kr) = 0xCCCC;
  reg(iwdg::kr) = 0xAAAA;
  if (!fast_lane) return;
  set(rcc::apb1enr, bit(11));  // WWDGEN
  reg(wwdg::cfr) = 0x7F;       // no window, / 4096
  feed_wwdg();
}

void all_gates_off() {
  for (const AxisPins& a : pins) write_pin(a.enable, false);
  clear(tim::tim1 + tim::bdtr, bit(15));  // MOE
  clear(tim::tim8 + tim::bdtr, bit(15));
}

namespace {
void unlock_flash() {
  if (!(reg(flash::cr) & bit(31))) return;
  reg(flash::keyr) = 0x45670123;  // 3.6.1
  reg(flash::keyr) = 0xCDEF89AB;
}

/// The data cache may still hold what stood there before (3.5.2); it can be reset only while it is off (3.9.1).
void lock_flash() {
  reg(flash::cr) = bit(31);  // LOCK
  const std::uint32_t acr = reg(flash::acr);
  reg(flash::acr) = acr & ~bit(10);              // DCEN
  reg(flash::acr) = (acr & ~bit(10)) | bit(12);  // DCRST
  reg(flash::acr) = acr;
  asm volatile("" ::: "memory");
}
}  // namespace

bool program_flash(std::uint32_t address, std::uint32_t word) {
  unlock_flash();
  reg(flash::cr) = 2u << 8 | 1u;  // PSIZE = x32, PG
  reg(address) = word;
  while (reg(flash::sr) & bit(16)) {  // BSY
  }
  lock_flash();
  return reg(address) == word;
}

bool erase_sector(std::uint32_t sector) {
  unlock_flash();
  reg(flash::cr) = 2u << 8 | sector << 3 | bit(1);  // SER, SNB
  set(flash::cr, bit(16));                          // STRT
  while (reg(flash::sr) & bit(16)) {
  }
  lock_flash();
  return reg(sector_address(sector)) == 0xFFFFFFFFu;
}

}  // namespace h8_15d

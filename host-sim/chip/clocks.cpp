// SPDX-License-Identifier: MIT
#include "host-sim/chip/clocks.hpp"

#include <cmath>
#include <string>

namespace host_sim::chip {
namespace {

constexpr double hsi_Hz = 16e6, hse_Hz = 8e6;  // HSI: RM0090 7.2.2; HSE: the crystal of the board, BENCH design value

// RM0090 7.3, register by register. Bits of peripherals that the F405 has not are reserved here.
constexpr Register map[] = {
    {Rcc::cr, "RCC_CR", 0x00000083, 0x0F0FFFFB, 0x050D00F9},
    {Rcc::pllcfgr, "RCC_PLLCFGR", 0x24003010, 0x0F437FFF, 0x0F437FFF},
    {Rcc::cfgr, "RCC_CFGR", 0, 0xFFFFFCFF, 0xFFFFFCF3},
    {Rcc::cir, "RCC_CIR", 0, 0x00BF3FBF, 0x00003F00},
    {Rcc::ahb1enr, "RCC_AHB1ENR", 0x00100000, 0x607411FF, 0x607411FF},
    {Rcc::ahb2enr, "RCC_AHB2ENR", 0, 0x000000C0, 0x000000C0},
    {Rcc::apb1enr, "RCC_APB1ENR", 0, 0x36FEC9FF, 0x36FEC9FF},
    {Rcc::apb2enr, "RCC_APB2ENR", 0, 0x00075F33, 0x00075F33},
    {Rcc::bdcr, "RCC_BDCR", 0, 0x00018307, 0x00018305},
    {Rcc::csr, "RCC_CSR", 0x0E000000, 0xFF000003, 0x00000001},
};

double divide(std::uint32_t code, int bits) {  // HPRE (4 bits) and PPRE (3 bits), RM0090 7.3.3
  if (bits == 3) return code < 4 ? 1 : 2 << (code - 4);
  static constexpr double ahb[] = {2, 4, 8, 16, 64, 128, 256, 512};
  return code < 8 ? 1 : ahb[code - 8];
}

}  // namespace

Rcc::Rcc(Host& host, Links links) : Device(host, "RCC", address, map, 0, -1) {
  update();
  links_ = std::move(links);
}

void Rcc::reset() {
  const std::uint32_t flags = peek(csr) & 0xFE000000, backup = peek(bdcr);
  Device::reset();
  at(csr) = flags;
  at(bdcr) = backup;
  hse_ready_ = pll_ready_ = lsi_ready_ = never;
  dead_ = false;
  update();
}

void Rcc::note_cause(ResetCause cause) {  // RM0090 7.3.21: every reset also pulls the pin
  std::uint32_t flags = 1u << 26;
  if (cause == ResetCause::power_on) flags |= 1u << 27 | 1u << 25;
  if (cause == ResetCause::software) flags |= 1u << 28;
  if (cause == ResetCause::iwdg) flags |= 1u << 29;
  if (cause == ResetCause::wwdg) flags |= 1u << 30;
  if (cause == ResetCause::power_on) {
    at(csr) = flags;
    at(bdcr) = 0;
  } else {
    at(csr) |= flags;
  }
}

Time Rcc::next_event() const { return std::min(hse_ready_, std::min(pll_ready_, lsi_ready_)); }

void Rcc::advance(Time now) {
  if (hse_ready_ <= now) {
    hse_ready_ = never;
    at(cr) |= 1u << 17;
  }
  if (pll_ready_ <= now) {
    pll_ready_ = never;
    at(cr) |= 1u << 25;
    update();
  }
  if (lsi_ready_ <= now) {
    lsi_ready_ = never;
    at(csr) |= 2;
  }
}

double Rcc::pll_Hz(std::uint32_t config, bool usb) const {
  const double m = field(config, 0, 6), n = field(config, 6, 9), p = 2 * (field(config, 16, 2) + 1),
               q = field(config, 24, 4);
  const double source = (config >> 22 & 1) ? hse_Hz : hsi_Hz;
  if (m < 2 || q < 2) return 0;
  return source / m * n / (usb ? q : p);
}

void Rcc::update() {
  const std::uint32_t c = peek(cfgr);
  const unsigned source = field(c, 0, 2);
  const double sys = source == 0 ? hsi_Hz : source == 1 ? hse_Hz : pll_Hz(peek(pllcfgr), false);
  tree_.hclk_Hz = sys / divide(field(c, 4, 4), 4);
  const double d1 = divide(field(c, 10, 3), 3), d2 = divide(field(c, 13, 3), 3);
  tree_.pclk1_Hz = tree_.hclk_Hz / d1;
  tree_.pclk2_Hz = tree_.hclk_Hz / d2;
  tree_.timer1_Hz = d1 > 1 ? 2 * tree_.pclk1_Hz : tree_.pclk1_Hz;  // RM0090 7.2: timer clocks double behind a prescaler
  tree_.timer2_Hz = d2 > 1 ? 2 * tree_.pclk2_Hz : tree_.pclk2_Hz;
  tree_.usb_Hz = (peek(cr) >> 25 & 1) ? pll_Hz(peek(pllcfgr), true) : 0;
  if (links_.clocks_changed) links_.clocks_changed();
}

void Rcc::check_limits() {
  const unsigned needed = tree_.hclk_Hz <= 30e6
                              ? 0
                              : static_cast<unsigned>(std::ceil(tree_.hclk_Hz / 30e6) - 1);  // 2.7..3.6 V, RM0090 3.5.1
  if (tree_.hclk_Hz > 168e6) trouble("HCLK above 168 MHz", cfgr);
  if (tree_.pclk1_Hz > 42e6) trouble("APB1 above 42 MHz", cfgr);
  if (tree_.pclk2_Hz > 84e6) trouble("APB2 above 84 MHz", cfgr);
  if (links_.flash_wait_states && links_.flash_wait_states() < needed)
    trouble("too few flash wait states for this HCLK", cfgr);
  if (tree_.hclk_Hz > 144e6 && links_.voltage_scale_1 && !links_.voltage_scale_1())
    trouble("HCLK above 144 MHz needs VOS = 1", cfgr);
}

void Rcc::stop_hse() {
  hse_works_ = false;
  const bool ready = peek(cr) >> 17 & 1;
  if (!ready) return;
  const bool watched = peek(cr) >> 19 & 1;
  const unsigned source = field(peek(cfgr), 0, 2);
  const bool through_pll = source == 2 && (peek(pllcfgr) >> 22 & 1);
  at(cr) &= ~(1u << 17);
  if (!watched) {
    dead_ = source == 1 || through_pll;  // the core just stops; nothing but the IWDG runs on
    return;
  }
  at(cr) &= ~(1u << 16 | 1u << 19 | (through_pll ? 3u << 24 : 0));
  at(cfgr) &= ~0xFu;  // RM0090 7.2.7: system clock falls back to HSI
  at(cir) |= 1u << 7;
  update();
  if (links_.clock_failed) links_.clock_failed();
  if (links_.nmi) links_.nmi(true);
}

std::uint32_t Rcc::on_read(std::uint32_t offset) {
  if (offset == cfgr) return (peek(cfgr) & ~0xCu) | field(peek(cfgr), 0, 2) << 2;
  return peek(offset);
}

void Rcc::on_write(std::uint32_t offset, std::uint32_t value) {
  const std::uint32_t old = peek(offset);
  switch (offset) {
    case cr: {
      keep(offset, value);
      const std::uint32_t rises = peek(cr) & ~old, falls = old & ~peek(cr);
      if (rises >> 16 & 1 && hse_works_)
        hse_ready_ = host_.now() + from_s(1e-3);  // crystal start-up, datasheet typ. 2 ms
      if (rises >> 24 & 1) {
        const std::uint32_t p = peek(pllcfgr);
        const double in = ((p >> 22 & 1) ? hse_Hz : hsi_Hz) / std::max(1u, field(p, 0, 6)), vco = in * field(p, 6, 9);
        if (in < 1e6 || in > 2e6) trouble("PLL input outside 1..2 MHz (PLLM)", pllcfgr);
        if (vco < 100e6 || vco > 432e6) trouble("PLL VCO outside 100..432 MHz (PLLN)", pllcfgr);
        if ((p >> 22 & 1) && !(old >> 17 & 1)) trouble("PLL started on HSE before HSERDY", offset);
        pll_ready_ = host_.now() + from_s(200e-6);
      }
      if (rises >> 19 & 1 && !(old >> 17 & 1)) trouble("CSS switched on before HSERDY", offset);
      if (falls >> 16 & 1) at(cr) &= ~(1u << 17);
      if (falls >> 24 & 1) at(cr) &= ~(1u << 25);
      if (falls & (1u << 24) && field(peek(cfgr), 0, 2) == 2)
        trouble("PLL switched off while it is the system clock", offset);
      if (falls >> 24 & 1) update();
      host_.reschedule();
      break;
    }
    case pllcfgr:
      if (peek(cr) >> 24 & 1) trouble("PLLCFGR written while the PLL is on", offset);
      keep(offset, value);
      break;
    case cfgr: {
      const unsigned to = field(value, 0, 2);
      if (to == 1 && !(peek(cr) >> 17 & 1)) trouble("switched to HSE before HSERDY", offset);
      if (to == 2 && !(peek(cr) >> 25 & 1)) trouble("switched to the PLL before PLLRDY", offset);
      if (to == 3) trouble("SW = 3 is not allowed", offset);
      keep(offset, value);
      update();
      check_limits();
      break;
    }
    case cir:
      keep(offset, value);
      if (value >> 23 & 1) {
        at(cir) &= ~(1u << 7);
        if (links_.nmi) links_.nmi(false);
      }
      break;
    case bdcr:
      if (links_.backup_writable && !links_.backup_writable()) {
        trouble("backup domain written while PWR_CR.DBP is 0", offset);
        return;
      }
      keep(offset, value);
      break;
    case csr:
      if (value >> 24 & 1) at(csr) &= 0x00FFFFFF;
      keep(offset, value);
      if (value & 1 && !(old & 1)) lsi_ready_ = host_.now() + from_s(40e-6);
      host_.reschedule();
      break;
    default:
      keep(offset, value);
  }
}

}  // namespace host_sim::chip

// SPDX-License-Identifier: MIT
#include "host-sim/chip/pins.hpp"

namespace host_sim::chip {
namespace {

// RM0090 8.4: after reset everything is a floating input but the debug pins PA13..15, PB3, PB4.
std::vector<Register> gpio_map(char port) {
  const bool a = port == 'A', b = port == 'B';
  return {{Gpio::moder, "MODER",
           a   ? 0xA8000000
           : b ? 0x00000280u
               : 0,
           0xFFFFFFFF, 0xFFFFFFFF},
          {Gpio::otyper, "OTYPER", 0, 0x0000FFFF, 0x0000FFFF},
          {Gpio::ospeedr, "OSPEEDR",
           a   ? 0x0C000000u
           : b ? 0x000000C0u
               : 0,
           0xFFFFFFFF, 0xFFFFFFFF},
          {Gpio::pupdr, "PUPDR",
           a   ? 0x64000000u
           : b ? 0x00000100u
               : 0,
           0xFFFFFFFF, 0xFFFFFFFF},
          {Gpio::idr, "IDR", 0, 0x0000FFFF, 0},
          {Gpio::odr, "ODR", 0, 0x0000FFFF, 0x0000FFFF},
          {Gpio::bsrr, "BSRR", 0, 0xFFFFFFFF, 0},
          {Gpio::lckr, "LCKR", 0, 0x0001FFFF, 0x0001FFFF},
          {Gpio::afrl, "AFRL", 0, 0xFFFFFFFF, 0xFFFFFFFF},
          {Gpio::afrh, "AFRH", 0, 0xFFFFFFFF, 0xFFFFFFFF}};
}

constexpr Register syscfg_map[] = {
    // RM0090 9.2
    {0x00, "SYSCFG_MEMRMP", 0, 0x3, 0x3},        {0x08, "SYSCFG_EXTICR1", 0, 0xFFFF, 0xFFFF},
    {0x0C, "SYSCFG_EXTICR2", 0, 0xFFFF, 0xFFFF}, {0x10, "SYSCFG_EXTICR3", 0, 0xFFFF, 0xFFFF},
    {0x14, "SYSCFG_EXTICR4", 0, 0xFFFF, 0xFFFF},
};

constexpr std::uint32_t exti_lines = 0x007FFFFF;  // 23 lines, RM0090 12.3
constexpr Register exti_map[] = {
    {Exti::imr, "EXTI_IMR", 0, exti_lines, exti_lines},   {Exti::emr, "EXTI_EMR", 0, exti_lines, exti_lines},
    {Exti::rtsr, "EXTI_RTSR", 0, exti_lines, exti_lines}, {Exti::ftsr, "EXTI_FTSR", 0, exti_lines, exti_lines},
    {Exti::swier, "EXTI_SWIER", 0, exti_lines, 0},        {Exti::pr, "EXTI_PR", 0, exti_lines, 0},
};

}  // namespace

Gpio::Gpio(Host& host, char port, std::function<void(char, int, bool)> edge)
    : Device(host, std::string("GPIO") + port, 0x40020000u + 0x400u * static_cast<std::uint32_t>(port - 'A'),
             gpio_map(port), 0x30, port - 'A'),
      port_(port),
      edge_(std::move(edge)) {}

void Gpio::set_level(int pin, bool high) {
  const bool old = levels_ >> pin & 1;
  if (old == high) return;
  levels_ ^= 1u << pin;
  if (edge_) edge_(port_, pin, high);
}

std::uint32_t Gpio::on_read(std::uint32_t offset) {
  if (offset != idr) return peek(offset);
  std::uint32_t v = 0;
  for (int p = 0; p < 16; ++p) {
    const bool high = mode(p) == PinMode::output   ? peek(odr) >> p & 1
                      : mode(p) == PinMode::analog ? false
                                                   : levels_ >> p & 1;
    v |= static_cast<std::uint32_t>(high) << p;
  }
  return v;
}

void Gpio::on_write(std::uint32_t offset, std::uint32_t value) {
  if (offset == bsrr) {
    at(odr) = (peek(odr) & ~(value >> 16)) | (value & 0xFFFF);  // set wins, RM0090 8.4.7
    return;
  }
  if (offset == idr) return trouble("IDR is read-only", offset);
  if (offset == moder && port_ == 'A' && field(value, 26, 4) != 0xA)
    trouble("the SWD pins PA13/PA14 are given away", offset);
  keep(offset, value);
}

Syscfg::Syscfg(Host& host) : Device(host, "SYSCFG", address, syscfg_map, 0x44, 14) {}

char Syscfg::port_of_line(int line) const {
  return static_cast<char>('A' + field(peek(0x08 + 4 * static_cast<std::uint32_t>(line / 4)), 4 * (line % 4), 4));
}

Exti::Exti(Host& host) : Device(host, "EXTI", address, exti_map, 0, -1) {}

void Exti::reset() {
  Device::reset();
  lines();
}

void Exti::edge(int line, bool rising) {
  if (!(peek(rising ? rtsr : ftsr) >> line & 1)) return;
  at(pr) |= 1u << line;
  lines();
}

void Exti::on_write(std::uint32_t offset, std::uint32_t value) {
  keep(offset, value);
  if (offset == pr) at(pr) &= ~value;
  if (offset == swier) at(pr) |= value;
  lines();
}

void Exti::lines() {  // RM0090 12.2, Table 61
  const std::uint32_t on = peek(pr) & peek(imr);
  for (int i = 0; i < 5; ++i) host_.set_line(6 + i, on >> i & 1);
  host_.set_line(23, field(on, 5, 5));
  host_.set_line(40, field(on, 10, 6));
  host_.set_line(1, on >> 16 & 1);
}

}  // namespace host_sim::chip

// SPDX-License-Identifier: MIT
#include "host-sim/chip/adc.hpp"

#include <algorithm>
#include <cmath>

namespace host_sim::chip {
namespace {

constexpr Register common_map[] = {{AdcCommon::csr, "ADC_CSR", 0, 0x003F3F3F, 0},
                                   {AdcCommon::ccr, "ADC_CCR", 0, 0x00C3EF1F, 0x00C3EF1F}};

using A = Adc;
constexpr Register map[] = {
    // RM0090 13.13
    {A::sr, "SR", 0, 0x3F, 0},
    {A::cr1, "CR1", 0, 0x07C0FFFF, 0x07C0FFFF},
    {A::cr2, "CR2", 0, 0x7F7F0F03, 0x3F3F0F03},
    {A::smpr1, "SMPR1", 0, 0x07FFFFFF, 0x07FFFFFF},
    {A::smpr2, "SMPR2", 0, 0x3FFFFFFF, 0x3FFFFFFF},
    {A::jofr1, "JOFR1", 0, 0xFFF, 0xFFF},
    {0x18, "JOFR2", 0, 0xFFF, 0xFFF},
    {0x1C, "JOFR3", 0, 0xFFF, 0xFFF},
    {0x20, "JOFR4", 0, 0xFFF, 0xFFF},
    {A::htr, "HTR", 0xFFF, 0xFFF, 0xFFF},
    {A::ltr, "LTR", 0, 0xFFF, 0xFFF},
    {A::sqr1, "SQR1", 0, 0x00FFFFFF, 0x00FFFFFF},
    {0x30, "SQR2", 0, 0x3FFFFFFF, 0x3FFFFFFF},
    {A::sqr3, "SQR3", 0, 0x3FFFFFFF, 0x3FFFFFFF},
    {A::jsqr, "JSQR", 0, 0x003FFFFF, 0x003FFFFF},
    {A::jdr1, "JDR1", 0, 0xFFFF, 0},
    {0x40, "JDR2", 0, 0xFFFF, 0},
    {0x44, "JDR3", 0, 0xFFFF, 0},
    {0x48, "JDR4", 0, 0xFFFF, 0},
    {A::dr, "DR", 0, 0xFFFF, 0},
};

constexpr int vrefint_channel = 17, hidden_from = 16;

}  // namespace

AdcCommon::AdcCommon(Host& host) : Device(host, "ADC common", address, common_map, 0x44, 8) {}

void AdcCommon::on_write(std::uint32_t offset, std::uint32_t value) {
  if (offset == ccr && (value & 0x1F)) trouble("multi-ADC modes are not modelled", offset);
  keep(offset, value);
}

Adc::Adc(Host& host, int number, Links links)
    : Device(host, "ADC" + std::to_string(number), 0x40012000u + 0x100u * static_cast<std::uint32_t>(number - 1), map,
             0x44, 7 + number),
      number_(number),
      links_(std::move(links)) {
  forced_.fill(-1);
}

void Adc::reset() {
  Device::reset();
  fresh_ = {};
  injected_start_ = injected_end_ = regular_end_ = patience_ = never;
}

bool Adc::irq() const {
  const std::uint32_t s = peek(sr), e = peek(cr1);
  return (s & 1 && e >> 6 & 1) || (s >> 1 & 1 && e >> 5 & 1) || (s >> 2 & 1 && e >> 7 & 1) ||
         (s >> 5 & 1 && e >> 26 & 1);
}

int Adc::injected_channel(int rank) const {  // 13.3.7, 13.13.12: JL < 3 begins at JSQ(4 - JL)
  const int first = 4 - injected_count();
  return static_cast<int>(field(peek(jsqr), 5 * (first + rank), 5));
}

double Adc::sample_cycles(int channel) const {
  static constexpr double cycles[] = {3, 15, 28, 56, 84, 112, 144, 480};
  return cycles[channel < 10 ? field(peek(smpr2), 3 * channel, 3) : field(peek(smpr1), 3 * (channel - 10), 3)];
}

Time Adc::clock() const {
  return static_cast<Time>(
      std::lround(static_cast<double>(ticks_per_s) * links_.common->prescaler() / links_.pclk2_Hz()));
}

Time Adc::next_event() const { return std::min({injected_end_, regular_end_, patience_}); }

void Adc::advance(Time now) {
  if (injected_end_ <= now) finish_injected();
  if (regular_end_ <= now) finish_regular();
  if (patience_ <= now) {
    patience_ = never;
    if (injected_armed())
      trouble("injected trigger armed, but its timer does not run or its channel 4 gives no event", cr2);
  }
}

void Adc::trigger(unsigned source, Time when) {
  if (!clocked() || !injected_armed() || field(peek(cr2), 16, 4) != source) return;
  if (field(peek(cr2), 20, 2) == 2) return;  // falling edge only: the compare pulse rises here
  patience_ = host_.now() + from_s(1e-3);
  if (injected_end_ != never) return trouble("trigger during an injected conversion", cr2);
  start_injected(when);
}

void Adc::start_injected(Time when) {
  const double hz = links_.pclk2_Hz() / links_.common->prescaler();
  if (hz > 36e6) trouble("ADC clock above 36 MHz (ADCPRE)", sr);
  if (injected_count() > 1 && !(peek(cr1) >> 8 & 1)) trouble("injected sequence without SCAN", cr1);
  double cycles = 0;
  for (int i = 0; i < injected_count(); ++i) cycles += sample_cycles(injected_channel(i)) + 12;
  injected_start_ = when;
  injected_end_ = injected_start_ + static_cast<Time>(cycles * static_cast<double>(clock()));
  at(sr) |= 1u << 3;
  if (regular_end_ != never) {  // 13.3.10: the regular conversion starts again afterwards
    const int channel = static_cast<int>(field(peek(sqr3), 0, 5));
    regular_end_ = injected_end_ + static_cast<Time>((sample_cycles(channel) + 12) * static_cast<double>(clock()));
  }
  host_.reschedule();
}

std::uint32_t Adc::convert(int channel, Time closed) {
  if (channel > 18) {
    trouble("channel does not exist", jsqr);
    return 0;
  }
  if (channel >= hidden_from) {
    if (number_ != 1) trouble("internal channels exist on ADC1 only", sqr3);
    if (!links_.common->reference_on()) trouble("VREFINT converted with TSVREFE = 0", sqr3);
    if (channel == vrefint_channel &&
        to_s(static_cast<Time>(sample_cycles(channel) * static_cast<double>(clock()))) < 10e-6) {
      trouble("VREFINT needs at least 10 us of sampling", smpr1);
    }
  }
  if (number_ == 3 && ((channel >= 4 && channel <= 9) || (channel >= 14 && channel < 18))) {
    trouble("this channel is not bonded to ADC3 on the 64-pin package", jsqr);
    return 0;
  }
  const int forced = forced_[static_cast<std::size_t>(channel)];
  return forced >= 0 ? static_cast<std::uint32_t>(forced) : links_.analog(number_, channel, closed);
}

void Adc::watch(int channel, bool injected, std::uint32_t counts) {
  const std::uint32_t c = peek(cr1);
  if (!(c >> (injected ? 22 : 23) & 1)) return;
  if ((c >> 9 & 1) && static_cast<int>(field(c, 0, 5)) != channel) return;
  if (counts > peek(htr) || counts < peek(ltr)) at(sr) |= 1;
}

void Adc::finish_injected() {
  Time at_time = injected_start_;
  injected_end_ = never;
  for (int i = 0; i < injected_count(); ++i) {
    const int channel = injected_channel(i);
    const Time closed = at_time + static_cast<Time>(sample_cycles(channel) * static_cast<double>(clock()));
    at_time = closed + 12 * clock();
    const std::uint32_t counts = convert(channel, closed);
    watch(channel, true, counts);
    const auto n = static_cast<std::uint32_t>(i);
    const auto value = static_cast<std::int32_t>(counts) - static_cast<std::int32_t>(peek(jofr1 + 4 * n));
    std::uint32_t out = static_cast<std::uint32_t>(value) & 0xFFFF;
    if (peek(cr2) >> 11 & 1) out = (out << 3) & 0xFFFF;  // ALIGN: left, injected data keep a sign (13.4)
    at(jdr1 + 4 * n) = out;
    fresh_[n] = true;
  }
  ++done_;
  at(sr) |= 1u << 2;
  links_.line();
}

void Adc::finish_regular() {
  const int channel = static_cast<int>(field(peek(sqr3), 0, 5));
  const std::uint32_t counts = convert(channel, regular_end_ - 12 * clock());
  regular_end_ = never;
  if (regular_lost_) return;
  watch(channel, false, counts);
  at(dr) = (peek(cr2) >> 11 & 1) ? counts << 4 : counts;
  at(sr) |= 1u << 1;
  links_.line();
}

std::uint32_t Adc::on_read(std::uint32_t offset) {
  if (offset >= jdr1 && offset < dr) {
    bool& fresh = fresh_[(offset - jdr1) / 4];
    if (!fresh) trouble("injected result read that no new conversion has written", offset);
    fresh = false;
  }
  if (offset == dr) {
    if (!(peek(sr) >> 1 & 1)) trouble("regular result read before EOC", offset);
    at(sr) &= ~2u;
    links_.line();
  }
  return peek(offset);
}

void Adc::on_write(std::uint32_t offset, std::uint32_t value) {
  switch (offset) {
    case sr:
      at(sr) &= value | ~0x3Fu;
      break;
    case cr2: {
      if (value & 0x302) trouble("CONT and DMA are not modelled", offset);
      keep(offset, value);
      patience_ = injected_armed() ? host_.now() + from_s(1e-3) : never;
      if (value >> 30 & 1) {
        if (!(value & 1))
          trouble("SWSTART with ADON = 0", offset);
        else if (regular_end_ != never)
          trouble("SWSTART while a regular conversion runs", offset);
        else {
          if (field(peek(sqr1), 20, 4)) trouble("regular sequences longer than one are not modelled", sqr1);
          const int channel = static_cast<int>(field(peek(sqr3), 0, 5));
          const Time from = injected_end_ != never ? injected_end_ : host_.now();
          regular_end_ = from + static_cast<Time>((sample_cycles(channel) + 12) * static_cast<double>(clock()));
          at(sr) |= 1u << 4;
        }
      }
      if (value >> 22 & 1) {
        if (!(value & 1))
          trouble("JSWSTART with ADON = 0", offset);
        else
          start_injected(host_.now());
      }
      host_.reschedule();
      break;
    }
    case jsqr:
      if (injected_end_ != never) trouble("JSQR changed during an injected conversion", offset);
      keep(offset, value);
      break;
    case sqr3:
      if (regular_end_ != never && value != peek(offset)) trouble("SQR3 changed during a regular conversion", offset);
      keep(offset, value);
      break;
    case cr1:
      if (value & 0x1C00) trouble("JAUTO and discontinuous modes are not modelled", offset);
      keep(offset, value);
      break;
    default:
      keep(offset, value);
  }
  links_.line();
}

}  // namespace host_sim::chip

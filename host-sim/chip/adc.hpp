// SPDX-License-Identifier: MIT
// ADC1..3 of the STM32F405 (RM0090 chapter 13) in independent mode: injected groups on timer triggers, single regular
// conversions started by software, analog watchdog, sampling times and the clock they are counted in. An injected
// trigger throws a regular conversion back to its start, as the manual says. DMA, multi-mode and discontinuous mode are
// refused.
#pragma once

#include <array>
#include <functional>

#include "host-sim/chip/device.hpp"

namespace host_sim::chip {

inline constexpr int adc_irq = 18;  // RM0090 Table 61, shared by all three

class AdcCommon : public Device {
 public:
  static constexpr std::uint32_t address = 0x40012300;
  enum : std::uint32_t { csr = 0x00, ccr = 0x04 };
  explicit AdcCommon(Host& host);
  double prescaler() const { return 2.0 * (field(peek(ccr), 16, 2) + 1); }
  bool reference_on() const { return peek(ccr) >> 23 & 1; }

 protected:
  void on_write(std::uint32_t offset, std::uint32_t value) override;
};

class Adc : public Device {
 public:
  enum : std::uint32_t {
    sr = 0x00,
    cr1 = 0x04,
    cr2 = 0x08,
    smpr1 = 0x0C,
    smpr2 = 0x10,
    jofr1 = 0x14,
    htr = 0x24,
    ltr = 0x28,
    sqr1 = 0x2C,
    sqr3 = 0x34,
    jsqr = 0x38,
    jdr1 = 0x3C,
    dr = 0x4C
  };

  struct Links {
    std::function<double()> pclk2_Hz;
    /// Counts (0..4095) of a channel whose sample-and-hold closed at that time.
    std::function<std::uint32_t(int adc, int channel, Time closed)> analog;
    std::function<void()> line;
    const AdcCommon* common;
  };

  Adc(Host& host, int number, Links links);
  void reset() override;
  Time next_event() const override;
  void advance(Time now) override;
  void trigger(unsigned source, Time when);  // JEXTSEL code of what just rose
  bool irq() const;
  bool injected_armed() const { return (peek(cr2) & 1) && field(peek(cr2), 20, 2) != 0; }

  /// Overrides what a conversion yields (stuck or wild sensor); negative: the pin decides.
  void force(int channel, int counts) { forced_[static_cast<std::size_t>(channel)] = counts; }
  /// From now on no regular conversion ends.
  void lose_regular() { regular_lost_ = true; }
  std::uint64_t injected_done() const { return done_; }
  double sampling_s(int channel) const { return sample_cycles(channel) * to_s(clock()); }

 protected:
  std::uint32_t on_read(std::uint32_t offset) override;
  void on_write(std::uint32_t offset, std::uint32_t value) override;

 private:
  int injected_channel(int rank) const;  // rank 0..JL
  int injected_count() const { return static_cast<int>(field(peek(jsqr), 20, 2)) + 1; }
  double sample_cycles(int channel) const;
  Time clock() const;
  void start_injected(Time when);
  void finish_injected();
  void finish_regular();
  void watch(int channel, bool injected, std::uint32_t counts);
  std::uint32_t convert(int channel, Time closed);

  int number_;
  Links links_;
  std::array<int, 19> forced_;
  std::array<bool, 4> fresh_{};
  Time injected_start_ = never, injected_end_ = never, regular_end_ = never, patience_ = never;
  std::uint64_t done_ = 0;
  bool regular_lost_ = false;
};

}  // namespace host_sim::chip

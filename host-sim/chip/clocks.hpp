// SPDX-License-Identifier: MIT
// RCC of the STM32F405 (RM0090 chapter 7): oscillators that need time, the PLL and its limits, bus prescalers, enable
// bits, the clock security system, and the reset flags. Asks the flash whether its wait states suffice. Knows no
// peripheral.
#pragma once

#include <functional>

#include "host-sim/chip/device.hpp"

namespace host_sim::chip {

struct ClockTree {
  double hclk_Hz, pclk1_Hz, pclk2_Hz, timer1_Hz, timer2_Hz, usb_Hz;
};

enum class ResetCause { power_on, pin, software, iwdg, wwdg };

class Rcc : public Device {
 public:
  static constexpr std::uint32_t address = 0x40023800;
  enum : std::uint32_t {
    cr = 0x00,
    pllcfgr = 0x04,
    cfgr = 0x08,
    cir = 0x0C,
    ahb1enr = 0x30,
    ahb2enr = 0x34,
    apb1enr = 0x40,
    apb2enr = 0x44,
    bdcr = 0x70,
    csr = 0x74
  };

  struct Links {
    std::function<void()> clocks_changed;  // new tree: everybody who counts cycles asks again
    std::function<void()> clock_failed;    // CSS: break to TIM1 and TIM8, RM0090 7.2.7
    std::function<void(bool)> nmi;
    std::function<unsigned()> flash_wait_states;
    std::function<bool()> backup_writable;  // PWR_CR.DBP
    std::function<bool()> voltage_scale_1;  // PWR_CR.VOS
  };

  Rcc(Host& host, Links links);
  void reset() override;
  void note_cause(ResetCause cause);
  Time next_event() const override;
  void advance(Time now) override;

  bool enabled(std::uint32_t enr, int bit) const { return peek(enr) >> bit & 1; }
  const ClockTree& tree() const { return tree_; }
  bool dead() const { return dead_; }
  void stop_hse();  // the crystal breaks
  void check_limits();

 protected:
  std::uint32_t on_read(std::uint32_t offset) override;
  void on_write(std::uint32_t offset, std::uint32_t value) override;

 private:
  double pll_Hz(std::uint32_t config, bool usb) const;
  void update();

  Links links_;
  ClockTree tree_{};
  Time hse_ready_ = never, pll_ready_ = never, lsi_ready_ = never;
  bool hse_works_ = true, dead_ = false;
};

}  // namespace host_sim::chip

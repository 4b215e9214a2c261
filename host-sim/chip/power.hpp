// SPDX-License-Identifier: MIT
// PWR with PVD and the backup regulator (RM0090 chapter 5), the 4 KiB backup SRAM, the two watchdogs (chapters 21, 22).
#pragma once

#include <functional>

#include "host-sim/chip/device.hpp"

namespace host_sim::chip {

class Pwr : public Device {
 public:
  static constexpr std::uint32_t address = 0x40007000;
  enum : std::uint32_t { cr = 0x00, csr = 0x04 };
  Pwr(Host& host, std::function<void(bool)> pvd_edge);
  void reset() override;
  bool backup_writable() const { return peek(cr) >> 8 & 1; }
  bool scale_1() const { return peek(cr) >> 14 & 1; }
  bool backup_kept() const { return peek(csr) >> 9 & 1; }
  void set_supply(double volts);
  void forget_backup() { at(csr) = 0; }

 protected:
  void on_write(std::uint32_t offset, std::uint32_t value) override;

 private:
  void compare();
  double supply_V_ = 3.3;
  std::function<void(bool)> pvd_edge_;
};

class Iwdg : public Device {
 public:
  static constexpr std::uint32_t address = 0x40003000;
  enum : std::uint32_t { kr = 0x00, pr = 0x04, rlr = 0x08, sr = 0x0C };
  Iwdg(Host& host, std::function<void()> bite);
  void reset() override;
  Time next_event() const override { return running_ ? deadline_ : never; }
  void advance(Time now) override;
  void set_lsi_Hz(double hz) { lsi_Hz_ = hz; }
  bool running() const { return running_; }
  double timeout_s() const;

 protected:
  std::uint32_t on_read(std::uint32_t offset) override;
  void on_write(std::uint32_t offset, std::uint32_t value) override;

 private:
  void reload();
  double lsi_Hz_ = 32e3;  // 17..47 kHz, STM32F405 datasheet, LSI oscillator characteristics
  bool running_ = false, open_ = false;
  Time deadline_ = never, updated_ = 0;
  std::function<void()> bite_;
};

class Wwdg : public Device {
 public:
  static constexpr std::uint32_t address = 0x40002C00;
  enum : std::uint32_t { cr = 0x00, cfr = 0x04, sr = 0x08 };
  Wwdg(Host& host, std::function<double()> pclk1_Hz, std::function<void(const char*)> bite);
  void reset() override;
  Time next_event() const override { return running_ ? deadline_ : never; }
  void advance(Time now) override;
  bool running() const { return running_; }

 protected:
  std::uint32_t on_read(std::uint32_t offset) override;
  void on_write(std::uint32_t offset, std::uint32_t value) override;

 private:
  Time count() const;           // ticks per step of T
  std::uint32_t value() const;  // T as it stands
  bool running_ = false;
  std::uint32_t loaded_ = 0x7F;
  Time from_ = 0, deadline_ = never;
  std::function<double()> pclk1_Hz_;
  std::function<void(const char*)> bite_;
};

}  // namespace host_sim::chip

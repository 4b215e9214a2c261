// SPDX-License-Identifier: MIT
// An STM32F405RG made of numbers: core, NVIC, clocks, flash, pins, timers, ADCs, watchdogs, in one box with pins. It
// executes the very .elf that would be flashed and writes down every mistake the firmware makes (troubles()). What
// hangs on the pins is handed in as a Board; the chip knows neither bridge nor motor. Absent registers and peripherals
// are mistakes as well.
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "host-sim/chip/adc.hpp"
#include "host-sim/chip/clocks.hpp"
#include "host-sim/chip/core.hpp"
#include "host-sim/chip/flash.hpp"
#include "host-sim/chip/nvic.hpp"
#include "host-sim/chip/otg.hpp"
#include "host-sim/chip/pins.hpp"
#include "host-sim/chip/power.hpp"
#include "host-sim/chip/timers.hpp"

namespace host_sim::chip {

/// What hangs on the pins. The chip calls, the board looks at the chip.
class Board {
 public:
  virtual ~Board() = default;
  /// The counter of TIM1 (0) or TIM8 (1) is at its top: the period behind it is over.
  virtual void period_ended(int bridge, Time when) = 0;
  virtual std::uint32_t analog(int adc, int channel, Time closed) = 0;
  virtual void was_reset() {}
};

/// A deliberate mistake in the driver: what it writes to a register, or reads from it, is changed on the way.
struct Mutation {
  std::string name;
  std::function<bool(std::uint32_t address, std::uint32_t& value)> on_write;  // false: the write is lost
  std::function<std::uint32_t(std::uint32_t address, std::uint32_t value)> on_read;
  std::function<std::uint32_t(std::uint32_t address)> redirect;  // another register than meant
};

class Chip final : public Host, public Bus {
 public:
  Chip();

  /// Loads an ELF image; its symbols become known. Throws std::runtime_error on a file that is none.
  void load(const std::string& elf);
  std::uint32_t symbol(const std::string& name) const;  // 0: unknown
  const std::map<std::string, std::uint32_t>& symbols() const { return symbols_; }
  std::string function_at(std::uint32_t pc) const;

  void connect(Board* board) { board_ = board; }
  void mutate(Mutation mutation) { mutation_ = std::move(mutation); }

  void power_on(std::uint32_t seed = 1, bool keep_backup = false);
  void power_off();
  void run_for(double seconds) { run_until(now() + from_s(seconds)); }
  void run_until(Time until);
  /// Something outside happens then, in the middle of whatever the core is doing.
  void at(Time when, std::function<void()> happens) { outside_.emplace(when, std::move(happens)); }
  void stop_hse() { rcc.stop_hse(); }
  void set_supply(double volts) { pwr.set_supply(volts); }

  // Host
  Time now() const override { return core_.now(); }
  Time event_time() const override { return std::min(event_at_, core_.now()); }
  std::uint32_t pc() const override { return core_.pc(); }
  void report(const std::string& what, std::uint32_t address) override;
  void reschedule() override { core_.stop_soon(); }
  void set_line(int irq, bool level) override { nvic.set_line(irq, level); }
  bool clock_on(std::uint32_t enr, int bit) const override { return rcc.enabled(enr, bit); }
  // Bus
  std::uint32_t bus_read(std::uint32_t address, unsigned size) override;
  void bus_write(std::uint32_t address, std::uint32_t value, unsigned size) override;
  void flash_write(std::uint32_t address, std::uint32_t value, unsigned size) override {
    flash.program(address, value, size);
  }
  void core_trouble(const std::string& what, std::uint32_t address) override { report(what, address); }

  void set_pin(Pin pin, bool high);
  Gpio& port(char letter) { return *ports_.at(letter); }
  const Gpio& port(char letter) const { return *ports_.at(letter); }
  AdvancedTimer& timer(int bridge) { return bridge == 0 ? tim1 : tim8; }
  Adc& adc(int number) { return number == 1 ? adc1 : number == 2 ? adc2 : adc3; }
  Core& core() { return core_; }
  const Troubles& troubles() const { return troubles_; }
  void clear_troubles() { troubles_.clear(); }
  /// All troubles as text, one a line, with the function they happened in.
  std::string report_text() const;
  int resets() const { return resets_; }
  ResetCause last_reset() const { return last_reset_; }
  std::uint8_t* backup_ram() { return backup_.data(); }

  Nvic nvic;
  Rcc rcc;
  Flash flash;
  Pwr pwr;
  Syscfg syscfg;
  Exti exti;
  Iwdg iwdg;
  Wwdg wwdg;
  AdvancedTimer tim1, tim8;
  EncoderTimer tim3, tim4;
  AdcCommon adc_common;
  Adc adc1, adc2, adc3;
  OtgFs otg;

 private:
  void system_reset(ResetCause cause);
  void clocks_changed();
  void line_of_adcs();
  void connect_break_inputs();
  Device* device_at(std::uint32_t address);

  Core core_;
  std::map<char, std::unique_ptr<Gpio>> ports_;
  std::vector<Device*> devices_;
  std::vector<std::uint8_t> backup_;
  std::map<std::uint32_t, std::string> functions_;
  std::map<std::string, std::uint32_t> symbols_;
  Board* board_ = nullptr;
  Mutation mutation_;
  std::multimap<Time, std::function<void()>> outside_;
  Troubles troubles_;
  Time event_at_ = never;  // of the event that a device works on; never: the core itself or a pin
  int resets_ = 0;
  ResetCause last_reset_ = ResetCause::power_on, wanted_cause_ = ResetCause::power_on;
  bool reset_wanted_ = false;
};

}  // namespace host_sim::chip

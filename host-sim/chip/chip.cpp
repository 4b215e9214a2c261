// SPDX-License-Identifier: MIT
#include "host-sim/chip/chip.hpp"

#include <elf.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace host_sim::chip {
namespace {

constexpr std::uint32_t backup_base = 0x40024000, backup_size = 4096;  // RM0090 2.3, Table 1

std::string hex(std::uint32_t v) {
  char text[16];
  std::snprintf(text, sizeof text, "0x%08X", v);
  return text;
}

}  // namespace

Chip::Chip()
    : nvic(*this),
      rcc(*this, {[this] { clocks_changed(); },
                  [this] {
                    tim1.clock_failure();
                    tim8.clock_failure();
                  },
                  [this](bool on) { nvic.set_nmi_line(on); }, [this] { return flash.wait_states(); },
                  [this] { return pwr.backup_writable(); }, [this] { return pwr.scale_1(); }}),
      flash(*this, {[this](Time t) { core_.stall(t); }, [this] { return tim1.main_output() || tim8.main_output(); },
                    [this](std::uint32_t where, std::uint32_t bytes) { core_.refresh_flash(where, bytes); },
                    [this] { rcc.check_limits(); }}),
      pwr(*this, [this](bool low) { exti.edge(16, low); }),
      syscfg(*this),
      exti(*this),
      iwdg(*this,
           [this] {
             reset_wanted_ = true;
             wanted_cause_ = ResetCause::iwdg;
           }),
      wwdg(
          *this, [this] { return rcc.tree().pclk1_Hz; },
          [this](const char* why) {
            if (std::string(why) != "T6 fell to 0") report(std::string("WWDG: ") + why, Wwdg::address);
            reset_wanted_ = true;
            wanted_cause_ = ResetCause::wwdg;
            reschedule();
          }),
      tim1(*this, "TIM1", 0x40010000, 0,
           {[this] { return rcc.tree().timer2_Hz; },
            [this](Time t) {
              if (board_) board_->period_ended(0, t);
            },
            [this](Time t) {
              for (int i = 1; i <= 3; ++i) adc(i).trigger(0, t);
            },                              // JEXTSEL 0000: TIM1_CC4, RM0090 13.13.3
            [this] { tim8.trigger_in(); },  // TIM8 ITR0 = TIM1, RM0090 17.4.3
            24, 25, 27}),
      tim8(*this, "TIM8", 0x40010400, 1,
           {[this] { return rcc.tree().timer2_Hz; },
            [this](Time t) {
              if (board_) board_->period_ended(1, t);
            },
            [this](Time t) {
              for (int i = 1; i <= 3; ++i) adc(i).trigger(14, t);
            },  // JEXTSEL 1110: TIM8_CC4
            [] {}, 43, 44, 46}),
      tim3(
          *this, "TIM3", 0x40000400, 1, [this] { return port('B').is_alternate(4, 2) && port('B').is_alternate(5, 2); },
          [this] { return nvic.running() == 16 + 9; }),
      tim4(
          *this, "TIM4", 0x40000800, 2, [this] { return port('B').is_alternate(6, 2) && port('B').is_alternate(7, 2); },
          [this] { return nvic.running() == 16 + 23; }),
      adc_common(*this),
      adc1(*this, 1,
           {[this] { return rcc.tree().pclk2_Hz; },
            [this](int a, int c, Time t) { return board_ ? board_->analog(a, c, t) : 0; }, [this] { line_of_adcs(); },
            &adc_common}),
      adc2(*this, 2,
           {[this] { return rcc.tree().pclk2_Hz; },
            [this](int a, int c, Time t) { return board_ ? board_->analog(a, c, t) : 0; }, [this] { line_of_adcs(); },
            &adc_common}),
      adc3(*this, 3,
           {[this] { return rcc.tree().pclk2_Hz; },
            [this](int a, int c, Time t) { return board_ ? board_->analog(a, c, t) : 0; }, [this] { line_of_adcs(); },
            &adc_common}),
      otg(*this, {[this] { return rcc.tree().usb_Hz; },
                  [this] { return port('A').is_alternate(11, 10) && port('A').is_alternate(12, 10); }}),
      core_(*this, nvic, flash.mapped()),
      backup_(backup_size) {
  for (char letter : {'A', 'B', 'C', 'D', 'H'}) {
    ports_[letter] = std::make_unique<Gpio>(*this, letter, [this](char p, int pin, bool rising) {
      if (syscfg.port_of_line(pin) == p) exti.edge(pin, rising);
    });
  }
  devices_ = {&rcc,  &flash, &pwr,  &syscfg,     &exti, &iwdg, &wwdg, &tim1,
              &tim8, &tim3,  &tim4, &adc_common, &adc1, &adc2, &adc3, &otg};
  for (auto& [letter, gpio] : ports_) devices_.push_back(gpio.get());
  auto* system = core_.system_memory();
  const std::uint32_t id[3] = {0x0043001F, 0x3135510D, 0x35373832};  // an example of RM0090 39.1's 96-bit unique id
  std::memcpy(system + 0xA10, id, 12);
  const std::uint16_t kib = 1024, vrefint_cal = 1502;  // 1.21 V at 3.3 V, RM0090 39.2 and datasheet VREFIN_CAL
  std::memcpy(system + 0xA22, &kib, 2);
  std::memcpy(system + 0xA2A, &vrefint_cal, 2);
  clocks_changed();
}

void Chip::load(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  const std::vector<char> file((std::istreambuf_iterator<char>(in)), {});
  if (file.size() < sizeof(Elf32_Ehdr) || std::memcmp(file.data(), ELFMAG, SELFMAG) != 0)
    throw std::runtime_error(path + ": this is no ELF image; give the one that was linked.");
  Elf32_Ehdr header;
  std::memcpy(&header, file.data(), sizeof header);
  const auto fits = [&](std::size_t offset, std::size_t bytes) {
    if (offset + bytes > file.size() || offset + bytes < offset)
      throw std::runtime_error(path + " is a torn ELF image");
  };
  for (int i = 0; i < header.e_phnum; ++i) {
    Elf32_Phdr segment;
    fits(header.e_phoff + static_cast<std::size_t>(i) * sizeof segment, sizeof segment);
    std::memcpy(&segment, file.data() + header.e_phoff + static_cast<std::size_t>(i) * sizeof segment, sizeof segment);
    if (segment.p_type != PT_LOAD || segment.p_filesz == 0) continue;
    fits(segment.p_offset, segment.p_filesz);
    const std::uint32_t where =
        segment.p_paddr < Flash::cells ? segment.p_paddr + Flash::cells : segment.p_paddr;  // alias at 0
    if (where < Flash::cells || where - Flash::cells + segment.p_filesz > Flash::size)
      throw std::runtime_error(path + ": a segment lies outside the flash");
    flash.load(where, file.data() + segment.p_offset, segment.p_filesz);
  }
  const Elf32_Shdr* strings = nullptr;
  std::vector<Elf32_Shdr> sections(header.e_shnum);
  fits(header.e_shoff, sections.size() * sizeof(Elf32_Shdr));
  std::memcpy(sections.data(), file.data() + header.e_shoff, sections.size() * sizeof(Elf32_Shdr));
  for (const Elf32_Shdr& s : sections) {
    if (s.sh_type != SHT_SYMTAB) continue;
    strings = &sections.at(s.sh_link);
    for (std::uint32_t o = 0; o + sizeof(Elf32_Sym) <= s.sh_size; o += sizeof(Elf32_Sym)) {
      Elf32_Sym symbol;
      fits(s.sh_offset + o, sizeof symbol);
      std::memcpy(&symbol, file.data() + s.sh_offset + o, sizeof symbol);
      const std::string name = file.data() + strings->sh_offset + symbol.st_name;
      if (name.empty() || name[0] == '$') continue;
      if (ELF32_ST_TYPE(symbol.st_info) == STT_FUNC) functions_[symbol.st_value & ~1u] = name;
      symbols_[name] = symbol.st_value;
    }
  }
}

std::uint32_t Chip::symbol(const std::string& name) const {
  const auto found = symbols_.find(name);
  return found == symbols_.end() ? 0 : found->second;
}

std::string Chip::function_at(std::uint32_t pc) const {
  auto after = functions_.upper_bound(pc);
  return after == functions_.begin() ? "?" : std::prev(after)->second;
}

void Chip::report(const std::string& what, std::uint32_t address) { troubles_.report(what, address, pc(), now()); }

std::string Chip::report_text() const {
  std::string text;
  char line[160];
  for (const Trouble& t : troubles_.list()) {
    std::snprintf(line, sizeof line, " (address %s, pc %s, %.6f s) in ", hex(t.address).c_str(), hex(t.pc).c_str(),
                  to_s(t.when));
    text += t.what + line + function_at(t.pc) + "\n";
  }
  return text;
}

void Chip::clocks_changed() {
  const Time tick = std::max<Time>(1, static_cast<Time>(static_cast<double>(ticks_per_s) / rcc.tree().hclk_Hz + 0.5));
  core_.set_ticks_per_cycle(tick);
  nvic.set_ticks_per_cycle(tick);
  if (devices_.empty()) return;
  tim1.clocks_changed();
  tim8.clocks_changed();
  reschedule();
}

void Chip::line_of_adcs() { nvic.set_line(adc_irq, adc1.irq() || adc2.irq() || adc3.irq()); }

void Chip::system_reset(ResetCause cause) {
  for (Device* d : devices_) d->reset();
  nvic.reset();
  rcc.note_cause(cause);
  core_.reset();
  last_reset_ = cause;
  ++resets_;
  reset_wanted_ = false;
  if (board_) board_->was_reset();
}

void Chip::power_on(std::uint32_t seed, bool keep_backup) {
  for (std::uint32_t i = 0; i < Core::ram_size; ++i) {  // RAM holds anything after power-on
    seed = seed * 1664525u + 1013904223u;
    core_.ram()[i] = static_cast<std::uint8_t>(seed >> 24);
  }
  if (!keep_backup || !pwr.backup_kept()) {
    for (auto& byte : backup_) {
      seed = seed * 1664525u + 1013904223u;
      byte = static_cast<std::uint8_t>(seed >> 24);
    }
    pwr.forget_backup();
  }
  system_reset(ResetCause::power_on);
  resets_ = 0;
}

void Chip::power_off() { flash.power_lost(now(), static_cast<std::uint32_t>(now() * 2654435761u)); }

void Chip::run_until(Time until) {
  while (now() < until && !core_.exited()) {
    Time next = std::min(until, nvic.next_event());
    for (const Device* d : devices_) next = std::min(next, d->next_event());
    if (!outside_.empty()) next = std::min(next, outside_.begin()->first);
    if (rcc.dead() || core_.locked_up())
      core_.skip_to(next);
    else if (next > now())
      core_.run(next);
    flash.restore();
    const Time t = now();
    event_at_ = nvic.next_event();
    nvic.advance(t);
    for (Device* d : devices_) {
      event_at_ = d->next_event();
      if (event_at_ <= t) d->advance(t);
    }
    while (!outside_.empty() && outside_.begin()->first <= t) {
      const auto first = outside_.extract(outside_.begin());
      event_at_ = first.key();
      first.mapped()();
    }
    event_at_ = never;
    if (nvic.reset_requested()) {
      reset_wanted_ = true;
      wanted_cause_ = ResetCause::software;
    }
    if (reset_wanted_) system_reset(wanted_cause_);
  }
}

Device* Chip::device_at(std::uint32_t address) {
  if (address >= 0x40012000 && address < 0x40012400) {
    return address < 0x40012100   ? &adc1
           : address < 0x40012200 ? &adc2
           : address < 0x40012300 ? static_cast<Device*>(&adc3)
                                  : &adc_common;
  }
  for (Device* d : devices_) {
    const std::uint32_t span = d == &otg ? 0x40000 : 0x400;
    if (address >= d->base() && address < d->base() + span) return d;
  }
  return nullptr;
}

std::uint32_t Chip::bus_read(std::uint32_t address, unsigned size) {
  flash.restore();
  if (mutation_.redirect) address = mutation_.redirect(address);
  std::uint32_t value = 0;
  if (address >= 0xE0000000) {
    value = nvic.read(address, size);
  } else if (address >= backup_base && address < backup_base + backup_size) {
    if (!rcc.enabled(Rcc::ahb1enr, 18)) report("backup SRAM: read with its clock off", address);
    std::memcpy(&value, backup_.data() + (address - backup_base), size);
  } else if (Device* d = device_at(address)) {
    value = d->read(address - d->base(), size);
  } else {
    report("read of an address where this image has no peripheral", address);
  }
  return mutation_.on_read ? mutation_.on_read(address, value) : value;
}

void Chip::bus_write(std::uint32_t address, std::uint32_t value, unsigned size) {
  flash.restore();
  if (mutation_.redirect) address = mutation_.redirect(address);
  if (mutation_.on_write && !mutation_.on_write(address, value)) return;
  if (address >= 0xE0000000) {
    nvic.write(address, value, size);
  } else if (address >= backup_base && address < backup_base + backup_size) {
    if (!rcc.enabled(Rcc::ahb1enr, 18)) return report("backup SRAM: write with its clock off", address);
    if (!pwr.backup_writable()) return report("backup SRAM: write while PWR_CR.DBP is 0", address);
    std::memcpy(backup_.data() + (address - backup_base), &value, size);
  } else if (Device* d = device_at(address)) {
    d->write(address - d->base(), value, size);
    if (address >= 0x40020000 && address < 0x40020800) connect_break_inputs();
  } else {
    report("write to an address where this image has no peripheral", address);
  }
}

// BKIN: TIM1 on PB12 (AF1), TIM8 on PA6 (AF3), STM32F405 datasheet table 9.
void Chip::connect_break_inputs() {
  tim1.break_pin(port('B').is_alternate(12, 1), port('B').level(12));
  tim8.break_pin(port('A').is_alternate(6, 3), port('A').level(6));
}

void Chip::set_pin(Pin pin, bool high) {
  port(pin.port).set_level(pin.number, high);
  if (pin == Pin{'B', 12} || pin == Pin{'A', 6}) connect_break_inputs();
}

}  // namespace host_sim::chip

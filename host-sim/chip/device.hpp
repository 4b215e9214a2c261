// SPDX-License-Identifier: MIT
// What every peripheral model has in common: a table of its registers (name, reset value, which bits exist, which can
// be written), the check that its clock runs, and the chip it reports to. A register that is not in the table does not
// exist.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "host-sim/chip/trouble.hpp"

namespace host_sim::chip {

/// What a device may ask of the chip around it.
class Host {
 public:
  virtual ~Host() = default;
  virtual Time now() const = 0;
  /// When what is being told happened: the chip looks up to a block of instructions later.
  virtual Time event_time() const = 0;
  virtual std::uint32_t pc() const = 0;
  virtual void report(const std::string& what, std::uint32_t address) = 0;
  virtual void reschedule() = 0;                                // an event moved: look again before the next block
  virtual void set_line(int irq, bool level) = 0;               // interrupt request line to the NVIC
  virtual bool clock_on(std::uint32_t enr, int bit) const = 0;  // RCC enable bit
};

struct Register {
  std::uint32_t offset;
  const char* name;
  std::uint32_t reset;
  std::uint32_t exists;    // bits that are not reserved
  std::uint32_t writable;  // bits that keep what is written
};

class Device {
 public:
  /// `enr` and `bit`: the RCC register and bit that clock it; bit < 0: always clocked.
  Device(Host& host, std::string name, std::uint32_t base, std::span<const Register> map, std::uint32_t enr, int bit)
      : host_(host), name_(std::move(name)), base_(base), map_(map.begin(), map.end()), enr_(enr), bit_(bit) {
    std::uint32_t last = 0;
    for (const Register& r : map_) last = r.offset > last ? r.offset : last;
    index_.assign(last / 4 + 1, -1);
    for (std::size_t i = 0; i < map_.size(); ++i) index_[map_[i].offset / 4] = static_cast<int>(i);
    value_.resize(index_.size());
    Device::reset();
  }
  virtual ~Device() = default;
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  virtual void reset() {
    for (const Register& r : map_) value_[r.offset / 4] = r.reset;
  }
  virtual Time next_event() const { return never; }
  virtual void advance(Time) {}

  std::uint32_t read(std::uint32_t offset, unsigned size);
  void write(std::uint32_t offset, std::uint32_t value, unsigned size);
  std::uint32_t base() const { return base_; }
  const std::string& name() const { return name_; }
  std::uint32_t peek(std::uint32_t offset) const { return value_[offset / 4]; }
  bool clocked() const { return bit_ < 0 || host_.clock_on(enr_, bit_); }

 protected:
  /// Default reading: the stored value. `offset` is known to exist.
  virtual std::uint32_t on_read(std::uint32_t offset) { return value_[offset / 4]; }
  /// Default writing: writable bits are kept.
  virtual void on_write(std::uint32_t offset, std::uint32_t value) { keep(offset, value); }

  void keep(std::uint32_t offset, std::uint32_t value) {
    const Register& r = map_[static_cast<std::size_t>(index_[offset / 4])];
    value_[offset / 4] = (value_[offset / 4] & ~r.writable) | (value & r.writable);
  }
  std::uint32_t& at(std::uint32_t offset) { return value_[offset / 4]; }
  void trouble(const std::string& what, std::uint32_t offset) { host_.report(name_ + ": " + what, base_ + offset); }

  Host& host_;

 private:
  const Register* find(std::uint32_t offset, unsigned size, const char* verb);

  std::string name_;
  std::uint32_t base_;
  std::vector<Register> map_;
  std::vector<int> index_;
  std::vector<std::uint32_t> value_;
  std::uint32_t enr_;
  int bit_;
};

/// Extracts `width` bits from `shift`.
constexpr std::uint32_t field(std::uint32_t value, int shift, int width) {
  return (value >> shift) & ((1u << width) - 1u);
}

}  // namespace host_sim::chip

// SPDX-License-Identifier: MIT
// The flash and its interface (RM0090 chapter 3): keys, PG, SER, PSIZE, BSY, error flags, sectors of 16, 64 and 128
// KiB. Bits only fall from 1 to 0 without an erase. The core stands still while a word is programmed or a sector
// erased, and a supply that goes in that time leaves the word (or the sector) undefined.
#pragma once

#include <functional>

#include "host-sim/chip/device.hpp"

namespace host_sim::chip {

class Flash : public Device {
 public:
  static constexpr std::uint32_t address = 0x40023C00, cells = 0x08000000, size = 1u << 20;
  enum : std::uint32_t { acr = 0x00, keyr = 0x04, optkeyr = 0x08, sr = 0x0C, cr = 0x10, optcr = 0x14 };

  struct Links {
    std::function<void(Time)> stall;                              // the core waits
    std::function<bool()> armed;                                  // a bridge is driven
    std::function<void(std::uint32_t, std::uint32_t)> refreshed;  // address, size: code caches forget
    std::function<void()> latency_changed;
  };

  Flash(Host& host, Links links);
  void reset() override;
  void program(std::uint32_t where, std::uint32_t value, unsigned width);
  unsigned wait_states() const { return peek(acr) & 7; }
  /// Unicorn lets a store through that it was told about; this puts the cells back as they are.
  void restore();
  /// The supply went at `when`: what was being written is garbage.
  void power_lost(Time when, std::uint32_t seed);
  std::uint8_t* mapped() { return mapped_.data(); }
  void load(std::uint32_t where, const void* data, std::uint32_t bytes);
  std::uint32_t word(std::uint32_t where) const;
  std::uint64_t words_programmed() const { return words_; }
  double word_s = 16e-6;  // that a word takes: STM32F405 datasheet, "Flash memory programming", 100e-6 at most

  static int sector_of(std::uint32_t where);
  static std::uint32_t sector_start(int sector);
  static std::uint32_t sector_size(int sector);

 protected:
  void on_write(std::uint32_t offset, std::uint32_t value) override;

 private:
  struct Operation {
    Time from = 0, to = 0;
    std::uint32_t where = 0, bytes = 0;
  };
  void refuse(std::uint32_t flag, const std::string& what, std::uint32_t where);
  void busy(double seconds, std::uint32_t where, std::uint32_t bytes);

  Links links_;
  std::vector<std::uint8_t> cells_, mapped_;
  std::vector<std::uint32_t> dirty_;
  int key_ = 0;
  Operation last_;
  std::uint64_t words_ = 0;
};

}  // namespace host_sim::chip

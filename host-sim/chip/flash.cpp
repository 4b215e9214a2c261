// SPDX-License-Identifier: MIT
#include "host-sim/chip/flash.hpp"

#include <cstring>

namespace host_sim::chip {
namespace {

// RM0090 3.9 (STM32F405): register map and reset values.
constexpr Register map[] = {
    {Flash::acr, "FLASH_ACR", 0, 0x00001F07, 0x00000707},
    {Flash::keyr, "FLASH_KEYR", 0, 0xFFFFFFFF, 0},
    {Flash::optkeyr, "FLASH_OPTKEYR", 0, 0xFFFFFFFF, 0},
    {Flash::sr, "FLASH_SR", 0, 0x000100F3, 0},
    {Flash::cr, "FLASH_CR", 0x80000000, 0x8301037F, 0x0300037F},
    {Flash::optcr, "FLASH_OPTCR", 0x0FFFAAED, 0x0FFFFFEF, 0},
};

}  // namespace

Flash::Flash(Host& host, Links links)
    : Device(host, "FLASH", address, map, 0, -1), links_(std::move(links)), cells_(size, 0xFF), mapped_(size, 0xFF) {}

void Flash::reset() {
  Device::reset();
  key_ = 0;
}

int Flash::sector_of(std::uint32_t where) {  // RM0090 3.4, Table 5
  const std::uint32_t o = where - cells;
  if (o < 0x10000) return static_cast<int>(o / 0x4000);
  return o < 0x20000 ? 4 : static_cast<int>(4 + o / 0x20000);
}
std::uint32_t Flash::sector_start(int s) {
  const auto n = static_cast<std::uint32_t>(s);
  return cells + (s < 4 ? n * 0x4000 : s == 4 ? 0x10000 : (n - 4) * 0x20000);
}
std::uint32_t Flash::sector_size(int s) { return s < 4 ? 0x4000 : s == 4 ? 0x10000 : 0x20000; }

void Flash::load(std::uint32_t where, const void* data, std::uint32_t bytes) {
  std::memcpy(cells_.data() + (where - cells), data, bytes);
  std::memcpy(mapped_.data() + (where - cells), data, bytes);
}

std::uint32_t Flash::word(std::uint32_t where) const {
  std::uint32_t v;
  std::memcpy(&v, cells_.data() + (where - cells), 4);
  return v;
}

void Flash::restore() {
  for (std::uint32_t where : dirty_) std::memcpy(mapped_.data() + (where - cells), cells_.data() + (where - cells), 4);
  dirty_.clear();
}

void Flash::refuse(std::uint32_t flag, const std::string& what, std::uint32_t where) {
  at(sr) |= flag;
  host_.report("FLASH: " + what, where);
}

void Flash::busy(double seconds, std::uint32_t where, std::uint32_t bytes) {
  last_ = {host_.now(), host_.now() + from_s(seconds), where, bytes};
  if (links_.stall) links_.stall(from_s(seconds));
}

void Flash::program(std::uint32_t where, std::uint32_t value, unsigned width) {
  dirty_.push_back(where & ~3u);
  host_.reschedule();
  const std::uint32_t c = peek(cr);
  if (c >> 31) return refuse(1u << 7, "write to the flash without unlocking it", where);
  if (!(c & 1)) return refuse(1u << 7, "write to the flash with PG = 0 (programming sequence error)", where);
  if (1u << field(c, 8, 2) != width)
    return refuse(1u << 6, "write width differs from PSIZE (parallelism error)", where);
  if (where % width) return refuse(1u << 5, "unaligned write to the flash", where);
  if (links_.armed && links_.armed())
    host_.report("FLASH: written while a bridge is driven; the core stands still for 16 to 100 us", where);
  if (sector_of(where) < 5) host_.report("FLASH: the image itself is being overwritten", where);
  std::uint32_t old = 0;
  std::memcpy(&old, cells_.data() + (where - cells), width);
  if (value & ~old) host_.report("FLASH: a bit is to rise from 0 to 1 without an erase", where);
  const std::uint32_t now = old & value;
  std::memcpy(cells_.data() + (where - cells), &now, width);
  ++words_;
  busy(word_s, where, width);
  if (links_.refreshed) links_.refreshed(where & ~3u, 4);
}

void Flash::power_lost(Time when, std::uint32_t seed) {
  if (when < last_.from || when >= last_.to) return;
  for (std::uint32_t i = 0; i < last_.bytes; ++i) {
    seed = seed * 1664525u + 1013904223u;
    std::uint8_t& cell = cells_[last_.where - cells + i];
    // A word half programmed reads anything between what was there (1) and what was meant; an erase leaves anything.
    cell = last_.bytes > 8 ? static_cast<std::uint8_t>(seed >> 24) : static_cast<std::uint8_t>(cell | (seed >> 24));
    mapped_[last_.where - cells + i] = cell;
  }
  if (links_.refreshed) links_.refreshed(last_.where & ~3u, last_.bytes);
}

void Flash::on_write(std::uint32_t offset, std::uint32_t value) {
  switch (offset) {
    case acr:
      keep(offset, value);
      if (links_.latency_changed) links_.latency_changed();
      return;
    case keyr:
      if (key_ == 0 && value == 0x45670123)
        key_ = 1;  // RM0090 3.6.1
      else if (key_ == 1 && value == 0xCDEF89AB) {
        key_ = 2;
        at(cr) &= ~(1u << 31);
      } else {
        key_ = -1;
        trouble("wrong key: the flash stays locked until the next reset", offset);
      }
      return;
    case sr:
      at(sr) &= ~(value & 0xF3);
      return;
    case cr: {
      if (peek(cr) >> 31) {
        if ((value ^ peek(cr)) & 0x0301037F) trouble("FLASH_CR written while locked", offset);
        return;
      }
      keep(offset, value);
      if (value >> 31) {
        at(cr) |= 1u << 31;
        key_ = 0;
      }
      if (!(value >> 16 & 1)) return;
      if (!(value & 2)) return trouble("STRT without SER (mass erase is not for this board)", offset);
      const int s = static_cast<int>(field(value, 3, 4));
      if (s > 11) return trouble("erase of a sector that does not exist", offset);
      if (s < 5) trouble("erase of a sector that holds the image", offset);
      if (links_.armed && links_.armed()) trouble("sector erase while a bridge is driven", offset);
      std::memset(cells_.data() + (sector_start(s) - cells), 0xFF, sector_size(s));
      std::memset(mapped_.data() + (sector_start(s) - cells), 0xFF, sector_size(s));
      // Datasheet, PSIZE = x32: 16 KiB 250 ms, 64 KiB 550 ms, 128 KiB 1 s (typ.)
      busy(sector_size(s) == 0x4000 ? 0.25 : sector_size(s) == 0x10000 ? 0.55 : 1.0, sector_start(s), sector_size(s));
      if (links_.refreshed) links_.refreshed(sector_start(s), sector_size(s));
      return;
    }
    case optcr:
    case optkeyr:
      trouble("option bytes are not for the firmware to change", offset);
      return;
    default:
      keep(offset, value);
  }
}

}  // namespace host_sim::chip

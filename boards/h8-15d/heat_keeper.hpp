// SPDX-License-Identifier: MIT
// Keeps what must survive a reset: how hot everything was, and why it stopped.
//
//   backup SRAM   every 10 ms, two records in turns, so that a reset in the middle of one leaves the other
//   journal       one record when the supply falls, for the board whose VBAT is empty
//
// A record of the journal counts for one start only: it is marked as used before anything can get hot. So a life that
// ended without a record (a supply that broke too fast, a torn word, a corrupt SRAM) is followed by a hot start and not
// by the cold memory of an earlier life.
#pragma once

#include <atomic>
#include <cstdint>

#include "boards/h8-15d/store.hpp"
#include "firmware/driver.hpp"
#include "firmware/record_log.hpp"

namespace h8_15d {

enum class Recalled : std::uint32_t { nothing = 0, backup_memory = 1, journal = 2 };

class HeatKeeper {
 public:
  static constexpr std::uint32_t magic = 0x41454848;  // "HHEA"
  static constexpr std::size_t slot_bytes = 256;
  static constexpr std::size_t used_mark_at = slot_bytes - 4;  // erased: nobody has started from this record yet
  static constexpr std::size_t record_words = firmware::header_words + sizeof(firmware::DriverMemory) / 4;
  static_assert(sizeof(firmware::DriverMemory) % 4 == 0 && 4 * record_words <= used_mark_at);

  /// Before the watchdogs run: may erase a sector, which takes a second.
  Recalled recall(firmware::DriverMemory& memory);
  /// Every 10 ms, from the slow lane.
  void keep(const firmware::DriverMemory& now);
  /// When the supply falls: 51 words, 0.8 ms (at worst 5.1). `watched`: the window watchdog runs. ISR, with open
  /// bridges.
  void last_words(bool watched);

 private:
  using Record = std::uint32_t[record_words];

  FlashStore<journal_sectors> flash_;
  firmware::RecordLog log_{magic, slot_bytes};
  Record records_[2] = {};
  std::atomic<int> newest_{-1};  // of records_; -1: none yet
  std::uint32_t serial_ = 0;
  bool spoken_ = false;
};

}  // namespace h8_15d

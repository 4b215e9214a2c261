// SPDX-License-Identifier: MIT
// The two pairs of flash sectors as hal/store.hpp wants them: parameters in 5 and 6, the heat journal in 7 and 8.
#pragma once

#include "boards/h8-15d/hardware.hpp"
#include "hal/store.hpp"

namespace h8_15d {

/// Which sectors is part of the type, and no flipped bit leads out of them: the image's own are next to them.
template <const std::uint32_t (&sectors)[hal::store_areas]>
class FlashStore {
 public:
  std::span<const std::uint8_t> area(int which) const {
    return {reinterpret_cast<const std::uint8_t*>(sector_address(sector(which))), sector_bytes};
  }
  /// A word costs 16 to 100 us of standstill. Each is a sign of life of the main loop, however many a save takes.
  /// `dying_`: the fast lane has ended, so its watchdog is fed word by word as well.
  bool program(int which, std::size_t byte, std::span<const std::uint32_t> words) {
    if (byte >= sector_bytes || words.size_bytes() > sector_bytes - byte) return false;
    bool good = true;
    for (const std::uint32_t word : words) {
      good = program_flash(sector_address(sector(which)) + static_cast<std::uint32_t>(byte), word) && good;
      byte += 4;
      feed_iwdg();
      if (dying_) feed_wwdg();
    }
    return good;
  }
  bool erase(int which) { return erase_sector(sector(which)); }

  void feed_while_writing() { dying_ = true; }

 private:
  static constexpr std::uint32_t sector(int which) { return sectors[which & 1]; }

  bool dying_ = false;
};
static_assert(hal::store_areas == 2 && hal::Store<FlashStore<journal_sectors>>);

}  // namespace h8_15d

// SPDX-License-Identifier: MIT
// The two pairs of flash sectors as hal/store.hpp wants them: parameters in 5 and 6, the heat journal in 7 and 8.
#pragma once

#include "boards/h8-15d/hardware.hpp"
#include "hal/store.hpp"

namespace h8_15d {

class FlashStore {
 public:
  explicit constexpr FlashStore(const std::uint32_t (&sectors)[hal::store_areas]) : sectors_{sectors[0], sectors[1]} {}

  std::span<const std::uint8_t> area(int which) const {
    return {reinterpret_cast<const std::uint8_t*>(sector_address(sectors_[which])), sector_bytes};
  }
  /// A word costs 16 to 100 us of standstill. Each is a sign of life of the main loop, however many a save takes.
  /// `dying_`: the fast lane has ended, so its watchdog is fed word by word as well.
  bool program(int which, std::size_t byte, std::span<const std::uint32_t> words) {
    bool good = true;
    for (const std::uint32_t word : words) {
      good = program_flash(sector_address(sectors_[which]) + static_cast<std::uint32_t>(byte), word) && good;
      byte += 4;
      feed_iwdg();
      if (dying_) feed_wwdg();
    }
    return good;
  }
  bool erase(int which) { return erase_sector(sectors_[which]); }

  void feed_while_writing() { dying_ = true; }

 private:
  std::uint32_t sectors_[hal::store_areas];
  bool dying_ = false;
};
static_assert(hal::Store<FlashStore>);

}  // namespace h8_15d

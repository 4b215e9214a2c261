// SPDX-License-Identifier: MIT
// Flash made of memory: bits can only be cleared, and only an erase sets them.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>

#include "hal/store.hpp"

namespace boards::host {

class MemoryStore {
 public:
  static constexpr std::size_t area_bytes = 16384;  // a sector of an STM32F405 (RM0090 3.4)

  MemoryStore() {
    for (auto& a : areas_) a.fill(0xFF);
  }

  // hal::Store
  std::span<const std::uint8_t> area(int index) const { return areas_[static_cast<std::size_t>(index)]; }
  bool program(int index, std::size_t byte, std::span<const std::uint32_t> words) {
    std::uint8_t* const to = areas_[static_cast<std::size_t>(index)].data() + byte;
    if (byte + words.size_bytes() > area_bytes) return false;
    const auto* const from = reinterpret_cast<const std::uint8_t*>(words.data());
    for (std::size_t i = 0; i < words.size_bytes(); ++i) to[i] = static_cast<std::uint8_t>(to[i] & from[i]);
    return std::memcmp(to, from, words.size_bytes()) == 0;
  }
  bool erase(int index) {
    areas_[static_cast<std::size_t>(index)].fill(0xFF);
    return true;
  }

 private:
  std::array<std::array<std::uint8_t, area_bytes>, hal::store_areas> areas_;
};
static_assert(hal::Store<MemoryStore>);

}  // namespace boards::host

// SPDX-License-Identifier: MIT
// Memory that keeps its words without power: two areas of flash, each of which can only be erased as a whole. What is
// written there and in which order is firmware/record_log.hpp's business. The processor may stand still while it
// writes: not for an ISR, not while a bridge is driven.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

namespace hal {

inline constexpr int store_areas = 2;

template <class S>
concept Store = requires(S& store, const S& look, int area, std::size_t byte, std::span<const std::uint32_t> words) {
  { look.area(area) } -> std::same_as<std::span<const std::uint8_t>>;  // all of it; erased bytes read 0xFF
  { store.program(area, byte, words) } -> std::same_as<bool>;          // into erased words; false: reads back otherwise
  { store.erase(area) } -> std::same_as<bool>;                         // seconds: only before anything is watched
};

}  // namespace hal

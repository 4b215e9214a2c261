// SPDX-License-Identifier: MIT
// Bytes in order of arrival, in a place of fixed size: no memory is taken.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

namespace console::link {

template <std::size_t capacity>
class Ring {
 public:
  std::size_t size() const { return filled_; }
  std::size_t room() const { return capacity - filled_; }
  /// The caller saw to it that there is room.
  void put(std::span<const std::uint8_t> bytes) {
    for (const std::uint8_t byte : bytes) bytes_[(start_ + filled_++) % capacity] = byte;
  }
  /// The oldest ones, at most `to.size()`; they stay.
  std::size_t peek(std::span<std::uint8_t> to) const {
    const std::size_t n = std::min(to.size(), filled_);
    for (std::size_t i = 0; i < n; ++i) to[i] = bytes_[(start_ + i) % capacity];
    return n;
  }
  void drop(std::size_t n) {
    start_ = (start_ + n) % capacity;
    filled_ -= n;
  }
  std::size_t take(std::span<std::uint8_t> to) {
    const std::size_t n = peek(to);
    drop(n);
    return n;
  }

 private:
  std::array<std::uint8_t, capacity> bytes_;
  std::size_t start_ = 0, filled_ = 0;
};

}  // namespace console::link

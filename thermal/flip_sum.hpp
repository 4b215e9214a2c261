// SPDX-License-Identifier: MIT
// A sum over the words of what must not change behind its owner's back. A flipped bit of a word turns one bit of the
// sum, so a single one never goes unseen (two may: it is no CRC, and three instructions a word). Of arrays and matrices
// only what is in use counts: a copy has the same sum, and a flip that nothing reads is nobody's business. No heap.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace thermal {

class FlipSum {
 public:
  /// Numbers, codes, matrices, and structs of whole words without a gap.
  template <class... Values>
  FlipSum& add(const Values&... values) {
    (add_one(values), ...);
    return *this;
  }

  template <class T, int most>
  FlipSum& add_first(int count, const T (&values)[most]) {
    for (int i = 0; i < count && i < most; ++i) add_one(values[i]);
    return *this;
  }

  std::uint32_t word() const { return word_; }

 private:
  template <class T>
  void add_one(const T& value) {
    if constexpr (requires { T::MaxRowsAtCompileTime; }) {
      add(value.rows(), value.cols());  // a flip of these may tell of more than there is
      for (int i = 0; i < value.rows() * value.cols() && i < value.MaxSizeAtCompileTime; ++i) add_one(value.data()[i]);
    } else if constexpr (sizeof(T) < sizeof(std::uint32_t)) {
      add_one(static_cast<std::uint32_t>(value));
    } else {
      static_assert(sizeof(T) % sizeof(std::uint32_t) == 0 && std::is_trivially_copyable_v<T>);
      std::uint32_t words[sizeof(T) / sizeof(std::uint32_t)];
      std::memcpy(words, &value, sizeof value);
      for (const std::uint32_t word : words) word_ = std::rotl(word_, 1) ^ word;
    }
  }

  std::uint32_t word_ = 0;
};

}  // namespace thermal

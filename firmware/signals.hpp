// SPDX-License-Identifier: MIT
// What can be watched, as a dictionary (declared in axis.signals, one line each) and as places in memory: whoever
// records copies words and need not know the axis. A place holds as long as its axis.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace firmware {

struct SignalInfo {
  std::uint8_t id;  // rises down the list and is never used again
  const char* name;
  const char* unit;
  const char* doc;
};

inline constexpr SignalInfo axis_signals[] = {
#define SIGNAL(id, name, unit, where, doc) {id, #name, unit, doc},
#include "firmware/axis.signals"
#undef SIGNAL
};
inline constexpr int axis_signal_count = sizeof axis_signals / sizeof axis_signals[0];

constexpr bool signals_well_declared() {
  for (int i = 1; i < axis_signal_count; ++i) {
    if (axis_signals[i].id <= axis_signals[i - 1].id) return false;
  }
  return true;
}
static_assert(signals_well_declared(), "ids must rise");

/// A float, or a code of one byte. Empty: there is no such signal.
class SignalPlace {
 public:
  constexpr SignalPlace() = default;
  explicit SignalPlace(const float& value) : word_(&value) {}
  /// `code` is an enum of one byte, inside of an object that is aligned to words.
  template <class Code>
  explicit SignalPlace(const Code& code) {
    static_assert(sizeof(Code) == 1);
    const std::size_t byte = reinterpret_cast<std::uintptr_t>(&code) % sizeof(std::uint32_t);
    word_ = reinterpret_cast<const std::uint8_t*>(&code) - byte;
    code_shift_ = static_cast<std::int8_t>(8 * byte);
  }

  bool exists() const { return word_ != nullptr; }
  /// For the control interrupt: the word as it lies, to be understood later.
  std::uint32_t raw() const {
    std::uint32_t word;
    std::memcpy(&word, word_, sizeof word);
    return word;
  }
  float value_of(std::uint32_t raw) const {
    return code_shift_ < 0 ? std::bit_cast<float>(raw) : static_cast<float>(raw >> code_shift_ & 0xFF);
  }
  float value() const { return value_of(raw()); }

 private:
  const void* word_ = nullptr;
  std::int8_t code_shift_ = -1;  // negative: it is a float
};

}  // namespace firmware

// SPDX-License-Identifier: MIT
// What can be watched, as a dictionary (declared in axis.signals, one line each) and as places in memory: whoever
// records copies words and need not know the axis. A place holds as long as its axis.
#pragma once

#include <cstddef>
#include <cstdint>

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
  explicit constexpr SignalPlace(const float& value) : number_(&value) {}
  /// `code` is an enum of one byte.
  template <class Code>
  explicit SignalPlace(const Code& code) : code_(reinterpret_cast<const std::uint8_t*>(&code)) {
    static_assert(sizeof(Code) == 1);
  }

  bool exists() const { return number_ != nullptr || code_ != nullptr; }
  float value() const { return number_ != nullptr ? *number_ : static_cast<float>(*code_); }

 private:
  const float* number_ = nullptr;
  const std::uint8_t* code_ = nullptr;
};

}  // namespace firmware

// SPDX-License-Identifier: MIT
// What a declared parameter is. A room writes one PARAM line a parameter (firmware/axis.params) and expands the list
// into a plain struct (field name + unit suffix) and into a table of these, which is the dictionary that a console will
// fetch.
//
// Keep the table a plain array: GCC 12 puts a deduced constexpr std::array into RAM. A default of `unset` means that no
// value is right for every motor: whoever uses the set must refuse to work until it was given.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

namespace wire {

/// Suffix of a parameter's name. A unit that does not stand here fails to compile at the line that uses it.
// clang-format off
enum class Unit : std::uint8_t { A, V, s, Hz, rad, ohm, H, Wb, count, share, degC, K, K_per_W, J_per_K, W_per_K, per_K, W, Nm, Nms, Nms2, Nm_per_A, ohms2 };

inline constexpr const char* unit_texts[] = {"A", "V", "s", "Hz", "rad", "ohm", "H", "Wb", "count", "share", "degC", "K", "K/W", "J/K", "W/K", "1/K", "W", "Nm", "Nms", "Nms2", "Nm/A", "ohms2"};
// clang-format on
constexpr const char* text_of(Unit unit) { return unit_texts[static_cast<int>(unit)]; }

inline constexpr float unset = std::numeric_limits<float>::quiet_NaN();
constexpr bool is_unset(float value) { return value != value; }

struct ParameterInfo {
  std::uint16_t id;  // rises down the list and is never used again
  const char* name;
  Unit unit;
  float fallback, min, max;
  const char* doc;

  constexpr bool holds(float value) const { return value >= min && value <= max; }
};

/// Ids rise and never repeat, no range is empty, every default lies in its own range or is unset.
template <std::size_t count>
constexpr bool well_declared(const ParameterInfo (&table)[count]) {
  for (std::size_t i = 0; i < count; ++i) {
    if (i > 0 && !(table[i].id > table[i - 1].id)) return false;
    if (!(table[i].min < table[i].max)) return false;
    if (!is_unset(table[i].fallback) && !table[i].holds(table[i].fallback)) return false;
  }
  return true;
}

}  // namespace wire

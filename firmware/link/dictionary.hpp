// SPDX-License-Identifier: MIT
// All that a console can name, as one hash: a console that has seen it before need not fetch the texts again.
#pragma once

#include <bit>
#include <cstdint>

#include "firmware/heat_parameters.hpp"
#include "firmware/signals.hpp"
#include "wire/crc.hpp"

namespace firmware {

consteval std::uint32_t hash_of_dictionary() {
  std::uint32_t hash = 0xFFFF'FFFFu;
  const auto byte = [&](unsigned b) {
    const std::uint8_t one = static_cast<std::uint8_t>(b);
    hash = wire::crc32(&one, 1, hash);
  };
  const auto text = [&](const char* t) {
    do byte(static_cast<unsigned char>(*t));
    while (*t++ != 0);
  };
  const auto word = [&](std::uint32_t w) {
    for (int shift = 0; shift < 32; shift += 8) byte(w >> shift & 0xFF);
  };
  const auto parameter = [&](const wire::ParameterInfo& p) {
    word(p.id), text(p.name), text(wire::text_of(p.unit)), text(p.doc);
    for (const float x : {p.fallback, p.min, p.max}) word(std::bit_cast<std::uint32_t>(x));
  };
  for (const wire::ParameterInfo& p : axis_dictionary) parameter(p);
  for (const wire::ParameterInfo& p : heat_dictionary) parameter(p);
  for (const SignalInfo& s : axis_signals) word(s.id), text(s.name), text(s.unit), text(s.doc);
  return ~hash;
}
inline constexpr std::uint32_t dictionary_hash = hash_of_dictionary();

}  // namespace firmware

// SPDX-License-Identifier: MIT
// Fault: the bridge is open, latched, carries evidence. Limit: still running, output below what was asked, one reason.
// Status: why a call was refused and changed nothing.
#pragma once

#include <cstdint>

namespace wire {

enum class Fault : std::uint8_t {
  none = 0,
#define FAULT(number, name, unit, happened, advice) name = number,
#define LIMIT(number, name, unit, happened, advice)
#define STATUS(number, name, refused, advice)
#include "wire/codes.def"
#undef FAULT
#undef LIMIT
#undef STATUS
};

enum class Limit : std::uint8_t {
  none = 0,
#define FAULT(number, name, unit, happened, advice)
#define LIMIT(number, name, unit, happened, advice) name = number,
#define STATUS(number, name, refused, advice)
#include "wire/codes.def"
#undef FAULT
#undef LIMIT
#undef STATUS
};

enum class [[nodiscard]] Status : std::uint8_t{
    done = 0,
#define FAULT(number, name, unit, happened, advice)
#define LIMIT(number, name, unit, happened, advice)
#define STATUS(number, name, refused, advice) name = number,
#include "wire/codes.def"
#undef FAULT
#undef LIMIT
#undef STATUS
};

/// What a person is told about a code. Every pointer outlives the program.
struct CodeText {
  std::uint8_t number;
  const char* name;
  const char* unit;
  const char* happened;
  const char* advice;
};

inline constexpr CodeText code_texts[] = {
#define FAULT(number, name, unit, happened, advice) {number, #name, unit, happened, advice},
#define LIMIT(number, name, unit, happened, advice) {number, #name, unit, happened, advice},
#define STATUS(number, name, refused, advice) {number, #name, "", refused, advice},
#include "wire/codes.def"
#undef FAULT
#undef LIMIT
#undef STATUS
};

/// Text of a code number; a number that nobody declared reads "unknown".
constexpr CodeText text_of(std::uint8_t number) {
  for (const CodeText& text : code_texts) {
    if (text.number == number) return text;
  }
  return {number, number == 0 ? "none" : "unknown", "", "", ""};
}

constexpr CodeText text_of(Fault fault) { return text_of(static_cast<std::uint8_t>(fault)); }
constexpr CodeText text_of(Limit limit) { return text_of(static_cast<std::uint8_t>(limit)); }
constexpr CodeText text_of(Status status) { return text_of(static_cast<std::uint8_t>(status)); }

}  // namespace wire

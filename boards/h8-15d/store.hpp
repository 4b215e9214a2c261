// SPDX-License-Identifier: MIT
// Records that survive: a header (magic, size, serial number, CRC) before a plain payload. The same bytes lie in the
// parameter sectors, in the heat journal and in the backup memory; the newest that is whole counts, so a power cut
// leaves the last or the one before it, never a mix. Pure functions over memory: they run on the PC as well. No writing
// here.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "firmware/driver.hpp"
#include "wire/crc.hpp"

namespace h8_15d {

struct RecordHeader {
  std::uint32_t magic, bytes, serial, crc;  // crc: of the payload, begun with the serial number
};

template <class Payload, std::uint32_t magic>
struct Record {
  RecordHeader header;
  Payload payload;

  std::uint32_t crc_now() const {
    std::uint8_t raw[sizeof(Payload)];
    std::memcpy(raw, &payload, sizeof raw);
    return wire::crc32(raw, sizeof raw, ~header.serial);
  }
  void seal(std::uint32_t serial) {
    header = {magic, sizeof(Payload), serial, 0};
    header.crc = crc_now();
  }
  bool whole() const { return header.magic == magic && header.bytes == sizeof(Payload) && header.crc == crc_now(); }
};

/// What a person set: both axes. Without it the image runs with unset parameters and refuses to arm.
struct ParameterPayload {
  firmware::AxisSetup axes[firmware::axis_count];
};
using ParameterRecord = Record<ParameterPayload, 0x52415048>;  // "HPAR"

/// What must not be forgotten while the power is gone: how hot it was, and why it stopped.
struct HeatPayload {
  float core_degC[firmware::axis_count][3];
  float housing_degC[firmware::axis_count];
  std::uint8_t fault[firmware::axis_count];
  std::uint8_t reset_flags, spare;  // RCC_CSR bits 31..24 of the last start
};
using HeatRecord = Record<HeatPayload, 0x41454848>;  // "HHEA"
static_assert(sizeof(HeatPayload) == 36 && sizeof(HeatRecord) % 4 == 0);

/// The newest whole record among the slots of a region, or null.
template <class R>
const R* newest(const std::uint8_t* region, std::size_t bytes) {
  const R* best = nullptr;
  for (std::size_t at = 0; at + sizeof(R) <= bytes; at += sizeof(R)) {
    const R* one = reinterpret_cast<const R*>(region + at);
    if (one->header.magic == 0xFFFFFFFFu) break;  // erased: nothing comes after
    if (one->whole() && (best == nullptr || static_cast<std::int32_t>(one->header.serial - best->header.serial) > 0))
      best = one;
  }
  return best;
}

/// First slot of a region that is still erased, or `bytes` if there is none.
template <class R>
std::size_t free_slot(const std::uint8_t* region, std::size_t bytes) {
  for (std::size_t at = 0; at + sizeof(R) <= bytes; at += sizeof(R)) {
    bool erased = true;
    for (std::size_t i = 0; i < sizeof(R) && erased; ++i) erased = region[at + i] == 0xFF;
    if (erased) return at;
  }
  return bytes;
}

}  // namespace h8_15d

// SPDX-License-Identifier: MIT
// Records that survive a power cut: slots of one size in two areas of flash, filled one after the other. The newest
// record that is whole counts, so a cut in any word leaves the last record or the one before it, never a mix.
//
//   slot   magic, bytes, serial, CRC of serial and payload | payload | erased words, free for the owner's marks
//
// Records may change their length with the firmware, slots may not. Not for an ISR, but for `append`, which is when the
// owner says so.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "hal/store.hpp"
#include "wire/crc.hpp"

namespace firmware {

struct RecordHeader {
  std::uint32_t magic, bytes, serial, crc;  // bytes: of the payload, a multiple of four
};
inline constexpr std::size_t header_words = sizeof(RecordHeader) / 4;

inline std::uint32_t record_crc(const RecordHeader& header, const void* payload) {
  const std::uint32_t begun = wire::crc32(reinterpret_cast<const std::uint8_t*>(&header.serial), sizeof header.serial);
  return wire::crc32(static_cast<const std::uint8_t*>(payload), header.bytes, begun);
}

/// Writes the header into the first words of a record whose payload stands behind them.
inline void seal(std::span<std::uint32_t> record, std::uint32_t magic, std::uint32_t serial) {
  RecordHeader header{magic, static_cast<std::uint32_t>(4 * (record.size() - header_words)), serial, 0};
  header.crc = record_crc(header, record.data() + header_words);
  std::memcpy(record.data(), &header, sizeof header);
}

/// The payload of the record that begins `memory`; empty unless it is whole.
inline std::span<const std::uint8_t> whole_payload(std::span<const std::uint8_t> memory, std::uint32_t magic) {
  RecordHeader header;
  if (memory.size() < sizeof header) return {};
  std::memcpy(&header, memory.data(), sizeof header);
  if (header.magic != magic || header.bytes == 0 || header.bytes % 4 != 0 ||
      header.bytes > memory.size() - sizeof header)
    return {};
  const auto payload = memory.subspan(sizeof header, header.bytes);
  return header.crc == record_crc(header, payload.data()) ? payload : std::span<const std::uint8_t>{};
}

class RecordLog {
 public:
  constexpr RecordLog(std::uint32_t magic, std::size_t slot_bytes) : magic_(magic), slot_bytes_(slot_bytes) {}

  /// Looks through both areas. Call once before anything else.
  template <hal::Store S>
  void find(const S& store) {
    found_ = {};
    for (int area = 0; area < hal::store_areas; ++area) {
      const std::span<const std::uint8_t> all = store.area(area);
      free_[area] = 0;
      for (std::size_t at = 0; at + slot_bytes_ <= all.size(); at += slot_bytes_) {
        const std::span<const std::uint8_t> slot = all.subspan(at, slot_bytes_);
        // An erase that was cut leaves gaps, so does a write that took no word. Behind the first one word tells.
        if (erased(slot.first(at > free_[area] ? sizeof(std::uint32_t) : slot_bytes_))) continue;
        free_[area] = at + slot_bytes_;
        const std::span<const std::uint8_t> payload = whole_payload(slot, magic_);
        if (payload.empty()) continue;
        std::uint32_t serial;
        std::memcpy(&serial, slot.data() + offsetof(RecordHeader, serial), sizeof serial);
        if (found_.payload.empty() || static_cast<std::int32_t>(serial - found_.serial) > 0)
          found_ = {payload, serial, area, at};
      }
    }
  }

  struct Found {
    std::span<const std::uint8_t> payload;  // empty: there is none
    std::uint32_t serial = 0;
    int area = 0;
    std::size_t at = 0;
  };
  const Found& newest() const { return found_; }

  /// May erase the area that does not hold the newest record: takes seconds, so only before the watchdogs run.
  template <hal::Store S>
  void make_room(S& store) {
    const int other = 1 - found_.area;
    if (room(store, found_.area) >= 8 * slot_bytes_ || free_[other] == 0) return;
    if (store.erase(other)) free_[other] = 0;
  }

  enum class Written : std::uint8_t { done, no_room, differs };

  /// Seals the record with the next serial number, writes it and reads it back whole.
  template <hal::Store S>
  Written append(S& store, std::span<std::uint32_t> record) {
    int area = found_.area;
    if (room(store, area) < slot_bytes_) area = 1 - area;
    if (4 * record.size() > slot_bytes_ || room(store, area) < slot_bytes_) return Written::no_room;
    const std::size_t at = free_[area];
    free_[area] += slot_bytes_;  // whatever happens, nobody writes over it
    seal(record, magic_, found_.serial + 1);
    const bool good = store.program(area, at, record);
    const std::span<const std::uint8_t> payload = whole_payload(store.area(area).subspan(at, slot_bytes_), magic_);
    if (!good || payload.empty()) return Written::differs;
    found_ = {payload, found_.serial + 1, area, at};
    return Written::done;
  }

 private:
  static bool erased(std::span<const std::uint8_t> slot) {
    for (const std::uint8_t byte : slot) {
      if (byte != 0xFF) return false;
    }
    return true;
  }
  template <hal::Store S>
  std::size_t room(const S& store, int area) const {
    return store.area(area).size() - free_[area];
  }

  std::uint32_t magic_;
  std::size_t slot_bytes_;
  Found found_;
  std::size_t free_[hal::store_areas] = {};
};

}  // namespace firmware

// SPDX-License-Identifier: MIT
#include "boards/h8-15d/heat_keeper.hpp"

#include <cstring>

namespace h8_15d {

namespace {

constexpr std::uint32_t backup_slot(int which) {
  return backup_ram + static_cast<std::uint32_t>(which) * HeatKeeper::slot_bytes;
}

void memory_of(std::span<const std::uint8_t> payload, firmware::DriverMemory& memory) {
  std::memcpy(static_cast<void*>(&memory), payload.data(), sizeof memory);
}

}  // namespace

Recalled HeatKeeper::recall(firmware::DriverMemory& memory) {
  Recalled from = Recalled::nothing;
  log_.find(flash_);
  const firmware::RecordLog::Found& journal = log_.newest();
  if (journal.payload.size() == sizeof memory) {
    const std::span<const std::uint8_t> slot = flash_.area(journal.area).subspan(journal.at, slot_bytes);
    std::uint32_t used;
    std::memcpy(&used, slot.data() + used_mark_at, sizeof used);
    if (used == 0xFFFFFFFFu) {
      memory_of(journal.payload, memory);
      from = Recalled::journal;
      constexpr std::uint32_t mark[1] = {0};
      flash_.program(journal.area, journal.at + used_mark_at, mark);
    }
  }
  for (int i = 0; i < 2; ++i) {  // where backup memory is whole it is as new as can be
    Record& kept = records_[i];
    for (std::uint32_t w = 0; w < record_words; ++w) kept[w] = reg(backup_slot(i) + 4 * w);
    const auto payload = firmware::whole_payload({reinterpret_cast<const std::uint8_t*>(kept), sizeof kept}, magic);
    if (payload.size() != sizeof memory) continue;
    firmware::RecordHeader header;
    std::memcpy(&header, kept, sizeof header);
    if (from == Recalled::backup_memory && static_cast<std::int32_t>(header.serial - serial_) < 0) continue;
    memory_of(payload, memory);
    serial_ = header.serial;
    newest_ = i;
    from = Recalled::backup_memory;
  }
  log_.make_room(flash_);
  return from;
}

void HeatKeeper::keep(const firmware::DriverMemory& now) {
  const int next = newest_.load(std::memory_order_relaxed) == 0 ? 1 : 0;
  Record& record = records_[next];
  std::memcpy(record + firmware::header_words, &now, sizeof now);
  firmware::seal(record, magic, ++serial_);
  for (std::uint32_t w = 0; w < record_words; ++w) reg(backup_slot(next) + 4 * w) = record[w];
  newest_.store(next, std::memory_order_release);
}

void HeatKeeper::last_words(bool watched) {
  const int newest = newest_.load(std::memory_order_relaxed);
  if (newest < 0 || spoken_) return;
  spoken_ = true;
  if (watched) flash_.feed_while_writing();
  (void)log_.append(flash_, records_[newest]);
}

}  // namespace h8_15d

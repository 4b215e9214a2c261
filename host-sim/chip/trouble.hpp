// SPDX-License-Identifier: MIT
// What the firmware did wrong, in plain words. A chip forgives most mistakes silently; the model writes each of them
// down with the address, the program counter and the time. Nothing here knows which peripheral it was.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace host_sim::chip {

/// Model time. 336 MHz is the smallest rate in which HSI (16 MHz), HSE (8 MHz) and 168 MHz are whole numbers of ticks.
using Time = std::uint64_t;
inline constexpr Time ticks_per_s = 336'000'000;
inline constexpr Time never = ~Time{0};

constexpr double to_s(Time t) { return static_cast<double>(t) / static_cast<double>(ticks_per_s); }
constexpr Time from_s(double s) { return static_cast<Time>(s * static_cast<double>(ticks_per_s) + 0.5); }

/// One mistake of the firmware.
struct Trouble {
  std::string what;
  std::uint32_t address;
  std::uint32_t pc;
  Time when;
};

/// Collects troubles; the same words from the same place are kept once and counted.
class Troubles {
 public:
  void report(std::string what, std::uint32_t address, std::uint32_t pc, Time when) {
    ++count_;
    for (const Trouble& t : list_) {
      if (t.pc == pc && t.address == address && t.what == what) return;
    }
    if (list_.size() < 200) list_.push_back({std::move(what), address, pc, when});
  }
  const std::vector<Trouble>& list() const { return list_; }
  std::uint64_t count() const { return count_; }
  void clear() {
    list_.clear();
    count_ = 0;
  }
  bool mention(const std::string& part) const {
    for (const Trouble& t : list_) {
      if (t.what.find(part) != std::string::npos) return true;
    }
    return false;
  }

 private:
  std::vector<Trouble> list_;
  std::uint64_t count_ = 0;
};

}  // namespace host_sim::chip

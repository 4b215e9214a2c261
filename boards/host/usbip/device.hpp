// SPDX-License-Identifier: MIT
// A full-speed USB device at the end of a cable, as a host controller sees it: tokens, line states, and time that
// passes. Met by the chip model's OTG_FS and by the simulated board of the PC.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace boards::usb {

struct Answer {
  enum Kind { none, ack, nak, stall } kind = none;
  bool data1 = false;                 // IN only
  std::vector<std::uint8_t> bytes{};  // IN only
};

class Device {
 public:
  virtual ~Device() = default;
  virtual void plug(bool in) = 0;
  virtual bool attached() const = 0;  // its pull-up is seen
  virtual void bus_reset() = 0;       // over when `run` has passed 10 ms
  virtual Answer setup(unsigned address, const std::array<std::uint8_t, 8>& request) = 0;
  virtual Answer out(unsigned address, int endpoint, bool data1, std::span<const std::uint8_t> bytes) = 0;
  virtual Answer in(unsigned address, int endpoint) = 0;
  virtual void run(double seconds) = 0;
  virtual void power_cycle() = 0;  // its supply goes and comes back; what it saved stays
};

}  // namespace boards::usb

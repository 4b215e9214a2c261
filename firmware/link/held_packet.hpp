// SPDX-License-Identifier: MIT
// A packet that came and is looked at byte by byte, as its stream has room for what it makes of it. USB context.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "hal/usb_port.hpp"

namespace firmware {

class HeldPacket {
 public:
  void take(const std::uint8_t* data, std::size_t bytes) {
    next_ = 0;
    count_ = std::min(bytes, sizeof bytes_);
    std::memcpy(bytes_, data, count_);
  }
  void drop() { next_ = count_ = 0; }
  bool empty() const { return next_ == count_; }
  std::uint8_t next() { return bytes_[next_++]; }

 private:
  std::uint8_t bytes_[hal::usb_packet_bytes]{};
  std::size_t next_ = 0, count_ = 0;
};

}  // namespace firmware

// SPDX-License-Identifier: MIT
// Frames on a byte stream. A frame is kind, sequence, length, payload and CRC-32, packed by COBS so that the byte 0
// stands only between frames: a reader that comes late or lost a byte is in step again at the next 0.
//
//   before COBS   u8 kind | u8 sequence | u16 bytes | payload[bytes] | u32 CRC-32 of all before it     little endian
//
// COBS: Cheshire, Baker: "Consistent overhead byte stuffing", IEEE/ACM Trans. Networking 7 (1999): each code byte n is
// followed by n - 1 bytes as they are, and then by a 0 unless n is 255 or the frame ends. No heap, bounded, ISR.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "wire/crc.hpp"

namespace wire {

inline constexpr std::size_t max_payload = 480, frame_head = 4, frame_tail = 4;
inline constexpr std::size_t max_frame = frame_head + max_payload + frame_tail;
/// COBS adds a byte to every 254 that were begun, the delimiter one more.
constexpr std::size_t encoded_bytes(std::size_t payload) {
  const std::size_t frame = frame_head + payload + frame_tail;
  return frame + frame / 254 + 2;
}
inline constexpr std::size_t max_encoded = encoded_bytes(max_payload);

/// A frame that passed its CRC. The payload lies in the reader and holds until its next byte.
struct Frame {
  std::uint8_t kind = 0, sequence = 0;
  std::uint16_t bytes = 0;
  const std::uint8_t* payload = nullptr;
};

/// Writes a whole frame with its delimiter; returns its bytes, or 0 if it cannot be one or has no room.
constexpr std::size_t encode(const Frame& frame, std::uint8_t* out, std::size_t room) {
  if (frame.bytes > max_payload || room < encoded_bytes(frame.bytes)) return 0;
  std::size_t code_at = 0, at = 1;
  std::uint8_t run = 1;
  std::uint32_t crc = 0xFFFF'FFFFu;
  const auto put = [&](std::uint8_t byte) {
    crc = crc32(&byte, 1, crc);
    if (byte != 0) {
      out[at++] = byte;
      ++run;
    }
    if (byte == 0 || run == 255) {
      out[code_at] = run;
      code_at = at++;
      run = 1;
    }
  };
  put(frame.kind);
  put(frame.sequence);
  put(static_cast<std::uint8_t>(frame.bytes));
  put(static_cast<std::uint8_t>(frame.bytes >> 8));
  for (std::size_t i = 0; i < frame.bytes; ++i) put(frame.payload[i]);
  const std::uint32_t check = ~crc;
  for (int shift = 0; shift < 32; shift += 8) put(static_cast<std::uint8_t>(check >> shift));
  out[code_at] = run;
  out[at++] = 0;
  return at;
}

/// Finds frames in a stream, byte by byte.
class FrameReader {
 public:
  /// True: a whole frame has just ended; it is `frame()` until the next byte.
  constexpr bool take(std::uint8_t byte) {
    if (byte == 0) return end();
    if (left_ == 0) {
      if (owes_zero_) store(0);
      owes_zero_ = byte != 255;
      left_ = static_cast<std::uint8_t>(byte - 1);
      begun_ = true;
    } else {
      store(byte);
      --left_;
    }
    return false;
  }

  const Frame& frame() const { return frame_; }
  /// Frames that were not whole: torn, too long, wrong length or wrong CRC.
  constexpr std::uint32_t bad() const { return bad_; }

  /// Forgets a frame that was begun (the other side is new).
  constexpr void restart() { at_ = 0, left_ = 0, owes_zero_ = false, begun_ = false, too_long_ = false; }

 private:
  constexpr void store(std::uint8_t byte) {
    if (at_ < max_frame)
      buffer_[at_++] = byte;
    else
      too_long_ = true;
  }

  constexpr bool end() {
    const bool good = left_ == 0 && !too_long_ && sound();
    if (begun_ && !good) ++bad_;
    restart();
    return good;
  }

  constexpr bool sound() {
    if (at_ < frame_head + frame_tail) return false;
    const auto bytes = static_cast<std::uint16_t>(buffer_[2] | buffer_[3] << 8);
    if (at_ != frame_head + bytes + frame_tail) return false;
    const std::uint32_t check = ~crc32(buffer_, frame_head + bytes);
    for (std::size_t i = 0; i < frame_tail; ++i) {
      if (buffer_[frame_head + bytes + i] != static_cast<std::uint8_t>(check >> (8 * i))) return false;
    }
    frame_ = {buffer_[0], buffer_[1], bytes, buffer_ + frame_head};
    return true;
  }

  std::uint8_t buffer_[max_frame]{};
  std::size_t at_ = 0;
  std::uint8_t left_ = 0;  // of the present COBS run
  bool owes_zero_ = false, begun_ = false, too_long_ = false;
  std::uint32_t bad_ = 0;
  Frame frame_;
};

}  // namespace wire

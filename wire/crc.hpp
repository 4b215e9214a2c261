// SPDX-License-Identifier: MIT
// CRC-32 of IEEE 802.3 (reflected polynomial 0xEDB88320), four bits a step: a table of 64 bytes, no heap, ISR.
#pragma once

#include <cstddef>
#include <cstdint>

namespace wire {

/// The bare register: begin with all ones, go on with what came back. Complemented it is the usual CRC-32.
constexpr std::uint32_t crc32(const std::uint8_t* data, std::size_t bytes, std::uint32_t crc = 0xFFFF'FFFFu) {
  constexpr std::uint32_t nibble[16] = {0x0000'0000, 0x1DB7'1064, 0x3B6E'20C8, 0x26D9'30AC, 0x76DC'4190, 0x6B6B'51F4,
                                        0x4DB2'6158, 0x5005'713C, 0xEDB8'8320, 0xF00F'9344, 0xD6D6'A3E8, 0xCB61'B38C,
                                        0x9B64'C2B0, 0x86D3'D2D4, 0xA00A'E278, 0xBDBD'F21C};
  for (std::size_t i = 0; i < bytes; ++i) {
    crc = (crc >> 4) ^ nibble[(crc ^ data[i]) & 15];
    crc = (crc >> 4) ^ nibble[(crc ^ (data[i] >> 4)) & 15];
  }
  return crc;
}

}  // namespace wire

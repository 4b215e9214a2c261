// SPDX-License-Identifier: MIT
// What the device says it is: one vendor interface with the frames of wire/ (WinUSB on Windows without a driver, by BOS
// and MS OS 2.0), and a CDC-ACM text port for people without the tool. No WebUSB and no DFU.
//
// Sources: USB 2.0 chapter 9 ("9.x"); USB 3.2 9.6.2 for the BOS; IAD ECN; CDC 1.2 and PSTN 1.2; Microsoft OS 2.0
// Descriptors Specification (July 2018), tables 4 and 10 to 15 ("MS x").
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/usb_port.hpp"
#include "wire/protocol.hpp"

namespace firmware::usb {

/// What differs from board to board. All texts outlive the device.
struct Identity {
  const char* board;     // at most 15 characters
  const char* firmware;  // version, at most 15 characters
  const char* serial;    // unique, printable, at most 27 characters
};

inline constexpr std::uint8_t interface_count = 3, text_control_interface = 1, text_data_interface = 2;
inline constexpr std::uint8_t notify_endpoint = 0x82, text_out_endpoint = 0x03, text_in_endpoint = 0x83;
inline constexpr std::uint8_t ms_vendor_code = 0x20;  // bRequest under which Windows asks for the MS OS 2.0 set
inline constexpr std::uint16_t ms_set_index = 7;      // wIndex with it, MS table 8

enum class Descriptor : std::uint8_t { device = 1, configuration = 2, string = 3, bos = 15 };  // 9.4, BOS: USB 3.2 9.4

struct Bytes {
  const std::uint8_t* data;
  std::uint16_t count;  // 0: there is no such descriptor
};

Bytes device_descriptor();
Bytes configuration_descriptor();
Bytes bos_descriptor();
Bytes ms_os_20_set();

/// A string descriptor (index 0: the languages) written to `out`; returns its bytes, 0 if there is none.
inline constexpr std::size_t max_string_bytes = 64;
std::uint16_t string_descriptor(std::uint8_t index, const Identity& identity, std::uint8_t (&out)[max_string_bytes]);
inline constexpr std::uint16_t language = 0x0409;  // English (United States), USB Language Identifiers 1.0

}  // namespace firmware::usb

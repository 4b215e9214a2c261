// SPDX-License-Identifier: MIT
// Endpoint 0 as a state machine: each SETUP is looked up in a whitelist with exact lengths and becomes one order for
// the device; what it does not hold is refused (stall). Nothing survives a SETUP or a bus reset but address,
// configuration, halts and the text port's line coding. One clamp, in `answer`. No port in sight: a pure class.
//
// Sources: USB 2.0 8.5.3 (control transfers), 9.2.7, 9.4; PSTN 1.2 6.3.
#pragma once

#include <cstdint>

#include "firmware/usb/descriptors.hpp"

namespace firmware::usb {

struct Setup {
  std::uint8_t type, request;
  std::uint16_t value, index, length;

  static constexpr Setup from(const std::uint8_t* raw) {
    const auto word = [raw](int at) { return static_cast<std::uint16_t>(raw[at] | raw[at + 1] << 8); };
    return {raw[0], raw[1], word(2), word(4), word(6)};
  }
};

enum class Order : std::uint8_t {
  refuse,       // stall
  answer,       // send what next_packet() gives, take a zero-length packet as status
  receive,      // take one packet for received(), then as `acknowledge`
  acknowledge,  // done: send a zero-length packet as status
  address,      // ... after telling the port argument() as its address
  configure,    // ... after opening all endpoints (argument() 1) or closing them (0)
  halt,         // ... after stalling endpoint argument()
  unhalt,       // ... after ending that stall, data toggle at DATA0
  restart,      // ... after ending the stalls of interface argument(), its data toggles at DATA0 (SET_INTERFACE)
};

/// PSTN 1.2 table 17. Kept because hosts want to read back what they wrote; there is no line.
struct LineCoding {
  std::uint8_t raw[7]{0x00, 0xC2, 0x01, 0x00, 0, 0, 8};  // 115200 baud, 1 stop bit, no parity, 8 bits
};

class Control {
 public:
  explicit Control(const Identity& identity) : identity_(&identity) {}

  /// A bus reset: address 0, not configured, nothing under way.
  void reset();
  /// 8 bytes. Ends whatever was under way.
  Order setup(const std::uint8_t* raw);
  std::uint8_t argument() const { return argument_; }

  /// The next packet of an answer; false: nothing is left to send.
  bool next_packet(Bytes& packet);
  /// Data of endpoint 0 that the host sent. `acknowledge`, `refuse`, or `answer`: that was the status of an answer,
  /// nothing is to be done.
  Order received(const std::uint8_t* data, std::size_t bytes);

  bool configured() const { return configured_; }
  bool halted(std::uint8_t endpoint) const { return (halted_ & halt_bit(endpoint)) != 0; }

 private:
  Order standard(const Setup& s);
  Order descriptor(const Setup& s);
  Order answer(Bytes all, const Setup& s);
  Order answer_word(std::uint16_t word, std::uint16_t bytes, const Setup& s);
  Order feature(const Setup& s, Order order);
  bool reaches(std::uint8_t endpoint) const;
  static std::uint16_t halts_of(std::uint8_t interface);
  static constexpr std::uint16_t halt_bit(std::uint8_t endpoint) {
    return static_cast<std::uint16_t>(1u << ((endpoint & 7u) + (endpoint & hal::endpoint_in ? 8u : 0u)));
  }

  const Identity* identity_;
  std::uint8_t address_ = 0, argument_ = 0;
  bool configured_ = false;
  std::uint16_t halted_ = 0;
  LineCoding line_;

  // Of the transfer under way.
  Bytes left_{nullptr, 0};
  bool short_end_ = false;  // the answer is shorter than asked and fills its packets: a zero-length one must end it
  bool receiving_ = false;
  std::uint8_t scratch_[max_string_bytes]{};
};

}  // namespace firmware::usb

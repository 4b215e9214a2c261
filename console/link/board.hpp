// SPDX-License-Identifier: MIT
// One board as a robot's process uses it: frames out, frames in, never blocking, many boards in one thread.
//
//   Board board(usb.open("3A00"));
//   for (;;) {                                       // 1 kHz, say
//     const wire::Setpoints wish{3, {}, 0, {}, {iq_A[0], iq_A[1]}};  // both axes; the reply is their state
//     board.write(static_cast<std::uint8_t>(wire::Kind::setpoint), bytes_of(wish));
//     while (const wire::Frame* frame = board.read())  // everything that has arrived
//       if (const auto state = state_in(*frame)) ...
//   }
//
// No memory is taken after the constructor, neither here nor in the transports of this library. libusb itself (1.0.26,
// submit_bulk_transfer in os/linux_usbfs.c) callocs one block for each transfer that it hands to the kernel and frees
// it when the transfer is back; that is out of our hands. A frame that is torn or fails its CRC is counted and dropped;
// nothing that a device sends is believed before it was checked (console/link/messages.hpp). Not for two threads at a
// time.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "console/link/transport.hpp"
#include "wire/framer.hpp"

namespace console::link {

class Board {
 public:
  explicit Board(std::unique_ptr<Transport> transport) : transport_(std::move(transport)) {}

  /// Sends a frame. Its sequence number, which the reply repeats; nothing while the way out is full or the board is
  /// gone.
  std::optional<std::uint8_t> write(std::uint8_t kind, std::span<const std::uint8_t> payload);

  /// The next frame that has arrived whole, or nullptr. It holds until the next call. Looks at 4 KB at most, so that a
  /// board which never falls silent does not keep its caller.
  const wire::Frame* read();

  /// Returns when something has happened, at the latest after so many milliseconds.
  void wait(int milliseconds) { transport_->wait(milliseconds); }

  double now_s() const { return transport_->now_s(); }
  bool gone() const { return transport_->gone(); }
  int restarts() const { return transport_->restarts(); }
  /// Frames that did not arrive whole.
  std::uint32_t bad_frames() const { return reader_.bad(); }

 private:
  std::unique_ptr<Transport> transport_;
  wire::FrameReader reader_;
  std::uint8_t sequence_ = 0;
  std::array<std::uint8_t, wire::max_encoded> out_;
  std::array<std::uint8_t, 4096> in_;  // read and not yet looked at
  std::size_t in_at_ = 0, in_end_ = 0;
};

}  // namespace console::link

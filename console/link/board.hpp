// SPDX-License-Identifier: MIT
// One board as a robot's process uses it: frames out, frames in, never blocking, many boards in one thread.
//
//   Usb usb;                                           // or, without hardware, simulated_board({...}): sim.hpp
//   Board board(usb.open("3A00"));
//   board.write(wire::Kind::hello);                    // its answer, by hello_in(): of another protocol than
//   ...                                                // wire::protocol_version, believe nothing else
//   board.write(wire::Kind::arm, bytes_of(wire::Axes{3}));
//   for (;;) {                                         // 1 kHz, say; setpoints older than 100 ms fade
//     const wire::Setpoints wish{3, {}, 0, {}, {iq_A[0], iq_A[1]}};  // both axes; the reply is their state
//     board.write(wire::Kind::setpoint, bytes_of(wish));
//     board.wait(1);                                   // moves the bytes of all boards of one Usb
//     while (const wire::Frame* frame = board.read())  // everything that has arrived
//       if (const auto state = state_in(*frame)) ...
//   }
//
// In a project of your own: add_subdirectory(hotcore EXCLUDE_FROM_ALL), target_link_libraries(robot PRIVATE
// console_link virtual_board), the latter for simulated boards only.
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
#include "wire/protocol.hpp"

namespace console::link {

template <class Message>
std::span<const std::uint8_t> bytes_of(const Message& message) {
  return {reinterpret_cast<const std::uint8_t*>(&message), sizeof message};
}

class Board {
 public:
  explicit Board(std::unique_ptr<Transport> transport) : transport_(std::move(transport)) {}

  /// Sends a request, of a struct of wire/protocol.hpp: write(wire::Kind::arm, bytes_of(wire::Axes{3})).
  std::optional<std::uint8_t> write(wire::Kind kind, std::span<const std::uint8_t> payload = {}) {
    return write(static_cast<std::uint8_t>(kind), payload);
  }
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

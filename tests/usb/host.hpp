// SPDX-License-Identifier: MIT
// A host for tests: control transfers as a host controller cuts them, enumeration, and a program at the link.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <deque>
#include <optional>
#include <vector>

#include "boards/host/virtual/virtual_board.hpp"
#include "tests/firmware/bench.hpp"

namespace usb_host {

using boards::host::Handshake;
using boards::host::VirtualBoard;
using Bytes = std::vector<std::uint8_t>;

inline boards::host::VirtualBoardOptions options() {
  boards::host::VirtualBoardOptions o;
  o.motor = bench::motor();
  return o;
}

struct Request {
  std::uint8_t type, request;
  std::uint16_t value, index, length;
  std::array<std::uint8_t, 8> raw() const {
    const auto low = [](unsigned x) { return static_cast<std::uint8_t>(x & 0xFF); };
    return {type, request, low(value), low(value >> 8u), low(index), low(index >> 8u), low(length), low(length >> 8u)};
  }
};

/// The result of a control transfer: what came, or nothing if the device refused.
using Transfer = std::optional<Bytes>;

template <class Bus>
Transfer control(Bus& bus, std::uint8_t address, const Request& r, const Bytes& data = {}) {
  if (bus.setup(address, r.raw().data()) != Handshake::ack) return {};
  Bytes came;
  typename Bus::Packet packet;
  if ((r.type & 0x80) != 0 && r.length > 0) {
    for (;;) {
      if (bus.in(address, 0x80, packet) != Handshake::ack) return {};
      came.insert(came.end(), packet.data.begin(), packet.data.begin() + static_cast<long>(packet.bytes));
      if (packet.bytes < hal::usb_packet_bytes || came.size() >= r.length) break;
    }
    if (came.size() > r.length) return {};  // more than asked: babble
    if (bus.out(address, 0x00, true, {}) != Handshake::ack) return {};
    return came;
  }
  if (!data.empty() && bus.out(address, 0x00, true, data) != Handshake::ack) return {};
  if (bus.in(address, 0x80, packet) != Handshake::ack || packet.bytes != 0) return {};
  return came;
}

/// A program at the link of one board, whose time it passes.
class Program {
 public:
  explicit Program(VirtualBoard& board) : board_(&board) {}

  /// From the plug to "configured", in the fewest steps.
  void connect() {
    board_->bus().plug();
    board_->bus().reset();
    out_data1_ = in_data1_ = false;
    reader_.restart();
    ASSERT_TRUE(control(board_->bus(), 0, {0x00, 5, address, 0, 0}));
    ASSERT_TRUE(control(board_->bus(), address, {0x00, 9, 1, 0, 0}));
  }

  /// SET_FEATURE and CLEAR_FEATURE(ENDPOINT_HALT), as after an error on the bus.
  void halt_and_clear(std::uint8_t endpoint) {
    for (const std::uint8_t feature : {std::uint8_t{3}, std::uint8_t{1}})
      ASSERT_TRUE(control(board_->bus(), address, {0x02, feature, 0, endpoint, 0}));
    ((endpoint & hal::endpoint_in) != 0 ? in_data1_ : out_data1_) = false;
  }
  /// Gives up what was not sent yet.
  void give_up() { to_send_.clear(); }

  void write(const Bytes& bytes) { to_send_.insert(to_send_.end(), bytes.begin(), bytes.end()); }
  void ask(wire::Kind kind, const Bytes& payload = {}) { write(framed(kind, ++sequence_, payload)); }
  std::uint8_t sequence() const { return sequence_; }

  static Bytes framed(wire::Kind kind, std::uint8_t sequence, const Bytes& payload) {
    Bytes out(wire::max_encoded);
    out.resize(wire::encode(
        {static_cast<std::uint8_t>(kind), sequence, static_cast<std::uint16_t>(payload.size()), payload.data()},
        out.data(), out.size()));
    return out;
  }

  /// One packet each way, if there is one.
  void exchange() {
    if (!to_send_.empty()) {
      const std::size_t bytes = std::min<std::size_t>(to_send_.size(), hal::usb_packet_bytes);
      const Bytes packet(to_send_.begin(), to_send_.begin() + static_cast<long>(bytes));
      if (board_->bus().out(address, wire::link_out_endpoint, out_data1_, packet) == Handshake::ack) {
        out_data1_ = !out_data1_;
        to_send_.erase(to_send_.begin(), to_send_.begin() + static_cast<long>(bytes));
      }
    }
    typename boards::host::UsbBus<VirtualBoard::Device>::Packet packet;
    if (board_->bus().in(address, wire::link_in_endpoint, packet) != Handshake::ack) return;
    EXPECT_EQ(packet.data1, in_data1_);
    in_data1_ = !in_data1_;
    for (const std::uint8_t byte : packet.view()) {
      if (reader_.take(byte)) {
        const wire::Frame& f = reader_.frame();
        frames_.push_back({f.kind, f.sequence, Bytes(f.payload, f.payload + f.bytes)});
      }
    }
  }

  struct Heard {
    std::uint8_t kind, sequence;
    Bytes payload;
  };
  /// The answer to the last `ask`; up to a second of simulated time. Empty: none came.
  std::optional<Heard> answer(int most_periods = 20000) {
    for (int i = 0; i < most_periods; ++i) {
      exchange();
      while (!frames_.empty()) {
        const Heard heard = frames_.front();
        frames_.pop_front();
        if ((heard.kind & wire::reply_bit) != 0 && heard.sequence == sequence_) return heard;
        if (heard.kind == static_cast<std::uint8_t>(wire::Kind::telemetry)) telemetry.push_back(heard.payload);
      }
      board_->advance(1);
    }
    return {};
  }
  std::optional<Heard> call(wire::Kind kind, const Bytes& payload = {}) {
    ask(kind, payload);
    return answer();
  }
  template <class Message>
  Message call_for(wire::Kind kind, const Bytes& payload = {}) {
    Message message{};
    const std::optional<Heard> heard = call(kind, payload);
    if (!heard || !wire::read(heard->payload.data(), heard->payload.size(), message))
      ADD_FAILURE() << "no answer, or a refusal, to kind " << static_cast<int>(kind);
    return message;
  }
  /// Status of the answer; 0xFF: there was none.
  std::uint8_t status(wire::Kind kind, const Bytes& payload = {}) {
    const std::optional<Heard> heard = call(kind, payload);
    return heard && !heard->payload.empty() ? heard->payload[0] : 0xFF;
  }
  void pass(int periods) {
    for (int i = 0; i < periods; ++i) {
      exchange();
      board_->advance(1);
    }
  }
  std::deque<Heard>& frames() { return frames_; }
  std::vector<Bytes> telemetry;

  static constexpr std::uint8_t address = 5;

 private:
  VirtualBoard* board_;
  wire::FrameReader reader_;
  std::deque<std::uint8_t> to_send_;
  std::deque<Heard> frames_;
  bool out_data1_ = false, in_data1_ = false;
  std::uint8_t sequence_ = 0;
};

/// The bytes of one or more messages.
template <class... Messages>
Bytes bytes_of(const Messages&... messages) {
  Bytes out;
  const auto add = [&](const auto& m) {
    const std::size_t at = out.size();
    out.resize(at + sizeof m);
    std::memcpy(out.data() + at, &m, sizeof m);
  };
  (add(messages), ...);
  return out;
}

}  // namespace usb_host

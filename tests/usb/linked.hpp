// SPDX-License-Identifier: MIT
// A program at the link of a virtual board, as a fixture.
#pragma once

#include "tests/usb/host.hpp"

namespace usb_host {

using wire::Kind;
using wire::Status;

inline constexpr std::uint8_t id_iq = 0x02, id_rotor = 0x0F, id_mode = 0x11, id_bus = 0x0E;
constexpr auto number(Status s) { return static_cast<std::uint8_t>(s); }

struct Linked : testing::Test {
  VirtualBoard board{options()};
  Program program{board};

  void SetUp() override {
    board.advance(3000);  // offsets are learnt
    program.connect();
  }
  void TearDown() override { EXPECT_EQ(board.violation(), nullptr) << board.violation(); }

  void arm(std::uint8_t mask) {
    ASSERT_EQ(program.status(Kind::arm, {mask}), 0);
    board.advance(2);
  }
  static Bytes setpoint(std::uint8_t mask, float iq_0, float iq_1 = 0.0f) {
    return bytes_of(wire::Setpoints{mask, {}, 0, {0, 0}, {iq_0, iq_1}});
  }
  wire::State set(std::uint8_t mask, float iq_0, float iq_1 = 0.0f) {
    return program.call_for<wire::State>(Kind::setpoint, setpoint(mask, iq_0, iq_1));
  }
  firmware::Axis& axis(int i) { return board.driver().axis(i); }
};

}  // namespace usb_host

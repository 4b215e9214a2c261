// SPDX-License-Identifier: MIT
// The link as a stream: pipelined, full, torn by a halt, a bus reset or a pulled cable.

#include <random>

#include "tests/usb/linked.hpp"

namespace {

using namespace usb_host;

TEST_F(Linked, RequestsMayBePipelinedAndAreAnsweredInOrder) {
  for (std::uint8_t i = 0; i < 60; ++i) program.write(Program::framed(Kind::describe_parameter, i, {i, 0}));
  program.pass(400);
  std::uint8_t expected = 0;
  for (const Program::Heard& h : program.frames()) EXPECT_EQ(h.sequence, expected++);
  EXPECT_EQ(expected, 60);
}

TEST_F(Linked, AHostThatNeverReadsIsToldToWaitAndThenLeft) {
  arm(1);
  for (int k = 0; k < 10; ++k) set(1, 1.0f), program.pass(20);
  const Bytes frame = Program::framed(Kind::setpoint, 0, setpoint(1, 1.0f));
  bool data1 = board.bus().toggle(wire::link_out_endpoint);
  int waits = 0;
  for (int k = 0; k < 500; ++k) {
    const Handshake h = board.bus().out(Program::address, wire::link_out_endpoint, data1, frame);
    if (h == Handshake::ack) data1 = !data1;
    waits += h == Handshake::nak;
    board.advance(20);
  }
  EXPECT_GT(waits, 400);
  EXPECT_EQ(axis(0).mode(), firmware::Mode::ready);
}

/// A halt drops the packet in flight and nothing else: who is torn out of step is in step again at the next delimiter.
TEST_F(Linked, AHaltInTheMiddleOfARequestCostsItAndAtMostTheNext) {
  for (int written = 1; written < 4; ++written) {
    const std::uint32_t bad = board.link().bad_frames();
    program.ask(Kind::stage, Bytes(7 * 40));  // five packets
    for (int i = 0; i < written; ++i) program.exchange();
    program.halt_and_clear(wire::link_out_endpoint);
    program.give_up();
    program.ask(Kind::state);
    EXPECT_FALSE(program.answer(400)) << "swallowed: it had no delimiter in front";
    EXPECT_EQ(program.status(Kind::state), 0) << written;
    EXPECT_EQ(board.link().bad_frames(), bad + 1) << "the torn one and the swallowed one look like one";
  }
}

TEST_F(Linked, ADelimiterInFrontSavesTheNextRequestToo) {
  program.ask(Kind::stage, Bytes(7 * 40));
  program.exchange();
  program.halt_and_clear(wire::link_out_endpoint);
  program.give_up();
  program.write({0});
  EXPECT_EQ(program.status(Kind::state), 0);
}

TEST_F(Linked, AHaltInTheMiddleOfAnAnswerCostsItAndAtMostTheNext) {
  for (int read = 1; read < 4; ++read) {
    program.ask(Kind::get, Bytes(3 * 60));
    program.exchange();
    for (int i = 0; i < read; ++i) program.exchange();
    program.halt_and_clear(wire::link_in_endpoint);
    program.ask(Kind::state);
    (void)program.answer(400);
    EXPECT_EQ(program.status(Kind::state), 0) << read;
    EXPECT_EQ(program.status(Kind::state), 0) << read;
  }
}

TEST_F(Linked, ABusResetInTheMiddleOfAFrameCostsNothingAfterwards) {
  program.ask(Kind::stage, Bytes(7 * 40));
  program.exchange();
  program = Program(board);
  program.connect();
  EXPECT_EQ(program.status(Kind::state), 0) << "the first request of the new session";
}

TEST_F(Linked, ABusResetForgetsAPacketThatWaitedForRoom) {
  bool data1 = board.bus().toggle(wire::link_out_endpoint);
  for (std::uint8_t i = 0; i < 200; ++i) {  // nobody reads: the queue fills, the last packet waits
    const Bytes packet = Program::framed(Kind::describe_parameter, i, {0, 0});
    if (board.bus().out(Program::address, wire::link_out_endpoint, data1, packet) != Handshake::ack) break;
    data1 = !data1;
  }
  program = Program(board);
  program.connect();
  program.pass(200);
  EXPECT_TRUE(program.frames().empty()) << "answers to a host that has gone";
  EXPECT_EQ(program.status(Kind::state), 0);
}

/// Pulled at any instant, the axis is without current after 100 ms and the ramp, and the link comes back.
TEST_F(Linked, TheCableIsPulledFiveHundredTimes) {
  std::mt19937 random(7);
  for (int k = 0; k < 500; ++k) {
    ASSERT_EQ(program.status(Kind::arm, {3}), 0) << k;
    board.advance(2);
    const int until = 20 + static_cast<int>(random() % 600);
    for (int p = 0; p < until; p += 20) {
      program.write(Program::framed(Kind::setpoint, 0, setpoint(3, 3.0f, -3.0f)));
      program.pass(20);
    }
    Bytes torn = Program::framed(Kind::setpoint, 0, setpoint(3, 3.0f, -3.0f));
    torn.resize(random() % torn.size());  // in the middle of a frame
    program.write(torn);
    program.exchange();
    board.advance(static_cast<int>(random() % 20));
    board.bus().unplug();
    board.advance(20 * (100 + 200) + 20);
    for (int i = 0; i < 2; ++i) {
      ASSERT_NE(axis(i).mode(), firmware::Mode::running) << k;
      ASSERT_EQ(board.plant().sample(i).current_A.a, 0.0f);
    }
    program = Program(board);
    program.connect();
    ASSERT_EQ(program.status(Kind::disarm, {3}), 0) << k;
    board.advance(2);
  }
}

}  // namespace

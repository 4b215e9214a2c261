// SPDX-License-Identifier: MIT
// The link over the USB device of a virtual board: every command, good and bad; telemetry; capture; how quickly a
// setpoint is obeyed and how surely a silent host is left.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <string>

#include "boards/dual_48v_20a.hpp"
#include "tests/usb/host.hpp"

namespace {

using namespace usb_host;
using wire::Kind;
using wire::Status;

constexpr std::uint8_t id_iq = 0x02, id_rotor = 0x0F, id_mode = 0x11, id_bus = 0x0E;
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
    return bytes_of(wire::Setpoints{mask, {}, {0, 0}, {iq_0, iq_1}});
  }
  wire::State set(std::uint8_t mask, float iq_0, float iq_1 = 0.0f) {
    return program.call_for<wire::State>(Kind::setpoint, setpoint(mask, iq_0, iq_1));
  }
  firmware::Axis& axis(int i) { return board.driver().axis(i); }
};

/// Strings behind a struct.
std::vector<std::string> texts(const Bytes& payload, std::size_t at) {
  std::vector<std::string> out;
  for (std::string one; at < payload.size(); ++at) {
    if (payload[at] != 0) {
      one += static_cast<char>(payload[at]);
    } else {
      out.push_back(one);
      one.clear();
    }
  }
  return out;
}

TEST_F(Linked, HelloSaysWhoItIs) {
  const auto hello = program.call_for<wire::Hello>(Kind::hello);
  EXPECT_EQ(hello.protocol, wire::protocol_version);
  EXPECT_EQ(hello.max_payload, wire::max_payload);
  EXPECT_STREQ(hello.serial, "SIM0");
  EXPECT_STREQ(hello.board, "virtual");
  EXPECT_EQ(hello.pwm_Hz, 20e3f);
  EXPECT_NE(hello.dictionary_hash, 0u);
  EXPECT_EQ(hello.parameters, firmware::parameter_count);
}

TEST_F(Linked, TheDictionaryIsFetchedWhole) {
  const auto hello = program.call_for<wire::Hello>(Kind::hello);
  std::map<std::string, wire::ParameterText> parameters;
  for (std::uint16_t i = 0; i < hello.parameters; ++i) {
    const auto heard = program.call(Kind::describe_parameter, bytes_of(wire::Index{i}));
    ASSERT_TRUE(heard);
    wire::ParameterText head{};
    ASSERT_TRUE(wire::read(heard->payload.data(), heard->payload.size(), head));
    const auto words = texts(heard->payload, sizeof head);
    ASSERT_EQ(words.size(), 3u) << i;
    parameters[words[0]] = head;
  }
  EXPECT_EQ(parameters.size(), hello.parameters);
  EXPECT_EQ(parameters["current_limit"].fallback, 20.0f);
  EXPECT_TRUE(std::isnan(parameters["flux_linkage"].fallback));
  EXPECT_EQ(parameters["pole_pairs"].flags, wire::needs_disarmed | wire::whole_number);
  for (std::uint16_t i = 0; i < hello.signals; ++i) {
    const auto heard = program.call(Kind::describe_signal, bytes_of(wire::Index{i}));
    ASSERT_TRUE(heard);
    EXPECT_EQ(texts(heard->payload, sizeof(wire::SignalText)).size(), 3u);
  }
  EXPECT_EQ(program.status(Kind::describe_parameter, bytes_of(wire::Index{hello.parameters})),
            number(Status::unknown_parameter));
  EXPECT_EQ(program.status(Kind::describe_signal, bytes_of(wire::Index{hello.signals})),
            number(Status::no_such_signal));
}

TEST_F(Linked, WhatIsUnknownOrHasTheWrongLengthIsRefused) {
  EXPECT_EQ(program.status(static_cast<Kind>(0x7E)), number(Status::unknown_command));
  EXPECT_EQ(program.status(Kind::telemetry), number(Status::unknown_command));
  EXPECT_EQ(program.status(Kind::hello, {1}), number(Status::wrong_length));
  EXPECT_EQ(program.status(Kind::arm), number(Status::wrong_length));
  EXPECT_EQ(program.status(Kind::get, {1, 2, 3}), number(Status::wrong_length));
  EXPECT_EQ(program.status(Kind::setpoint, Bytes(19)), number(Status::wrong_length));
  EXPECT_EQ(program.status(Kind::ask, Bytes(4 + 17 * 8)), number(Status::wrong_length));
  EXPECT_EQ(program.status(Kind::arm, {0}), number(Status::no_such_axis));
  EXPECT_EQ(program.status(Kind::arm, {4}), number(Status::no_such_axis));
  EXPECT_EQ(program.status(Kind::load, {3}), number(Status::out_of_range));
}

TEST_F(Linked, ParametersAreStagedCheckedAsAWholeSavedAndSurvive) {
  const wire::Address limit{0x0111, 1}, low_end{0x011B, 1}, low_start{0x011A, 1};
  const auto value = [&](const wire::Address& a) {
    const auto heard = program.call(Kind::get, bytes_of(a));
    float x = 0;
    if (heard && heard->payload.size() == 8) std::memcpy(&x, heard->payload.data() + 4, 4);
    return x;
  };
  EXPECT_EQ(value(limit), 20.0f);
  EXPECT_EQ(program.status(Kind::stage, bytes_of(wire::Assignment{limit, 12.0f})), 0);
  EXPECT_EQ(value(limit), 20.0f) << "staged is not in force";
  EXPECT_EQ(program.status(Kind::commit), 0);
  board.advance(2);
  EXPECT_EQ(value(limit), 12.0f);

  EXPECT_EQ(program.status(Kind::stage, bytes_of(wire::Assignment{limit, 101.0f})), number(Status::parameter_refused));
  EXPECT_EQ(program.status(Kind::stage, bytes_of(wire::Assignment{{0x0111, 2}, 1.0f})),
            number(Status::unknown_parameter));
  // Each in its range, together a contradiction: the commit names it and nothing is in force.
  EXPECT_EQ(program.status(Kind::stage, bytes_of(wire::Assignment{low_end, 30.0f}, wire::Assignment{low_start, 20.0f})),
            0);
  const auto refused = program.call_for<wire::Answer>(Kind::commit);
  EXPECT_EQ(refused.status, number(Status::parameter_refused));
  EXPECT_EQ(refused.axis, 1);
  EXPECT_EQ(refused.id, 0x011A);
  EXPECT_EQ(value(low_start), 36.0f);
  EXPECT_EQ(program.status(Kind::load, {0}), 0);  // takes the staged ones back
  EXPECT_EQ(program.status(Kind::commit), 0);

  board.power_cycle();
  board.advance(3000);
  program.connect();
  EXPECT_EQ(value(limit), 20.0f) << "not saved";
  EXPECT_EQ(program.status(Kind::stage, bytes_of(wire::Assignment{limit, 7.0f})), 0);
  EXPECT_EQ(program.status(Kind::commit), 0);
  board.advance(2);
  EXPECT_EQ(program.status(Kind::save), 0);
  board.power_cycle();
  board.advance(3000);
  program.connect();
  EXPECT_EQ(value(limit), 7.0f);
}

TEST_F(Linked, NothingIsCommittedOrSavedWhileArmed) {
  arm(2);
  EXPECT_EQ(program.status(Kind::commit), number(Status::not_disarmed));
  EXPECT_EQ(program.status(Kind::save), number(Status::not_disarmed));
}

TEST_F(Linked, WhileAnErrandRunsNobodyArmsOrStages) {
  program.ask(Kind::commit);
  program.ask(Kind::arm, {1});
  program.ask(Kind::stage, bytes_of(wire::Assignment{{0x0111, 0}, 12.0f}));
  program.ask(Kind::commit);
  for (int i = 0; i < 4; ++i) program.exchange();  // no time passes: the main context has not had its turn
  program.pass(100);
  std::map<int, int> statuses;
  for (const Program::Heard& h : program.frames()) statuses[h.sequence] = h.payload[0];
  EXPECT_EQ(statuses[1], 0);
  for (const int later : {2, 3, 4}) EXPECT_EQ(statuses[later], number(Status::busy)) << later;
}

TEST_F(Linked, TheAnswerToAnErrandIsNotGivenToTheNextSession) {
  program.ask(Kind::commit);
  for (int i = 0; i < 2; ++i) program.exchange();  // taken, and no time has passed
  program = Program(board);
  program.connect();
  program.pass(100);
  EXPECT_TRUE(program.frames().empty());
  EXPECT_EQ(program.status(Kind::commit), 0) << "and the next errand is served";
}

TEST_F(Linked, ArmsAllOrNone) {
  VirtualBoard fresh(options());
  Program early(fresh);
  early.connect();
  const auto answer = early.call_for<wire::Answer>(Kind::arm, {3});
  EXPECT_EQ(answer.status, number(Status::sample_refused));
  EXPECT_EQ(answer.axis, 0);
  arm(3);
  EXPECT_EQ(axis(0).mode(), firmware::Mode::ready);
  EXPECT_EQ(axis(1).mode(), firmware::Mode::ready);
  EXPECT_EQ(program.status(Kind::disarm, {1}), 0);
  board.advance(2);
  EXPECT_EQ(axis(0).mode(), firmware::Mode::off);
  EXPECT_EQ(axis(1).mode(), firmware::Mode::ready);
}

TEST_F(Linked, AnAxisThatMayNotArmKeepsTheOtherOff) {
  axis(1).hold({wire::Fault::over_current, 1, 40.0f, 28.0f, 0.0f});
  const auto refused = program.call_for<wire::Answer>(Kind::arm, {3});
  EXPECT_EQ(refused.status, number(Status::tripped));
  EXPECT_EQ(refused.axis, 1);
  board.advance(2);
  EXPECT_EQ(axis(0).mode(), firmware::Mode::off);
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

TEST_F(Linked, RowsThatMissPeriodsBeginANewFrame) {
  const firmware::usb::Identity identity{"test", "0", "1"};
  auto recorder = std::make_unique<firmware::Recorder>();
  firmware::Commands commands(board.driver(), *recorder, board.parameters(), identity, boards::dual_48V_20A);
  firmware::Reply reply;
  const Bytes order = bytes_of(wire::Subscribe{1}, wire::SignalAddress{id_bus, 0});
  commands.answer(
      {static_cast<std::uint8_t>(Kind::subscribe), 0, static_cast<std::uint16_t>(order.size()), order.data()}, true,
      reply);
  for (const std::uint32_t period : {1u, 2u, 3u, 10u, 11u}) recorder->tick(period);
  std::vector<std::pair<std::uint32_t, int>> frames;
  for (;;) {
    firmware::Reply rows;
    wire::Rows head{};
    if (!commands.telemetry(rows) || !wire::read(rows.bytes(), rows.count(), head)) break;
    frames.emplace_back(head.first_period, head.rows);
  }
  EXPECT_EQ(frames, (std::vector<std::pair<std::uint32_t, int>>{{1, 3}, {10, 2}}));
}

TEST_F(Linked, ADisarmThatFollowsAnArmInTheSamePeriodWins) {
  program.write(Program::framed(Kind::arm, 1, {1}));
  program.write(Program::framed(Kind::disarm, 2, {1}));
  program.exchange();
  board.advance(5);
  EXPECT_EQ(axis(0).mode(), firmware::Mode::off);
}

TEST_F(Linked, ASetpointIsADutyWithinTwoPwmPeriods) {
  arm(3);
  for (int k = 0; k < 200; ++k) {  // awake, currents settled at zero
    program.write(Program::framed(Kind::setpoint, 0, setpoint(3, 0.0f)));
    program.pass(20);
  }
  ASSERT_EQ(axis(0).mode(), firmware::Mode::running);
  const wire::Abc before = axis(0).fast().ratio;
  program.write(Program::framed(Kind::setpoint, 0, setpoint(3, 5.0f)));
  program.exchange();  // the packet has arrived
  EXPECT_EQ(axis(0).fast().permitted_A.q, 0.0f);
  board.advance(1);
  EXPECT_EQ(axis(0).fast().permitted_A.q, 5.0f);
  EXPECT_NE(axis(0).fast().ratio.b, before.b) << "the duty of the very next tick: loads one period after it";
}

TEST_F(Linked, BothAxesFollowTheirOwnSetpoints) {
  arm(3);
  wire::State state{};
  for (int k = 0; k < 30; ++k) {
    state = set(3, 3.0f, -2.0f);
    program.pass(20);
  }
  EXPECT_NEAR(state.axis[0].iq_A, 3.0f, 0.2f);
  EXPECT_NEAR(state.axis[1].iq_A, -2.0f, 0.2f);
  EXPECT_GT(state.axis[0].speed_rad_per_s, 1.0f);
  EXPECT_LT(state.axis[1].speed_rad_per_s, -1.0f);
  EXPECT_EQ(state.axis[0].mode, 2);
  EXPECT_NEAR(state.bus_V, 48.0f, 0.1f);
  EXPECT_GT(state.axis[0].allowance_A, 10.0f);
  const auto later = program.call_for<wire::State>(Kind::state);
  EXPECT_GT(later.period, state.period);
}

TEST_F(Linked, OneAxisFedDoesNotKeepTheOtherAlive) {
  arm(3);
  for (int k = 0; k < 10; ++k) set(3, 2.0f, 2.0f), program.pass(20);
  for (int k = 0; k < 400; ++k) set(1, 2.0f), program.pass(20);
  EXPECT_EQ(axis(0).mode(), firmware::Mode::running);
  EXPECT_EQ(axis(1).mode(), firmware::Mode::ready) << "faded and stopped";
}

TEST_F(Linked, ASetpointThatIsNoCurrentIsRefusedAndFeedsNobody) {
  arm(1);
  for (int k = 0; k < 10; ++k) set(1, 1.0f), program.pass(20);
  for (int k = 0; k < 400; ++k) {
    EXPECT_EQ(set(1, std::nanf("")).axis[0].refused, number(Status::not_a_current));
    program.pass(20);
  }
  EXPECT_EQ(axis(0).mode(), firmware::Mode::ready);
}

TEST_F(Linked, DamagedFramesFeedNobody) {
  arm(1);
  for (int k = 0; k < 10; ++k) set(1, 1.0f), program.pass(20);
  Bytes damaged = Program::framed(Kind::setpoint, 0, setpoint(1, 1.0f));
  damaged[6] ^= 0x40;
  for (int k = 0; k < 400; ++k) program.write(damaged), program.pass(20);
  EXPECT_EQ(axis(0).mode(), firmware::Mode::ready);
  EXPECT_GE(board.link().bad_frames(), 400u);
}

/// R1: from 100 ms after the last setpoint (safety.md: +- 5 ms) the current fades, 200 ms later the bridge is open.
TEST_F(Linked, ASilentHostIsLeftAtAHundredMilliseconds) {
  arm(1);
  for (int k = 0; k < 50; ++k) set(1, 4.0f), program.pass(20);
  program.write(Program::framed(Kind::setpoint, 0, setpoint(1, 4.0f)));
  program.exchange();
  int periods = 0;
  while (axis(0).fast().permitted_A.q > 3.999f && periods < 10000) board.advance(1), ++periods;
  EXPECT_NEAR(periods * board.period_s(), 0.1, 0.001);
  EXPECT_EQ(axis(0).fast().limit, wire::Limit::setpoint_old);
  while (axis(0).mode() == firmware::Mode::running && periods < 20000) board.advance(1), ++periods;
  EXPECT_NEAR(periods * board.period_s(), 0.3, 0.002);
}

TEST_F(Linked, AFaultIsToldWithItsEvidenceAndCleared) {
  arm(1);
  const hal::AxisSample hot{{40.0f, -20.0f, -20.0f}, 48.0f, 1.0f, 100000, true};
  (void)axis(0).tick(hot);
  const auto evidence = program.call_for<wire::FaultEvidence>(Kind::fault, {1});
  EXPECT_EQ(evidence.fault, static_cast<std::uint8_t>(wire::Fault::over_current));
  EXPECT_EQ(evidence.value, 40.0f);
  EXPECT_EQ(evidence.threshold, 28.0f);
  EXPECT_EQ(program.call_for<wire::State>(Kind::state).axis[0].mode, 3);
  EXPECT_EQ(program.status(Kind::arm, {1}), number(Status::tripped));
  set(1, 1.0f);
  EXPECT_EQ(program.status(Kind::clear, {1}), number(Status::setpoint_not_zero));
  set(1, 0.0f);
  EXPECT_EQ(program.status(Kind::clear, {1}), 0);
  board.advance(2);
  EXPECT_EQ(axis(0).mode(), firmware::Mode::off);
  EXPECT_EQ(program.call_for<wire::FaultEvidence>(Kind::fault, {1}).fault, 0);
}

TEST_F(Linked, OffsetsAreThoseThatWereLearnt) {
  const auto offsets = program.call_for<wire::Offsets>(Kind::calibrate, {2});
  EXPECT_EQ(offsets.phase_A[0], axis(1).current_offset_A().a);
  VirtualBoard fresh(options());
  Program early(fresh);
  early.connect();
  EXPECT_EQ(early.status(Kind::calibrate, {1}), number(Status::offset_unknown));
}

TEST_F(Linked, AsksWhetherAMotionFits) {
  board.advance(4000);
  const auto ask = [&](std::uint8_t standing, const Bytes& segments) {
    Bytes payload = bytes_of(wire::Ask{0, standing});
    payload.insert(payload.end(), segments.begin(), segments.end());
    return program.call_for<wire::Outlook>(Kind::ask, payload);
  };
  const auto easy = ask(0, bytes_of(wire::Segment{0.3f, 20.0f}, wire::Segment{5.0f, 2.0f}));
  EXPECT_EQ(easy.feasible, 1);
  EXPECT_TRUE(std::isinf(easy.limits_after_s));
  EXPECT_EQ(easy.share_before_limit, 1.0f);
  const auto hard = ask(0, bytes_of(wire::Segment{60.0f, 40.0f}));
  EXPECT_EQ(hard.feasible, 0);
  EXPECT_GT(hard.limits_after_s, 1.0f);
  EXPECT_LT(hard.limits_after_s, 60.0f);
  EXPECT_NEAR(hard.share_before_limit, hard.limits_after_s / 60.0f, 0.001f);
  EXPECT_GT(hard.peak_degC, 155.0f);
  const auto standing = ask(1, bytes_of(wire::Segment{60.0f, 40.0f}));
  EXPECT_LT(standing.limits_after_s, hard.limits_after_s);
  EXPECT_EQ(program.status(Kind::ask, bytes_of(wire::Ask{0, 0})), number(Status::out_of_range)) << "no segment";
  EXPECT_EQ(program.status(Kind::ask, bytes_of(wire::Ask{2, 0}, wire::Segment{1, 1})), number(Status::no_such_axis));
  EXPECT_EQ(program.status(Kind::ask, bytes_of(wire::Ask{0, 0}, wire::Segment{61, 1})), number(Status::out_of_range));
  EXPECT_EQ(program.status(Kind::ask, bytes_of(wire::Ask{0, 0}, wire::Segment{std::nanf(""), 1})),
            number(Status::out_of_range));
}

TEST_F(Linked, SetpointsGoOnWhileItLooksAhead) {
  arm(1);
  for (int k = 0; k < 10; ++k) set(1, 1.0f), program.pass(20);
  program.write(Program::framed(Kind::ask, 200, bytes_of(wire::Ask{0, 0}, wire::Segment{60.0f, 1.0f})));
  bool answered = false;
  for (int k = 0; k < 1000 && !answered; ++k) {
    set(1, 1.0f);
    program.pass(20);
    for (const Program::Heard& h : program.frames()) answered = answered || h.sequence == 200;
    EXPECT_EQ(axis(0).mode(), firmware::Mode::running);
  }
  EXPECT_TRUE(answered);
}

struct Row {
  std::uint32_t period;
  std::vector<float> values;
};
std::vector<Row> rows_of(const Bytes& payload, std::uint32_t& dropped) {
  wire::Rows head{};
  std::vector<Row> out;
  if (!wire::read(payload.data(), payload.size(), head)) return out;
  EXPECT_EQ(payload.size(), sizeof head + 4u * head.rows * head.signals);
  dropped = head.dropped;
  for (unsigned k = 0; k < head.rows; ++k) {
    Row row{head.first_period + k * head.decimation, std::vector<float>(head.signals)};
    std::memcpy(row.values.data(), payload.data() + sizeof head + 4u * k * head.signals, 4u * head.signals);
    out.push_back(row);
  }
  return out;
}

TEST_F(Linked, TelemetryComesAtItsPaceWithItsTime) {
  arm(1);
  const Bytes order = bytes_of(wire::Subscribe{20}, wire::SignalAddress{id_iq, 0}, wire::SignalAddress{id_mode, 0},
                               wire::SignalAddress{id_bus, 1});
  ASSERT_EQ(program.status(Kind::subscribe, order), 0);
  for (int k = 0; k < 200; ++k) set(1, 2.0f), program.pass(20);
  std::vector<Row> all;
  std::uint32_t dropped = 0;
  for (const Bytes& frame : program.telemetry)
    for (const Row& row : rows_of(frame, dropped)) all.push_back(row);
  EXPECT_EQ(dropped, 0u);
  ASSERT_GE(all.size(), 190u);
  for (std::size_t i = 1; i < all.size(); ++i) ASSERT_EQ(all[i].period, all[i - 1].period + 20);
  EXPECT_NEAR(all.back().values[0], 2.0f, 0.2f);
  EXPECT_EQ(all.back().values[1], 2.0f);
  EXPECT_NEAR(all.back().values[2], 48.0f, 0.1f);
  ASSERT_EQ(program.status(Kind::subscribe, bytes_of(wire::Subscribe{1})), 0);
  program.pass(100);
  program.telemetry.clear();
  (void)program.status(Kind::state);
  program.pass(2000);
  (void)program.status(Kind::state);
  EXPECT_TRUE(program.telemetry.empty());
}

TEST_F(Linked, EveryPwmPeriodOfFourSignalsReachesAHostThatReads) {
  const wire::SignalAddress s{id_rotor, 0};
  ASSERT_EQ(program.status(Kind::subscribe, bytes_of(wire::Subscribe{1}, s, s, s, s)), 0);
  program.pass(4000);
  (void)program.status(Kind::state);
  std::uint32_t dropped = 0, rows = 0, last = 0;
  for (const Bytes& frame : program.telemetry) {
    for (const Row& row : rows_of(frame, dropped)) {
      EXPECT_TRUE(rows == 0 || row.period == last + 1);
      ++rows;
      last = row.period;
    }
  }
  EXPECT_EQ(dropped, 0u);
  EXPECT_GT(rows, 3900u);
}

TEST_F(Linked, RowsThatAHostDoesNotReadAreDroppedAndCounted) {
  const wire::SignalAddress s{id_rotor, 0};
  ASSERT_EQ(program.status(Kind::subscribe, bytes_of(wire::Subscribe{1}, s)), 0);
  board.advance(5000);
  program.telemetry.clear();
  program.pass(500);
  (void)program.status(Kind::state);
  std::uint32_t dropped = 0, rows = 0, first = 0, last = 0;
  for (const Bytes& frame : program.telemetry) {
    for (const Row& row : rows_of(frame, dropped)) {
      if (rows++ == 0) first = row.period;
      last = row.period;
    }
  }
  EXPECT_GT(dropped, 3000u);
  EXPECT_EQ(last - first + 1, rows + dropped) << "each period is either there or counted";
}

TEST_F(Linked, BadSubscriptionsAndCapturesAreRefused) {
  EXPECT_EQ(program.status(Kind::subscribe, bytes_of(wire::Subscribe{1}, wire::SignalAddress{0x7F, 0})),
            number(Status::no_such_signal));
  EXPECT_EQ(program.status(Kind::subscribe, bytes_of(wire::Subscribe{1}, wire::SignalAddress{id_iq, 2})),
            number(Status::no_such_signal));
  EXPECT_EQ(program.status(Kind::subscribe, bytes_of(wire::Subscribe{0}, wire::SignalAddress{id_iq, 0})),
            number(Status::out_of_range));
  const wire::SignalAddress iq{id_iq, 0};
  EXPECT_EQ(program.status(Kind::capture, bytes_of(wire::CaptureOrder{iq, wire::Edge::now, 0, 0, 1, 1024, 1}, iq)),
            number(Status::capture_too_long));
  EXPECT_EQ(program.status(Kind::capture, bytes_of(wire::CaptureOrder{iq, wire::Edge::now, 0, 0, 1, 0, 1}, iq)),
            number(Status::out_of_range));
  EXPECT_EQ(
      program.status(Kind::capture, bytes_of(wire::CaptureOrder{iq, static_cast<wire::Edge>(3), 0, 0, 1, 9, 1}, iq)),
      number(Status::out_of_range));
  EXPECT_EQ(program.status(Kind::capture, bytes_of(wire::CaptureOrder{{99, 0}, wire::Edge::rising, 0, 0, 1, 9, 1}, iq)),
            number(Status::no_such_signal));
  EXPECT_EQ(program.status(Kind::capture_read, bytes_of(wire::Index{0})), number(Status::nothing_captured));
}

std::vector<Row> captured(Program& program, std::uint16_t rows) {
  std::vector<Row> all;
  while (all.size() < rows) {
    const auto heard = program.call(Kind::capture_read, bytes_of(wire::Index{static_cast<std::uint16_t>(all.size())}));
    std::uint32_t none = 0;
    if (!heard || heard->payload[0] != 0) break;
    for (const Row& row : rows_of(heard->payload, none)) all.push_back(row);
  }
  return all;
}

TEST_F(Linked, ACaptureHoldsEveryPeriodBeforeAndAfterItsTrigger) {
  arm(1);
  const wire::SignalAddress iq{id_iq, 0}, rotor{id_rotor, 0};
  for (int k = 0; k < 20; ++k) set(1, 0.0f), program.pass(20);
  ASSERT_EQ(program.status(Kind::capture,
                           bytes_of(wire::CaptureOrder{iq, wire::Edge::rising, 0, 2.0f, 100, 300, 1}, iq, rotor)),
            0);
  for (int k = 0; k < 20; ++k) set(1, 0.0f), program.pass(20);
  EXPECT_EQ(program.call_for<wire::CaptureStatus>(Kind::capture_status).phase, wire::CapturePhase::waiting);
  for (int k = 0; k < 40; ++k) set(1, 5.0f), program.pass(20);
  const auto status = program.call_for<wire::CaptureStatus>(Kind::capture_status);
  ASSERT_EQ(status.phase, wire::CapturePhase::complete);
  ASSERT_EQ(status.rows, 400);
  EXPECT_EQ(status.pre, 100);
  const std::vector<Row> all = captured(program, status.rows);
  ASSERT_EQ(all.size(), 400u);
  for (std::size_t i = 1; i < all.size(); ++i) ASSERT_EQ(all[i].period, all[i - 1].period + 1);
  EXPECT_EQ(all[100].period, status.trigger_period);
  EXPECT_LT(all[99].values[0], 2.0f);
  EXPECT_GE(all[100].values[0], 2.0f);
  EXPECT_NEAR(all[399].values[0], 5.0f, 0.3f);
}

TEST_F(Linked, AnEarlyTriggerHasFewerRowsBeforeIt) {
  const wire::SignalAddress rotor{id_rotor, 0};
  ASSERT_EQ(
      program.status(Kind::capture, bytes_of(wire::CaptureOrder{rotor, wire::Edge::now, 0, 0, 100, 50, 4}, rotor)), 0);
  program.pass(400);
  const auto status = program.call_for<wire::CaptureStatus>(Kind::capture_status);
  ASSERT_EQ(status.phase, wire::CapturePhase::complete);
  EXPECT_EQ(status.pre, 0);
  EXPECT_EQ(status.rows, 50);
  const std::vector<Row> all = captured(program, status.rows);
  ASSERT_EQ(all.size(), 50u);
  for (std::size_t i = 1; i < all.size(); ++i) ASSERT_EQ(all[i].period, all[i - 1].period + 4);
}

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

/// Both axes' setpoint and state, one exchange a USB frame, packets at most as many as a full-speed frame holds.
TEST_F(Linked, ExchangesBothAxesAtAKilohertz) {
  arm(3);
  int exchanges = 0;
  for (int ms = 0; ms < 1000; ++ms) {
    program.ask(Kind::setpoint, setpoint(3, 1.0f, -1.0f));
    for (int packet = 0; packet < 4; ++packet) program.exchange();  // 19 of 64 bytes fit into a frame
    board.advance(20);
    while (!program.frames().empty()) {
      exchanges += program.frames().front().kind == wire::reply_to(Kind::setpoint);
      program.frames().pop_front();
    }
  }
  EXPECT_GE(exchanges, 999);
}

TEST_F(Linked, TheTextPortAnswersInPlainLines) {
  bool data1 = false, in_data1 = false;
  const auto type = [&](const std::string& line) {
    std::string answer;
    const Bytes bytes(line.begin(), line.end());
    for (std::size_t at = 0; at < bytes.size(); at += 64) {
      const Bytes packet(bytes.begin() + static_cast<long>(at),
                         bytes.begin() + static_cast<long>(std::min(bytes.size(), at + 64)));
      EXPECT_EQ(board.bus().out(Program::address, 0x03, data1, packet), Handshake::ack);
      data1 = !data1;
      boards::host::UsbBus<VirtualBoard::Device>::Packet in;
      while (board.bus().in(Program::address, 0x83, in) == Handshake::ack) {
        EXPECT_EQ(in.data1, in_data1);
        in_data1 = !in_data1;
        answer.append(in.data.begin(), in.data.begin() + static_cast<long>(in.bytes));
      }
    }
    return answer;
  };
  EXPECT_NE(type("help\r").find("iq 0 1.5"), std::string::npos);
  EXPECT_EQ(type("arm 1\r\n"), "ok\r\n");
  board.advance(2);
  EXPECT_EQ(axis(1).mode(), firmware::Mode::ready);
  EXPECT_EQ(type("iq 1 -1.25\n"), "ok\r\n");
  board.advance(100);
  EXPECT_EQ(axis(1).fast().permitted_A.q, -1.25f);
  EXPECT_NE(type("state\n").find("axis 1: running"), std::string::npos);
  EXPECT_EQ(type("iq 1 x\n"), "give amperes, such as: iq 0 1.5\r\n");
  EXPECT_EQ(type("iq 2 1\n"), "name axis 0 or 1\r\n");
  EXPECT_EQ(type("dance\n"), "unknown command; try: help\r\n");
  EXPECT_EQ(type(std::string(200, 'a') + "\n"), "this line is too long; try: help\r\n");
  EXPECT_EQ(type("disarm 1\n"), "ok\r\n");
  board.advance(2);
  EXPECT_EQ(axis(1).mode(), firmware::Mode::off);
  for (const char* bad : {"iq 1 1.2.3\n", "iq 1 -\n", "iq 1 .\n", "iq 1\n", "iq  1  1e3\n"})
    EXPECT_EQ(type(bad), "give amperes, such as: iq 0 1.5\r\n") << bad;
  EXPECT_EQ(type("iq 1 99999\n").substr(0, 12), "the setpoint");
  for (const char* bad : {"arm\n", "arm x\n", "arm 10\n"}) EXPECT_EQ(type(bad), "name axis 0 or 1\r\n") << bad;
  EXPECT_EQ(type("\r\n \n").substr(0, 7), "unknown") << "an empty line says nothing, one of blanks is no command";
  axis(0).hold({wire::Fault::over_current, 0, 40.0f, 28.0f, 0.0f});
  EXPECT_NE(type("state\n").find("axis 0: tripped"), std::string::npos);
  EXPECT_NE(type("state\n").find("a phase current passed the trip level"), std::string::npos);
  EXPECT_NE(type("arm 0\n").find("read the fault"), std::string::npos);
  EXPECT_NE(type("clear 7\narm 0\n").find("name axis"), std::string::npos);
  EXPECT_EQ(type("clear 0\n"), "ok\r\n");
  board.advance(2);
  EXPECT_NE(type("state\n").find("axis 0: off"), std::string::npos);
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

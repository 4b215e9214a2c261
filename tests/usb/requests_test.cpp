// SPDX-License-Identifier: MIT
// Every request of the link, good and bad, but setpoints and telemetry.

#include <cmath>
#include <map>
#include <string>

#include "tests/usb/linked.hpp"

namespace {

using namespace usb_host;

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
  EXPECT_EQ(hello.bus_min_V, boards::dual_48V_20A.bus_min_V);
  EXPECT_EQ(hello.bus_max_V, boards::dual_48V_20A.bus_max_V);
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

// One that crashed, or gave up when a later value was refused.
TEST_F(Linked, WhatAnEarlierProgramHasStagedIsNotPutInForceByTheNext) {
  ASSERT_EQ(program.status(Kind::stage, bytes_of(wire::Assignment{{0x0111, 1}, 12.0f})), 0);
  ASSERT_TRUE(program.call(Kind::hello));
  EXPECT_EQ(program.status(Kind::stage, bytes_of(wire::Assignment{{0x0115, 1}, 0.3f})), 0);
  EXPECT_EQ(program.status(Kind::commit), 0);
  EXPECT_EQ(board.parameters().in_force().axes[1].drive.ramp_s, 0.3f);
  EXPECT_EQ(board.parameters().in_force().axes[1].drive.current_limit_A, 20.0f);

  ASSERT_EQ(program.status(Kind::stage, bytes_of(wire::Assignment{{0x0111, 1}, 12.0f})), 0);
  program = Program(board);
  program.connect();  // a bus reset
  EXPECT_FALSE(board.parameters().uncommitted()) << "or the terminal would be told to wait for ever";
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

/// A program that asks again and again keeps an axis from looking for itself: what it saw before is not what is.
TEST(Ask, WhatIsToldUnaskedIsNothingRatherThanOldWhileAProgramAsks) {
  boards::host::VirtualBoardOptions o = options();
  o.motor.phase_resistance_ohm = 0.5;  // a winding as small as an EC 16's
  o.motor.C1_J_per_K = 1.13;
  o.motor.R1_K_per_W = 1.08;
  VirtualBoard board(o);
  Program program(board);
  board.advance(40000);
  program.connect();
  ASSERT_TRUE(std::isinf(board.driver().axis(0).state().time_left_s)) << "at rest";
  ASSERT_EQ(board.driver().axis(0).arm(), Status::done);
  float least_A = 20.0f, told_s = 0.0f;
  for (int ms = 0; ms < 10000; ++ms) {
    if (ms % 100 == 0)
      program.write(Program::framed(Kind::ask, 200, bytes_of(wire::Ask{0, 0}, wire::Segment{60.0f, 0.1f})));
    ASSERT_EQ(board.driver().axis(0).set_current({0.0f, ms / 10 % 2 == 0 ? 20.0f : -20.0f}), Status::done);  // shaken
    program.pass(20);
    (void)program.frames();
    const firmware::AxisState& now = board.driver().axis(0).state();
    least_A = std::min(least_A, now.allowance_A);
    if (ms > 5000) told_s = std::max(told_s, now.time_left_s);
  }
  EXPECT_LT(least_A, 8.0f) << "the limit was never near, so nothing was shown";
  EXPECT_LT(told_s, 2.0f);
}

/// A board fresh from the factory knows no winding: what it bears is nothing, and no question about it has an answer.
TEST(Ask, OfAWindingThatNobodyDescribedNothingIsPromised) {
  boards::host::VirtualBoardOptions o = options();
  o.has_parameters = false;
  VirtualBoard board(o);
  Program program(board);
  board.advance(80000);
  program.connect();
  const auto now = program.call_for<wire::State>(Kind::state);
  for (const wire::AxisReport& axis : now.axis) {
    EXPECT_EQ(axis.time_left_s, 0.0f);
    EXPECT_EQ(axis.allowance_1s_A, 0.0f);
    EXPECT_EQ(axis.allowance_A, 0.0f);
  }
  for (const std::uint8_t axis : {std::uint8_t{0}, std::uint8_t{1}})
    EXPECT_EQ(program.status(Kind::ask, bytes_of(wire::Ask{axis, 1}, wire::Segment{60.0f, 20.0f})),
              number(Status::parameters_unset));
}

}  // namespace

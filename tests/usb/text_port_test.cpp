// SPDX-License-Identifier: MIT
// The text port as a person at a terminal meets it.

#include <cmath>
#include <string>

#include "tests/usb/linked.hpp"

namespace {

using namespace usb_host;

/// A person at a terminal.
struct Typed : Linked {
  bool data1 = false, in_data1 = false;

  std::string hear() {
    std::string answer;
    boards::host::UsbBus<VirtualBoard::Device>::Packet in;
    while (board.bus().in(Program::address, 0x83, in) == Handshake::ack) {
      EXPECT_EQ(in.data1, in_data1);
      in_data1 = !in_data1;
      answer.append(in.data.begin(), in.data.begin() + static_cast<long>(in.bytes));
    }
    return answer;
  }
  std::string type(const std::string& line) {
    std::string answer;
    const Bytes bytes(line.begin(), line.end());
    for (std::size_t at = 0; at < bytes.size(); at += 64) {
      const Bytes packet(bytes.begin() + static_cast<long>(at),
                         bytes.begin() + static_cast<long>(std::min(bytes.size(), at + 64)));
      EXPECT_EQ(board.bus().out(Program::address, 0x03, data1, packet), Handshake::ack);
      data1 = !data1;
      answer += hear();
    }
    return answer;
  }
  /// What takes the main context some time.
  std::string wait(const std::string& line) {
    EXPECT_EQ(type(line), "");
    board.advance(60);
    return hear();
  }
  float in_force(const char* name, std::uint8_t axis) {
    for (int i = 0; i < firmware::parameter_count; ++i) {
      float value = 0;
      if (std::string(firmware::parameter_info(i)->name) != name) continue;
      EXPECT_EQ(board.parameters().get({firmware::parameter_info(i)->id, axis}, value), Status::done);
      return value;
    }
    return NAN;
  }
};

TEST_F(Typed, TheTextPortAnswersInPlainLines) {
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
  EXPECT_EQ(program.status(Kind::stage, bytes_of(wire::Assignment{{0x0111, 1}, 7.5f})), 0);
  EXPECT_EQ(program.status(Kind::commit), 0);
  EXPECT_EQ(type("get current_limit 1\n"), "axis 1: 7.5 A\r\n");
  EXPECT_EQ(type("get current_limit\n"), "axis 0: 20 A\r\naxis 1: 7.5 A\r\n");
  for (const char* bad : {"get current_limit 2\n", "get current_limit x\n"})
    EXPECT_EQ(type(bad), "name axis 0 or 1\r\n") << bad;
  for (const char* bad : {"get\n", "get current\n", "get current_limit_ 0\n"})
    EXPECT_EQ(type(bad).substr(0, 17), "no such parameter") << bad;
  for (int i = 0; i < firmware::parameter_count; ++i) {  // to six digits what the link says
    const wire::ParameterInfo& p = *firmware::parameter_info(i);
    float value = 0;
    ASSERT_EQ(board.parameters().get({p.id, 0}, value), Status::done);
    const std::string answer = type(std::string("get ") + p.name + " 0\n"), unit = wire::text_of(p.unit);
    ASSERT_EQ(answer.substr(0, 8), "axis 0: ") << p.name;
    if (std::isnan(value))
      EXPECT_EQ(answer, "axis 0: not set " + unit + "\r\n") << p.name;
    else if (std::abs(value) >= 1e6f)
      EXPECT_EQ(answer, "axis 0: a million or more " + unit + "\r\n") << p.name;
    else
      EXPECT_NEAR(std::stof(answer.substr(8)), value, 1e-5f * std::abs(value) + 1e-12f) << p.name << ' ' << answer;
  }
  EXPECT_EQ(type("clear 0\n"), "ok\r\n");
  board.advance(2);
  program.ask(Kind::commit);
  program.exchange();  // asked, and the main context has not had its turn
  EXPECT_EQ(type("arm 1\n").find("ok"), std::string::npos) << "nobody arms while parameters are put in force";
  board.advance(100);
  EXPECT_EQ(type("arm 1\n"), "ok\r\n");
  board.advance(2);
  EXPECT_EQ(type("disarm 1\n"), "ok\r\n");
  board.advance(2);
  EXPECT_NE(type("state\n").find("axis 0: off"), std::string::npos);
}

TEST_F(Typed, HelpIsWhole) {
  const std::string help = type("help\n");
  EXPECT_TRUE(help.ends_with("\nEverything else: the program hotcore.\r\n")) << help;
}

TEST_F(Typed, ParametersAreSetCheckedAndSaved) {
  EXPECT_EQ(wait("set ramp 0.3\n"), "ok\r\n");
  EXPECT_EQ(in_force("ramp", 0), 0.3f);
  EXPECT_EQ(in_force("ramp", 1), 0.3f);
  EXPECT_EQ(wait("set current_limit 7.5 1\n"), "ok\r\n");
  EXPECT_EQ(in_force("current_limit", 0), 20.0f);
  EXPECT_EQ(in_force("current_limit", 1), 7.5f);
  EXPECT_EQ(wait("save\n"), "ok\r\n");
  board.power_cycle();
  EXPECT_EQ(in_force("current_limit", 1), 7.5f);
  EXPECT_EQ(in_force("ramp", 0), 0.3f);
}

TEST_F(Typed, WhatIsWrongIsRefusedAndNothingStaysStaged) {
  EXPECT_EQ(type("set current_limit 500\n"), "it may be 0 to 100 A\r\n");
  EXPECT_EQ(type("set current_limit\n"), "give a number, such as: set ramp 0.3\r\n");
  EXPECT_EQ(type("set current_limit 1e1\n"), "give a number, such as: set ramp 0.3\r\n");
  EXPECT_EQ(type("set current_limit 5 2\n"), "name axis 0 or 1\r\n");
  EXPECT_EQ(type("set speed 5\n").substr(0, 17), "no such parameter");
  EXPECT_EQ(type("set\n").substr(0, 17), "no such parameter");
  EXPECT_EQ(wait("set pole_pairs 2.5 1\n").substr(0, 34), "pole_pairs of axis 1: the value is")
      << "seen by the whole check";
  EXPECT_EQ(wait("set bus_low_end 60 0\n").substr(0, 11), "bus_low_sta");
  EXPECT_FALSE(board.parameters().uncommitted());
  EXPECT_EQ(wait("set ramp 0.25\n"), "ok\r\n") << "and the next one is not held up by it";
  EXPECT_EQ(in_force("pole_pairs", 1), 2.0f);
  EXPECT_EQ(type("arm 0\n"), "ok\r\n");
  board.advance(2);
  EXPECT_EQ(wait("set ramp 0.2\n").substr(0, 16), "an axis is armed");
  EXPECT_EQ(wait("save\n").substr(0, 16), "an axis is armed");
  EXPECT_EQ(in_force("ramp", 0), 0.25f);
  EXPECT_EQ(type("disarm 0\n"), "ok\r\n");
  board.advance(2);
  // Nor after a bus reset in the middle of it.
  EXPECT_EQ(type("set pole_pairs 2.5 1\n"), "");
  program.connect();
  board.advance(60);
  data1 = in_data1 = false;
  EXPECT_EQ(wait("set ramp 0.3\n"), "ok\r\n");
}

/// One errand at a time, whoever asks; nobody stages or arms meanwhile, and nobody waits for ever.
TEST_F(Typed, TheTerminalAndAProgramExcludeEachOther) {
  EXPECT_EQ(type("set ramp 0.3\narm 1\n"), "") << "the second line waits for the first";
  EXPECT_EQ(program.status(Kind::arm, {1}), number(Status::busy));
  EXPECT_EQ(program.status(Kind::stage, bytes_of(wire::Assignment{{0x0111, 1}, 7.5f})), number(Status::busy));
  program.ask(Kind::save);
  program.exchange();
  board.advance(60);
  EXPECT_EQ(hear(), "ok\r\nok\r\n");
  board.advance(2);
  EXPECT_EQ(axis(1).mode(), firmware::Mode::ready);
  EXPECT_EQ(type("disarm 1\n"), "ok\r\n");
  board.advance(2);

  program.ask(Kind::commit);
  program.exchange();
  EXPECT_EQ(type("set ramp 0.2\n").substr(0, 15), "the board still");
  EXPECT_EQ(type("save\n").substr(0, 15), "the board still");
  program.pass(100);

  EXPECT_EQ(program.status(Kind::stage, bytes_of(wire::Assignment{{0x0111, 1}, 7.5f})), 0);
  EXPECT_EQ(type("set ramp 0.2\n").substr(0, 15), "the board still") << "what a program has begun is not mixed in";
  EXPECT_EQ(program.status(Kind::commit), 0);
  EXPECT_EQ(in_force("ramp", 0), 0.3f);

  // A terminal that was closed while its errand ran keeps no program waiting.
  EXPECT_EQ(type("save\n"), "");
  board.advance(60);
  EXPECT_EQ(program.status(Kind::save), 0);
  EXPECT_EQ(hear(), "ok\r\n");
}

/// As a script prints them: the digits behind the point pass a float's range before the line's end.
TEST_F(Typed, DigitsThatNoFloatHoldsChangeNoNumber) {
  EXPECT_EQ(wait("set ramp 0.30000000000000000000000000000000000000000\n"), "ok\r\n");
  EXPECT_EQ(in_force("ramp", 0), 0.3f);
  EXPECT_EQ(wait("set R1 0.5" + std::string(45, '0') + "\n"), "ok\r\n");
  EXPECT_EQ(in_force("R1", 0), 0.5f);
  EXPECT_EQ(wait("set ramp 00000000000000000000000000000000000000000.4\n"), "ok\r\n");
  EXPECT_EQ(in_force("ramp", 0), 0.4f);
  EXPECT_EQ(type("set ramp 1" + std::string(45, '0') + "\n"), "it may be 0.005 to 1 s\r\n");
  EXPECT_EQ(type("iq 0 1" + std::string(45, '0') + "\n").substr(0, 12), "the setpoint");
}

/// Who names two axes means both, and who is told "ok" believes it.
TEST_F(Typed, ALineWithMoreWordsThanItsCommandHasIsNotObeyed) {
  EXPECT_EQ(type("arm 0\narm 1\n"), "ok\r\nok\r\n");
  board.advance(2);
  EXPECT_EQ(type("disarm 0 1\n").find("ok"), std::string::npos) << "axis 1 stays armed";
  board.advance(2);
  EXPECT_EQ(axis(0).mode(), firmware::Mode::off) << "what it names is off all the same";
  EXPECT_EQ(type("arm 0\n"), "ok\r\n");
  board.advance(2);
  EXPECT_EQ(type("iq 0 1 .5\n").find("ok"), std::string::npos);
  board.advance(2);
  EXPECT_NE(axis(0).mode(), firmware::Mode::running);
  EXPECT_EQ(type("disarm 0 \ndisarm 1\n"), "ok\r\nok\r\n");
  board.advance(2);
  EXPECT_EQ(type("arm 0 1\n").find("ok"), std::string::npos);
  EXPECT_EQ(type("set ramp 0.3 0 1\n").find("ok"), std::string::npos);
  board.advance(60);
  EXPECT_EQ(hear(), "");
  EXPECT_EQ(in_force("ramp", 0), 0.2f);
}

TEST_F(Typed, TorqueModeHasItsOwnWord) {
  EXPECT_EQ(type("torque 0 0.05\n").substr(0, 29), "the setpoint has another unit");
  EXPECT_EQ(type("mode 0 torque\n"), "ok\r\n");
  EXPECT_EQ(type("mode 0 speed\n"), "give current or torque, such as: mode 0 torque\r\n");
  EXPECT_NE(type("state\n").find("axis 0: off, torque mode"), std::string::npos);
  EXPECT_EQ(type("arm 0\n"), "ok\r\n");
  board.advance(2);
  EXPECT_EQ(type("iq 0 1\n").substr(0, 29), "the setpoint has another unit");
  EXPECT_EQ(type("torque 0 x\n"), "give newton metres, such as: torque 0 0.02\r\n");
  EXPECT_EQ(type("torque 0 0.0239\n"), "ok\r\n");
  board.advance(100);
  EXPECT_NEAR(axis(0).fast().permitted_A.q, 1.0f, 1e-3f);
  EXPECT_EQ(type("mode 0 current\n").substr(0, 17), "the axis is armed");
}

}  // namespace

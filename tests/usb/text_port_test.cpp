// SPDX-License-Identifier: MIT
// The text port as a person at a terminal meets it.

#include <cmath>
#include <string>

#include "tests/usb/linked.hpp"

namespace {

using namespace usb_host;

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

}  // namespace

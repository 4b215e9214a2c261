// SPDX-License-Identifier: MIT
// The host controller's half of USB against a device that says what it is told to say, right or wrong.
#include "boards/host/usbip/transfers.hpp"

#include <gtest/gtest.h>

#include <deque>

namespace boards::usb {
namespace {

using Bytes = std::vector<std::uint8_t>;

const Bytes device_bytes = {18, 1, 1, 2, 0, 0, 0, 64, 9, 0x12, 1, 0, 0, 1, 0, 0, 0, 1};
/// Two interfaces: endpoints 0x81 and 0x01 belong to the first, 0x82 to the second.
const Bytes configuration_bytes = {9, 2, 44, 0, 2, 1,    0, 0xC0, 0,                                                 //
                                   9, 4, 0,  0, 2, 0xFF, 0, 0,    0, 7, 5, 0x81, 2, 64, 0, 0, 7, 5, 1, 2, 64, 0, 0,  //
                                   9, 4, 1,  0, 1, 0xFF, 0, 0,    0, 3, 5, 0x82};

/// Enumerates as it should; every other transaction is answered from a list, and without one by silence.
class Scripted final : public Device {
 public:
  void plug(bool) override {}
  bool attached() const override { return pulled_up; }
  void bus_reset() override {}
  Answer setup(unsigned, const std::array<std::uint8_t, 8>& r) override {
    if (!honest) return next();
    if (r[1] == 6) answer_ = r[3] == 1 ? device : configuration;
    answer_.resize(std::min<std::size_t>(answer_.size(), r[6] | r[7] << 8));
    return {Answer::ack};
  }
  Answer out(unsigned, int, bool data1, std::span<const std::uint8_t>) override {
    toggles.push_back(data1);
    return honest ? Answer{Answer::ack} : next();
  }
  Answer in(unsigned, int) override { return honest ? Answer{Answer::ack, true, std::exchange(answer_, {})} : next(); }
  void run(double) override {}
  void power_cycle() override {}

  bool pulled_up = true, honest = true;
  Bytes device = device_bytes, configuration = configuration_bytes;
  std::deque<Answer> script;
  std::vector<bool> toggles;  // of what was sent to it

 private:
  Answer next() {
    if (script.empty()) return {};
    const Answer answer = script.front();
    script.pop_front();
    return answer;
  }
  Bytes answer_;
};

struct HostSide : ::testing::Test {
  HostSide() {
    EXPECT_TRUE(host.enumerate());
    device.honest = false;
  }
  Transfer read(std::size_t wanted, std::vector<Answer> script, int endpoint = 1) {
    device.script.assign(script.begin(), script.end());
    Transfer t;
    t.endpoint = endpoint;
    t.in = true;
    t.wanted = wanted;
    return host.wait_for(t);
  }
  Transfer write(std::size_t bytes, std::vector<Answer> script) {
    device.script.assign(script.begin(), script.end());
    Transfer t;
    t.endpoint = 1;
    t.bytes.resize(bytes);
    return host.wait_for(t);
  }
  Transfer control(std::uint8_t type, std::uint16_t length, std::vector<Answer> script) {
    device.script.assign(script.begin(), script.end());
    return host.control(type, 0x42, 0, 0, length, Bytes((type & 0x80) != 0 ? 0 : length));
  }
  Scripted device;
  Transfers host{device};
};

const Answer ack{Answer::ack}, stall{Answer::stall}, nak{Answer::nak}, silence{};
Answer data(bool data1, std::size_t bytes) { return {Answer::ack, data1, Bytes(bytes, 7)}; }

TEST_F(HostSide, AReadEndsWithAShortPacketOrWhenItIsFull) {
  Transfer t = read(512, {nak, data(false, 64), nak, data(true, 10)});
  EXPECT_EQ(t.outcome, Outcome::done);
  EXPECT_EQ(t.bytes.size(), 74u);
  EXPECT_EQ(read(128, {data(false, 64), data(true, 64)}).bytes.size(), 128u);
  EXPECT_EQ(host.refused(), 2u);
}

TEST_F(HostSide, ARepeatedPacketIsDroppedAndCounted) {
  const Transfer t = read(512, {data(false, 64), data(false, 64), data(true, 1)});
  EXPECT_EQ(t.bytes.size(), 65u);
  EXPECT_EQ(host.toggle_errors(), 1u);
}

TEST_F(HostSide, MoreThanWasAskedForIsGarbled) {
  EXPECT_EQ(read(10, {data(false, 11)}).outcome, Outcome::garbled);
  EXPECT_EQ(control(0xC0, 4, {ack, data(true, 5)}).outcome, Outcome::garbled);
  EXPECT_EQ(control(0x40, 0, {ack, data(true, 1)}).outcome, Outcome::garbled) << "a status stage carries nothing";
}

TEST_F(HostSide, AStallInAnyStageEndsTheTransfer) {
  EXPECT_EQ(read(64, {stall}).outcome, Outcome::stalled);
  EXPECT_EQ(write(64, {stall}).outcome, Outcome::stalled);
  EXPECT_EQ(control(0xC0, 8, {ack, stall}).outcome, Outcome::stalled);
  EXPECT_EQ(control(0x40, 8, {ack, stall}).outcome, Outcome::stalled);
  EXPECT_EQ(control(0x40, 8, {ack, ack, stall}).outcome, Outcome::stalled);
}

TEST_F(HostSide, ThreeSilencesInARowAreAPulledCableAndTwoAreNot) {
  EXPECT_EQ(read(64, {}).outcome, Outcome::gone);
  EXPECT_EQ(write(64, {}).outcome, Outcome::gone);
  EXPECT_EQ(control(0x40, 8, {}).outcome, Outcome::gone);
  EXPECT_EQ(control(0x40, 8, {ack}).outcome, Outcome::gone);
  EXPECT_EQ(control(0xC0, 8, {ack, data(true, 8)}).outcome, Outcome::gone);
  EXPECT_EQ(read(64, {silence, silence, nak, silence, silence, data(false, 1)}).outcome, Outcome::done);
  EXPECT_EQ(write(64, {silence, nak, ack}).outcome, Outcome::done);
  EXPECT_EQ(control(0xC0, 8, {silence, nak, ack, nak, data(true, 8), nak, ack}).outcome, Outcome::done);
}

TEST_F(HostSide, AnAnswerThatNeverComesIsGivenUpAndNothingIsLeftWaiting) {
  const Transfer t = read(64, std::vector<Answer>(100000, nak));
  EXPECT_EQ(t.outcome, Outcome::gone);
  EXPECT_FALSE(host.cancel(t.id));
}

TEST_F(HostSide, WhatFinishesMeanwhileIsKept) {
  device.script.assign({ack, data(false, 3), ack, ack});
  Transfer other;
  other.id = 5;
  other.endpoint = 2;
  other.in = true;
  other.wanted = 64;
  host.submit(other);
  Transfer t;
  t.id = 6;
  t.endpoint = 1;
  t.bytes.resize(130);
  EXPECT_EQ(host.wait_for(t).outcome, Outcome::done);
  std::vector<Transfer> finished;
  host.turn(finished);
  ASSERT_EQ(finished.size(), 1u);
  EXPECT_EQ(finished[0].id, 5u);
  EXPECT_EQ(finished[0].bytes.size(), 3u);
}

/// USB 2.0 9.1.1.5 and 9.4.5: CLEAR_FEATURE(ENDPOINT_HALT), SET_INTERFACE and SET_CONFIGURATION.
TEST_F(HostSide, TogglesBeginAnewWhereTheStandardSaysSo) {
  const auto toggle_of_next_write = [&] {
    device.toggles.clear();
    EXPECT_EQ(write(1, {ack}).outcome, Outcome::done);
    return static_cast<bool>(device.toggles.at(0));
  };
  const auto say = [&](std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index) {
    device.script.assign({ack, ack});
    EXPECT_EQ(host.control(type, request, value, index, 0).outcome, Outcome::done);
  };
  EXPECT_FALSE(toggle_of_next_write());
  EXPECT_TRUE(toggle_of_next_write());
  toggle_of_next_write();
  say(0x02, 1, 0, 0x81);  // another endpoint's halt
  say(0x02, 1, 1, 0x01);  // another feature
  say(0x02, 3, 0, 0x01);  // the halt itself
  say(0x01, 11, 0, 1);    // the interface beside it
  EXPECT_TRUE(toggle_of_next_write());
  toggle_of_next_write();
  say(0x02, 1, 0, 0x01);
  EXPECT_FALSE(toggle_of_next_write());
  say(0x01, 11, 0, 0);
  EXPECT_FALSE(toggle_of_next_write());
  say(0x00, 9, 1, 0);
  EXPECT_FALSE(toggle_of_next_write());
}

TEST(Enumerate, EndsWithANoWhereNoDeviceAnswersAsOne) {
  const auto enumerates = [](auto spoil) {
    Scripted device;
    spoil(device);
    return Transfers(device).enumerate();
  };
  EXPECT_TRUE(enumerates([](Scripted&) {}));
  EXPECT_FALSE(enumerates([](Scripted& d) { d.pulled_up = false; }));
  EXPECT_FALSE(enumerates([](Scripted& d) { d.honest = false; }));
  EXPECT_FALSE(enumerates([](Scripted& d) { d.device.resize(17); }));
  EXPECT_FALSE(enumerates([](Scripted& d) { d.configuration.resize(8); }));
  EXPECT_FALSE(enumerates([](Scripted& d) { d.configuration.resize(40); }));
  EXPECT_FALSE(enumerates([](Scripted& d) { d.configuration[2] = 0; })) << "no bytes at all, says its total length";
}

TEST(Enumerate, ADescriptorOfLengthZeroIsNoLoopWithoutEnd) {
  Scripted device;
  device.configuration[9] = 0;
  Transfers host(device);
  ASSERT_TRUE(host.enumerate());
  EXPECT_EQ(host.control(0x01, 11, 0, 0, 0).outcome, Outcome::done);
}

}  // namespace
}  // namespace boards::usb

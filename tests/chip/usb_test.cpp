// SPDX-License-Identifier: MIT
// The image's USB side over the registers of OTG_FS: a host enumerates it, talks to it, resets, suspends and pulls it,
// and the power stage must not notice.
#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <string>

#include "tests/chip/plugged.hpp"

namespace image_tests {
namespace {

using host_sim::chip::to_s;
using wire::Kind;

TEST(Usb, TheImageEnumeratesAndSaysWhoItIs) {
  NEEDS_IMAGE(image);
  Plugged p;
  ASSERT_TRUE(p.configure()) << p.pcb->chip.report_text();
  const auto& d = p.host.device_descriptor();
  EXPECT_EQ(d[8] | d[9] << 8, wire::usb_vendor_id);
  EXPECT_EQ(d[10] | d[11] << 8, wire::usb_product_id);
  const auto serial = p.host.control(0x80, 6, static_cast<std::uint16_t>(0x0300 | d[16]), 0x0409, 255).bytes;
  std::string text;
  for (std::size_t i = 2; i < serial.size(); i += 2) text += static_cast<char>(serial[i]);
  char expected[25];
  std::snprintf(expected, sizeof expected, "%08X%08X%08X", p.pcb->chip.core().word(0x1FFF7A10),
                p.pcb->chip.core().word(0x1FFF7A14), p.pcb->chip.core().word(0x1FFF7A18));
  EXPECT_EQ(text, expected) << "RM0090 39.1, the unique device id";
  const auto hello = Plugged::as<wire::Hello>(p.ask(Kind::hello));
  EXPECT_EQ(hello.answer.status, 0);
  EXPECT_STREQ(hello.board, "h8-15d");
  EXPECT_STREQ(hello.serial, expected);
  EXPECT_GT(hello.parameters, 10);
  for (std::uint16_t i = 0; i < hello.parameters; ++i) {
    const auto one = p.ask(Kind::describe_parameter, wire::Index{i});
    ASSERT_GT(one.size(), sizeof(wire::ParameterText)) << i;
    EXPECT_EQ(one[0], 0) << i;
  }
  NO_TROUBLE_ON_USB(p);
}

TEST(Usb, AnUnknownRequestIsStalledAndTheNextOneWorks) {
  NEEDS_IMAGE(image);
  Plugged p;
  ASSERT_TRUE(p.configure());
  EXPECT_EQ(p.host.control(0xC0, 0x77, 1, 2, 64).outcome, Outcome::stalled);
  EXPECT_EQ(p.host.control(0x40, 0x77, 1, 2, 64, std::vector<std::uint8_t>(64)).outcome, Outcome::stalled);
  EXPECT_EQ(p.host.control(0x80, 6, 0x0100, 0, 64).bytes.size(), 18u);
  for (const std::uint16_t endpoint : {std::uint16_t{0x81}, std::uint16_t{0x01}}) {
    EXPECT_EQ(p.host.control(0x02, 3, 0, endpoint, 0).outcome, Outcome::done) << "SET_FEATURE(ENDPOINT_HALT)";
    EXPECT_EQ(p.host.wait_for(bulk(endpoint == 0x81, {1, 2, 3}, 64, 9)).outcome, Outcome::stalled);
    EXPECT_EQ(p.host.control(0x02, 1, 0, endpoint, 0).outcome, Outcome::done) << "CLEAR_FEATURE(ENDPOINT_HALT)";
  }
  for (int i = 0; i < 3; ++i) EXPECT_EQ(Plugged::as<wire::Hello>(p.ask(Kind::hello)).answer.status, 0);
  NO_TROUBLE_ON_USB(p);
}

/// The next setpoints, exchanged as a robot does each ms.
wire::State exchange(Plugged& p, float iq0_A, float iq1_A) {
  return Plugged::as<wire::State>(p.ask(Kind::setpoint, wire::Setpoints{3, {}, 0, {0, 0}, {iq0_A, iq1_A}}));
}

bool arm(Plugged& p) {
  for (int tries = 0; tries < 50; ++tries) {  // offsets take their time after power-on
    const auto answer = p.ask(Kind::arm, wire::Axes{3});
    if (answer.size() >= 4 && answer[0] == 0) return true;
    p.host.control(0x80, 0, 0, 0, 2);
    p.cable.run(0.01);
  }
  return false;
}

TEST(Usb, ArmsAndHoldsCurrentOverTheCable) {
  NEEDS_IMAGE(image);
  Plugged p;
  ASSERT_TRUE(p.configure());
  ASSERT_TRUE(arm(p));
  for (int ms = 0; ms < 40; ++ms) {
    exchange(p, 5.0f, -3.0f);
    p.cable.run(1e-3);
  }
  EXPECT_NEAR(p.pcb->bench.truth(0).current_q_A, 5.0, 0.4);
  EXPECT_NEAR(p.pcb->bench.truth(1).current_q_A, -3.0, 0.4);
  NO_TROUBLE_ON_USB(p);
}

TEST(Usb, APulledCableEndsInZeroCurrentAndTheLinkComesBack) {
  NEEDS_IMAGE(image);
  Plugged p;
  std::mt19937 random(5);
  ASSERT_TRUE(p.configure());
  for (int round = 0; round < 8; ++round) {
    ASSERT_TRUE(arm(p)) << "round " << round;
    const int instants = 20 + static_cast<int>(random() % 400);
    Transfer setpoints = bulk(false, {}, 0, 1);
    for (int ms = 0; ms < 10; ++ms) exchange(p, 4.0f, 4.0f);
    const wire::Setpoints wish{3, {}, 0, {0, 0}, {4.0f, 4.0f}};  // pulled in the middle of this exchange
    p.host.submit(bulk(false, encoded(Kind::setpoint, 1, &wish, sizeof wish), 0, 1));
    p.host.submit(bulk(true, {}, 512, 2));
    std::vector<Transfer> finished;
    const double end_s = p.host.time_s() + instants * 1e-6;
    while (p.host.time_s() < end_s) p.host.turn(finished);
    p.pull();
    p.pcb->run_for(0.1 + 0.2 + 5e-3);  // setpoint_timeout_s and ramp_s, firmware/axis.params
    for (int axis = 0; axis < 2; ++axis) {
      EXPECT_NEAR(p.pcb->bench.truth(axis).current_q_A, 0.0, 0.1) << "round " << round;
      EXPECT_TRUE(p.pcb->gates_open(axis));
    }
    p.cable.plug(true);
    ASSERT_TRUE(p.configure()) << "round " << round;
    EXPECT_EQ(Plugged::as<wire::Hello>(p.ask(Kind::hello)).answer.status, 0);
    p.ask(Kind::disarm, wire::Axes{3});
  }
  EXPECT_EQ(p.pcb->chip.resets(), 0);
  NO_TROUBLE_ON_USB(p);
}

// Arming and setpoints know one caller at a time: the main loop looks at the door while USB waits, and only so long.
TEST(Usb, ComesNeverBetweenTheStepsOfTheDoor) {
  NEEDS_IMAGE(image);
  constexpr int usb = 16 + 67;
  Plugged p;
  ASSERT_TRUE(p.configure());
  auto& chip = p.pcb->chip;
  const auto run_until = [&](auto happened) {
    const double until_s = to_s(chip.now()) + 5e-3;
    while (!happened() && to_s(chip.now()) < until_s) chip.run_for(10e-9);
    return happened();
  };
  const auto arming = [&] { return p.pcb->door().answer[1]; };
  const auto order = [&] { return static_cast<std::uint32_t>(p.pcb->door().order_answer.status); };
  struct Case {
    const char* function;  // where the main loop is when USB comes
    std::function<void()> begin;
    std::function<std::uint32_t()> answer;  // differs from the one before
  };
  const Case cases[] = {{"4Axis3arm", [&] { p.pcb->wish(1, h8_15d::wish_arm); }, arming},
                        {"14ParameterStore5stage",
                         [&] {
                           p.pcb->post(h8_15d::order_stage, {{0x0111, 0}, 1e9f});
                         },
                         order},
                        {"14ParameterStore6commit", [&] { p.pcb->post(h8_15d::order_commit); }, order}};
  for (const auto& [function, begin, answer] : cases) {
    p.pcb->run_for(1.3e-3);
    const std::uint32_t before = answer();
    begin();
    ASSERT_TRUE(run_until([&] {
      return chip.nvic.running() == 0 && chip.function_at(chip.pc()).find(function) != std::string::npos;
    })) << function;
    ASSERT_EQ(answer(), before) << function;
    chip.nvic.pend(usb);
    ASSERT_TRUE(run_until([&] { return chip.nvic.running() == usb; })) << "served afterwards: " << function;
    EXPECT_NE(answer(), before) << "USB came between the steps of " << function;
  }
  EXPECT_EQ(Plugged::as<wire::Hello>(p.ask(Kind::hello)).answer.status, 0);
  NO_TROUBLE_ON_USB(p);
}

// F23 of the safety plan: whatever the bus does, control does not notice. Setpoints come by the debugger's door here.
TEST(Usb, ResetsSuspendsAndGarbageDoNotTouchControl) {
  NEEDS_IMAGE(image);
  Plugged p;
  ASSERT_TRUE(p.configure());
  ASSERT_TRUE(p.pcb->arm());
  hold(*p.pcb, 6.0f, -6.0f, 0.05);
  const auto lost = p.pcb->door().lost_samples[0] + p.pcb->door().lost_samples[1];
  p.pcb->chip.core().clear_counts();
  std::mt19937 random(7);
  double worst_A = 0;
  const auto look = [&] {
    p.pcb->set_current(0, 0.0f, 6.0f);
    p.pcb->set_current(1, 0.0f, -6.0f);
    worst_A = std::max({worst_A, std::abs(p.pcb->bench.truth(0).current_q_A - 6.0),
                        std::abs(p.pcb->bench.truth(1).current_q_A + 6.0)});
  };
  for (int k = 0; k < 60; ++k) {
    switch (random() % 5) {
      case 0:
        p.cable.bus_reset();
        break;
      case 1:
        p.pcb->chip.otg.suspend();
        break;
      case 2:
        p.pcb->chip.otg.resume();
        break;
      case 3:
        ASSERT_TRUE(p.configure());
        break;
      default:
        for (int n = 0; n < 6; ++n) {
          std::vector<std::uint8_t> garbage(64);
          for (auto& byte : garbage) byte = static_cast<std::uint8_t>(random());
          p.host.wait_for(bulk(false, garbage, 0, 1), 2e-3);
        }
    }
    for (int n = 0; n < 20; ++n) {
      look();
      p.pcb->run_for(0.5e-3);
    }
  }
  std::printf("current moved by at most %.2f A in a storm of bus resets, suspends and garbage\n", worst_A);
  EXPECT_LT(worst_A, 0.2);
  EXPECT_EQ(p.pcb->door().lost_samples[0] + p.pcb->door().lost_samples[1], lost);
  EXPECT_EQ(p.pcb->chip.resets(), 0);
  p.cable.plug(true);
  EXPECT_TRUE(p.configure());
  EXPECT_EQ(Plugged::as<wire::Hello>(p.ask(Kind::hello)).answer.status, 0);
  EXPECT_EQ(p.pcb->chip.troubles().count(), 0u) << p.pcb->chip.report_text();
}

TEST(Usb, ASetpointIsInTheDutyWithinTwoPeriodsOfItsArrival) {
  NEEDS_IMAGE(image);
  for (const unsigned cycles : {1u, 2u}) {
    Options o;
    o.cycles_per_instruction = cycles;
    Plugged p(o);
    ASSERT_TRUE(p.configure());
    ASSERT_TRUE(arm(p));
    const auto a = [&] { return static_cast<double>(p.pcb->duty(0).ratio.a); };
    double worst_s = 0, sum_s = 0;
    int measured = 0;
    std::vector<Transfer> finished;
    for (int k = 0; k < 24; ++k) {
      double low = 1, high = 0;  // where the duty lies at rest
      for (int ms = 0; ms < 6; ++ms) {
        exchange(p, 0.0f, 0.0f);
        for (int n = 0; n < 20; ++n) {
          p.cable.run(50e-6);
          low = std::min(low, a()), high = std::max(high, a());
        }
      }
      p.cable.run(static_cast<double>(k) * 50e-6 / 24);  // at any phase of the period
      const wire::Setpoints wish{3, {}, 0, {8.0f, 8.0f}, {8.0f, 8.0f}};
      p.host.submit(bulk(false, encoded(Kind::setpoint, 99, &wish, sizeof wish), 0, 1));
      for (finished.clear(); finished.empty();) p.host.turn(finished);
      const double arrived_s = p.host.time_s();  // the packet's last bit and its handshake
      const double band = 2 * (high - low) + 0.002;
      double now_s = arrived_s;
      while (now_s < arrived_s + 1e-3 && a() > low - band && a() < high + band) {
        p.cable.run(1e-6);
        now_s += 1e-6;
      }
      ASSERT_LT(now_s, arrived_s + 1e-3) << "the duty never moved";
      worst_s = std::max(worst_s, now_s - arrived_s);
      sum_s += now_s - arrived_s;
      ++measured;
      exchange(p, 0.0f, 0.0f);
      p.cable.run(5e-3);
    }
    std::printf("%u cycle(s) an instruction: setpoint to duty mean %.0f us, worst %.0f us of %d = %.2f PWM periods\n",
                cycles, 1e6 * sum_s / measured, 1e6 * worst_s, measured, worst_s / 50e-6);
    EXPECT_LE(worst_s, 100e-6);
    NO_TROUBLE_ON_USB(p);
  }
}

TEST(Usb, BothAxesExchangeSetpointAndStateMoreThanAThousandTimesASecond) {
  NEEDS_IMAGE(image);
  for (const unsigned cycles : {1u, 2u}) {
    Options o;
    o.cycles_per_instruction = cycles;
    Plugged p(o);
    ASSERT_TRUE(p.configure());
    ASSERT_TRUE(arm(p));
    p.pcb->chip.core().clear_counts();
    std::vector<double> trips_s;
    const double from_s = p.host.time_s();
    while (p.host.time_s() < from_s + 0.2) {
      const double sent_s = p.host.time_s();
      const wire::State state = exchange(p, 2.0f, -2.0f);
      ASSERT_EQ(state.answer.status, 0);
      trips_s.push_back(p.host.time_s() - sent_s);
    }
    std::sort(trips_s.begin(), trips_s.end());
    const double per_s = static_cast<double>(trips_s.size()) / (p.host.time_s() - from_s);
    const auto& lane = p.pcb->chip.core().lane(16 + 67);
    std::printf(
        "%u cycle(s) an instruction: %.0f exchanges a second, round trip median %.0f us, 99 %% %.0f us, worst %.0f us; "
        "USB handler worst %llu instructions, mean %.0f\n",
        cycles, per_s, 1e6 * trips_s[trips_s.size() / 2], 1e6 * trips_s[trips_s.size() * 99 / 100],
        1e6 * trips_s.back(), static_cast<unsigned long long>(lane.worst),
        static_cast<double>(lane.total) / static_cast<double>(lane.calls));
    for (std::size_t from = 0, to = 0; from < trips_s.size(); from = to) {  // round trips by 20 us
      const auto slot = static_cast<int>(trips_s[from] / 20e-6);
      while (to < trips_s.size() && static_cast<int>(trips_s[to] / 20e-6) == slot) ++to;
      std::printf("  %4d us %6zu %s\n", 20 * slot, to - from,
                  std::string(1 + 60 * (to - from) / trips_s.size(), '#').c_str());
    }
    EXPECT_GT(per_s, 1000);
    EXPECT_EQ(p.pcb->chip.resets(), 0);
    NO_TROUBLE_ON_USB(p);
  }
}

}  // namespace
}  // namespace image_tests

// SPDX-License-Identifier: MIT
// How quickly a setpoint is obeyed, and how surely a silent host is left.

#include <cmath>
#include <random>

#include "tests/usb/linked.hpp"

namespace {

using namespace usb_host;

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

TEST_F(Linked, TheControlModeIsChosenByACommandAndReported) {
  const auto choose = [&](std::uint8_t mask, int mode) {
    return program.status(Kind::mode, {mask, static_cast<std::uint8_t>(mode)});
  };
  EXPECT_EQ(choose(3, 2), number(Status::out_of_range));
  EXPECT_EQ(choose(4, 1), number(Status::no_such_axis));
  EXPECT_EQ(choose(0, 1), number(Status::no_such_axis));
  arm(1);
  EXPECT_EQ(choose(3, 1), number(Status::mode_in_use));
  EXPECT_EQ(axis(1).control(), wire::ControlMode::current) << "all of them or none";
  EXPECT_EQ(choose(2, 1), 0);
  arm(2);
  wire::Setpoints wish{3, {wire::ControlMode::current, wire::ControlMode::torque}, 0, {0, 0}, {2.0f, 0.072f}};
  wire::State state{};
  for (int k = 0; k < 30; ++k) state = program.call_for<wire::State>(Kind::setpoint, bytes_of(wish)), program.pass(20);
  EXPECT_EQ(state.axis[0].control, wire::ControlMode::current);
  EXPECT_EQ(state.axis[1].control, wire::ControlMode::torque);
  EXPECT_NEAR(state.axis[0].iq_A, 2.0f, 0.2f);
  EXPECT_NEAR(state.axis[1].iq_A, 0.072 / (27.6e-3 * std::sqrt(3.0) / 2), 0.2);  // the sheet's, per ampere of amplitude
  // Amperes where newton metres are expected, and the other way round, feed nobody.
  std::swap(wish.mode[0], wish.mode[1]);
  for (int k = 0; k < 400; ++k) {
    state = program.call_for<wire::State>(Kind::setpoint, bytes_of(wish));
    EXPECT_EQ(state.axis[0].refused, number(Status::other_mode));
    EXPECT_EQ(state.axis[1].refused, number(Status::other_mode));
    program.pass(20);
  }
  wish.mode[0] = static_cast<wire::ControlMode>(7);
  state = program.call_for<wire::State>(Kind::setpoint, bytes_of(wish));
  EXPECT_EQ(state.axis[0].refused, number(Status::out_of_range));
  EXPECT_EQ(axis(0).mode(), firmware::Mode::ready);
  EXPECT_EQ(axis(1).mode(), firmware::Mode::ready);
}

TEST_F(Linked, EveryStartBeginsWithCurrent) {
  ASSERT_EQ(program.status(Kind::mode, {3, 1}), 0);
  board.power_cycle();
  EXPECT_EQ(axis(0).control(), wire::ControlMode::current);
  EXPECT_EQ(axis(1).control(), wire::ControlMode::current);
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

/// What holds in each PWM period whatever was asked for before, in any order.
struct Invariants {
  struct Asked {
    float iq_A = 0.0f;        // by the last setpoint
    int ago = 1 << 20;        // periods since it,
    int arm_ago = 1 << 20;    // since arm
    int clear_ago = 1 << 20;  // and since clear were sent
    firmware::Mode mode = firmware::Mode::off;
    float allowance_A = 0.0f;
    double hottest_degC = 0.0;
  };
  Asked asked[2];

  /// A frame may wait for the bus, and for an errand before it.
  static constexpr int soon = 100;

  void look(const firmware::Axis& axis, Asked& a) {
    using firmware::Mode;
    ++a.ago, ++a.arm_ago, ++a.clear_ago;
    const Mode mode = axis.mode();
    const float permitted_A = std::hypot(axis.fast().permitted_A.d, axis.fast().permitted_A.q);
    const float allowance_A = axis.state().allowance_A;
    if (mode != Mode::running) {
      ASSERT_EQ(permitted_A, 0.0f);
      ASSERT_EQ(axis.fast().ratio.a, 0.5f) << "the bridge is open";
    }
    ASSERT_LE(permitted_A, std::fmax(allowance_A, a.allowance_A) * 1.0001f);
    const float left = 1.0f - static_cast<float>(a.ago - 2000 - soon) / 4000.0f;  // 100 ms, and a ramp of 200 ms
    if (left < 1.0f) {
      ASSERT_LE(permitted_A, std::fmax(left, 0.0f) * std::fabs(a.iq_A) + 1e-4f) << a.ago;
    }
    if (left < 0.0f) {
      ASSERT_NE(mode, Mode::running);
    }
    if (a.mode == Mode::tripped && mode != Mode::tripped) {
      ASSERT_LT(a.clear_ago, soon);
      ASSERT_EQ(a.iq_A, 0.0f);
    }
    if (a.mode == Mode::off && mode != Mode::off && mode != Mode::tripped) {
      ASSERT_LT(a.arm_ago, soon);
    }
    const double hottest_degC = axis.core().estimate().hottest_degC();
    // By less in 10 ms, but where all of it is only believed to be as warm as an ambient of 70 degC at most.
    if (a.hottest_degC > 70.0) {
      ASSERT_GT(hottest_degC, a.hottest_degC - 2.0);
    }
    a.mode = mode, a.allowance_A = allowance_A, a.hottest_degC = hottest_degC;
  }
};

TEST_F(Linked, NoOrderOfCommandsDrivesADisarmedAxisOrCoolsAnEstimate) {
  std::mt19937 seed{11};
  const auto drawn = [&seed](int from, int to) { return std::uniform_int_distribution<int>(from, to)(seed); };
  Invariants held;
  int ran[2] = {}, tripped = 0, committed = 0;
  for (int step = 0; step < 3000 && !HasFatalFailure(); ++step) {
    const auto mask = static_cast<std::uint8_t>(drawn(1, 3));
    const auto each = [&](auto what) {
      for (int i = 0; i < 2; ++i) {
        if (mask >> i & 1) what(held.asked[i], i);
      }
    };
    const auto send = [&](Kind kind, const Bytes& payload = {}) {
      program.write(Program::framed(kind, static_cast<std::uint8_t>(step), payload));
    };
    switch (drawn(0, 15)) {
      case 0:
      case 1:
      case 2:
        each([](Invariants::Asked& a, int) { a.arm_ago = 0; });
        send(Kind::arm, {mask});
        break;
      case 3:
        send(Kind::disarm, {mask});
        break;
      case 4:
      case 5:
        each([](Invariants::Asked& a, int) { a.clear_ago = 0; });
        send(Kind::clear, {mask});
        break;
      case 6: {
        constexpr std::uint16_t ids[] = {0x0111, 0x0203, 0x0205, 0x020C};  // current limit, C1, limit, ambient
        constexpr float from[] = {2, 2, 80, -20}, to[] = {20, 30, 200, 70};
        const int k = drawn(0, 3);
        const float value = from[k] + (to[k] - from[k]) * static_cast<float>(drawn(0, 100)) / 100.0f;
        send(Kind::stage, bytes_of(wire::Assignment{{ids[k], static_cast<std::uint8_t>(mask & 1)}, value}));
        break;
      }
      case 7:
        ++committed;
        send(Kind::commit);
        break;
      case 8:
        // Not of nothing: the walk would end here.
        send(wire::is_unset(board.parameters().in_force().axes[0].drive.pole_pairs_count) ? Kind::state : Kind::save);
        break;
      case 9:
        send(Kind::load, {static_cast<std::uint8_t>(drawn(0, 2))});
        break;
      case 10:
        if (drawn(0, 9) == 0) {
          each([&](Invariants::Asked&, int i) {
            (void)axis(i).tick({{40.0f, -20.0f, -20.0f}, 48.0f, 1.0f, static_cast<std::uint32_t>(step), true});
          });
          ++tripped;
        }
        break;
      default: {
        const float iq_A = drawn(0, 2) == 0 ? 0.0f : static_cast<float>(drawn(-20, 20));
        each([&](Invariants::Asked& a, int) { a.iq_A = iq_A, a.ago = 0; });
        send(Kind::setpoint, setpoint(mask, iq_A, iq_A));
      }
    }
    program.frames().clear();
    const int periods = drawn(0, 40) == 0 ? 7000 : drawn(1, 200);
    for (int k = 0; k < periods && !HasFatalFailure(); ++k) {
      if (k % 4 == 0) program.exchange();
      board.advance(1);
      for (int i = 0; i < 2; ++i) {
        held.look(axis(i), held.asked[i]);
        ran[i] += axis(i).mode() == firmware::Mode::running;
      }
    }
  }
  std::printf("  %d and %d periods ran, %d trips, %d commits\n", ran[0], ran[1], tripped, committed);
  EXPECT_GT(ran[0], 10000);
  EXPECT_GT(ran[1], 10000);
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

}  // namespace

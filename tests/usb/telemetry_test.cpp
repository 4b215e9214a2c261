// SPDX-License-Identifier: MIT
// Signals as they are pushed, and as a capture holds them.

#include "boards/dual_48v_20a.hpp"
#include "tests/usb/linked.hpp"

namespace {

using namespace usb_host;

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

TEST_F(Linked, RowsThatMissPeriodsBeginANewFrame) {
  const firmware::usb::Identity identity{"test", "0", "1"};
  auto recorder = std::make_unique<firmware::Recorder>();
  firmware::Commands commands(board.driver(), *recorder, board.parameters(), identity);
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

TEST_F(Linked, ACaptureThatWaitsIsGivenUpByOneWithoutSignals) {
  const wire::SignalAddress iq{id_iq, 0};
  ASSERT_EQ(
      program.status(Kind::capture, bytes_of(wire::CaptureOrder{iq, wire::Edge::rising, 0, 50.0f, 10, 10, 1}, iq)), 0);
  program.pass(40);
  ASSERT_EQ(program.call_for<wire::CaptureStatus>(Kind::capture_status).phase, wire::CapturePhase::waiting);
  ASSERT_EQ(program.status(Kind::capture, bytes_of(wire::CaptureOrder{{0, 0}, wire::Edge::now, 0, 0, 0, 0, 1})), 0);
  program.pass(40);
  EXPECT_EQ(program.call_for<wire::CaptureStatus>(Kind::capture_status).phase, wire::CapturePhase::idle);
  EXPECT_EQ(program.status(Kind::capture_read, bytes_of(wire::Index{0})), number(Status::nothing_captured));
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

}  // namespace

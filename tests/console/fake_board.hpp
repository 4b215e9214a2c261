// SPDX-License-Identifier: MIT
// A board made of a script, for tests of the console alone: it speaks wire's protocol over memory, keeps parameters,
// and misbehaves when told to. It knows no motor; its clock moves only in wait().
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "console/link/transport.hpp"
#include "wire/protocol.hpp"

struct FakeBoard {
  struct Parameter {
    std::uint16_t id;
    const char *name, *unit, *doc;
    float min, max, fallback;
    std::uint8_t flags = 0, axes = 2;
  };
  struct Signal {
    std::uint8_t id;
    const char *name, *unit;
  };
  using Values = std::map<std::pair<std::uint16_t, std::uint8_t>, float>;

  std::vector<Parameter> parameters = {
      {0x0101, "phase_resistance", "ohm", "of one phase", 1e-3f, 50.0f, std::nanf(""), wire::needs_disarmed},
      {0x0104, "flux_linkage", "Wb", "peak, of one phase", 1e-5f, 1.0f, 0.01f, wire::needs_disarmed},
      {0x0105, "pole_pairs", "count", "whole number", 1.0f, 50.0f, 1.0f, wire::whole_number},
      {0x0111, "current_limit", "A", "amplitude", 0.0f, 100.0f, 20.0f},
      {0x0201, "fan_delay", "s", "of the whole board", 0.0f, 60.0f, 5.0f, 0, 1}};
  std::vector<Signal> signals = {{0x01, "id", "A"},        {0x02, "iq", "A"},        {0x0E, "bus", "V"},
                                 {0x10, "speed", "rad/s"}, {0x41, "core_a", "degC"}, {0x47, "housing_measured", "degC"},
                                 {0x11, "mode", ""},       {0x12, "limit", ""}};

  // What a test looks at or bends.
  std::uint16_t protocol = wire::protocol_version;
  Values in_force, staged, saved;
  std::uint8_t armed = 0;
  int saves = 0, setpoints = 0;
  wire::ControlMode control[wire::axis_count]{};
  bool unplugged = false;
  std::uint8_t fault = 0;
  float temperature_degC = 30.0f;
  std::uint8_t axis1_limit = 0;
  std::uint32_t lost_periods = 0;  // of a capture, between its first answer and the second
  wire::FaultEvidence evidence{};
  wire::Outlook standing{{}, 0, {}, 171.0f, 0.21f, 0.8f}, turning{{}, 1, {}, 98.0f, INFINITY, 1.0f};
  float enough_rest_s = INFINITY;     // before a course, for any
  std::vector<wire::Segment> course;  // last
  /// Sees each request before it is answered; false: no answer comes.
  std::function<bool(wire::Kind)> before = [](wire::Kind) { return true; };
  /// Sees time pass.
  std::function<void()> passing = [] {};
  /// May change an answer's payload before it is framed.
  std::function<void(wire::Kind, std::vector<std::uint8_t>&)> twist = [](wire::Kind, std::vector<std::uint8_t>&) {};

  /// Holds back one answer of this kind until the next one of it, and sends both then.
  wire::Kind late{};

  FakeBoard() {
    for (const Parameter& p : parameters) {
      for (std::uint8_t a = 0; a < p.axes; ++a)
        in_force[{p.id, p.axes == 1 ? wire::no_axis : a}] = std::isnan(p.fallback) ? 0.5f : p.fallback;
    }
    saved = in_force;
  }

  // The board's end of the stream.
  std::deque<std::uint8_t> to_pc;
  double now_s = 0;
  wire::FrameReader reader;

  void take(std::span<const std::uint8_t> bytes) {
    for (const std::uint8_t byte : bytes) {
      if (reader.take(byte)) answer(reader.frame());
    }
  }
  void pass(double seconds) {
    now_s += seconds;
    passing();
    while (!watched_.empty() && next_row_s_ <= now_s) push_row();
  }

 private:
  using Bytes = std::vector<std::uint8_t>;

  template <class Message>
  static void add(Bytes& bytes, const Message& message) {
    const auto* first = reinterpret_cast<const std::uint8_t*>(&message);
    bytes.insert(bytes.end(), first, first + sizeof message);
  }
  static void add(Bytes& bytes, const char* text) { bytes.insert(bytes.end(), text, text + std::strlen(text) + 1); }
  template <class Message>
  static std::vector<Message> list(const wire::Frame& frame, std::size_t after) {
    std::vector<Message> all((frame.bytes - after) / sizeof(Message));
    if (!all.empty()) std::memcpy(all.data(), frame.payload + after, all.size() * sizeof(Message));
    return all;
  }

  void send(std::uint8_t kind, std::uint8_t sequence, const Bytes& payload) {
    std::uint8_t out[wire::max_encoded];
    const wire::Frame frame{kind, sequence, static_cast<std::uint16_t>(payload.size()), payload.data()};
    const std::size_t n = wire::encode(frame, out, sizeof out);
    to_pc.insert(to_pc.end(), out, out + n);
  }

  wire::State state() const {
    wire::State s{};
    s.period = static_cast<std::uint32_t>(now_s * 20000.0);
    s.bus_V = 48.0f;
    for (int a = 0; a < wire::axis_count; ++a) {
      wire::AxisReport& axis = s.axis[a];
      axis.mode = (armed >> a & 1) != 0 ? 2 : fault != 0 ? 3 : 0;
      axis.fault = fault;
      axis.refused = refused_[a];
      axis.control = control[a];
      axis.iq_A = asked_A_[a];
      axis.core_degC = temperature_degC;
      axis.core_sigma_K = 1.5f;
      axis.housing_degC = 28.0f;
      axis.allowance_A = 17.0f;
    }
    s.axis[1].limit = axis1_limit;
    return s;
  }

  void push_row() {
    Bytes payload;
    add(payload, wire::Rows{{},
                            static_cast<std::uint32_t>(next_row_s_ * 20000.0 + 0.5),
                            0,
                            decimation_,
                            static_cast<std::uint8_t>(watched_.size()),
                            1});
    for (const auto& signal : watched_) add(payload, 20.0f + static_cast<float>(signal.id));
    twist(wire::Kind::telemetry, payload);
    send(static_cast<std::uint8_t>(wire::Kind::telemetry), telemetry_sequence_++, payload);
    next_row_s_ += decimation_ / 20000.0;
  }

  void refuse(const wire::Frame& frame) {
    Bytes payload;
    add(payload, wire::Answer{0xFF, wire::no_axis, 0});  // a status that nobody declared
    send(static_cast<std::uint8_t>(frame.kind | wire::reply_bit), frame.sequence, payload);
  }

  void answer(const wire::Frame& frame) {
    const auto kind = static_cast<wire::Kind>(frame.kind);
    if (!before(kind) || unplugged) return;
    Bytes payload;
    wire::Answer verdict{};
    const std::uint8_t mask = frame.bytes > 0 ? frame.payload[0] : 0;
    switch (kind) {
      case wire::Kind::hello: {
        wire::Hello hello{{},
                          protocol,
                          wire::max_payload,
                          0x1234abcd,
                          static_cast<std::uint16_t>(parameters.size()),
                          static_cast<std::uint16_t>(signals.size()),
                          wire::axis_count,
                          {},
                          20000.0f,
                          2048,
                          12.0f,
                          58.0f,
                          "fake",
                          "0.1",
                          "FAKE01"};
        add(payload, hello);
        break;
      }
      case wire::Kind::describe_parameter: {
        if (mask >= parameters.size()) return refuse(frame);
        const Parameter& p = parameters[mask];
        add(payload, wire::ParameterText{{}, p.id, p.axes, p.flags, p.min, p.max, p.fallback});
        add(payload, p.name), add(payload, p.unit), add(payload, p.doc);
        break;
      }
      case wire::Kind::describe_signal: {
        if (mask >= signals.size()) return refuse(frame);
        const Signal& s = signals[mask];
        add(payload, wire::SignalText{{}, s.id, 2});
        add(payload, s.name), add(payload, s.unit), add(payload, "doc");
        break;
      }
      case wire::Kind::get:
        add(payload, wire::Answer{});
        for (const auto& a : list<wire::Address>(frame, 0)) {
          if (in_force.count({a.id, a.axis}) == 0) return refuse(frame);
          add(payload, in_force[{a.id, a.axis}]);
        }
        break;
      case wire::Kind::stage:
        for (const auto& a : list<wire::Assignment>(frame, 0)) staged[{a.address.id, a.address.axis}] = a.value;
        add(payload, verdict);
        break;
      case wire::Kind::commit:
        // A rule across parameters that only the board knows.
        if (staged.at({0x0111, 0}) * staged.at({0x0101, 0}) > 48.0f)
          verdict = {static_cast<std::uint8_t>(wire::Status::parameters_unset), 0, 0x0111};
        else
          in_force = staged;
        add(payload, verdict);
        break;
      case wire::Kind::save:
        saved = in_force;
        ++saves;
        add(payload, verdict);
        break;
      case wire::Kind::load:
        staged = in_force;
        add(payload, verdict);
        break;
      case wire::Kind::arm:
        if (fault != 0)
          verdict = {static_cast<std::uint8_t>(wire::Status::tripped), 0, 0};
        else
          armed = static_cast<std::uint8_t>(armed | mask);
        add(payload, verdict);
        break;
      case wire::Kind::disarm:
        armed = static_cast<std::uint8_t>(armed & ~mask);
        add(payload, verdict);
        break;
      case wire::Kind::clear:
        fault = 0;
        evidence = {};
        add(payload, verdict);
        break;
      case wire::Kind::mode: {
        wire::ChooseMode wish{};
        (void)wire::read(frame.payload, frame.bytes, wish);
        if ((armed & wish.mask) != 0) verdict = {static_cast<std::uint8_t>(wire::Status::mode_in_use), 0, 0};
        for (int a = 0; a < wire::axis_count && verdict.status == 0; ++a) {
          if ((wish.mask >> a & 1) != 0) control[a] = wish.mode;
        }
        add(payload, verdict);
        break;
      }
      case wire::Kind::setpoint: {
        wire::Setpoints asked{};
        (void)wire::read(frame.payload, frame.bytes, asked);
        for (int a = 0; a < wire::axis_count; ++a) {
          refused_[a] = 0;
          if ((asked.mask >> a & 1) == 0) continue;
          if (asked.mode[a] != control[a])
            refused_[a] = static_cast<std::uint8_t>(wire::Status::other_mode);
          else if (!(std::abs(asked.q[a]) < 1000.0f))
            refused_[a] = static_cast<std::uint8_t>(wire::Status::not_a_current);
          else
            asked_A_[a] = asked.q[a];
        }
        ++setpoints;
        add(payload, state());
        break;
      }
      case wire::Kind::state:
        add(payload, state());
        break;
      case wire::Kind::fault:
        add(payload, evidence);
        break;
      case wire::Kind::calibrate:
        add(payload, wire::Offsets{{}, {0.01f, -0.02f, 0.03f}});
        break;
      case wire::Kind::ask:
        course = list<wire::Segment>(frame, sizeof(wire::Ask));
        add(payload, course.front().current_A == 0 && course.front().seconds >= enough_rest_s
                         ? wire::Outlook{{}, 1, {}, 98.0f, INFINITY, 1.0f}
                     : frame.payload[1] != 0 ? standing
                                             : turning);
        break;
      case wire::Kind::subscribe:
        watched_ = list<wire::SignalAddress>(frame, sizeof(wire::Subscribe));
        decimation_ = static_cast<std::uint16_t>(frame.payload[0] | frame.payload[1] << 8);
        next_row_s_ = now_s;
        add(payload, verdict);
        break;
      case wire::Kind::capture:
        (void)wire::read(frame.payload, frame.bytes, order_);
        captured_ = static_cast<int>(list<wire::SignalAddress>(frame, sizeof(wire::CaptureOrder)).size());
        add(payload, verdict);
        break;
      case wire::Kind::capture_status:
        add(payload, wire::CaptureStatus{{},
                                         wire::CapturePhase::complete,
                                         static_cast<std::uint8_t>(captured_),
                                         static_cast<std::uint16_t>(order_.pre + order_.post),
                                         order_.pre,
                                         order_.decimation,
                                         trigger_period});
        break;
      case wire::Kind::capture_read: {
        const int first = mask | frame.payload[1] << 8,
                  fit = static_cast<int>(wire::max_row_values) / std::max(1, captured_);
        const int rows = std::clamp(order_.pre + order_.post - first, 0, fit);
        const int since_trigger = (first - order_.pre) * order_.decimation;
        add(payload,
            wire::Rows{{},
                       trigger_period + static_cast<std::uint32_t>(since_trigger) + (first > 0 ? lost_periods : 0),
                       0,
                       order_.decimation,
                       static_cast<std::uint8_t>(captured_),
                       static_cast<std::uint8_t>(rows)});
        for (int i = 0; i < rows * captured_; ++i) add(payload, static_cast<float>(first + i / captured_));
        break;
      }
      default:
        return refuse(frame);
    }
    twist(kind, payload);
    if (unplugged) return;
    if (late == kind) {
      late = {};
      held_ = {wire::reply_to(kind), frame.sequence, payload};
      return;
    }
    if (held_.kind == wire::reply_to(kind)) send(held_.kind, held_.sequence, held_.payload);
    send(wire::reply_to(kind), frame.sequence, payload);
  }

  static constexpr std::uint32_t trigger_period = 20;  // as if the counter had wrapped a moment ago

  struct Held {
    std::uint8_t kind = 0, sequence = 0;
    Bytes payload;
  } held_;
  float asked_A_[wire::axis_count]{};
  std::uint8_t refused_[wire::axis_count]{};
  std::vector<wire::SignalAddress> watched_;
  std::uint16_t decimation_ = 1;
  double next_row_s_ = 0;
  std::uint8_t telemetry_sequence_ = 0;
  wire::CaptureOrder order_{};
  int captured_ = 0;
};

/// The cable to it.
class FakeTransport final : public console::link::Transport {
 public:
  explicit FakeTransport(std::shared_ptr<FakeBoard> board) : board_(std::move(board)) {}
  bool write(std::span<const std::uint8_t> bytes) override {
    if (board_->unplugged) return false;
    board_->take(bytes);
    return true;
  }
  std::size_t read(std::span<std::uint8_t> room) override {
    const std::size_t n = std::min(room.size(), board_->to_pc.size());
    std::copy_n(board_->to_pc.begin(), n, room.begin());
    board_->to_pc.erase(board_->to_pc.begin(), board_->to_pc.begin() + static_cast<std::ptrdiff_t>(n));
    return n;
  }
  void wait(int milliseconds) override { board_->pass(milliseconds * 1e-3); }
  double now_s() const override { return board_->now_s; }
  bool gone() const override { return board_->unplugged; }

 private:
  std::shared_ptr<FakeBoard> board_;
};

// SPDX-License-Identifier: MIT
// A conversation with one board: ask, wait, check, and say in one sentence what went wrong.
//
// Every call may throw UserError: gone (unplugged, or silent for longer than the request may take), refused (the
// board's own reason and advice), wrong_version. Time-outs run on the transport's clock.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "console/dictionary.hpp"
#include "console/link/board.hpp"
#include "console/link/messages.hpp"

namespace console {

struct Assignment {
  Target target;
  float value;
};

class Session {
 public:
  /// Says hello.
  explicit Session(std::unique_ptr<link::Transport> transport);

  const wire::Hello& hello() const { return hello_; }
  /// "h8-15d 3A00C5": how sentences call this board.
  const std::string& name() const { return name_; }
  const Dictionary& parameters();  // fetched when first asked for
  const Dictionary& signals();

  std::vector<float> get(const std::vector<Target>& targets);
  /// All of them or none: staged, checked by the board as a whole, put in force.
  void set(const std::vector<Assignment>& assignments);
  void save();
  void load(wire::LoadFrom from);  // stages and puts in force

  void arm(std::uint8_t mask);
  void disarm(std::uint8_t mask);
  void clear(std::uint8_t mask);
  void choose(std::uint8_t mask, wire::ControlMode mode);
  wire::State exchange(const wire::Setpoints& setpoints);
  wire::State state();
  wire::FaultEvidence fault(int axis);
  wire::Offsets calibrate(int axis);
  /// `standing`: each phase as if it were the hottest, wherever the rotor stands; else all phases share the heat.
  wire::Outlook ask(int axis, std::span<const wire::Segment> segments, bool standing);

  /// From now on each telemetry frame goes to `taker`, whatever else is asked or waited for meanwhile.
  void subscribe(const std::vector<Target>& signals, std::uint16_t decimation,
                 std::function<void(const link::RowsView&)> taker);
  void unsubscribe();
  /// Telemetry that still comes is thrown away.
  void take_no_more() { taker_ = {}; }

  void capture(const wire::CaptureOrder& order, const std::vector<Target>& signals);
  wire::CaptureStatus capture_status();
  /// Appends the rows from `first` on that fit one answer, `signals` values each; returns how many. They follow each
  /// other without a gap from `period` on.
  int capture_read(std::uint16_t first, int signals, std::vector<float>& values, std::uint32_t& period);

  double now_s() const { return board_.now_s(); }
  /// Lets telemetry come in until then.
  void wait_until(double time_s);

 private:
  /// A frame that has arrived and is no telemetry.
  const wire::Frame* read();
  /// The answer to a request; `what` completes "refused to ...".
  const wire::Frame& request(wire::Kind kind, std::span<const std::uint8_t> payload, const std::string& what,
                             double patience_s = 1.0);
  template <class Message>
  Message asked(wire::Kind kind, std::span<const std::uint8_t> payload, const std::string& what,
                double patience_s = 1.0);
  [[noreturn]] void misread(const std::string& what) const;
  [[noreturn]] void vanished(const std::string& what) const;
  [[noreturn]] void refuse(const wire::Answer& answer, const std::string& what);
  Dictionary fetch(const std::string& kind, std::uint16_t count, bool parameters);

  link::Board board_;
  wire::Hello hello_{};
  std::string name_;
  std::optional<Dictionary> parameters_, signals_;
  int subscribed_ = 0;
  std::function<void(const link::RowsView&)> taker_;
};

}  // namespace console

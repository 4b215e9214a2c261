// SPDX-License-Identifier: MIT
#include "console/session.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "wire/pc/user_error.hpp"

namespace console {
namespace {

using link::bytes_of;
using wire::Kind;
using wire::pc::Exit;
using wire::pc::refuse;
using wire::pc::UserError;

// An answer takes milliseconds; the slow ones erase a flash sector (up to 2 s on an STM32F405, its data sheet's Table
// 43, rounded up) or think ahead over hours.
constexpr double slow_s = 5.0;
// 60 s ahead take a board 1.2 s, in the dearest model up to 7 s.
constexpr double look_ahead_s = 15.0;

/// A head and what is packed behind it.
class Payload {
 public:
  template <class Message>
  void add(const Message& message) {
    const auto bytes = bytes_of(message);
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  }
  operator std::span<const std::uint8_t>() const { return bytes_; }

 private:
  std::vector<std::uint8_t> bytes_;
};

std::string axes_of(std::uint8_t mask) { return mask == 3 ? "both axes" : mask == 2 ? "axis 1" : "axis 0"; }

/// How many addresses, assignments and so on fit one request or its answer.
std::size_t most(std::size_t bytes_each) { return (wire::max_payload - sizeof(wire::Answer)) / bytes_each; }

}  // namespace

Session::Session(std::unique_ptr<link::Transport> transport) : board_(std::move(transport)) {
  name_ = "the board";
  const auto hello = link::hello_in(request(Kind::hello, {}, "say what it is"));
  if (!hello) misread("say what it is");
  hello_ = *hello;
  if (hello_.protocol != wire::protocol_version) {
    throw UserError(Exit::wrong_version, fmt::format("The board's firmware speaks protocol {} and this program {}; {}.",
                                                     hello_.protocol, wire::protocol_version,
                                                     hello_.protocol > wire::protocol_version ? "use a newer hotcore"
                                                                                              : "update the firmware"));
  }
  name_ = fmt::format("{} {}", hello_.board, hello_.serial);
}

const wire::Frame* Session::read() {
  while (const wire::Frame* frame = board_.read()) {
    if (frame->kind != static_cast<std::uint8_t>(Kind::telemetry)) return frame;
    const auto rows = link::rows_in(*frame, frame->kind, subscribed_);
    if (rows && taker_) taker_(*rows);
  }
  return nullptr;
}

const wire::Frame& Session::request(Kind kind, std::span<const std::uint8_t> payload, const std::string& what,
                                    double patience_s) {
  const double until_s = board_.now_s() + patience_s;
  std::optional<std::uint8_t> sequence;
  int restarts = board_.restarts();
  while (true) {
    if (board_.restarts() != restarts) {  // question or answer may be lost: ask again
      restarts = board_.restarts();
      sequence.reset();
    }
    if (!sequence) sequence = board_.write(static_cast<std::uint8_t>(kind), payload);
    const wire::Frame* frame = sequence ? read() : nullptr;
    if (frame == nullptr) {
      if (board_.gone() || board_.now_s() > until_s) vanished(what);
      board_.wait(10);
      continue;
    }
    // An answer that came after its time-out is none of this request's.
    if (frame->kind != wire::reply_to(kind) || frame->sequence != *sequence) continue;
    const auto answer = link::answer_in(*frame, kind);
    if (!answer) misread(what);
    if (answer->status != 0) refuse(*answer, what);
    return *frame;
  }
}

template <class Message>
Message Session::asked(Kind kind, std::span<const std::uint8_t> payload, const std::string& what, double patience_s) {
  const auto message = link::message_in<Message>(request(kind, payload, what, patience_s), kind);
  if (!message) misread(what);
  return *message;
}

void Session::misread(const std::string& what) const {
  throw UserError(Exit::wrong_version,
                  fmt::format("{}: asked to {}, it answered something that this program does not understand; "
                              "update the firmware or hotcore.",
                              name_, what));
}

void Session::vanished(const std::string& what) const {
  throw UserError(Exit::gone, fmt::format("{}: {} when asked to {}; check cable and power, then try again.", name_,
                                          board_.gone() ? "unplugged" : "no answer", what));
}

void Session::refuse(const wire::Answer& answer, const std::string& what) {
  const wire::CodeText text = wire::text_of(answer.status);
  const std::string reason = text.happened[0] != '\0'
                                 ? text.happened
                                 : fmt::format("for reason {:#04x}, which this program does not know", answer.status);
  const std::string advice = text.advice[0] != '\0' ? text.advice : "use a newer hotcore";
  std::string whose;
  if (answer.id != 0 && parameters_)
    whose = parameters_->told(answer.id, answer.axis) + ": ";
  else if (answer.axis < wire::axis_count && what.find("axis") == std::string::npos)
    whose = fmt::format("axis {}: ", answer.axis);
  throw UserError(Exit::refused, fmt::format("{} refused to {}: {}{}; {}.", name_, what, whose, reason, advice));
}

Dictionary Session::fetch(const std::string& kind, std::uint16_t count, bool parameters) {
  std::vector<Description> entries;
  for (std::uint16_t i = 0; i < count; ++i) {
    const std::string what = fmt::format("describe {} {} of {}", kind, i + 1, count);
    const wire::Index index{i};
    auto entry = parameters ? link::parameter_in(request(Kind::describe_parameter, bytes_of(index), what))
                            : link::signal_in(request(Kind::describe_signal, bytes_of(index), what));
    if (!entry) misread(what);
    entries.push_back(std::move(*entry));
  }
  return Dictionary(kind, std::move(entries));
}

const Dictionary& Session::parameters() {
  if (!parameters_) parameters_ = fetch("parameter", hello_.parameters, true);
  return *parameters_;
}

const Dictionary& Session::signals() {
  if (!signals_) signals_ = fetch("signal", hello_.signals, false);
  return *signals_;
}

std::vector<float> Session::get(const std::vector<Target>& targets) {
  std::vector<float> values(targets.size());
  const std::size_t most_at_once = most(sizeof(wire::Address));
  for (std::size_t from = 0; from < targets.size(); from += most_at_once) {
    const std::size_t n = std::min(most_at_once, targets.size() - from);
    Payload payload;
    for (std::size_t i = from; i < from + n; ++i) payload.add(wire::Address{targets[i].what->id, targets[i].axis});
    const wire::Frame& frame = request(Kind::get, payload, "tell parameters");
    if (!link::values_in(frame, std::span(values).subspan(from, n))) misread("tell parameters");
  }
  return values;
}

void Session::set(const std::vector<Assignment>& assignments) {
  const wire::Load as_is{wire::LoadFrom::in_force};
  request(Kind::load, bytes_of(as_is),
          "begin a change of parameters");  // whatever was staged by somebody else is dropped
  const std::size_t most_at_once = most(sizeof(wire::Assignment));
  for (std::size_t from = 0; from < assignments.size(); from += most_at_once) {
    Payload payload;
    for (std::size_t i = from; i < std::min(from + most_at_once, assignments.size()); ++i) {
      const auto& [target, value] = assignments[i];
      payload.add(wire::Assignment{{target.what->id, target.axis}, value});
    }
    request(Kind::stage, payload, "take parameters");
  }
  request(Kind::commit, {}, "put the parameters in force", slow_s);
}

void Session::save() {
  request(Kind::save, {}, "save its parameters, which are in force until the next reset", slow_s);
}

void Session::load(wire::LoadFrom from) {
  const wire::Load load{from};
  request(Kind::load, bytes_of(load), "load parameters", slow_s);
  request(Kind::commit, {}, "put the parameters in force", slow_s);
}

void Session::arm(std::uint8_t mask) { request(Kind::arm, bytes_of(wire::Axes{mask}), "arm " + axes_of(mask)); }

void Session::disarm(std::uint8_t mask) {
  request(Kind::disarm, bytes_of(wire::Axes{mask}), "disarm " + axes_of(mask));
}

void Session::clear(std::uint8_t mask) {
  request(Kind::clear, bytes_of(wire::Axes{mask}), "clear the fault of " + axes_of(mask));
}

void Session::choose(std::uint8_t mask, wire::ControlMode mode) {
  request(Kind::mode, bytes_of(wire::ChooseMode{mask, mode}),
          fmt::format("put {} in {} mode", axes_of(mask), wire::text_of(mode)));
}

wire::State Session::exchange(const wire::Setpoints& setpoints) {
  const auto state = link::state_in(request(Kind::setpoint, bytes_of(setpoints), "take setpoints"));
  if (!state) misread("take setpoints");
  return *state;
}

wire::State Session::state() { return asked<wire::State>(Kind::state, {}, "tell its state"); }

wire::FaultEvidence Session::fault(int axis) {
  const wire::Axes axes{static_cast<std::uint8_t>(1 << axis)};
  return asked<wire::FaultEvidence>(Kind::fault, bytes_of(axes), "tell its fault");
}

wire::Offsets Session::calibrate(int axis) {
  const wire::Axes axes{static_cast<std::uint8_t>(1 << axis)};
  return asked<wire::Offsets>(Kind::calibrate, bytes_of(axes), fmt::format("calibrate axis {}", axis), slow_s);
}

wire::Outlook Session::ask(int axis, std::span<const wire::Segment> segments, bool standing) {
  Payload payload;
  payload.add(wire::Ask{static_cast<std::uint8_t>(axis), static_cast<std::uint8_t>(standing ? 1 : 0)});
  for (const wire::Segment& segment : segments) payload.add(segment);
  return asked<wire::Outlook>(Kind::ask, payload, "look ahead", look_ahead_s);
}

void Session::subscribe(const std::vector<Target>& signals, std::uint16_t decimation,
                        std::function<void(const link::RowsView&)> taker) {
  Payload payload;
  payload.add(wire::Subscribe{decimation});
  for (const Target& signal : signals)
    payload.add(wire::SignalAddress{static_cast<std::uint8_t>(signal.what->id), signal.axis});
  request(Kind::subscribe, payload, "send telemetry");
  // Rows that came before the answer are of what was subscribed before.
  subscribed_ = static_cast<int>(signals.size());
  taker_ = std::move(taker);
}

void Session::unsubscribe() {
  request(Kind::subscribe, bytes_of(wire::Subscribe{1}), "end telemetry");
  take_no_more();
}

void Session::capture(const wire::CaptureOrder& order, const std::vector<Target>& signals) {
  Payload payload;
  payload.add(order);
  for (const Target& signal : signals)
    payload.add(wire::SignalAddress{static_cast<std::uint8_t>(signal.what->id), signal.axis});
  request(Kind::capture, payload, "begin a capture");
}

wire::CaptureStatus Session::capture_status() {
  return asked<wire::CaptureStatus>(Kind::capture_status, {}, "tell how far the capture is");
}

int Session::capture_read(std::uint16_t first, int signals, std::vector<float>& values, std::uint32_t& period) {
  const wire::Frame& frame = request(Kind::capture_read, bytes_of(wire::Index{first}), "hand over the capture");
  const auto view = link::rows_in(frame, wire::reply_to(Kind::capture_read), signals);
  if (!view || view->head.rows == 0) misread("hand over the capture");
  period = view->head.first_period;
  for (std::size_t r = 0; r < view->head.rows; ++r) {
    for (std::size_t s = 0; s < static_cast<std::size_t>(signals); ++s) values.push_back(view->value(r, s));
  }
  return view->head.rows;
}

void Session::wait_until(double time_s) {
  while (true) {
    while (read() != nullptr) {
    }
    const double left_s = time_s - board_.now_s();
    if (board_.gone()) vanished("go on");
    if (!(left_s > 0)) return;
    board_.wait(1 + static_cast<int>(std::min(left_s, 1.0) * 1e3));
  }
}

}  // namespace console

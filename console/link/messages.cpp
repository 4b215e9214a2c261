// SPDX-License-Identifier: MIT
#include "console/link/messages.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

namespace console::link {
namespace {

bool printable(char c) { return c >= ' ' && c <= '~'; }

/// A field of fixed size: up to its NUL, made printable in place, always ended.
template <std::size_t n>
void tidy(char (&field)[n]) {
  field[n - 1] = '\0';
  bool ended = false;
  for (char& c : field) {
    ended = ended || c == '\0';
    c = ended ? '\0' : printable(c) ? c : '?';
  }
}

/// Takes one NUL-terminated text off the front. False: it does not end inside the payload.
bool text(std::span<const std::uint8_t>& rest, std::string& out) {
  const auto end = std::find(rest.begin(), rest.end(), std::uint8_t{0});
  if (end == rest.end()) return false;
  out.assign(rest.begin(), end);
  std::replace_if(
      out.begin(), out.end(), [](char c) { return !printable(c); }, '?');
  rest = rest.subspan(static_cast<std::size_t>(end - rest.begin()) + 1);
  return true;
}

/// Names become column headers, file keys and words of the command line: letters, digits and underscores.
bool is_name(const std::string& name) {
  return !name.empty() && name.size() <= 64 && std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  });
}

/// "rad/s", "degC", or nothing.
bool is_unit(const std::string& unit) {
  std::string joined = unit;
  std::replace(joined.begin(), joined.end(), '/', '_');
  return unit.empty() || is_name(joined);
}

/// Head, then name, unit and doc.
template <class Head>
bool described(const wire::Frame& frame, wire::Kind kind, Head& head, Description& d) {
  const auto message = message_in<Head>(frame, kind);
  if (!message) return false;
  head = *message;
  auto rest = std::span(frame.payload, frame.bytes).subspan(sizeof(Head));
  if (!text(rest, d.name) || !text(rest, d.unit) || !text(rest, d.doc)) return false;
  if (!is_name(d.name) || !is_unit(d.unit) || head.axes < 1 || head.axes > wire::axis_count) return false;
  d.id = head.id;
  d.per_axis = head.axes > 1;
  return true;
}

}  // namespace

std::optional<wire::Answer> answer_in(const wire::Frame& frame, wire::Kind kind) {
  wire::Answer answer;
  if (frame.kind != wire::reply_to(kind) || !wire::read(frame.payload, frame.bytes, answer)) return {};
  return answer;
}

std::optional<wire::Hello> hello_in(const wire::Frame& frame) {
  const auto answer = answer_in(frame, wire::Kind::hello);
  if (!answer || answer->status != 0 || frame.bytes < offsetof(wire::Hello, max_payload)) return {};
  wire::Hello hello{};
  std::memcpy(&hello, frame.payload, std::min<std::size_t>(frame.bytes, sizeof hello));
  tidy(hello.board);
  tidy(hello.firmware);
  tidy(hello.serial);
  // Of another version, whatever else it says means something else, and it may be shorter.
  if (hello.protocol != wire::protocol_version) return hello;
  const bool sane = frame.bytes >= sizeof hello && hello.axes >= 1 && hello.axes <= wire::axis_count &&
                    hello.pwm_Hz >= 1000.0f && hello.pwm_Hz <= 1e6f && hello.max_payload <= wire::max_payload &&
                    hello.bus_min_V >= 0.0f && hello.bus_max_V > hello.bus_min_V;
  return sane ? std::optional(hello) : std::nullopt;
}

std::optional<Description> parameter_in(const wire::Frame& frame) {
  wire::ParameterText head;
  Description d{};
  if (!described(frame, wire::Kind::describe_parameter, head, d)) return {};
  if (!(head.min <= head.max)) return {};
  d.needs_disarmed = (head.flags & wire::needs_disarmed) != 0;
  d.whole_number = (head.flags & wire::whole_number) != 0;
  d.min = head.min, d.max = head.max, d.fallback = head.fallback;
  return d;
}

std::optional<Description> signal_in(const wire::Frame& frame) {
  wire::SignalText head;
  Description d{};
  if (!described(frame, wire::Kind::describe_signal, head, d)) return {};
  return d;
}

bool values_in(const wire::Frame& frame, std::span<float> values) {
  const auto answer = message_in<wire::Answer>(frame, wire::Kind::get);
  if (!answer || frame.bytes != sizeof(wire::Answer) + values.size_bytes()) return false;
  if (!values.empty()) std::memcpy(values.data(), frame.payload + sizeof(wire::Answer), values.size_bytes());
  return true;
}

std::optional<wire::State> state_in(const wire::Frame& frame) {
  const bool exchange = frame.kind == wire::reply_to(wire::Kind::setpoint);
  return message_in<wire::State>(frame, exchange ? wire::Kind::setpoint : wire::Kind::state);
}

std::optional<RowsView> rows_in(const wire::Frame& frame, std::uint8_t kind, int signals) {
  RowsView view{};
  if (frame.kind != kind || !wire::read(frame.payload, frame.bytes, view.head)) return {};
  if (view.head.answer.status != 0 || view.head.signals != signals || view.head.decimation == 0) return {};
  const std::size_t values = std::size_t{view.head.rows} * view.head.signals;
  if (frame.bytes != sizeof(wire::Rows) + values * sizeof(float)) return {};
  view.values = frame.payload + sizeof(wire::Rows);
  return view;
}

}  // namespace console::link

// SPDX-License-Identifier: MIT
// What arrived, checked: each function returns nothing unless the frame is the answer that was asked for, whole, with
// every length and index inside what the board itself announced. A device may be broken or hostile; nothing here
// believes it, throws, or takes memory but for texts. Spans and views lie in the frame and end with it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "wire/protocol.hpp"

namespace console::link {

/// The status with which a request was answered; nothing if the frame is no answer to it.
std::optional<wire::Answer> answer_in(const wire::Frame& frame, wire::Kind kind);

/// Protocol, lengths and axis count are such that this program can go on; texts are printable.
std::optional<wire::Hello> hello_in(const wire::Frame& frame);

/// A parameter or a signal as the board describes it. Texts are printable ASCII.
struct Description {
  std::uint16_t id;
  bool per_axis;
  std::string name, unit, doc;
  // Parameters only:
  bool needs_disarmed = false, whole_number = false;
  float min = 0, max = 0, fallback = 0;
};
std::optional<Description> parameter_in(const wire::Frame& frame);
std::optional<Description> signal_in(const wire::Frame& frame);

/// The `count` values that were asked for.
bool values_in(const wire::Frame& frame, std::span<float> values);

/// The answer to setpoint or state. Modes, limits and faults of numbers nobody knows are left as they are.
std::optional<wire::State> state_in(const wire::Frame& frame);

/// An answer that is one struct and nothing else: FaultEvidence, Offsets, Outlook, CaptureStatus.
template <class Message>
std::optional<Message> message_in(const wire::Frame& frame, wire::Kind kind) {
  Message message;
  const auto answer = answer_in(frame, kind);
  if (!answer || answer->status != 0 || !wire::read(frame.payload, frame.bytes, message)) return {};
  return message;
}

/// Rows of telemetry or of a capture; value(row, signal) for row < head.rows, signal < head.signals.
struct RowsView {
  wire::Rows head;
  const std::uint8_t* values;
  float value(std::size_t row, std::size_t signal) const {
    float v;
    std::memcpy(&v, values + sizeof v * (row * head.signals + signal), sizeof v);
    return v;
  }
};
/// `signals`: how many were subscribed; rows with another number of them are refused.
std::optional<RowsView> rows_in(const wire::Frame& frame, std::uint8_t kind, int signals);

}  // namespace console::link

// SPDX-License-Identifier: MIT
// What a request does and what is answered: one frame in, one payload out. Runs in the USB context, below the control
// interrupt, so that a setpoint is in force at the next tick; what takes longer becomes an errand for the main context
// (link.hpp). Bad input is refused by a status and changes nothing.
#pragma once

#include "firmware/driver.hpp"
#include "firmware/parameter_store.hpp"
#include "firmware/recorder.hpp"
#include "firmware/usb/descriptors.hpp"
#include "wire/protocol.hpp"

namespace firmware {

/// A payload under construction; what has no room is left away as a whole.
class Reply {
 public:
  template <class Message>
  void put(const Message& message) {
    static_assert(std::is_trivially_copyable_v<Message>);
    std::uint8_t raw[sizeof message];
    std::memcpy(raw, &message, sizeof message);
    append(raw, sizeof raw);
  }
  /// With its NUL; cut to what has room.
  void text(const char* text);
  void append(const std::uint8_t* data, std::size_t bytes) {
    if (bytes > sizeof bytes_ - count_) return;
    std::memcpy(bytes_ + count_, data, bytes);
    count_ = static_cast<std::uint16_t>(count_ + bytes);
  }
  void refuse(wire::Status status, std::uint8_t axis = wire::no_axis, std::uint16_t id = 0) {
    put(wire::refused(status, axis, id));
  }

  const std::uint8_t* bytes() const { return bytes_; }
  std::uint16_t count() const { return count_; }

 private:
  std::uint16_t count_ = 0;
  std::uint8_t bytes_[wire::max_payload];
};

class Commands {
 public:
  Commands(Driver& driver, Recorder& recorder, ParameterStore& parameters, const usb::Identity& identity)
      : driver_(driver), recorder_(recorder), parameters_(parameters), identity_(identity) {}

  /// True if the kind is known and the payload has a length it can have; else the reply says what is wrong.
  static bool well_formed(const wire::Frame& request, Reply& reply);
  /// For the main context: commit, save, load, ask.
  static bool is_errand(std::uint8_t kind);
  /// Everything else. `parameters_free` false: an errand has them, and nobody stages or arms meanwhile.
  void answer(const wire::Frame& request, bool parameters_free, Reply& reply);

  /// Rows of the stream that fit into one frame; false: none are there.
  bool telemetry(Reply& reply);

  wire::State state() const;
  Driver& driver() { return driver_; }
  ParameterStore& parameters() { return parameters_; }

 private:
  void hello(Reply& reply);
  void describe_parameter(std::uint16_t index, Reply& reply) const;
  void describe_signal(std::uint16_t index, Reply& reply) const;
  void get(const wire::Frame& request, Reply& reply) const;
  void stage(const wire::Frame& request, Reply& reply);
  void for_axes(wire::Kind kind, std::uint8_t mask, Reply& reply);
  void set(const wire::Setpoints& wish, Reply& reply);
  void choose(const wire::ChooseMode& wish, Reply& reply);
  void fault(int axis, Reply& reply) const;
  void offsets(int axis, Reply& reply) const;
  void subscribe(const wire::Frame& request, Reply& reply);
  void capture(const wire::Frame& request, Reply& reply);
  void capture_status(Reply& reply) const;
  void capture_read(std::uint16_t first, Reply& reply) const;
  SignalPlace place(const wire::SignalAddress& address) const;
  bool select(const wire::Frame& request, std::size_t head, std::uint16_t decimation, Selection& selection,
              Reply& reply) const;

  Driver& driver_;
  Recorder& recorder_;
  ParameterStore& parameters_;
  const usb::Identity& identity_;
};

}  // namespace firmware

// SPDX-License-Identifier: MIT
// One end of the link: bytes to frames to commands, and back. A usb::Stream for the USB context; what takes long runs
// in the main context as an errand, one at a time, while the stream goes on.
//
// Way out: a queue of encoded frames. A request is only looked at while an answer has room; until then the host is told
// to wait, and setpoints with it: who never reads is not obeyed for long. Telemetry steps behind answers.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "firmware/link/commands.hpp"
#include "firmware/link/held_packet.hpp"
#include "thermal/look_ahead.hpp"
#include "wire/framer.hpp"

namespace firmware {

class Link {
 public:
  Link(Driver& driver, Recorder& recorder, ParameterStore& parameters, const usb::Identity& identity)
      : commands_(driver, recorder, parameters, identity) {}

  // usb::Stream, USB context.
  void restart();
  bool wants() const { return held_.empty(); }
  void take(const std::uint8_t* data, std::size_t bytes);
  std::size_t give(std::uint8_t* out, std::size_t room);

  /// Main context, once a ms. Short, but for the flash: an `ask` is worked off in slices.
  template <hal::Store S>
  void work(S& store) {
    if (errand_.load(std::memory_order_relaxed) != Errand::asked) return;
    std::atomic_signal_fence(std::memory_order_acquire);
    ParameterStore& parameters = commands_.parameters();
    switch (static_cast<wire::Kind>(errand_kind_)) {
      case wire::Kind::commit:
        return finish(parameters.commit(commands_.driver()));
      case wire::Kind::save:
        return finish(parameters.save(commands_.driver(), store));
      case wire::Kind::load:
        return finish(load());
      default:
        return look_ahead();
    }
  }

  /// Between two slices of an `ask`.
  bool looks_ahead() const { return looking_ahead_; }

  Commands& commands() { return commands_; }
  /// A commit or a save for the text port, as an errand like any other. False: an earlier one is not done. USB context.
  bool begin(wire::Kind kind);
  /// True once it is done: this is the answer.
  bool finished(wire::Answer& answer);
  /// False while the main context checks or saves parameters: until then nobody arms and nobody stages. USB context.
  bool parameters_free() const;
  /// Frames that were torn or damaged.
  std::uint32_t bad_frames() const { return reader_.bad(); }

 private:
  // USB context: none -> asked, done -> none; main context: asked -> done.
  enum class Errand : std::uint8_t { none, asked, done };

  void digest();
  void obey(const wire::Frame& request);
  void send(std::uint8_t kind, std::uint8_t sequence, const Reply& reply);
  bool has_room() const { return sizeof queue_ - (queued_ - sent_) >= wire::max_encoded; }
  enum class For : std::uint8_t { nobody, program, terminal };
  void take_errand(const wire::Frame& request, Reply& reply);
  void start_errand(std::uint8_t kind, For whom);
  void settle();
  void return_errand();
  wire::Answer load();
  void look_ahead();
  template <class Message>
  void finish(const Message& message) {
    static_assert(sizeof message <= sizeof errand_answer_);
    std::memcpy(errand_answer_, &message, sizeof message);
    errand_answer_bytes_ = sizeof message;
    std::atomic_signal_fence(std::memory_order_release);
    errand_.store(Errand::done, std::memory_order_relaxed);
  }

  Commands commands_;
  wire::FrameReader reader_;
  HeldPacket held_;
  std::uint8_t queue_[2 * wire::max_encoded]{};
  std::size_t sent_ = 0, queued_ = 0;  // queue_[sent_, queued_) waits
  std::uint8_t telemetry_sequence_ = 0;

  std::atomic<Errand> errand_{Errand::none};
  For errand_for_ = For::nobody;  // who still listens
  bool terminal_done_ = false;
  wire::Answer terminal_answer_{};
  std::uint8_t errand_kind_ = 0, errand_sequence_ = 0;
  std::uint16_t errand_bytes_ = 0;
  std::uint8_t errand_payload_[sizeof(wire::Ask) + wire::max_segments * sizeof(wire::Segment)]{};
  std::uint8_t errand_answer_[sizeof(wire::Outlook)]{};
  std::size_t errand_answer_bytes_ = 0;
  thermal::ProfileRun profile_;
  bool looking_ahead_ = false;
};

}  // namespace firmware

// SPDX-License-Identifier: MIT
#include "firmware/link/link.hpp"

#include <algorithm>
#include <cstring>

namespace firmware {

/// A new host, or the same one after a bus reset: it waits for nothing that was asked before.
void Link::restart() {
  reader_.restart();
  held_.drop();
  sent_ = queued_ = 0;
  if (errand_for_ == For::program) errand_for_ = For::nobody;
  if (parameters_free()) commands_.parameters().take_back();
}

void Link::take(const std::uint8_t* data, std::size_t bytes) {
  held_.take(data, bytes);
  digest();
}

std::size_t Link::give(std::uint8_t* out, std::size_t room) {
  settle();
  if (errand_.load(std::memory_order_relaxed) == Errand::done && has_room()) return_errand();
  digest();
  if (queued_ - sent_ < room) {
    Reply rows;
    if (has_room() && commands_.telemetry(rows))
      send(static_cast<std::uint8_t>(wire::Kind::telemetry), telemetry_sequence_++, rows);
  }
  const std::size_t bytes = std::min(room, queued_ - sent_);
  std::memcpy(out, queue_ + sent_, bytes);
  sent_ += bytes;
  return bytes;
}

/// What came and was not looked at yet, as long as answers have room.
void Link::digest() {
  while (!held_.empty() && has_room()) {
    if (reader_.take(held_.next())) obey(reader_.frame());
  }
}

void Link::obey(const wire::Frame& request) {
  Reply reply;
  if (Commands::well_formed(request, reply)) {
    if (Commands::is_errand(request.kind))
      take_errand(request, reply);
    else
      commands_.answer(request, parameters_free(), reply);
  }
  if (reply.count() > 0) send(static_cast<std::uint8_t>(request.kind | wire::reply_bit), request.sequence, reply);
}

void Link::send(std::uint8_t kind, std::uint8_t sequence, const Reply& reply) {
  if (sizeof queue_ - queued_ < wire::max_encoded) {
    std::memmove(queue_, queue_ + sent_, queued_ - sent_);
    queued_ -= sent_;
    sent_ = 0;
  }
  queued_ += wire::encode({kind, sequence, reply.count(), reply.bytes()}, queue_ + queued_, sizeof queue_ - queued_);
}

void Link::take_errand(const wire::Frame& request, Reply& reply) {
  settle();
  if (errand_.load(std::memory_order_relaxed) != Errand::none) return reply.refuse(wire::Status::busy);
  errand_sequence_ = request.sequence;
  errand_bytes_ = request.bytes;
  std::memcpy(errand_payload_, request.payload, request.bytes);
  start_errand(request.kind, For::program);
}

void Link::start_errand(std::uint8_t kind, For whom) {
  errand_kind_ = kind;
  errand_for_ = whom;
  std::atomic_signal_fence(std::memory_order_release);
  errand_.store(Errand::asked, std::memory_order_relaxed);
}

bool Link::begin(wire::Kind kind) {
  settle();
  if (errand_.load(std::memory_order_relaxed) != Errand::none) return false;
  terminal_done_ = false;
  start_errand(static_cast<std::uint8_t>(kind), For::terminal);
  return true;
}

bool Link::finished(wire::Answer& answer) {
  settle();
  answer = terminal_answer_;
  return terminal_done_;
}

/// What is done and needs no frame makes room for the next one.
void Link::settle() {
  if (errand_.load(std::memory_order_relaxed) != Errand::done || errand_for_ == For::program) return;
  std::atomic_signal_fence(std::memory_order_acquire);
  if (errand_for_ == For::terminal) {
    std::memcpy(&terminal_answer_, errand_answer_, sizeof terminal_answer_);
    terminal_done_ = true;
    if (terminal_answer_.status != 0 && static_cast<wire::Kind>(errand_kind_) == wire::Kind::commit)
      (void)commands_.parameters().load(wire::LoadFrom::in_force);  // what was refused does not stay staged
  }
  errand_.store(Errand::none, std::memory_order_relaxed);
}

void Link::return_errand() {
  std::atomic_signal_fence(std::memory_order_acquire);
  Reply reply;
  reply.append(errand_answer_, errand_answer_bytes_);
  send(static_cast<std::uint8_t>(errand_kind_ | wire::reply_bit), errand_sequence_, reply);
  errand_.store(Errand::none, std::memory_order_relaxed);
}

bool Link::parameters_free() const {
  return errand_.load(std::memory_order_relaxed) != Errand::asked ||
         static_cast<wire::Kind>(errand_kind_) == wire::Kind::ask;
}

wire::Answer Link::load() {
  const auto from = static_cast<wire::LoadFrom>(errand_payload_[0]);
  if (from > wire::LoadFrom::defaults) return wire::refused(wire::Status::out_of_range);
  return commands_.parameters().load(from);
}

/// Main context: a slice of the forecast at each call.
void Link::look_ahead() {
  wire::Ask ask{};
  std::memcpy(&ask, errand_payload_, sizeof ask);
  if (ask.axis >= axis_count) return finish(wire::refused(wire::Status::no_such_axis, ask.axis));
  const Axis& axis = commands_.driver().axis(ask.axis);
  const thermal::CoreEstimator& core = axis.core();
  if (!looking_ahead_) {
    if (!axis.configured()) return finish(wire::refused(wire::Status::parameters_unset, ask.axis));
    constexpr float standing = 1.0f, turning = 0.5f;  // mean(i_k^2) / |i|^2
    const float share = ask.standing != 0 ? standing : turning;
    const thermal::PhaseShares shares{{share, share, share}};
    static_assert(wire::longest_ask_s == thermal::ProfileRun::most_s);
    thermal::Piece pieces[wire::max_segments]{};
    const int count = static_cast<int>((errand_bytes_ - sizeof ask) / sizeof(wire::Segment));
    for (int i = 0; i < count; ++i) {
      wire::Segment segment{};
      std::memcpy(&segment, errand_payload_ + sizeof ask + static_cast<std::size_t>(i) * sizeof segment,
                  sizeof segment);
      pieces[i] = {segment.seconds, segment.current_A};
    }
    if (!axis.ask(profile_, pieces, count, shares)) return finish(wire::refused(wire::Status::out_of_range, ask.axis));
    looking_ahead_ = true;
    return;
  }
  // A law that is no constant makes a step three times as dear: some 30000 instructions.
  const int steps_a_slice = core.network().curved() ? 2 : 10;
  if (!profile_.go_on(core, steps_a_slice)) return;
  looking_ahead_ = false;
  const thermal::Forecast& seen = profile_.forecast();
  finish(wire::Outlook{{},
                       static_cast<std::uint8_t>(seen.feasible),
                       {},
                       seen.peak_degC,
                       seen.limits_after_s,
                       profile_.share_before_limit()});
}

}  // namespace firmware

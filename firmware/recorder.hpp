// SPDX-License-Identifier: MIT
// Copies signals at the pace of the PWM: a stream of rows for telemetry (decimated, drops counted) and one triggered
// capture with rows from before the trigger. A row is its PWM period followed by the words that its places held.
//
// `tick` is for the control interrupt, once a PWM period, after the ticks of both axes. It costs 5 instructions while
// nobody listens and 57 with four signals on their way to the host, each further one 5 (ctest --preset qemu-m4f -R
// instructions -V). Everything else is for one lower context, which the interrupt may break into at any place: what it
// sees is switched on last and off first. No locks, no heap.
#pragma once

#include <atomic>
#include <bit>
#include <cstdint>

#include "firmware/signals.hpp"
#include "wire/protocol.hpp"

namespace firmware {

/// Which signals, and how often.
struct Selection {
  SignalPlace places[wire::max_signals];
  std::uint32_t count = 0;
  std::uint32_t decimation = 1;

  std::uint32_t row_words() const { return count + 1; }
};

struct Trigger {
  SignalPlace place;  // not used by Edge::now
  wire::Edge edge = wire::Edge::now;
  float level = 0.0f;
};

class Recorder {
 public:
  Recorder() = default;
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  static constexpr std::uint32_t capture_words = 2048;  // 8 KiB: 25 ms of three signals at 20 kHz
  static constexpr std::uint32_t stream_words = 512;    // rides over some ms in which the host does not read

  /// Control interrupt. `period` counts PWM periods and may wrap.
  void tick(std::uint32_t period) noexcept {
    period_.store(period, std::memory_order_relaxed);
    if (streams_.load(std::memory_order_relaxed)) stream_tick(period);
    if (captures_.load(std::memory_order_relaxed)) capture_tick(period);
  }
  /// Number of the last PWM period.
  std::uint32_t period() const { return period_.load(std::memory_order_relaxed); }

  // ---- stream; no signals: it ends
  void stream(const Selection& selection) {
    streams_.store(false, std::memory_order_relaxed);
    fence();
    stream_selection_ = selection;
    put_ = taken_ = dropped_ = 0;
    taken_row_ = 0;
    put_at_ = stream_;
    rows_room_ = stream_words / selection.row_words();
    stream_end_ = stream_ + rows_room_ * selection.row_words();
    stream_due_ = period();
    fence();
    streams_.store(selection.count > 0, std::memory_order_relaxed);
  }
  const Selection& streamed() const { return stream_selection_; }
  std::uint32_t stream_rows() const {
    return put_.load(std::memory_order_relaxed) - taken_.load(std::memory_order_relaxed);
  }
  /// The row `ahead` of the oldest; ahead < stream_rows().
  const std::uint32_t* stream_row(std::uint32_t ahead) const {
    return &stream_[(taken_row_ + ahead) % rows_room_ * stream_selection_.row_words()];
  }
  /// rows <= stream_rows().
  void stream_release(std::uint32_t rows) {
    taken_row_ = (taken_row_ + rows) % rows_room_;
    fence();
    taken_.store(taken_.load(std::memory_order_relaxed) + rows, std::memory_order_relaxed);
  }
  std::uint32_t dropped() const { return dropped_.load(std::memory_order_relaxed); }

  // ---- capture; no signals: it ends
  void capture(const Selection& selection, const Trigger& trigger, std::uint32_t pre, std::uint32_t post) {
    captures_.store(false, std::memory_order_relaxed);
    fence();
    capture_selection_ = selection;
    trigger_ = trigger;
    pre_ = pre, post_ = post;
    next_row_ = rows_ = to_come_ = 0;
    last_ = std::bit_cast<float>(0x7FC0'0000u);  // NaN: the first row cannot pass the level
    capture_due_ = period();
    phase_ = selection.count > 0 ? wire::CapturePhase::waiting : wire::CapturePhase::idle;
    fence();
    captures_.store(selection.count > 0, std::memory_order_relaxed);
  }
  const Selection& captured() const { return capture_selection_; }
  wire::CapturePhase phase() const { return phase_; }
  // Of a complete capture:
  std::uint32_t captured_rows() const { return phase_ == wire::CapturePhase::complete ? before_ + post_ : 0; }
  std::uint32_t rows_before_trigger() const { return before_; }
  std::uint32_t trigger_period() const { return trigger_period_; }
  /// index < captured_rows().
  const std::uint32_t* captured_row(std::uint32_t index) const {
    const std::uint32_t ring = pre_ + post_;
    return &capture_[(next_row_ + ring - captured_rows() + index) % ring * capture_selection_.row_words()];
  }

 private:
  static void fence() { std::atomic_signal_fence(std::memory_order_seq_cst); }  // one core
  static bool due(std::uint32_t period, std::uint32_t& next, std::uint32_t decimation) {
    if (static_cast<std::int32_t>(period - next) < 0) return false;
    next = period + decimation;
    return true;
  }
  /// Returns where the next row begins.
  static std::uint32_t* write(std::uint32_t* row, std::uint32_t period, const Selection& selection) {
    *row++ = period;
    const SignalPlace* place = selection.places;
    for (std::uint32_t left = selection.count; left != 0; --left) *row++ = (place++)->raw();
    return row;
  }

  void stream_tick(std::uint32_t period) {
    if (!due(period, stream_due_, stream_selection_.decimation)) return;
    const std::uint32_t put = put_.load(std::memory_order_relaxed);
    if (put - taken_.load(std::memory_order_relaxed) >= rows_room_) {
      dropped_.store(dropped() + 1, std::memory_order_relaxed);
      return;
    }
    std::uint32_t* const next = write(put_at_, period, stream_selection_);
    put_at_ = next == stream_end_ ? stream_ : next;
    put_.store(put + 1, std::memory_order_relaxed);
  }

  [[gnu::noinline]] void capture_tick(std::uint32_t period) {
    if (!due(period, capture_due_, capture_selection_.decimation)) return;
    if (to_come_ == 0 && triggers()) {
      before_ = rows_ < pre_ ? rows_ : pre_;
      trigger_period_ = period;
      to_come_ = post_;
      phase_ = wire::CapturePhase::filling;
    }
    (void)write(&capture_[next_row_ * capture_selection_.row_words()], period, capture_selection_);
    if (++next_row_ == pre_ + post_) next_row_ = 0;
    ++rows_;
    if (to_come_ == 0 || --to_come_ > 0) return;
    captures_.store(false, std::memory_order_relaxed);
    phase_ = wire::CapturePhase::complete;
  }

  bool triggers() {
    if (trigger_.edge == wire::Edge::now) return true;
    const float now = trigger_.place.value(), before = last_;
    last_ = now;
    return trigger_.edge == wire::Edge::rising ? before < trigger_.level && now >= trigger_.level
                                               : before > trigger_.level && now <= trigger_.level;
  }

  std::atomic<std::uint32_t> period_{0};
  std::atomic<bool> streams_{false}, captures_{false};

  Selection stream_selection_;
  std::atomic<std::uint32_t> put_{0}, taken_{0}, dropped_{0};  // rows since the subscription; they wrap together
  std::uint32_t* put_at_ = stream_;
  std::uint32_t* stream_end_ = stream_;
  std::uint32_t taken_row_ = 0;  // in the ring
  std::uint32_t rows_room_ = 1, stream_due_ = 0;

  Selection capture_selection_;
  Trigger trigger_;
  std::uint32_t pre_ = 0, post_ = 0, before_ = 0;
  std::uint32_t next_row_ = 0, rows_ = 0;  // in the ring; ever written
  std::uint32_t to_come_ = 0;              // rows after the trigger
  std::uint32_t capture_due_ = 0, trigger_period_ = 0;
  float last_ = 0.0f;
  wire::CapturePhase phase_ = wire::CapturePhase::idle;

  std::uint32_t stream_[stream_words];
  std::uint32_t capture_[capture_words];
};

}  // namespace firmware

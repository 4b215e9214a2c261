// SPDX-License-Identifier: MIT
// The three doors of both axes (hal/axis_port.hpp) on TIM1, TIM8 and ADC1..3.
//
//   TIM1  /\/\/\/\   up and down at 20 kHz; at its top all lower switches of axis 0 are on: sample, and load the duty
//   TIM8   /\/\/\/\  started by TIM1's first top, so half a period later: axis 1
//
// Channel 4 of the timer triggers one injected conversion on all three ADCs: phase currents, then bus voltage twice and
// bus current. One interrupt per axis and period; it reads, then arms the ADCs for the other axis. A late interrupt
// loses a sample (and says so), it can never take one axis' sample for the other's.
#pragma once

#include <cstdint>

#include "boards/h8-15d/board.hpp"
#include "hal/axis_port.hpp"

namespace h8_15d {

class PowerStage {
 public:
  /// Timers and ADCs, stopped and disarmed; LOCK is set here and holds until the next reset.
  void set_up();
  /// Starts both counters. False: they do not stand half a period apart, or their updates come at the wrong end.
  [[nodiscard]] bool start();

  /// Which axis the finished conversion belongs to; arms the other. -1: no complete conversion. Control interrupt.
  int take();
  hal::AxisSample sample(int axis);
  void drive(int axis, const hal::Duty& duty);
  void release(int axis);
  /// No conversion is triggered any more. Any context.
  void stop_sampling();

  /// Rotor: counter value that is mechanical zero; written by the index interrupt.
  void set_encoder_zero(int axis, std::uint32_t counter) {
    encoder_zero_[axis] = counter;
    zero_turned_[axis] = ~counter;
  }
  std::uint32_t encoder_zero(int axis) const { return encoder_zero_[axis]; }
  void distrust_encoder(int axis) { encoder_good_[axis] = false; }
  void trust_encoder(int axis) { encoder_good_[axis] = true; }
  /// A bit of the zero that flips turns the field of a motor that stands, and nothing else would show it. Main loop.
  void watch_encoder_zero(int axis) {
    const std::uint32_t zero = encoder_zero_[axis], turned = zero_turned_[axis];
    if (zero != ~turned && zero == encoder_zero_[axis]) distrust_encoder(axis);  // else the index pulse came in between
  }

  /// Slow conversions ride behind the fast ones: ask, then fetch some periods later. Main loop.
  void ask_slow(std::uint32_t channel) { slow_wanted_ = static_cast<std::uint8_t>(channel | 0x80u); }
  bool slow_ready() const { return slow_ready_; }
  std::uint16_t fetch_slow() {
    slow_ready_ = false;
    return slow_counts_;
  }
  void set_reference_good(bool good) { reference_good_ = good; }
  std::uint16_t bus_A_counts() const { return bus_A_counts_; }
  std::uint32_t lost(int axis) const { return lost_[axis]; }

 private:
  void arm(int axis);
  bool driven(int axis) const;

  std::uint16_t counts_[2][3] = {};
  std::uint16_t bus_counts_ = 0, bus_again_ = 0;
  volatile std::uint16_t bus_A_counts_ = 0, slow_counts_ = 0;
  volatile std::uint8_t slow_wanted_ = 0;
  volatile bool slow_ready_ = false, reference_good_ = false;
  bool slow_running_ = false;
  bool over_current_[2] = {};  // the analog watchdog spoke
  bool wanted_on_[2] = {}, broken_[2] = {};
  bool complete_ = false;
  volatile bool encoder_good_[2] = {};
  volatile std::uint32_t encoder_zero_[2] = {}, zero_turned_[2] = {~0u, ~0u};
  std::uint32_t zero_seen_[2] = {};
  std::uint32_t sequence_[2] = {}, cycles_[2] = {}, lost_[2] = {};
  int armed_ = 0;
  hal::Duty loading_[2] = {}, active_[2] = {};  // written this period; shaping the zero vector that is sampled next
};

}  // namespace h8_15d

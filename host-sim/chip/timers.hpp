// SPDX-License-Identifier: MIT
// TIM1 and TIM8 (RM0090 chapter 17) as far as a three-phase bridge needs them: centre-aligned counting, preload,
// repetition, complementary outputs, dead time, break, LOCK, channel 4 as ADC trigger, trigger mode. TIM3 and TIM4
// (chapter 18) as quadrature counters. Counters are not stepped: positions follow from the time, only their events are
// scheduled.
#pragma once

#include <array>
#include <functional>

#include "host-sim/chip/device.hpp"

namespace host_sim::chip {

/// What one leg of the bridge is told to do over a period.
struct Leg {
  bool upper_driven = false, lower_driven = false;  // the timer holds the pin (not floating, not idle)
  double upper_ratio = 0, lower_ratio = 0;          // share of the period the switch is told to be on, dead time aside
};

class AdvancedTimer : public Device {
 public:
  enum : std::uint32_t {
    cr1 = 0x00,
    cr2 = 0x04,
    smcr = 0x08,
    dier = 0x0C,
    sr = 0x10,
    egr = 0x14,
    ccmr1 = 0x18,
    ccmr2 = 0x1C,
    ccer = 0x20,
    cnt = 0x24,
    psc = 0x28,
    arr = 0x2C,
    rcr = 0x30,
    ccr1 = 0x34,
    ccr4 = 0x40,
    bdtr = 0x44
  };

  struct Links {
    std::function<double()> clock_Hz;
    std::function<void(Time)> overflow;  // counter at the top, before the new compare values are loaded
    std::function<void(Time)> compare4;  // towards the ADCs, with the time of the match
    std::function<void()> trgo;          // towards the other timer
    int irq_break, irq_update, irq_compare;
  };

  AdvancedTimer(Host& host, const char* name, std::uint32_t base, int enable_bit, Links links);
  void reset() override;
  Time next_event() const override;
  void advance(Time now) override;
  void clocks_changed();

  void break_pin(bool connected, bool high);  // BKIN; without a pin it rests inactive
  void clock_failure();                       // CSS
  void trigger_in();                          // rising edge of its ITR
  bool running() const { return running_; }
  bool main_output() const { return peek(bdtr) >> 15 & 1; }
  bool centre_aligned() const { return field(peek(cr1), 5, 2) != 0; }
  double period_s() const;
  double dead_time_s() const;
  Leg leg(int phase) const;
  unsigned trgo_mode() const { return field(peek(cr2), 4, 3); }
  bool slave_trigger_itr0() const { return field(peek(smcr), 0, 3) == 6 && field(peek(smcr), 4, 3) == 0; }
  bool compare4_works() const;
  Time last_overflow() const { return last_overflow_; }
  std::uint32_t position() const;  // CNT

 protected:
  std::uint32_t on_read(std::uint32_t offset) override;
  void on_write(std::uint32_t offset, std::uint32_t value) override;

 private:
  void start();
  void update();
  void check_break();
  void lines();
  void write_bdtr(std::uint32_t value);
  bool locked(std::uint32_t offset, std::uint32_t value, std::uint32_t bits, int level);
  Time tick() const { return tick_ * (peek(psc) + 1); }

  Links links_;
  std::array<std::uint32_t, 4> active_{};  // shadow compare registers
  bool running_ = false, down_ = false, break_high_ = true, break_connected_ = false, lock_written_ = false,
       update_on_underflow_ = false;
  bool compare_fresh_ = false;  // written with MOE off, this period
  int silent_periods_ = 0;      // one after the other
  std::uint32_t frozen_ = 0;    // CNT while stopped
  Time tick_ = 2, underflow_ = never, overflow_ = never, compare_ = never, last_overflow_ = 0;
};

class EncoderTimer : public Device {
 public:
  enum : std::uint32_t { cr1 = 0x00, smcr = 0x08, ccmr1 = 0x18, ccer = 0x20, cnt = 0x24, psc = 0x28, arr = 0x2C };
  EncoderTimer(Host& host, const char* name, std::uint32_t base, int enable_bit, std::function<bool()> pins_connected,
               std::function<bool()> at_index);
  void reset() override;
  /// The plant moves in steps; an index handler would have read the counter in between, at the pulse: this count.
  void set_index_edges(std::int64_t count) { index_edges_ = count; }
  void set_edges(std::int64_t count) { edges_ = count; }  // quadrature edges since power-on, forwards positive

 protected:
  std::uint32_t on_read(std::uint32_t offset) override;
  void on_write(std::uint32_t offset, std::uint32_t value) override;

 private:
  std::uint32_t count() const;
  std::function<bool()> pins_connected_, at_index_;
  std::int64_t edges_ = 0, index_edges_ = 0, base_ = 0;
  std::uint32_t stopped_at_ = 0;
};

}  // namespace host_sim::chip

// SPDX-License-Identifier: MIT
// The Cortex-M4 system control space: NVIC with priorities, preemption and tail-chaining decisions, SysTick, SCB, the
// cycle counter. Written from the Armv7-M Architecture Reference Manual (B1.5, B3) and PM0214. It decides which
// exception runs next; pushing and popping is the core's work (core.cpp). Counts core cycles as the core counts them.
#pragma once

#include <array>
#include <vector>

#include "host-sim/chip/device.hpp"

namespace host_sim::chip {

inline constexpr int irq_count = 82;  // RM0090 12.2, Table 61
inline constexpr int exception_count = 16 + irq_count;
enum Exception : int {
  nmi = 2,
  hard_fault = 3,
  mem_manage = 4,
  bus_fault = 5,
  usage_fault = 6,
  svcall = 11,
  pendsv = 14,
  systick = 15
};

class Nvic {
 public:
  explicit Nvic(Host& host) : host_(host) {}  // reset() comes with power

  void reset();
  std::uint32_t read(std::uint32_t address, unsigned size);
  void write(std::uint32_t address, std::uint32_t value, unsigned size);

  void set_line(int irq, bool level);
  void set_nmi_line(bool level);
  void pend(int exception);
  bool pending(int exception) const { return pending_[static_cast<std::size_t>(exception)]; }
  bool any_pending() const { return pending_count_ > 0; }
  Time pending_since(int exception) const { return since_[static_cast<std::size_t>(exception)]; }
  /// A synchronous fault; escalates to HardFault when its own handler is off or it cannot preempt.
  void fault(int exception);

  /// The exception that preempts now, or 0.
  int next(bool primask, bool faultmask, std::uint32_t basepri) const;
  void enter(int exception);
  void leave(int exception);
  int running() const { return active_stack_.empty() ? 0 : active_stack_.back(); }
  int depth() const { return static_cast<int>(active_stack_.size()); }

  /// Something enabled is pending: WFI wakes even when PRIMASK holds it back (B1.5.19).
  bool wakes() const;

  std::uint32_t vector_table() const { return vtor_; }
  bool fpu_open() const { return ((cpacr_ >> 20) & 0xF) == 0xF; }
  bool reset_requested() const { return reset_requested_; }

  void set_ticks_per_cycle(Time t) { ticks_per_cycle_ = t; }
  Time next_event() const;
  void advance(Time now);

 private:
  int priority(int exception) const;  // lower preempts; as the group sees it
  int full_priority(int exception) const;
  int running_priority(bool primask, bool faultmask, std::uint32_t basepri) const;
  void set_pending(int exception, bool on);
  std::uint32_t bits(const std::array<bool, exception_count>& from, int word) const;
  std::uint32_t cycles() const { return static_cast<std::uint32_t>((host_.now() - cycle_base_) / ticks_per_cycle_); }

  Host& host_;
  std::array<bool, exception_count> enabled_{}, pending_{}, active_{};
  std::array<bool, irq_count> line_{};
  std::array<Time, exception_count> since_{};  // pending; or its line came up while it was active
  std::array<std::uint8_t, exception_count> priority_{};
  std::vector<int> active_stack_;
  int pending_count_ = 0;
  std::uint32_t vtor_ = 0, aircr_ = 0, cpacr_ = 0, shcsr_ = 0, ccr_ = 0x200, scr_ = 0, cfsr_ = 0, hfsr_ = 0, fpccr_ = 0;
  std::uint32_t fpdscr_ = 0, demcr_ = 0, dwt_ctrl_ = 0, dbg_apb1_ = 0, dbg_apb2_ = 0;
  bool reset_requested_ = false, nmi_line_ = false;
  std::uint32_t systick_csr_ = 0, systick_rvr_ = 0;
  Time systick_base_ = 0;
  Time cycle_base_ = 0;
  Time ticks_per_cycle_ = 21;
};

}  // namespace host_sim::chip

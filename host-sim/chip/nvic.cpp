// SPDX-License-Identifier: MIT
#include "host-sim/chip/nvic.hpp"

#include <algorithm>

namespace host_sim::chip {
namespace {

constexpr int thread_priority = 256;
constexpr std::uint32_t scs = 0xE000E000;

}  // namespace

void Nvic::reset() {
  enabled_.fill(false);
  pending_.fill(false);
  active_.fill(false);
  priority_.fill(0);
  line_.fill(false);
  active_stack_.clear();
  pending_count_ = 0;
  vtor_ = aircr_ = cpacr_ = shcsr_ = scr_ = cfsr_ = hfsr_ = fpdscr_ = demcr_ = dwt_ctrl_ = 0;
  ccr_ = 0x200;
  fpccr_ = 0xC0000000;
  reset_requested_ = nmi_line_ = false;
  systick_csr_ = systick_rvr_ = 0;
  cycle_base_ = host_.now();
  for (int e : {static_cast<int>(nmi), static_cast<int>(hard_fault), static_cast<int>(svcall), static_cast<int>(pendsv),
                static_cast<int>(systick)}) {
    enabled_[static_cast<std::size_t>(e)] = true;
  }
}

void Nvic::set_pending(int exception, bool on) {
  bool& p = pending_[static_cast<std::size_t>(exception)];
  if (p == on) return;
  p = on;
  pending_count_ += on ? 1 : -1;
  if (!on) return;
  since_[static_cast<std::size_t>(exception)] = host_.event_time();
  host_.reschedule();
}

void Nvic::pend(int exception) { set_pending(exception, true); }

void Nvic::set_line(int irq, bool level) {
  bool& line = line_[static_cast<std::size_t>(irq)];
  if (level == line) return;
  line = level;
  if (!level) return;
  if (active_[static_cast<std::size_t>(16 + irq)])
    since_[static_cast<std::size_t>(16 + irq)] = host_.event_time();
  else
    set_pending(16 + irq, true);
}

void Nvic::set_nmi_line(bool level) {
  if (level && !nmi_line_ && !active_[nmi]) pend(nmi);
  nmi_line_ = level;
}

void Nvic::fault(int exception) {
  const bool on = exception == hard_fault || enabled_[static_cast<std::size_t>(exception)];
  const bool can = running_priority(false, false, 0) > priority(exception);
  if (on && can) {
    pend(exception);
  } else {
    hfsr_ |= 1u << 30;  // FORCED
    pend(hard_fault);
  }
}

int Nvic::full_priority(int exception) const {
  if (exception == nmi) return -2;
  if (exception == hard_fault) return -1;
  return priority_[static_cast<std::size_t>(exception)];
}

int Nvic::priority(int exception) const {
  const int p = full_priority(exception);
  if (p < 0) return p;
  const int subpriority_bits = static_cast<int>(field(aircr_, 8, 3)) + 1;  // B1.5.4: group is bits 7..PRIGROUP+1
  return p & ~((1 << subpriority_bits) - 1);
}

int Nvic::running_priority(bool primask, bool faultmask, std::uint32_t basepri) const {
  int p = thread_priority;
  for (int e : active_stack_) p = std::min(p, priority(e));
  if (basepri) {
    const int subpriority_bits = static_cast<int>(field(aircr_, 8, 3)) + 1;
    p = std::min(p, static_cast<int>(basepri) & ~((1 << subpriority_bits) - 1));
  }
  if (primask) p = std::min(p, 0);
  if (faultmask) p = std::min(p, -1);
  return p;
}

int Nvic::next(bool primask, bool faultmask, std::uint32_t basepri) const {
  if (pending_count_ == 0) return 0;
  int best = 0;
  for (int e = 1; e < exception_count; ++e) {
    const auto i = static_cast<std::size_t>(e);
    if (!pending_[i] || !enabled_[i]) continue;
    if (best == 0 || full_priority(e) < full_priority(best)) best = e;  // equal: the lower number, B1.5.4
  }
  if (best == 0 || priority(best) >= running_priority(primask, faultmask, basepri)) return 0;
  return best;
}

bool Nvic::wakes() const {
  if (pending_count_ == 0) return false;
  for (int e = 1; e < exception_count; ++e) {
    const auto i = static_cast<std::size_t>(e);
    if (pending_[i] && enabled_[i]) return true;
  }
  return false;
}

void Nvic::enter(int exception) {
  set_pending(exception, false);
  active_[static_cast<std::size_t>(exception)] = true;
  since_[static_cast<std::size_t>(exception)] = host_.now();
  active_stack_.push_back(exception);
}

void Nvic::leave(int exception) {
  active_[static_cast<std::size_t>(exception)] = false;
  std::erase(active_stack_, exception);
  if (exception == nmi && nmi_line_) pend(nmi);
  if (exception >= 16 && line_[static_cast<std::size_t>(exception - 16)]) {
    const Time rose = since_[static_cast<std::size_t>(exception)];
    set_pending(exception, true);
    since_[static_cast<std::size_t>(exception)] = rose;
  }
}

std::uint32_t Nvic::bits(const std::array<bool, exception_count>& from, int word) const {
  std::uint32_t v = 0;
  for (int b = 0; b < 32; ++b) {
    const int e = 16 + word * 32 + b;
    if (e < exception_count && from[static_cast<std::size_t>(e)]) v |= 1u << b;
  }
  return v;
}

Time Nvic::next_event() const {
  if (!(systick_csr_ & 1) || systick_rvr_ == 0) return never;
  const Time per = ticks_per_cycle_ * ((systick_csr_ & 4) ? 1 : 8);
  return systick_base_ + per * (systick_rvr_ + 1);
}

void Nvic::advance(Time now) {
  while (next_event() <= now) {
    systick_base_ = next_event();
    systick_csr_ |= 1u << 16;
    if (systick_csr_ & 2) pend(systick);
  }
}

std::uint32_t Nvic::read(std::uint32_t address, unsigned size) {
  const std::uint32_t o = address - scs;
  if (address >= 0xE0001000 && address < 0xE0002000) {
    if (address == 0xE0001000) return dwt_ctrl_ | 0x40000000;
    if (address == 0xE0001004) return (dwt_ctrl_ & 1) && (demcr_ >> 24 & 1) ? cycles() : 0;
  }
  if (address == 0xE0042000) return 0x10076413;  // DBGMCU_IDCODE of the F405, RM0090 38.6.1
  if (address == 0xE0042008) return dbg_apb1_;
  if (address == 0xE004200C) return dbg_apb2_;
  if (o >= 0x400 && o < 0x400 + irq_count) {
    std::uint32_t v = 0;
    for (unsigned b = 0; b < size && o - 0x400 + b < irq_count; ++b)
      v |= std::uint32_t{priority_[16 + o - 0x400 + b]} << (8 * b);
    return v;
  }
  if (o >= 0xD18 && o < 0xD24) {
    std::uint32_t v = 0;
    for (unsigned b = 0; b < size; ++b) v |= std::uint32_t{priority_[4 + o - 0xD18 + b]} << (8 * b);
    return v;
  }
  if (size == 4) {
    const int word = static_cast<int>((o & 0x7F) / 4);
    if (o >= 0x100 && o < 0x10C) return bits(enabled_, word);
    if (o >= 0x180 && o < 0x18C) return bits(enabled_, word);
    if (o >= 0x200 && o < 0x20C) return bits(pending_, word);
    if (o >= 0x280 && o < 0x28C) return bits(pending_, word);
    if (o >= 0x300 && o < 0x30C) return bits(active_, word);
    switch (o) {
      case 0x010: {
        const std::uint32_t v = systick_csr_;
        systick_csr_ &= ~(1u << 16);
        return v;
      }
      case 0x014:
        return systick_rvr_;
      case 0x018: {
        if (!(systick_csr_ & 1)) return 0;
        const Time per = ticks_per_cycle_ * ((systick_csr_ & 4) ? 1 : 8);
        return systick_rvr_ - static_cast<std::uint32_t>(((host_.now() - systick_base_) / per) % (systick_rvr_ + 1));
      }
      case 0xD00:
        return 0x410FC241;  // CPUID: Cortex-M4 r0p1, PM0214 4.4.2
      case 0xD04:
        return static_cast<std::uint32_t>(running()) | (pending(pendsv) ? 1u << 28 : 0) |
               (pending(systick) ? 1u << 26 : 0);
      case 0xD08:
        return vtor_;
      case 0xD0C:
        return 0xFA050000 | aircr_;
      case 0xD10:
        return scr_;
      case 0xD14:
        return ccr_;
      case 0xD24:
        return shcsr_;
      case 0xD28:
        return cfsr_;
      case 0xD2C:
        return hfsr_;
      case 0xD34:
      case 0xD38:
        return 0;
      case 0xD88:
        return cpacr_;
      case 0xDFC:
        return demcr_;
      case 0xF34:
        return fpccr_;
      case 0xF3C:
        return fpdscr_;
      default:
        break;
    }
  }
  host_.report("system control space: read of a register that is not modelled", address);
  return 0;
}

void Nvic::write(std::uint32_t address, std::uint32_t value, unsigned size) {
  const std::uint32_t o = address - scs;
  if (address == 0xE0001000) {
    dwt_ctrl_ = value & 1;
    return;
  }
  if (address == 0xE0001004) {
    cycle_base_ = host_.now() - Time{value} * ticks_per_cycle_;
    return;
  }
  if (address == 0xE0042008) {
    dbg_apb1_ = value;
    return;
  }
  if (address == 0xE004200C) {
    dbg_apb2_ = value;
    return;
  }
  if (o >= 0x400 && o < 0x400 + irq_count) {
    for (unsigned b = 0; b < size && o - 0x400 + b < irq_count; ++b) {
      const auto p = static_cast<std::uint8_t>(value >> (8 * b));
      if (p & 0x0F) host_.report("NVIC: priority bits 3..0 are not implemented (16 levels, PM0214 4.3.7)", address);
      priority_[16 + o - 0x400 + b] = p & 0xF0;
    }
    host_.reschedule();
    return;
  }
  if (o >= 0xD18 && o < 0xD24) {
    for (unsigned b = 0; b < size; ++b)
      priority_[4 + o - 0xD18 + b] = static_cast<std::uint8_t>(value >> (8 * b)) & 0xF0;
    host_.reschedule();
    return;
  }
  if (size == 4) {
    const int word = static_cast<int>((o & 0x7F) / 4);
    const bool set_enable = o >= 0x100 && o < 0x10C, clear_enable = o >= 0x180 && o < 0x18C;
    const bool set_pend = o >= 0x200 && o < 0x20C, clear_pend = o >= 0x280 && o < 0x28C;
    if (set_enable || clear_enable || set_pend || clear_pend) {
      for (int b = 0; b < 32; ++b) {
        if (!(value >> b & 1)) continue;
        const int e = 16 + word * 32 + b;
        if (e >= exception_count) {
          host_.report("NVIC: interrupt number beyond 81", address);
          continue;
        }
        if (set_enable) enabled_[static_cast<std::size_t>(e)] = true;
        if (clear_enable) enabled_[static_cast<std::size_t>(e)] = false;
        if (set_pend) set_pending(e, true);
        if (clear_pend) set_pending(e, line_[static_cast<std::size_t>(e - 16)]);
      }
      host_.reschedule();
      return;
    }
    switch (o) {
      case 0x010:
        if ((value & 1) && !(systick_csr_ & 1)) systick_base_ = host_.now();
        systick_csr_ = (systick_csr_ & 0x10000) | (value & 7);
        host_.reschedule();
        return;
      case 0x014:
        systick_rvr_ = value & 0xFFFFFF;
        host_.reschedule();
        return;
      case 0x018:
        systick_base_ = host_.now();
        systick_csr_ &= 7;
        host_.reschedule();
        return;
      case 0xD04:
        if (value >> 31 & 1) pend(nmi);
        if (value >> 28 & 1) pend(pendsv);
        if (value >> 27 & 1) set_pending(pendsv, false);
        if (value >> 26 & 1) pend(systick);
        if (value >> 25 & 1) set_pending(systick, false);
        return;
      case 0xD08:
        if (value & 0x1FF) host_.report("SCB: VTOR not aligned to 512 bytes (98 vectors, PM0214 4.4.4)", address);
        vtor_ = value & ~0x1FFu;
        return;
      case 0xD0C:
        if (value >> 16 != 0x05FA) {
          host_.report("SCB: AIRCR written without its key 0x05FA, the write is ignored", address);
          return;
        }
        aircr_ = value & 0x700;
        if (value & 4) reset_requested_ = true;
        host_.reschedule();
        return;
      case 0xD10:
        scr_ = value;
        return;
      case 0xD14:
        ccr_ = value;
        return;
      case 0xD24:
        shcsr_ = value & 0x70000;
        for (int i = 0; i < 3; ++i) enabled_[static_cast<std::size_t>(4 + i)] = value >> (16 + i) & 1;
        return;
      case 0xD28:
        cfsr_ &= ~value;
        return;
      case 0xD2C:
        hfsr_ &= ~value;
        return;
      case 0xD88:
        cpacr_ = value & 0x00F00000;
        return;
      case 0xDFC:
        demcr_ = value;
        return;
      case 0xF00:
        pend(16 + static_cast<int>(value & 0x1FF));
        return;
      case 0xF34:
        fpccr_ = value;
        return;
      case 0xF3C:
        fpdscr_ = value;
        return;
      default:
        break;
    }
  }
  host_.report("system control space: write of a register that is not modelled", address);
}

}  // namespace host_sim::chip

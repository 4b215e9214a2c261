// SPDX-License-Identifier: MIT
// Exceptions of the core, which Unicorn leaves out: who runs next, entry, tail-chaining, return (Armv7-M ARM B1.5).
#include <unicorn/unicorn.h>

#include <algorithm>

#include "host-sim/chip/core.hpp"

namespace host_sim::chip {

bool Core::masks(bool& primask, bool& faultmask, std::uint32_t& basepri) const {
  primask = reg(UC_ARM_REG_PRIMASK) & 1;
  faultmask = reg(UC_ARM_REG_FAULTMASK) & 1;
  basepri = reg(UC_ARM_REG_BASEPRI) & 0xFF;
  return primask || faultmask || basepri;
}

void Core::dispatch() {
  bool primask, faultmask;
  std::uint32_t basepri;
  masked_ = false;
  if (!nvic_.any_pending()) return;
  const bool any_mask = masks(primask, faultmask, basepri);
  const int exception = nvic_.next(primask, faultmask, basepri);
  if (exception) {
    sleeping_ = false;
    push_and_enter(exception);
  } else if (any_mask && nvic_.next(false, false, 0)) {
    masked_ = true;
  }
}

void Core::note(ExceptionEvent::Kind kind, int exception) {
  if (tracing_ && events_.size() < 1'000'000) events_.push_back({kind, exception, nvic_.depth(), instructions_, now_});
}

void Core::begin(ExceptionEvent::Kind kind, int exception) {
  LaneCount& lane = lanes_[static_cast<std::size_t>(exception)];
  ++lane.calls;
  lane.worst_wait = std::max(lane.worst_wait, now_ - std::min(now_, nvic_.pending_since(exception)));
  nvic_.enter(exception);
  deepest_ = std::max(deepest_, nvic_.depth());
  note(kind, exception);
}

void Core::push_and_enter(int exception) {
  const std::uint32_t control = reg(UC_ARM_REG_CONTROL);
  const bool fp = control & 4;
  std::uint32_t sp = reg(UC_ARM_REG_SP);
  const std::uint32_t xpsr = reg(UC_ARM_REG_XPSR);
  std::uint32_t frame[26] = {reg(UC_ARM_REG_R0),  reg(UC_ARM_REG_R1), reg(UC_ARM_REG_R2),       reg(UC_ARM_REG_R3),
                             reg(UC_ARM_REG_R12), reg(UC_ARM_REG_LR), reg(UC_ARM_REG_PC) & ~1u, 0};
  const bool padded = sp & 4;
  frame[7] = (xpsr & ~(1u << 9)) | (padded ? 1u << 9 : 0) | (1u << 24);
  const std::uint32_t words = fp ? 26 : 8;
  if (fp) {
    for (int i = 0; i < 16; ++i) frame[8 + i] = reg(UC_ARM_REG_S0 + i);
    frame[24] = reg(UC_ARM_REG_FPSCR);
  }
  sp = (sp - 4 * words) & ~7u;
  if (sp < ram_base || sp + 4 * words > ram_base + ram_size)
    bus_.core_trouble("exception entry with the stack outside the RAM", sp);
  uc_mem_write(uc_, sp, frame, 4 * words);
  set(UC_ARM_REG_SP, sp);
  const std::uint32_t exc_return = (nvic_.depth() ? 0xFFFFFFE1u : 0xFFFFFFE9u) | (fp ? 0 : 0x10u);
  set(UC_ARM_REG_CONTROL, control & ~4u);
  begin(ExceptionEvent::entered, exception);
  enter_handler(exception, exc_return);
}

void Core::enter_handler(int exception, std::uint32_t exc_return) {
  const std::uint32_t vector = word(nvic_.vector_table() + 4 * static_cast<std::uint32_t>(exception));
  set(UC_ARM_REG_LR, exc_return);
  set(UC_ARM_REG_XPSR,
      (reg(UC_ARM_REG_XPSR) & 0xF80F0000 & ~0x0600FC00u) | (1u << 24) | static_cast<std::uint32_t>(exception));
  set(UC_ARM_REG_IPSR, static_cast<std::uint32_t>(exception));
  if (!(vector & 1))
    bus_.core_trouble("exception " + std::to_string(exception) + " has no handler", nvic_.vector_table());
  set(UC_ARM_REG_PC, vector | 1);
  frames_.push_back({exception, instructions_, 0});
  if (exception == hang_) stay_here();
}

/// `b .` in unused system memory: what runs now never ends.
void Core::stay_here() {
  system_[0] = 0xFE;
  system_[1] = 0xE7;
  uc_mem_protect(uc_, system_base, system_size, UC_PROT_READ | UC_PROT_EXEC);
  set(UC_ARM_REG_PC, system_base | 1);
}

void Core::exception_return(std::uint32_t exc_return) {
  const int exception = nvic_.running();
  if ((exc_return & 0xFFFFFFE0) != 0xFFFFFFE0 || exception == 0) {
    bus_.core_trouble("return from an exception that is not running", exc_return);
    nvic_.fault(usage_fault);
    return;
  }
  note(ExceptionEvent::returned, exception);
  nvic_.leave(exception);
  set(UC_ARM_REG_FAULTMASK, 0);
  if (!frames_.empty()) {
    const Frame f = frames_.back();
    frames_.pop_back();
    const std::uint64_t all = instructions_ - f.start, own = all - f.nested;
    LaneCount& lane = lanes_[static_cast<std::size_t>(f.exception)];
    lane.total += own;
    if (own > lane.worst) lane.worst = own;
    if (!frames_.empty())
      frames_.back().nested += all;
    else
      in_handlers_ += all;
  }
  bool primask, faultmask;
  std::uint32_t basepri;
  masks(primask, faultmask, basepri);
  if (const int chained = nvic_.next(primask, faultmask, basepri)) {
    begin(ExceptionEvent::tail_chained, chained);
    enter_handler(chained, exc_return);
    return;
  }
  const bool fp = !(exc_return & 0x10);
  const std::uint32_t words = fp ? 26 : 8;
  std::uint32_t frame[26];
  const std::uint32_t sp = reg(UC_ARM_REG_SP);
  uc_mem_read(uc_, sp, frame, 4 * words);
  set(UC_ARM_REG_IPSR, 0);
  static constexpr int registers[6] = {UC_ARM_REG_R0, UC_ARM_REG_R1,  UC_ARM_REG_R2,
                                       UC_ARM_REG_R3, UC_ARM_REG_R12, UC_ARM_REG_LR};
  for (int i = 0; i < 6; ++i) set(registers[i], frame[i]);
  if (fp) {
    for (int i = 0; i < 16; ++i) set(UC_ARM_REG_S0 + i, frame[8 + i]);
    set(UC_ARM_REG_FPSCR, frame[24]);
  }
  set(UC_ARM_REG_CONTROL, (reg(UC_ARM_REG_CONTROL) & ~4u) | (fp ? 4u : 0));
  set(UC_ARM_REG_SP, sp + 4 * words + ((frame[7] >> 9 & 1) ? 4 : 0));
  set(UC_ARM_REG_XPSR, frame[7] & ~(1u << 9));
  if (nvic_.running()) set(UC_ARM_REG_IPSR, static_cast<std::uint32_t>(nvic_.running()));
  set(UC_ARM_REG_PC, frame[6] | 1);
  if (hang_ == 0 && nvic_.depth() == 0) stay_here();
}

}  // namespace host_sim::chip

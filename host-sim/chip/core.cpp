// SPDX-License-Identifier: MIT
#include "host-sim/chip/core.hpp"

#include <unicorn/unicorn.h>

#include <cstring>
#include <stdexcept>

namespace host_sim::chip {
namespace {

void check(uc_err error) {
  if (error != UC_ERR_OK) throw std::runtime_error(std::string("unicorn: ") + uc_strerror(error));
}

constexpr std::uint16_t wfi_opcode = 0xBF30, bkpt_semihosting = 0xBEAB;

std::uint64_t read_mmio(uc_engine*, std::uint64_t offset, unsigned size, void* bus, std::uint32_t base) {
  return static_cast<Bus*>(bus)->bus_read(base + static_cast<std::uint32_t>(offset), size);
}
template <std::uint32_t base>
std::uint64_t mmio_read(uc_engine* uc, std::uint64_t offset, unsigned size, void* bus) {
  return read_mmio(uc, offset, size, bus, base);
}
template <std::uint32_t base>
void mmio_write(uc_engine*, std::uint64_t offset, unsigned size, std::uint64_t value, void* bus) {
  static_cast<Bus*>(bus)->bus_write(base + static_cast<std::uint32_t>(offset), static_cast<std::uint32_t>(value), size);
}
template <std::uint32_t base>
void map_device(uc_engine* uc, std::uint32_t size, Bus* bus) {
  check(uc_mmio_map(uc, base, size, mmio_read<base>, bus, mmio_write<base>, bus));
}

}  // namespace

Core::Core(Bus& bus, Nvic& nvic, std::uint8_t* flash)
    : bus_(bus),
      nvic_(nvic),
      ram_(ram_size),
      ccm_(ccm_size),
      system_(system_size, 0xFF),
      flash_(flash),
      cache_(flash_size / 2) {
  check(uc_open(UC_ARCH_ARM, static_cast<uc_mode>(UC_MODE_THUMB | UC_MODE_MCLASS), &uc_));
  check(uc_ctl_set_cpu_model(uc_, UC_CPU_ARM_CORTEX_M4));
  check(uc_mem_map_ptr(uc_, flash_base, flash_size, UC_PROT_READ | UC_PROT_EXEC, flash_));
  check(uc_mem_map_ptr(uc_, 0, flash_size, UC_PROT_READ | UC_PROT_EXEC, flash_));  // BOOT0 = 0: alias, RM0090 2.4
  check(uc_mem_map_ptr(uc_, ram_base, ram_size, UC_PROT_ALL, ram_.data()));
  check(uc_mem_map_ptr(uc_, ccm_base, ccm_size, UC_PROT_READ | UC_PROT_WRITE, ccm_.data()));
  check(uc_mem_map_ptr(uc_, system_base, system_size, UC_PROT_READ, system_.data()));
  map_device<0x40000000>(uc_, 0x80000, &bus_);
  map_device<0x50000000>(uc_, 0x40000, &bus_);
  map_device<0xE0000000>(uc_, 0x100000, &bus_);
  uc_hook hook;
  check(uc_hook_add(uc_, &hook, UC_HOOK_BLOCK, reinterpret_cast<void*>(&Core::on_block), this, 1, 0));
  check(uc_hook_add(uc_, &hook, UC_HOOK_INTR, reinterpret_cast<void*>(&Core::on_interrupt), this, 1, 0));
  check(uc_hook_add(uc_, &hook, UC_HOOK_MEM_UNMAPPED | UC_HOOK_MEM_PROT, reinterpret_cast<void*>(&Core::on_bad_memory),
                    this, 1, 0));
}

Core::~Core() { uc_close(uc_); }

std::uint32_t Core::reg(int id) const {
  std::uint32_t v = 0;
  uc_reg_read(uc_, id, &v);
  return v;
}
void Core::set(int id, std::uint32_t value) { uc_reg_write(uc_, id, &value); }

std::uint32_t Core::word(std::uint32_t address) const {
  std::uint32_t v = 0;
  uc_mem_read(uc_, address, &v, 4);
  return v;
}
void Core::poke(std::uint32_t address, std::uint32_t value) { uc_mem_write(uc_, address, &value, 4); }

void Core::forget_code() {
  for (const Range& r : stale_) {
    const std::uint32_t first = (r.address - flash_base) / 2;
    for (std::uint32_t i = first; i < first + r.size / 2 && i < cache_.size(); ++i) cache_[i] = {};
    uc_ctl_remove_cache(uc_, r.address, r.address + r.size);
    uc_ctl_remove_cache(uc_, r.address - flash_base, r.address - flash_base + r.size);
  }
  stale_.clear();
}

void Core::reset() {
  for (int id = UC_ARM_REG_R0; id <= UC_ARM_REG_R12; ++id) set(id, 0);
  set(UC_ARM_REG_IPSR, 0);
  set(UC_ARM_REG_XPSR, 1u << 24);
  set(UC_ARM_REG_CONTROL, 0);
  set(UC_ARM_REG_PRIMASK, 0);
  set(UC_ARM_REG_BASEPRI, 0);
  set(UC_ARM_REG_FAULTMASK, 0);
  set(UC_ARM_REG_LR, 0xFFFFFFFF);
  set(UC_ARM_REG_SP, word(0));
  set(UC_ARM_REG_PC, word(4) | 1);
  if (!(word(4) & 1)) bus_.core_trouble("reset vector without the Thumb bit", 4);
  sleeping_ = locked_up_ = returning_ = masked_ = bad_memory_ = false;
  fault_ = 0;
  frames_.clear();
}

void Core::stop_soon() { stop_ = 0; }

void Core::on_block(uc_struct*, std::uint64_t address, std::uint32_t size, void* self) {
  static_cast<Core*>(self)->block(static_cast<std::uint32_t>(address), size);
}

void Core::block(std::uint32_t address, std::uint32_t size) {
  block_ = address;
  const std::uint32_t slot = (address & 0x07FFFFFF) >> 1;
  Block b;
  if (slot < cache_.size() && (address & 0xF0000000) == 0) {
    Block& c = cache_[slot];
    if (c.size != size) c = decode(address, size);
    b = c;
  } else {
    b = decode(address, size);
  }
  now_ += b.count * ticks_per_instruction_;
  instructions_ += b.count;
  if (b.fpu && !nvic_.fpu_open()) {
    bus_.core_trouble("FPU instruction while CPACR keeps the FPU closed", 0xE000ED88);
    fault_ = usage_fault;
    uc_emu_stop(uc_);
  }
  if (now_ >= stop_) {
    uc_emu_stop(uc_);
  } else if (masked_) {
    bool primask, faultmask;
    std::uint32_t basepri;
    masks(primask, faultmask, basepri);
    if (nvic_.next(primask, faultmask, basepri)) uc_emu_stop(uc_);
  }
}

Core::Block Core::decode(std::uint32_t address, std::uint32_t size) {
  Block b;
  b.size = static_cast<std::uint16_t>(size);
  std::vector<std::uint16_t> half(size / 2 + 1, 0);
  uc_mem_read(uc_, address, half.data(), size);
  for (std::uint32_t i = 0; i < size / 2;) {
    const std::uint16_t h = half[i];
    const bool wide = (h >> 11) >= 0x1D;
    // Coprocessors 10 and 11 are the FPU (Armv7-M ARM, A6.6): 111x 11xx ... / xxxx 101x
    if (wide && (h & 0xEC00) == 0xEC00 && (half[i + 1] >> 9 & 7) == 5) b.fpu = true;
    i += wide ? 2 : 1;
    ++b.count;
  }
  return b;
}

void Core::on_interrupt(uc_struct*, std::uint32_t number, void* self) {
  Core& c = *static_cast<Core*>(self);
  if (number == 8) {  // EXC_RETURN loaded into PC
    c.returning_ = true;
    uc_emu_stop(c.uc_);
    return;
  }
  const std::uint32_t pc = c.reg(UC_ARM_REG_PC);
  std::uint16_t opcode = 0;
  uc_mem_read(c.uc_, pc, &opcode, 2);
  if (opcode == bkpt_semihosting) {
    c.semihost();
    if (!c.exited_) c.set(UC_ARM_REG_PC, (pc + 2) | 1);
    return;
  }
  if (number == 2) {
    c.nvic_.pend(svcall);
  } else {
    c.bus_.core_trouble(
        number == 1 ? "undefined instruction" : "breakpoint or exception " + std::to_string(number) + " of the core",
        pc);
    c.fault_ = number == 1 ? usage_fault : hard_fault;
  }
  uc_emu_stop(c.uc_);
}

void Core::semihost() {
  const std::uint32_t operation = reg(UC_ARM_REG_R0);
  std::uint32_t argument = reg(UC_ARM_REG_R1);
  if (operation == 4) {
    char letter = 0;
    while (uc_mem_read(uc_, argument++, &letter, 1) == UC_ERR_OK && letter) text_ += letter;
  } else if (operation == 0x20) {
    exit_code_ = static_cast<int>(word(argument + 4));
    exited_ = true;
    uc_emu_stop(uc_);
  }
}

bool Core::on_bad_memory(uc_struct*, int type, std::uint64_t address, int size, std::int64_t value, void* self) {
  Core& c = *static_cast<Core*>(self);
  const auto where = static_cast<std::uint32_t>(address);
  if (type == UC_MEM_WRITE_PROT && where >= flash_base && where < flash_base + flash_size) {
    c.bus_.flash_write(where, static_cast<std::uint32_t>(value), static_cast<unsigned>(size));
    return true;
  }
  c.bad_memory_ = true;
  c.bus_.core_trouble(
      type == UC_MEM_FETCH_UNMAPPED || type == UC_MEM_FETCH_PROT   ? "instruction fetch where there is no code"
      : type == UC_MEM_WRITE_UNMAPPED || type == UC_MEM_WRITE_PROT ? "write to an address where nothing can be written"
                                                                   : "read of an address where nothing is",
      where);
  return false;
}

bool Core::masks(bool& primask, bool& faultmask, std::uint32_t& basepri) const {
  primask = reg(UC_ARM_REG_PRIMASK) & 1;
  faultmask = reg(UC_ARM_REG_FAULTMASK) & 1;
  basepri = reg(UC_ARM_REG_BASEPRI) & 0xFF;
  return primask || faultmask || basepri;
}

void Core::run(Time until) {
  if (locked_up_ || exited_) return;
  if (!stale_.empty()) forget_code();
  dispatch();
  if (sleeping_) {
    if (!nvic_.wakes()) {
      if (until > now_) slept_ += until - now_;
      skip_to(until);
      return;
    }
    sleeping_ = false;
  }
  stop_ = until;
  if (now_ >= stop_) return;
  const uc_err error = uc_emu_start(uc_, reg(UC_ARM_REG_PC) | 1, 0xFFFFFFFF, 0, 0);
  if (error != UC_ERR_OK) {
    if (!bad_memory_) bus_.core_trouble(std::string("the core stopped: ") + uc_strerror(error), reg(UC_ARM_REG_PC));
    bad_memory_ = false;
    fault_ = bus_fault;
  }
  if (exited_) return;
  if (returning_) {
    returning_ = false;
    exception_return(reg(UC_ARM_REG_PC) | 1);
    return;
  }
  if (fault_) {
    const int f = fault_;
    fault_ = 0;
    if (nvic_.running() == hard_fault || nvic_.running() == nmi) {
      locked_up_ = true;
      bus_.core_trouble("lockup: a fault inside the HardFault or NMI handler", reg(UC_ARM_REG_PC));
      return;
    }
    nvic_.fault(f);
  } else if (now_ < stop_) {
    const std::uint32_t pc = reg(UC_ARM_REG_PC) & ~1u;
    std::uint16_t op[2] = {0, 0};
    uc_mem_read(uc_, pc - 2, op, 4);
    if (op[0] == wfi_opcode || op[1] == wfi_opcode) {
      if (op[1] == wfi_opcode && op[0] != wfi_opcode) set(UC_ARM_REG_PC, (pc + 2) | 1);
      sleeping_ = true;
      if (nvic_.depth() == 0) {
        const std::uint64_t own = instructions_ - awake_at_ - in_handlers_;
        LaneCount& main_lane = lanes_[0];
        ++main_lane.calls;
        main_lane.total += own;
        if (own > main_lane.worst) main_lane.worst = own;
        awake_at_ = instructions_;
        in_handlers_ = 0;
      }
    }
  }
  dispatch();
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
  nvic_.enter(exception);
  note(ExceptionEvent::entered, exception);
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
  if (exception == hang_) {
    // `b .` in unused system memory: the handler never ends.
    system_[0] = 0xFE;
    system_[1] = 0xE7;
    uc_mem_protect(uc_, system_base, system_size, UC_PROT_READ | UC_PROT_EXEC);
    set(UC_ARM_REG_PC, system_base | 1);
  }
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
    ++lane.calls;
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
    nvic_.enter(chained);
    note(ExceptionEvent::tail_chained, chained);
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
  if (hang_ == 0 && nvic_.depth() == 0) {
    system_[0] = 0xFE;
    system_[1] = 0xE7;
    uc_mem_protect(uc_, system_base, system_size, UC_PROT_READ | UC_PROT_EXEC);
    set(UC_ARM_REG_PC, system_base | 1);
  }
}

void Core::clear_counts() {
  lanes_.fill({});
  events_.clear();
  slept_ = 0;
  awake_at_ = instructions_;
  in_handlers_ = 0;
}

}  // namespace host_sim::chip

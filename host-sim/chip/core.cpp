// SPDX-License-Identifier: MIT
#include "host-sim/chip/core.hpp"

#include <unicorn/unicorn.h>

#include <algorithm>
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

/// Nothing says what RAM holds at power-up; ones are NaN to a float and far away to an integer.
constexpr std::uint8_t unwritten = 0xFF;

}  // namespace

Core::Core(Bus& bus, Nvic& nvic, std::uint8_t* flash)
    : bus_(bus),
      nvic_(nvic),
      ram_(ram_size, unwritten),
      ccm_(ccm_size, unwritten),
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

std::uint32_t Core::stack_pointer() const { return reg(UC_ARM_REG_SP); }

std::uint32_t Core::word(std::uint32_t address) const {
  std::uint32_t v = 0;
  uc_mem_read(uc_, address, &v, 4);
  return v;
}
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
  if (wants_to_stop()) {  // this block is not executed now, so it is not counted either
    uc_emu_stop(uc_);
    return;
  }
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
}

bool Core::wants_to_stop() const {
  if (now_ >= stop_) return true;
  if (!masked_) return false;
  bool primask, faultmask;
  std::uint32_t basepri;
  masks(primask, faultmask, basepri);
  return nvic_.next(primask, faultmask, basepri) != 0;
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
  longest_block_ = std::max(longest_block_, b.count);
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

void Core::clear_counts() {
  lanes_.fill({});
  events_.clear();
  slept_ = 0;
  deepest_ = 0;
  for (Frame& f : frames_) f = {f.exception, instructions_, 0};
  awake_at_ = instructions_;
  in_handlers_ = 0;
}

}  // namespace host_sim::chip

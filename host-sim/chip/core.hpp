// SPDX-License-Identifier: MIT
// The Cortex-M4F core: Unicorn executes the instructions, this class does what Unicorn leaves out: exception entry and
// return (push 8 or 26 words, EXC_RETURN) and tail-chaining (exceptions.cpp), WFI, the CPACR check, and time
// (instructions at a stated number of cycles each). No wait states, no bus contention: what it counts are instructions,
// never a deadline.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "host-sim/chip/nvic.hpp"
#include "host-sim/chip/trouble.hpp"

struct uc_struct;

namespace host_sim::chip {

/// Memory-mapped world of the core; addresses are absolute.
class Bus {
 public:
  virtual ~Bus() = default;
  virtual std::uint32_t bus_read(std::uint32_t address, unsigned size) = 0;
  virtual void bus_write(std::uint32_t address, std::uint32_t value, unsigned size) = 0;
  virtual void flash_write(std::uint32_t address, std::uint32_t value, unsigned size) = 0;
  virtual void core_trouble(const std::string& what, std::uint32_t address) = 0;
};

/// What happened at the border of an exception; the order is compared with QEMU's NVIC.
struct ExceptionEvent {
  enum Kind : std::uint8_t { entered, tail_chained, returned } kind;
  int exception;
  int depth;
  std::uint64_t instruction;
  Time when;
};

/// Own instructions (nested exceptions excluded) of one exception's handler, and how long it was pending before its
/// first instruction. The core looks for exceptions where a block of instructions ends, so the wait is at most a block
/// longer than on silicon (whose 12 cycles of entry are not counted).
struct LaneCount {
  std::uint64_t calls = 0, total = 0, worst = 0;
  Time worst_wait = 0;
};

class Core {
 public:
  static constexpr std::uint32_t flash_base = 0x08000000, flash_size = 1u << 20;
  static constexpr std::uint32_t ram_base = 0x20000000, ram_size = 128u << 10;
  static constexpr std::uint32_t ccm_base = 0x10000000, ccm_size = 64u << 10;
  static constexpr std::uint32_t system_base = 0x1FFF7000, system_size = 4096;

  Core(Bus& bus, Nvic& nvic, std::uint8_t* flash);
  ~Core();
  Core(const Core&) = delete;
  Core& operator=(const Core&) = delete;

  void reset();  // SP and PC from the vector table; RAM is left alone
  /// Executes until `stop` (or earlier, when something asked for it).
  void run(Time stop);
  void stop_soon();

  Time now() const { return now_; }
  void skip_to(Time t) { now_ = t > now_ ? t : now_; }
  void stall(Time t) { now_ += t; }
  void set_ticks_per_cycle(Time t) { ticks_per_instruction_ = t * cycles_per_instruction_; }
  void set_cycles_per_instruction(unsigned n) { cycles_per_instruction_ = n; }

  bool exited() const { return exited_; }
  int exit_code() const { return exit_code_; }
  bool locked_up() const { return locked_up_; }
  const std::string& semihost_text() const { return text_; }
  std::uint32_t pc() const { return block_; }
  std::uint32_t stack_pointer() const;
  std::uint64_t instructions() const { return instructions_; }
  Time slept() const { return slept_; }

  std::uint8_t* ram() { return ram_.data(); }
  std::uint8_t* system_memory() { return system_.data(); }
  std::uint32_t word(std::uint32_t address) const;
  /// Translated code of this range is forgotten before the core goes on.
  void refresh_flash(std::uint32_t address, std::uint32_t size) { stale_.push_back({address, size}); }

  void trace(bool on) { tracing_ = on; }
  const std::vector<ExceptionEvent>& events() const { return events_; }
  /// 0: the main program, counted from waking to sleeping, handlers excluded.
  const LaneCount& lane(int exception) const { return lanes_[static_cast<std::size_t>(exception)]; }
  /// Most handlers active at once since clear_counts().
  int deepest_nesting() const { return deepest_; }
  /// Instructions of the longest block executed so far: how coarsely the core looks for exceptions.
  unsigned longest_block() const { return longest_block_; }
  void clear_counts();
  /// Fault injection: from its next entry on, this exception's handler (0: the main program) never ends.
  void hang(int exception) { hang_ = exception; }
  void unhang() { hang_ = -1; }

 private:
  struct Block {
    std::uint16_t size = 0, count = 0;
    bool fpu = false;
  };
  struct Frame {
    int exception;
    std::uint64_t start, nested;
  };

  static void on_block(uc_struct*, std::uint64_t address, std::uint32_t size, void* self);
  static void on_interrupt(uc_struct*, std::uint32_t number, void* self);
  static bool on_bad_memory(uc_struct*, int type, std::uint64_t address, int size, std::int64_t value, void* self);
  void block(std::uint32_t address, std::uint32_t size);
  bool wants_to_stop() const;
  Block decode(std::uint32_t address, std::uint32_t size);
  void dispatch();
  bool masks(bool& primask, bool& faultmask, std::uint32_t& basepri) const;
  void push_and_enter(int exception);
  void enter_handler(int exception, std::uint32_t exc_return);
  void begin(ExceptionEvent::Kind kind, int exception);
  void exception_return(std::uint32_t exc_return);
  void stay_here();
  void semihost();
  std::uint32_t reg(int id) const;
  void set(int id, std::uint32_t value);
  void note(ExceptionEvent::Kind kind, int exception);

  Bus& bus_;
  Nvic& nvic_;
  uc_struct* uc_ = nullptr;
  std::vector<std::uint8_t> ram_, ccm_, system_;
  std::uint8_t* flash_;
  std::vector<Block> cache_;
  Time now_ = 0, stop_ = 0, slept_ = 0;
  Time ticks_per_instruction_ = 21;
  unsigned cycles_per_instruction_ = 1;
  std::uint64_t instructions_ = 0;
  std::uint32_t block_ = 0;
  bool sleeping_ = false, exited_ = false, locked_up_ = false, tracing_ = false;
  bool returning_ = false, masked_ = false, bad_memory_ = false;
  int exit_code_ = -1, fault_ = 0, hang_ = -1, deepest_ = 0;
  std::uint16_t longest_block_ = 0;
  std::string text_;
  std::vector<ExceptionEvent> events_;
  std::array<LaneCount, exception_count> lanes_{};
  std::vector<Frame> frames_;
  struct Range {
    std::uint32_t address, size;
  };
  std::vector<Range> stale_;
  void forget_code();
  std::uint64_t awake_at_ = 0, in_handlers_ = 0;
};

}  // namespace host_sim::chip

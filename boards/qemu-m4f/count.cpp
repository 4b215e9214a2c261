// SPDX-License-Identifier: MIT
// Counts the instructions of every fast and slow tick of the walk, call and return included, on QEMU's netduinoplus2
// with -icount shift=0: there TIM2 advances by one each instruction, exactly and repeatably. Instructions, not cycles.
// Ends with 1 if a fast tick takes more than the budget.
#include "boards/qemu-m4f/console.hpp"
#include "boards/qemu-m4f/replay.hpp"

namespace {

constexpr unsigned budget = 500;

volatile std::uint32_t& tim2(unsigned offset) {
  return *reinterpret_cast<volatile std::uint32_t*>(0x40000000u + offset);
}
std::uint32_t now() { return tim2(0x24); }

struct Counter {
  std::uint32_t start = 0, overhead = 0;
  int at_tick = 0;
  unsigned worst = 0, worst_at = 0, worst_running = 0, slow_worst = 0, ticks = 0;
  unsigned long long running_sum = 0;
  unsigned running = 0;

  void before() { start = now(); }
  unsigned elapsed() { return now() - start - overhead; }
  void after_tick(int, const hal::Duty& duty) {
    const unsigned count = elapsed();
    ++ticks;
    if (count > worst) worst = count, worst_at = ticks;
    if (!duty.on) return;
    if (count > worst_running) worst_running = count;
    running_sum += count;
    ++running;
  }
  void after_slow() {
    const unsigned count = elapsed();
    if (count > slow_worst) slow_worst = count;
  }
};

void line(const char* what, unsigned count) {
  console::write(what);
  console::write(count);
  console::write("\n");
}

Counter counter;

}  // namespace

int main() {
  tim2(0x2C) = 0xFFFFFFFFu;  // ARR: wraps as late as it can
  tim2(0x00) = 1;            // CR1: on
  counter.before();
  counter.overhead = now() - counter.start;

  replay::Walk walk(counter);
  for (int t = 0; t < replay::slow_ticks; ++t) walk.run(t);

  line("fast ticks counted            ", counter.ticks);
  line("one axis tick, worst          ", counter.worst);
  line("  which was tick number       ", counter.worst_at);
  line("one axis tick, bridge on, worst ", counter.worst_running);
  line("one axis tick, bridge on, mean  ", static_cast<unsigned>(counter.running_sum / counter.running));
  line("slow tick of both axes, worst ", counter.slow_worst);
  line("budget of one axis tick       ", budget);
  console::quit(counter.worst <= budget ? 0 : 1);
}

// SPDX-License-Identifier: MIT
// Counts the instructions of every fast and slow tick of the walk, call and return included, on QEMU's netduinoplus2
// with -icount shift=0: there TIM2 advances by one each instruction, exactly and repeatably. Instructions, not cycles.
// Ends with 1 if a fast tick, or what recording adds to it, takes more than the budget.
#include "boards/qemu-m4f/console.hpp"
#include "boards/qemu-m4f/replay.hpp"
#include "firmware/recorder.hpp"

namespace {

constexpr unsigned budget = 500;
constexpr unsigned recorder_budget = 60;  // idle, and with four signals on their way to the host

volatile std::uint32_t& tim2(unsigned offset) {
  return *reinterpret_cast<volatile std::uint32_t*>(0x40000000u + offset);
}
/// Called, not inlined: or what stands around it is scheduled between two of them, and counted as what they take.
[[gnu::noinline]] std::uint32_t now() { return tim2(0x24); }

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
firmware::Recorder recorder;

/// Worst of a thousand periods; the stream is emptied in each.
unsigned recording(unsigned overhead) {
  unsigned worst = 0;
  for (std::uint32_t period = 1; period <= 1000; ++period) {
    const std::uint32_t start = now();
    recorder.tick(period);
    const unsigned count = now() - start - overhead;
    if (count > worst) worst = count;
    if (recorder.stream_rows() > 0) recorder.stream_release(1);
  }
  return worst;
}

firmware::Selection first_signals(const firmware::Driver& driver, std::uint32_t count) {
  firmware::Selection selection;
  selection.count = count;
  for (std::uint32_t i = 0; i < count; ++i)
    selection.places[i] = driver.axis(i & 1).signal(firmware::axis_signals[i].id);
  return selection;
}

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

  const unsigned idle = recording(counter.overhead);
  recorder.stream(first_signals(walk.driver(), 4));
  const unsigned streaming = recording(counter.overhead);
  recorder.capture(first_signals(walk.driver(), 8), {}, 100, 100);
  const unsigned both = recording(counter.overhead);
  line("recorder, idle                ", idle);
  line("recorder, four signals streamed ", streaming);
  line("  and eight captured          ", both);
  line("budget of the first two       ", recorder_budget);
  console::quit(counter.worst <= budget && idle <= recorder_budget && streaming <= recorder_budget ? 0 : 1);
}

// SPDX-License-Identifier: MIT
// Interrupts of the product image, by the table of priorities in board.hpp: how long each source waits for its first
// instruction, and that the more urgent preempts the less urgent down to the deepest nesting there is. Waits are
// instructions at one cycle each; silicon adds 12 cycles of entry and gives back the rest of a block.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <vector>

#include "tests/chip/plugged.hpp"

namespace image_tests {
namespace {

using namespace host_sim::chip;
constexpr int pvd = 16 + 1, index0 = 16 + 9, adc = 16 + 18, index1 = 16 + 23, usb = 16 + 67;

double instructions(Time wait) { return to_s(wait) * 168e6; }

/// Stops with this handler at its first instruction.
testing::AssertionResult run_into(boards::Pcb& pcb, int exception, double patience_s = 2e-3) {
  const double end_s = to_s(pcb.chip.now()) + patience_s;
  while (pcb.chip.nvic.running() != exception) {
    if (to_s(pcb.chip.now()) > end_s) return testing::AssertionFailure() << "exception " << exception << " never began";
    pcb.chip.run_for(10e-9);
  }
  return testing::AssertionSuccess();
}

void index_edge(boards::Pcb& pcb, int axis) {
  const Pin pin = axis == 0 ? Pin{'B', 3} : Pin{'B', 8};
  pcb.chip.set_pin(pin, false);
  pcb.chip.set_pin(pin, true);
}

template <class Happens>
void in(boards::Pcb& pcb, double seconds, Happens happens) {
  pcb.chip.at(pcb.chip.now() + from_s(seconds), happens);
}

/// A program's traffic in turns: setpoints, a long answer, another.
void talk(Plugged& p, int k) {
  const wire::Setpoints wish{3, {}, 0, {0, 0}, {4.0f, -4.0f}};
  const wire::Index first{0};
  const auto out = k % 3 == 0   ? encoded(wire::Kind::setpoint, 1, &wish, sizeof wish)
                   : k % 3 == 1 ? encoded(wire::Kind::describe_parameter, 2, &first, sizeof first)
                                : encoded(wire::Kind::hello, 3, nullptr, 0);
  p.host.submit(bulk(false, out, 0, 1));
  p.host.submit(bulk(true, {}, 512, 2));
}

// Index pulses, millisecond ticks and packets are laid over every phase of the fast lanes, supply and crystal fail in
// several.
TEST(Interrupts, NobodyWaitsLongerThanForABlockAndItsBetters) {
  NEEDS_IMAGE(image);
  std::map<int, LaneCount> seen;
  unsigned block = 0, slow_lane = 0;
  const auto look = [&](boards::Pcb& pcb) {
    for (const int e : {int{nmi}, pvd, index0, index1, adc, usb, int{systick}}) {
      const LaneCount& lane = pcb.chip.core().lane(e);
      LaneCount& all = seen[e];
      all.calls += lane.calls;
      all.worst = std::max(all.worst, lane.worst);
      all.worst_wait = std::max(all.worst_wait, lane.worst_wait);
    }
    block = std::max(block, pcb.chip.core().longest_block());
    slow_lane = std::max(slow_lane, static_cast<unsigned>(pcb.chip.core().lane(0).worst));
  };
  Options o;
  o.locked = false;
  for (int phase = 0; phase < 8; ++phase) {
    Plugged p(o);
    const auto& pcb = p.pcb;
    ASSERT_TRUE(p.configure());
    ASSERT_TRUE(pcb->arm());
    hold(*pcb, 4.0f, -4.0f, 0.05);
    pcb->chip.core().clear_counts();
    if (phase == 0) {
      hold(*pcb, 4.0f, -4.0f, 0.1);
      for (int k = 0; k < 800; ++k) {
        if (k % 100 == 0) hold(*pcb, 4.0f, -4.0f, 0.01);
        in(*pcb, 20e-6, [&] { index_edge(*pcb, k % 2); });
        if (k % 4 == 1) talk(p, k / 4);
        if (k % 4 == 0) in(*pcb, 30e-6, [&] { pcb->chip.nvic.pend(systick); });
        std::vector<Transfer> finished;
        p.host.turn(finished);
        pcb->run_for(50.05e-6);
      }
      EXPECT_EQ(pcb->chip.troubles().count(), 0u) << pcb->chip.report_text();
      EXPECT_EQ(pcb->door().axis[0].mode, firmware::Mode::running);
    } else {
      in(*pcb, 4.1e-6 * phase, [&] { pcb->chip.set_supply(2.8); });
      // The NMI resets the chip: it comes once the longest wait allowed to the PVD, 200 instructions or 1.2 us, is
      // over.
      in(*pcb, 4.1e-6 * phase + 1.2e-6, [&] { pcb->chip.stop_hse(); });
      pcb->run_for(50e-6);
      EXPECT_EQ(pcb->chip.core().lane(pvd).calls, 1u);
      EXPECT_EQ(pcb->chip.core().lane(nmi).calls, 1u);
    }
    look(*pcb);
  }
  struct Row {
    const char* name;
    int exception;
    double bound;
  };
  const auto own = [&](int e) { return static_cast<double>(seen[e].worst); };
  const double both_indices = own(index0) + own(index1), one = block;
  double after_usb = one + both_indices + own(usb);  // and the fast lanes that come meanwhile, one every 25 us
  for (int turn = 0; turn < 3; ++turn)
    after_usb = one + both_indices + own(usb) + own(adc) * (1 + std::floor(after_usb / 4200));
  const Row rows[] = {{"CSS (NMI)", nmi, std::min(200.0, one)},
                      {"PVD, level 0", pvd, std::min(200.0, one)},
                      {"index 0, level 1", index0, std::min(200.0, one + own(index1))},
                      {"index 1, level 1", index1, std::min(200.0, one + own(index0))},
                      {"ADC, level 2", adc, std::min(250.0, one + both_indices)},
                      {"OTG_FS, level 8", usb, std::min(2100.0, one + both_indices + own(adc))},
                      {"SysTick, level 14", systick, std::min(10e3, after_usb)}};
  std::printf("%-20s %8s %12s %12s %12s\n", "source", "entries", "waits, worst", "bound", "own, worst");
  for (const Row& row : rows) {
    const LaneCount& s = seen[row.exception];
    std::printf("%-20s %8llu %12.0f %12.0f %12.0f\n", row.name, static_cast<unsigned long long>(s.calls),
                instructions(s.worst_wait), row.bound, own(row.exception));
    EXPECT_LE(instructions(s.worst_wait), row.bound) << row.name;
  }
  std::printf("longest block %u, main loop with the slow lane %u instructions\n", block, slow_lane);
  EXPECT_GT(instructions(seen[usb].worst_wait), 0.5 * own(adc)) << "the sweep must have met the fast lane";
  EXPECT_GT(instructions(seen[systick].worst_wait), 0.5 * own(usb)) << "and USB";
  EXPECT_GT(instructions(seen[adc].worst_wait), 0.0);
  EXPECT_LT(instructions(seen[index0].worst_wait) + own(index0), 257) << "one count at 1000 rad/s takes 1.53 us";
  EXPECT_GT(slow_lane, 10 * instructions(seen[adc].worst_wait)) << "the fast lane must preempt the slow lane";
}

// Each is made pending at the first instruction of the less urgent one: main, SysTick, ADC, index, PVD, NMI.
TEST(Interrupts, NestInTheOrderOfTheTableAndReturnInTheOpposite) {
  NEEDS_IMAGE(image);
  auto pcb = board();
  ASSERT_TRUE(pcb->arm());
  hold(*pcb, 4.0f, 4.0f, 0.02);
  ASSERT_TRUE(run_into(*pcb, systick));
  pcb->chip.core().trace(true);
  pcb->chip.core().clear_counts();
  pcb->chip.nvic.pend(adc);  // nothing was converted: the fast lane looks and returns
  ASSERT_TRUE(run_into(*pcb, adc, 0.1e-6));
  index_edge(*pcb, 0);
  ASSERT_TRUE(run_into(*pcb, index0, 0.1e-6));
  index_edge(*pcb, 1);
  pcb->run_for(10e-6);
  std::vector<int> order;
  for (const ExceptionEvent& e : pcb->chip.core().events())
    order.push_back(e.kind == ExceptionEvent::returned ? -e.exception : e.exception);
  order.resize(std::min<std::size_t>(order.size(), 7));
  EXPECT_EQ(order, (std::vector<int>{adc, index0, -index0, index1, -index1, -adc, -systick}));
  EXPECT_EQ(pcb->chip.core().deepest_nesting(), 3);
  hold(*pcb, 4.0f, 4.0f, 0.02);
  EXPECT_TRUE(pcb->duty(0).on && pcb->duty(1).on) << "and nobody was hurt";
  EXPECT_NEAR(mean_iq_A(*pcb, 0, 4.0f, 4.0f), 4.0, 0.1);

  ASSERT_TRUE(run_into(*pcb, systick));
  pcb->chip.core().clear_counts();
  pcb->chip.nvic.pend(adc);
  ASSERT_TRUE(run_into(*pcb, adc, 0.1e-6));
  index_edge(*pcb, 0);
  ASSERT_TRUE(run_into(*pcb, index0, 0.1e-6));
  pcb->chip.set_supply(2.8);
  ASSERT_TRUE(run_into(*pcb, pvd, 0.1e-6));
  pcb->chip.stop_hse();
  ASSERT_TRUE(run_into(*pcb, nmi, 0.1e-6));
  EXPECT_EQ(pcb->chip.core().deepest_nesting(), 5);
  EXPECT_FALSE(pcb->duty(0).on || pcb->duty(1).on);
  std::printf("deepest nesting, forced: %d (SysTick, ADC, index, PVD, NMI)\n", pcb->chip.core().deepest_nesting());
  EXPECT_EQ(pcb->chip.troubles().count(), 0u) << pcb->chip.report_text();
}

// A conversion that ends while the supply falls: what it would start has nothing left to drive, and last words are due.
TEST(Interrupts, TheFastLaneEndsWithTheSupply) {
  NEEDS_IMAGE(image);
  auto pcb = board();
  ASSERT_TRUE(pcb->arm());
  hold(*pcb, 4.0f, 4.0f, 0.02);
  pcb->chip.set_supply(2.8);
  ASSERT_TRUE(run_into(*pcb, pvd));
  pcb->chip.core().clear_counts();
  pcb->chip.nvic.pend(adc);
  for (int k = 0; k < 140 && pcb->chip.nvic.running() == pvd; ++k) pcb->run_for(10e-6);  // the window watchdog: 1.56 ms
  ASSERT_NE(pcb->chip.nvic.running(), pvd) << "the last words last longer";
  pcb->run_for(10e-6);
  EXPECT_EQ(pcb->chip.core().lane(adc).calls, 0u);
}

}  // namespace
}  // namespace image_tests

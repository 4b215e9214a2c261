// SPDX-License-Identifier: MIT
// What the image costs and how well it agrees with the host build: instructions of both lanes, share
// of the processor, the thermal limit held, and the same scene on both. Figures are printed; bounds are asserted.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "boards/host/chip/play.hpp"
#include "boards/host/run_scene.hpp"
#include "tests/chip/image.hpp"

namespace image_tests {
namespace {

using namespace host_sim::chip;
constexpr int adc_exception = 16 + 18;
constexpr double half_period_cycles = 4200;  // 168 MHz / 20 kHz / 2

const std::string scenes = std::string(HOTCORE_SOURCE_DIR) + "/host-sim/scenes";
const std::string motors = std::string(HOTCORE_SOURCE_DIR) + "/boards/motors";

TEST(Figures, TheFastLaneTakesLessThanHalfOfEachHalfPeriodAtTwoCyclesPerInstruction) {
  NEEDS_IMAGE(image);
  for (const unsigned cycles : {1u, 2u}) {
    Options o;
    o.locked = false;
    o.cycles_per_instruction = cycles;
    auto pcb = board(o);
    ASSERT_TRUE(pcb->arm());
    pcb->chip.core().clear_counts();
    const double start_s = to_s(pcb->chip.now());
    hold(*pcb, 6.0f, -6.0f, 0.15);
    const double seconds = to_s(pcb->chip.now()) - start_s;
    const LaneCount& fast = pcb->chip.core().lane(adc_exception);
    const LaneCount& slow = pcb->chip.core().lane(0);
    const double share = static_cast<double>(cycles * fast.worst) / half_period_cycles;
    const double busy = 1 - to_s(pcb->chip.core().slept()) / seconds;
    std::printf(
        "%u cycle(s) an instruction: fast lane mean %.0f, worst %llu instructions = %.0f %% of a half period; main "
        "loop with "
        "the slow lane worst %llu; processor busy %.0f %%\n",
        cycles, static_cast<double>(fast.total) / static_cast<double>(fast.calls),
        static_cast<unsigned long long>(fast.worst), 100 * share, static_cast<unsigned long long>(slow.worst),
        100 * busy);
    EXPECT_LE(share, 0.5);
    EXPECT_LT(busy, 0.75);
    EXPECT_LE(pcb->door().lost_samples[0] + pcb->door().lost_samples[1], 1u);
    EXPECT_EQ(pcb->chip.resets(), 0);
    EXPECT_EQ(pcb->chip.troubles().count(), 0u) << pcb->chip.report_text();
  }
}

TEST(Figures, ReachesTheThermalLimitAndHoldsIt) {
  NEEDS_IMAGE(image);
  boards::host::Scene scene = boards::host::read_scene("jump", scenes, {"seconds=2.0"});
  const boards::ChipPlay play = boards::play_on_chip(scene, image, motors);
  EXPECT_EQ(play.mistake_count, 0u) << play.mistakes;
  const boards::host::Trace& trace = play.result.traces.at(0);
  EXPECT_GT(trace.hottest_true_degC, play.result.winding_max_degC - 8) << "the limit is reached";
  EXPECT_LE(trace.hottest_true_degC, play.result.winding_max_degC + 3) << "and held";
  double least_A = 1e9;
  for (const auto& row : trace.rows) least_A = std::min(least_A, row.allowance_A);
  EXPECT_LT(least_A, 15.0) << "because the governor took current back";
  std::printf("jump on the chip: hottest winding %.1f degC of %.0f, least allowance %.1f A, %.2f of real time\n",
              trace.hottest_true_degC, play.result.winding_max_degC, least_A, play.result.simulated_s / play.wall_s);
}

// Tolerances and why. Same plant, sheet and demands; other noise (the image has been on for longer), current scale 3 %
// coarser, a sampling window of 3.5 instead of 2 us, setpoints up to 2 ms later, and a slow lane whose 10 ms begin
// elsewhere.
//   current that nothing limits, mean of 20 ms: 0.2 A (the host's logged current carries the ripple's
//   heat, up to 0.14 A of 17 A; this one is the motor's own; without it they differ by 0.006 A)
//   duties, as modulation depth (mean of 20 ms): 0.02: 0.2 A in 0.7 ohm hot are 0.3 % of the bus, the sampling instant
//   of a ramping speed (1 ms of 12000 rad/s2) 0.1 %, and 20 rad/s of speed where the pushes differ another 0.3 %
//   while the governor acts: 0.6 A (it moves 0.4 A in the 10 ms by which the slow lanes may differ)
//   estimated core: 4 K (it rises 0.3 K a millisecond, and is 10 ms old at worst); true core: 3 K; impulse: 1 %
TEST(Figures, AgreesWithTheHostBuildOnTheSameScene) {
  NEEDS_IMAGE(image);
  boards::host::Scene scene = boards::host::read_scene("jump", scenes, {"seconds=1.2"});
  scene.limiters = {boards::host::Limiter::governor};
  const boards::ChipPlay chip = boards::play_on_chip(scene, image, motors);
  const boards::host::Result host = boards::host::run_scene(scene, {.motor_folder = motors});
  const auto &a = chip.result.traces.at(0), &b = host.traces.at(0);
  ASSERT_EQ(a.rows.size(), b.rows.size());
  double worst_A = 0, worst_depth = 0, deepest = 0, worst_limited_A = 0, worst_core_K = 0, worst_true_K = 0,
         worst_speed = 0;
  constexpr std::size_t window = 20;
  for (std::size_t i = 0; i + window <= a.rows.size(); i += window) {
    bool steady = true;
    double chip_A = 0, host_A = 0, chip_depth = 0, host_depth = 0;
    for (std::size_t k = i; k < i + window; ++k) {
      steady = steady && a.rows[k].demand_A == a.rows[i].demand_A && b.rows[k].demand_A == a.rows[i].demand_A &&
               (k < 2 || a.rows[k - 2].demand_A == a.rows[i].demand_A);
      chip_A += a.rows[k].current_A / window;
      host_A += b.rows[k].current_A / window;
      chip_depth += a.rows[k].depth_ratio / window;
      host_depth += b.rows[k].depth_ratio / window;
    }
    const auto &x = a.rows[i + window - 1], &y = b.rows[i + window - 1];
    worst_core_K = std::max(worst_core_K, std::abs(x.estimated_core_degC - y.estimated_core_degC));
    worst_true_K = std::max(worst_true_K, std::abs(x.true_core_degC - y.true_core_degC));
    worst_speed = std::max(worst_speed, std::abs(x.speed_rad_per_s - y.speed_rad_per_s));
    const bool limited = y.allowance_A < 19.9 || x.allowance_A < 19.9 || b.rows[i].allowance_A < 19.9;
    double& worst = limited ? worst_limited_A : worst_A;
    if (steady && host_A > 1)
      worst_depth = std::max(worst_depth, std::abs(chip_depth - host_depth)), deepest = std::max(deepest, host_depth);
    if (steady && host_A > 1) worst = std::max(worst, std::abs(chip_A - host_A));
  }
  std::printf(
      "chip against host: modulation depth %.4f of %.2f, current %.3f A (%.3f A while limited), estimated core %.2f K, "
      "true core %.2f K, speed %.1f "
      "rad/s of 2900; impulse %.3f and %.3f A s\n",
      worst_depth, deepest, worst_A, worst_limited_A, worst_core_K, worst_true_K, worst_speed, a.impulse_As,
      b.impulse_As);
  EXPECT_LT(worst_A, 0.2);
  EXPECT_LT(worst_depth, 0.02);
  EXPECT_LT(worst_limited_A, 0.6);
  EXPECT_LT(worst_core_K, 4.0);
  EXPECT_LT(worst_true_K, 3.0);
  EXPECT_LT(std::abs(a.impulse_As - b.impulse_As), 0.01 * b.impulse_As);
}

}  // namespace
}  // namespace image_tests

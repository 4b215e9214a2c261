// SPDX-License-Identifier: MIT
// The very image that would be flashed, executed: boots, arms, drives both motors of host-sim, and opens its gates
// whenever it must. Every test also asks that the model found no mistake of the firmware.
#include "tests/chip/image.hpp"

#include <array>
#include <cmath>
#include <cstdio>

#include "boards/h8-15d/heat_keeper.hpp"

namespace image_tests {
namespace {

using boards::Pcb;
using namespace host_sim::chip;

#define NO_TROUBLE(pcb) EXPECT_EQ((pcb).chip.troubles().count(), 0u) << (pcb).chip.report_text()

std::string output_of(const std::string& command) {
  std::string text;
  if (FILE* pipe = popen(command.c_str(), "r")) {
    std::array<char, 256> part{};
    while (fgets(part.data(), static_cast<int>(part.size()), pipe)) text += part.data();
    pclose(pipe);
  }
  return text;
}

TEST(Nvic, OrderOfNestedAndChainedHandlersIsThatOfQemu) {
  NEEDS_IMAGE(order_image);
  if (std::system("command -v qemu-system-arm >/dev/null") != 0) GTEST_SKIP() << "skipped: no qemu-system-arm";
  const std::string qemu = output_of(
      "timeout 20 qemu-system-arm -M mps2-an386 -nographic -monitor none -serial none "
      "-semihosting -kernel " +
      order_image + " 2>&1");
  Chip chip;
  chip.load(order_image);
  chip.power_on();
  chip.core().trace(true);
  chip.run_for(0.01);
  ASSERT_TRUE(chip.core().exited());
  EXPECT_EQ(chip.core().semihost_text(), qemu);
  EXPECT_GT(qemu.size(), 150u);
  int chained = 0, depth = 0;
  for (const ExceptionEvent& e : chip.core().events()) {
    chained += e.kind == ExceptionEvent::tail_chained;
    depth = std::max(depth, e.depth);
  }
  EXPECT_GE(chained, 5);
  EXPECT_GE(depth, 2);
}

TEST(Image, BootsFromColdWithoutAMistakeAndKnowsItself) {
  NEEDS_IMAGE(image);
  for (std::uint64_t seed : {1u, 2u, 3u}) {  // RAM holds anything
    Options o;
    o.seed = seed;
    auto pcb = board(o);
    pcb->run_for(0.05);
    NO_TROUBLE(*pcb);
    const auto door = pcb->door();
    EXPECT_EQ(door.magic, h8_15d::Door::open);
    EXPECT_NEAR(door.vdda_V, 3.3, 0.01);
    EXPECT_EQ(door.unique_id[0], pcb->chip.core().word(0x1FFF7A10));
    EXPECT_TRUE(pcb->gates_open(0) && pcb->gates_open(1));
  }
}

TEST(Image, LearnsItsOffsetsArmsAndHoldsCurrentOnBothAxes) {
  NEEDS_IMAGE(image);
  auto pcb = board();
  ASSERT_TRUE(pcb->arm()) << pcb->door().answer[0] << " " << pcb->chip.report_text();
  EXPECT_TRUE(pcb->gates_open(0)) << "armed, but nobody asked for current yet";
  hold(*pcb, 5.0f, -3.0f, 0.05);
  EXPECT_NEAR(mean_iq_A(*pcb, 0, 5.0f, -3.0f), 5.0, 0.1);  // offsets of +-0.2 A are gone; gain is exact by design
  EXPECT_NEAR(mean_iq_A(*pcb, 1, 5.0f, -3.0f), -3.0, 0.1);
  EXPECT_EQ(pcb->door().lost_samples[0] + pcb->door().lost_samples[1], 1u);  // the first, before there was one
  pcb->run_for(0.4);                                                         // no setpoint: fades and opens
  EXPECT_TRUE(pcb->gates_open(0) && pcb->gates_open(1));
  NO_TROUBLE(*pcb);
}

TEST(Image, TurnsBothRotorsAndFollowsTheIndex) {
  NEEDS_IMAGE(image);
  Options o;
  o.locked = false;
  auto pcb = board(o);
  ASSERT_TRUE(pcb->arm());
  hold(*pcb, 2.0f, -2.0f, 0.1);
  EXPECT_GT(pcb->bench.truth(0).speed_rad_per_s, 200);
  EXPECT_LT(pcb->bench.truth(1).speed_rad_per_s, -200);
  EXPECT_EQ(pcb->door().axis[0].mode, firmware::Mode::running);
  EXPECT_EQ(pcb->door().axis[1].mode, firmware::Mode::running);
  NO_TROUBLE(*pcb);
}

TEST(Image, EachMotorFeelsItsDutiesFromTopToTopOfItsOwnTimer) {
  NEEDS_IMAGE(image);
  Options o;
  o.locked = false;
  auto pcb = board(o);
  ASSERT_TRUE(pcb->arm());
  hold(*pcb, 3.0f, 3.0f, 0.05);
  double angle_rad[2], moved_s[2] = {};
  for (int i : {0, 1}) angle_rad[i] = pcb->bench.truth(i).angle_rad;
  int steps[2] = {};
  const double end_s = to_s(pcb->chip.now()) + 1e-3;
  while (to_s(pcb->chip.now()) < end_s) {
    pcb->run_for(0.5e-6);
    for (int i : {0, 1}) {
      const double now_rad = pcb->bench.truth(i).angle_rad;
      if (now_rad == angle_rad[i]) continue;
      angle_rad[i] = now_rad;
      ++steps[i];
      moved_s[i] = to_s(pcb->chip.now());
      EXPECT_LE(moved_s[i] - to_s(pcb->chip.timer(i).last_overflow()), 1e-6) << "axis " << i;
    }
  }
  EXPECT_EQ(steps[0], 20);
  EXPECT_EQ(steps[1], 20);
  EXPECT_NEAR(std::abs(moved_s[0] - moved_s[1]), 25e-6, 1e-6);
  NO_TROUBLE(*pcb);
}

/// The timers' compare registers take a duty over a period after it was written: a bridge that opened at once would
/// meet a turning motor with the duty of its last run.
TEST(Image, AStartOnATurningMotorMeetsNoOldDuty) {
  NEEDS_IMAGE(image);
  Options o;
  o.motor = "ec-16-40w";
  o.locked = false;
  auto pcb = board(o);
  pcb->bench.load(0).mode = pcb->bench.load(1).mode = host_sim::Load::Mode::imposed_speed;
  ASSERT_TRUE(pcb->arm());
  hold(*pcb, 0.0f, 0.0f, 0.05);
  pcb->run_for(0.4);  // faded and open again, the last duty still in the registers
  for (int i : {0, 1}) pcb->bench.load(i).speed_rad_per_s = 3000;
  pcb->run_for(0.05);
  ASSERT_TRUE(pcb->gates_open(0) && pcb->gates_open(1));
  pcb->set_current(0, 0.0f, 0.0f);
  pcb->set_current(1, 0.0f, 0.0f);
  double most_A = 0;
  for (int k = 0; k < 400; ++k) {  // 10 ms
    pcb->run_for(25e-6);
    for (int i : {0, 1}) {
      const auto truth = pcb->bench.truth(i);
      most_A = std::max(most_A, std::hypot(truth.current_d_A, truth.current_q_A));
    }
  }
  EXPECT_FALSE(pcb->gates_open(0) || pcb->gates_open(1));
  EXPECT_LT(most_A, 1.5);  // 13 V on 30 uH for a period are 21 A
  std::printf("most current at the start %.2f A\n", most_A);
  NO_TROUBLE(*pcb);
}

TEST(Image, StartsOnTheHallSensorsWhereTheRotorIsNotOnItsIndex) {
  NEEDS_IMAGE(image);
  for (const double electrical_turns : {0.05, 0.30, 0.47, 0.70, 0.95}) {
    auto pcb = std::make_unique<Pcb>(design_of({}), 1);
    pcb->flash_image(image);
    firmware::AxisSet setup[2];
    setup_of({}, setup);
    pcb->flash_parameters(setup);
    for (int i = 0; i < 2; ++i) {
      pcb->bench.load(i).mode = host_sim::Load::Mode::locked;
      pcb->bench.motor(i).place(
          electrical_turns * 2 * host_sim::pi / static_cast<double>(setup[i].drive.pole_pairs_count), 0);
    }
    pcb->power_on();
    ASSERT_TRUE(pcb->arm()) << electrical_turns;
    hold(*pcb, 4.0f, 4.0f, 0.05);
    for (int i = 0; i < 2; ++i) {  // a sector is 60 degrees wide: at most 30 off, so most of the current is torque
      const auto truth = pcb->bench.truth(i);
      EXPECT_NEAR(std::hypot(truth.current_d_A, truth.current_q_A), 4.0, 0.4) << electrical_turns;
      EXPECT_GT(truth.current_q_A, 4.0 * 0.866 - 0.4) << electrical_turns;
    }
    NO_TROUBLE(*pcb);
  }
}

/// Both rotors locked at this part of an electrical turn, away from the index; powered on with these parameters.
std::unique_ptr<Pcb> standing_between_two_switches(double electrical_turns, const firmware::AxisSet (&setup)[2]) {
  auto pcb = std::make_unique<Pcb>(design_of({}), 1);
  pcb->flash_image(image);
  pcb->flash_parameters(setup);
  for (int i = 0; i < 2; ++i) {
    pcb->bench.load(i).mode = host_sim::Load::Mode::locked;
    pcb->bench.motor(i).place(electrical_turns * 2 * host_sim::pi / pcb->bench.motor(i).design().pole_pairs, 0);
  }
  pcb->power_on();
  return pcb;
}

/// Most of the current is torque, in the direction asked for: a Hall sector is 60 degrees wide.
void expect_torque(Pcb& pcb) {
  ASSERT_TRUE(pcb.arm());
  hold(pcb, 4.0f, 4.0f, 0.05);
  for (int i = 0; i < 2; ++i) EXPECT_GT(pcb.bench.truth(i).current_q_A, 4.0 * 0.866 - 0.4);
  NO_TROUBLE(pcb);
}

// Hall switches are mounted to the magnet, the index anywhere: its offset must not turn the field of a start on them.
TEST(Image, AStartOnTheHallSensorsDoesNotDependOnWhereTheIndexIs) {
  NEEDS_IMAGE(image);
  for (const float offset_rad : {-3.1f, 1.0f, 3.1f}) {
    firmware::AxisSet setup[2];
    setup_of({}, setup);
    for (auto& s : setup) s.drive.angle_offset_rad = offset_rad;
    for (const double electrical_turns : {0.05, 0.70}) {
      SCOPED_TRACE(testing::Message() << offset_rad << " rad, at " << electrical_turns);
      expect_torque(*standing_between_two_switches(electrical_turns, setup));
    }
  }
}

TEST(Image, ACommitOfPolePairsOrOffsetFindsARotorOnItsHallSensorsAnew) {
  NEEDS_IMAGE(image);
  for (const float first_pole_pairs : {1.0f, 5.0f}) {
    firmware::AxisSet setup[2];
    setup_of({}, setup);
    for (auto& s : setup) s.drive.pole_pairs_count = first_pole_pairs;
    auto pcb = standing_between_two_switches(0.47, setup);
    pcb->run_for(0.3);
    for (const auto axis : {std::uint8_t{0}, std::uint8_t{1}}) {
      ASSERT_EQ(pcb->order(h8_15d::order_stage, {{0x0105, axis}, 2.0f}).status, 0);
      ASSERT_EQ(pcb->order(h8_15d::order_stage, {{0x0106, axis}, 2.5f}).status, 0);
    }
    ASSERT_EQ(pcb->order(h8_15d::order_commit).status, 0);
    SCOPED_TRACE(first_pole_pairs);
    expect_torque(*pcb);
  }
}

// The Hall switches tell one pole pair from the other as little as they tell where in a sector: the first index moves
// the rotor's angle by up to half a turn. That is no movement, and the current must not feel it as one.
TEST(Image, TheFirstIndexAfterAStartOnTheHallSensorsIsNoMovement) {
  NEEDS_IMAGE(image);
  for (const double turns : {0.97, 0.47}) {
    firmware::AxisSet setup[2];
    setup_of({}, setup);
    auto pcb = standing_between_two_switches(2 * turns, setup);
    ASSERT_TRUE(pcb->arm());
    hold(*pcb, 4.0f, 4.0f, 0.02);
    for (int i = 0; i < 2; ++i) {
      pcb->bench.load(i).mode = host_sim::Load::Mode::imposed_speed;
      pcb->bench.load(i).speed_rad_per_s = 100;
    }
    double most_A = 0;
    for (int k = 0; k < 4000; ++k) {  // 100 ms: past the index
      for (int i = 0; i < 2 && k % 400 == 0; ++i) pcb->set_current(i, 0.0f, 4.0f);
      pcb->run_for(25e-6);
      for (int i : {0, 1}) {
        const auto truth = pcb->bench.truth(i);
        most_A = std::max(most_A, std::hypot(truth.current_d_A, truth.current_q_A));
      }
    }
    std::printf("from %.2f turns: most current %.1f A\n", turns, most_A);
    EXPECT_LT(most_A, 8.0) << turns;  // the field moves by up to half a sector
    for (int i : {0, 1}) EXPECT_EQ(pcb->door().axis[i].mode, firmware::Mode::running);
    NO_TROUBLE(*pcb);
  }
}

// A glitch before the first index, or an offset that is another motor's: either would turn the field anywhere.
TEST(Image, AnIndexThatTheHallSensorsContradictIsNotBelieved) {
  NEEDS_IMAGE(image);
  firmware::AxisSet setup[2];
  setup_of({}, setup);
  auto pcb = standing_between_two_switches(0.55, setup);
  ASSERT_TRUE(pcb->arm());
  hold(*pcb, 4.0f, 4.0f, 0.02);
  for (int i : {0, 1}) {
    const h8_15d::Pin index = h8_15d::pins[i].index;
    auto& counter = i == 0 ? pcb->chip.tim3 : pcb->chip.tim4;
    counter.set_index_edges(pcb->bench.raw(i).encoder_counts);  // a glitch here and now, and not where the index is
    pcb->chip.set_pin({index.port, index.number}, true);
    pcb->chip.set_pin({index.port, index.number}, false);
  }
  double worst_A = 4.0;
  for (int k = 0; k < 20; ++k) {
    pcb->run_for(1e-3);
    for (int i : {0, 1}) worst_A = std::min(worst_A, pcb->bench.truth(i).current_q_A);
  }
  EXPECT_GT(worst_A, -0.5) << "torque the wrong way";
  for (int i : {0, 1}) EXPECT_EQ(pcb->door().axis[i].fault.fault, wire::Fault::invalid_sample);
  NO_TROUBLE(*pcb);
}

TEST(Image, ARotorOnAnIndexThatTheHallSensorsContradictIsNotArmed) {
  NEEDS_IMAGE(image);
  firmware::AxisSet setup[2];
  setup_of({}, setup);
  for (auto& s : setup) s.drive.angle_offset_rad = 2.5f;  // the bench's index is where the magnet lies on phase a
  EXPECT_FALSE(standing_between_two_switches(0.0, setup)->arm(0.3));
}

// The first use of a board: empty flash, one axis told after the other.
TEST(Image, ABoardArmsOnceItWasToldItsMotorsAndNotBefore) {
  NEEDS_IMAGE(image);
  Options o;
  o.parameters = false;
  auto pcb = board(o);
  EXPECT_FALSE(pcb->arm(0.3));
  EXPECT_TRUE(pcb->gates_open(0) && pcb->gates_open(1));
  firmware::AxisSet told[2];
  setup_of(o, told);
  for (const auto axis : {std::uint8_t{0}, std::uint8_t{1}}) {
    EXPECT_FALSE(pcb->arm(0.3)) << "axis " << +axis << " and what follows were not told";
    for (int i = 0; i < 2; ++i) {
      pcb->wish(i, h8_15d::wish_disarm);
      pcb->run_for(0.01);
    }
    for (int k = 0; k < firmware::parameter_count; ++k) {
      const wire::Address where{firmware::parameter_info(k)->id, axis};
      ASSERT_EQ(pcb->order(h8_15d::order_stage, {where, firmware::parameter_value(told[axis], k)}).status, 0);
    }
    ASSERT_EQ(pcb->order(h8_15d::order_commit).status, 0);
  }
  ASSERT_EQ(pcb->order(h8_15d::order_save).status, 0);
  EXPECT_TRUE(pcb->arm()) << "without a restart";
  pcb->power_on(2);
  EXPECT_TRUE(pcb->arm()) << "and after one";
  NO_TROUBLE(*pcb);
}

TEST(Image, AGateDriverFaultOpensTheBridgeWithoutASingleInstruction) {
  NEEDS_IMAGE(image);
  for (int axis : {0, 1}) {
    auto pcb = board();
    ASSERT_TRUE(pcb->arm());
    hold(*pcb, 4.0f, 4.0f, 0.02);
    ASSERT_TRUE(pcb->duty(axis).on);
    const auto before = pcb->chip.core().instructions();
    pcb->set_fault_pin(axis, true);
    EXPECT_FALSE(pcb->duty(axis).on);
    EXPECT_EQ(pcb->chip.core().instructions(), before);
    EXPECT_TRUE(pcb->duty(1 - axis).on) << "the other axis is another bridge";
    pcb->set_fault_pin(axis, false);
    hold(*pcb, 4.0f, 4.0f, 0.05);
    EXPECT_FALSE(pcb->duty(axis).on) << "it must not come back by itself";
    EXPECT_EQ(pcb->door().axis[axis].mode, firmware::Mode::tripped);
    EXPECT_EQ(pcb->door().axis[axis].fault.fault, wire::Fault::invalid_sample) << "not because no current comes";
    EXPECT_TRUE(pcb->duty(1 - axis).on);
    NO_TROUBLE(*pcb);
  }
}

TEST(Image, ALostCrystalOpensBothBridgesAndTheImageStaysDisarmed) {
  NEEDS_IMAGE(image);
  auto pcb = board();
  ASSERT_TRUE(pcb->arm());
  hold(*pcb, 4.0f, 4.0f, 0.02);
  const auto before = pcb->chip.core().instructions();
  pcb->chip.stop_hse();
  EXPECT_FALSE(pcb->duty(0).on || pcb->duty(1).on);
  EXPECT_EQ(pcb->chip.core().instructions(), before);
  pcb->run_for(0.2);
  EXPECT_EQ(pcb->chip.last_reset(), ResetCause::software);
  EXPECT_FALSE(pcb->arm(0.1));
  EXPECT_TRUE(pcb->gates_open(0) && pcb->gates_open(1));
}

TEST(Image, TheFastestLsiDoesNotBiteAHealthyImage) {
  NEEDS_IMAGE(image);
  auto pcb = board();
  pcb->chip.iwdg.set_lsi_Hz(47e3);
  ASSERT_TRUE(pcb->arm());
  hold(*pcb, 4.0f, 4.0f, 0.1);
  EXPECT_EQ(pcb->chip.resets(), 0);
}

TEST(Image, ASagOfTheLogicSupplyOpensTheGatesAndSavesTheHeat) {
  NEEDS_IMAGE(image);
  auto pcb = board();
  ASSERT_TRUE(pcb->arm());
  hold(*pcb, 4.0f, 4.0f, 0.05);
  const auto words = pcb->chip.flash.words_programmed();
  pcb->chip.set_supply(2.8);
  pcb->run_for(0.001);
  EXPECT_FALSE(pcb->duty(0).on || pcb->duty(1).on);
  EXPECT_FALSE(pcb->chip.port('B').drives_high(9) || pcb->chip.port('B').drives_high(2)) << "and the drivers are off";
  EXPECT_TRUE(pcb->chip.flash.peek(Flash::cr) >> 31) << "locked again, before the watchdog resets";
  pcb->run_for(0.001);
  EXPECT_EQ(pcb->chip.flash.words_programmed() - words, h8_15d::HeatKeeper::record_words);
  pcb->run_for(0.002);
  EXPECT_EQ(pcb->chip.last_reset(), ResetCause::wwdg)
      << "nobody feeds it any more: a supply that comes back starts anew";
  NO_TROUBLE(*pcb);
}

}  // namespace
}  // namespace image_tests

// SPDX-License-Identifier: MIT
#include "boards/host/scene.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "boards/dual_48v_20a.hpp"
#include "boards/host/optimum.hpp"
#include "boards/host/stage.hpp"
#include "wire/pc/motor_file.hpp"
#include "wire/pc/user_error.hpp"

namespace {

using boards::host::Demand;
using boards::host::read_scene;
using boards::host::Scene;

const std::string folder = HOTCORE_SOURCE_DIR "/host-sim/scenes";

std::string complaint(const std::string& which, const std::vector<std::string>& overrides = {}) {
  try {
    read_scene(which, folder, overrides);
  } catch (const wire::pc::UserError& error) {
    EXPECT_EQ(error.exit_code(), 2);
    return error.what();
  }
  ADD_FAILURE() << which << " was read without a complaint";
  return "";
}

std::string complaint_about(const std::string& text) {
  const std::string path =
      ::testing::TempDir() + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) + ".toml";
  std::ofstream(path) << text;
  return complaint(path);
}

TEST(Scene, EverySceneOfTheIssueIsThere) {
  for (const char* name : {"jump", "get-up", "stall", "hold", "walk-loaded", "water-cooled"}) {
    const Scene scene = read_scene(name, folder, {});
    EXPECT_FALSE(scene.demands.empty()) << name;
    EXPECT_GT(scene.seconds, 0) << name;
  }
}

TEST(Scene, AKeyCanBeSetFromTheCommandLine) {
  const Scene scene = read_scene("stall", folder, {"shaft.angle_rad=0.5", "seed=7", "motor=ec-powermax-30-24v"});
  EXPECT_DOUBLE_EQ(scene.shaft.angle_rad, 0.5);
  EXPECT_EQ(scene.seed, 7u);
  EXPECT_EQ(scene.motor, "ec-powermax-30-24v");
}

TEST(Scene, InAHotterRoomTheBoardIsHotterToo) {
  const wire::Motor motor = wire::pc::read_motor("ec-16-40w", HOTCORE_SOURCE_DIR "/boards/motors").motor;
  const auto board_degC = [&](const std::string& ambient) {
    return boards::host::bench_of(read_scene("stall", folder, {"ambient_degC=" + ambient}), motor).board_ambient_degC;
  };
  EXPECT_EQ(board_degC("25"), 40);
  EXPECT_EQ(board_degC("60"), 75);
}

TEST(Scene, MistakesAreAnsweredWithTheNearestName) {
  EXPECT_NE(complaint("jmp").find("did you mean 'jump'?"), std::string::npos);
  EXPECT_NE(complaint("stall", {"secondz=3"}).find("did you mean 'seconds'?"), std::string::npos);
  EXPECT_NE(complaint("stall", {"shaft.angle=3"}).find("did you mean 'angle_rad'?"), std::string::npos);
  EXPECT_NE(complaint("stall", {"seconds"}).find("key=value"), std::string::npos);
  EXPECT_NE(complaint("stall", {"seconds=soon"}).find("not a number"), std::string::npos);
  EXPECT_NE(complaint("stall", {"seconds=nan"}).find("out of range"), std::string::npos);
  EXPECT_NE(complaint_about("secnds = 3").find("did you mean 'seconds'?"), std::string::npos);
  EXPECT_NE(complaint_about("limiters = ['govenor']").find("not one of governor"), std::string::npos);
  EXPECT_NE(complaint_about("[[demand]]\nfrom_s = 2\nto_s = 1").find("to_s must lie after from_s"), std::string::npos);
  EXPECT_NE(complaint_about("seconds = ").find("line 1"), std::string::npos);
}

TEST(Scene, NothingIsLeftOutBecauseOfHowItIsWritten) {
  EXPECT_NE(complaint_about("[demand]\nfrom_s = 1\nto_s = 2").find("'demand' must be written as [[demand]]"),
            std::string::npos);
  EXPECT_NE(complaint_about("[[shaft]]\nkind = 'free'").find("'shaft' must be written as [shaft]"), std::string::npos);
  EXPECT_NE(complaint_about("limiters = 'governor'").find("must be written as a list"), std::string::npos);
  EXPECT_NE(complaint_about("[shaft]\nkind = 'free'\nlandings_s = 0.6").find("a list"), std::string::npos);
  EXPECT_NE(complaint_about("[shaft]\nkind = 'free'\nlandings_s = ['a']").find("must be numbers"), std::string::npos);
  EXPECT_NE(complaint_about("seed = 1.5").find("seed = 1.5 must be a whole number"), std::string::npos);
  EXPECT_NE(complaint_about("[[demand]]\naxis = 0.5\nfrom_s = 1\nto_s = 2").find("axis = 0.5 must be a whole"),
            std::string::npos);
}

TEST(Scene, AMotorThatNoBoardTakesIsRefusedByItsParameter) {
  wire::Motor motor = wire::pc::read_motor("ec-16-40w", HOTCORE_SOURCE_DIR "/boards/motors").motor;
  const auto said = [&] {
    const firmware::AxisSet set{firmware::parameters_from(motor, boards::dual_48V_20A, {48.0f, 0.0f}),
                                firmware::heat_parameters_from(motor, thermal::sheet_trust)};
    try {
      boards::host::need_drivable("my.toml", set, boards::dual_48V_20A);
    } catch (const wire::pc::UserError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(said(), "");
  motor.phase_resistance_ohm = 100;
  EXPECT_EQ(said().find("my.toml: a board does not take its phase_resistance = 100 ohm (0.001 to 50: "), 0u) << said();
  motor.phase_resistance_ohm = 0.5;
  motor.C1_J_per_K = 0.1;
  EXPECT_NE(said().find("C1 = 0.1 J/K (0.01 to 100000: heat capacity of the whole winding; R1 C1 is at least 0.5 s)"),
            std::string::npos)
      << said();
}

TEST(Optimum, ReachesTheLimitThenHoldsItsCurrent) {
  Scene scene;
  scene.seconds = 1;
  scene.demands = {Demand{0, 0, 1, 20, 0, 0}};
  // No copper coefficient and a housing that cannot warm: T1 = Ta + P R1 (1 - exp(-t / tau)) has a closed form.
  wire::Motor motor{};
  motor.phase_resistance_ohm = 0.5;
  motor.R1_K_per_W = 1;
  motor.R2_K_per_W = 1e9;
  motor.C1_J_per_K = 1;
  motor.C2_J_per_K = 1e12;
  motor.winding_max_degC = 125;
  const double hold_A = std::sqrt(100 / 0.75), reach_s = -std::log(1 - 100 / (0.75 * 400));
  EXPECT_NEAR(boards::host::optimal_impulse_As(scene, motor, 100), 20 * reach_s + hold_A * (1 - reach_s), 2e-3);
  EXPECT_NEAR(boards::host::optimal_impulse_As(scene, motor, 5), 5, 1e-3);
}

}  // namespace

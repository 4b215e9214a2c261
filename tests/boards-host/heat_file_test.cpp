// SPDX-License-Identifier: MIT
#include "boards/host/heat_file.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>

#include "boards/host/run_scene.hpp"
#include "host-sim/plant/heat.hpp"
#include "thermal/motor_set.hpp"
#include "thermal/network.hpp"
#include "wire/pc/motor_file.hpp"
#include "wire/pc/user_error.hpp"

namespace {

wire::Motor known() {
  const wire::Motor sheet = wire::pc::read_motor("ec-16-40w", HOTCORE_SOURCE_DIR "/boards/motors").motor;
  return host_sim::true_sheet(sheet, host_sim::heat_from_sheet(sheet));
}

/// The two-resistor motor as identify writes it.
std::string model_text() {
  const wire::Motor m = known();
  return fmt::format(
      "format = 1\n[[node]]\ncapacity_J_per_K = {}\nmax_degC = 155\n[[node]]\ncapacity_J_per_K = {}\n"
      "[[link]]\nfrom = 0\nto = 1\nlaw = \"constant\"\nconductance_W_per_K = {}\n"
      "[[link]]\nfrom = 1\nto = \"ambient\"\nlaw = \"speed\"\nconductance_W_per_K = {}\nk = 0\n"
      "[[source]]\nnode = 0\ndrive = \"current_A2\"\ngain = {}\ncoefficient_per_K = 0.00393\n[housing_sensor]\nnode = "
      "1\n",
      m.C1_J_per_K, m.C2_J_per_K, 1 / m.R1_K_per_W, 1 / m.R2_K_per_W, 1.5 * m.phase_resistance_ohm);
}

std::string written(const std::string& text) {
  const std::string path =
      ::testing::TempDir() + ::testing::UnitTest::GetInstance()->current_test_info()->name() + ".toml";
  std::ofstream(path) << text;
  return path;
}

std::string complaint(std::string text, const std::string& from, const std::string& to) {
  text.replace(text.find(from), from.size(), to);
  try {
    boards::host::read_heat_model(written(text));
  } catch (const wire::pc::UserError& error) {
    EXPECT_EQ(error.exit_code(), 2);
    return error.what();
  }
  ADD_FAILURE() << "'" << to << "' was read without a complaint";
  return "";
}

TEST(HeatFile, TheFirmwareRunsTheModelAsItRunsTheSheet) {
  const std::string scenes = HOTCORE_SOURCE_DIR "/host-sim/scenes";
  const boards::host::RunOptions options{.motor_folder = HOTCORE_SOURCE_DIR "/boards/motors"};
  const auto by_sheet = boards::host::run_scene(boards::host::read_scene("get-up", scenes, {"seconds=2"}), options);
  const auto by_model = boards::host::run_scene(
      boards::host::read_scene("get-up", scenes, {"seconds=2", "model=" + written(model_text())}), options);
  EXPECT_NEAR(by_model.traces[0].impulse_As, by_sheet.traces[0].impulse_As, 0.002 * by_sheet.traces[0].impulse_As);
  EXPECT_NEAR(by_model.traces[0].hottest_true_degC, by_sheet.traces[0].hottest_true_degC, 0.3);
}

TEST(HeatFile, AnUncertainModelIsRunMoreCautiously) {
  const std::string scenes = HOTCORE_SOURCE_DIR "/host-sim/scenes";
  const boards::host::RunOptions options{.motor_folder = HOTCORE_SOURCE_DIR "/boards/motors"};
  const auto hottest_degC = [&](const std::string& trust) {
    const std::string model = written(model_text() + trust);
    const auto scene = boards::host::read_scene("get-up", scenes, {"seconds=2", "trust=identified", "model=" + model});
    return boards::host::run_scene(scene, options).traces[0].hottest_true_degC;
  };
  const double typical = hottest_degC(""),
               unsure = hottest_degC("[trust]\npower = 0.1\ninner_resistance = 0.1\ncooling = 0.1\n");
  EXPECT_LT(unsure, typical - 10) << "two standard deviations of a tenth of the rise, less what is typical";
  EXPECT_NE(complaint(model_text() + "[trust]\npower = 2\n", "power = 2", "power = 3").find("trust"),
            std::string::npos);
}

TEST(HeatFile, AModelOfAnotherMotorIsRefused) {
  const std::string scenes = HOTCORE_SOURCE_DIR "/host-sim/scenes",
                    model = written("motor = \"other\"\n" + model_text());
  EXPECT_THROW(boards::host::run_scene(boards::host::read_scene("get-up", scenes, {"seconds=1", "model=" + model}),
                                       {.motor_folder = HOTCORE_SOURCE_DIR "/boards/motors"}),
               wire::pc::UserError);
}

TEST(HeatFile, SplitPhasesEquallyHeatedAreTheLumpedWinding) {
  const thermal::HeatSet<double> lumped = boards::host::read_heat_model(written(model_text())).set;
  const thermal::HeatSet<double> split = thermal::split_phases(lumped, 0);
  ASSERT_EQ(split.node_count, lumped.node_count + 2);
  const thermal::HeatNetwork<double> one(lumped), three(split);
  const auto one_step = one.transition(0.01), three_step = three.transition(0.01);
  thermal::HeatNetwork<double>::Vector a = thermal::HeatNetwork<double>::Vector::Constant(2, 25.0), b = a;
  b.setConstant(4, 25.0);
  thermal::HeatInput<> input;
  input[thermal::Boundary::ambient] = 25;
  input[thermal::Drive::current_A2] = 100;
  for (const auto drive : {thermal::Drive::phase_a_A2, thermal::Drive::phase_b_A2, thermal::Drive::phase_c_A2})
    input[drive] = 50;
  for (int i = 0; i < 300; ++i) a = one.step(one_step, a, input), b = three.step(three_step, b, input);
  EXPECT_GT(a[0], 80);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(b[k], a[0], 1e-9);
  EXPECT_NEAR(b[3], a[1], 1e-9);
}

TEST(HeatFile, MistakesAreAnsweredWithThePlace) {
  EXPECT_NE(complaint(model_text(), "capacity_J_per_K", "capacity_J_K").find("did you mean 'capacity_J_per_K'"),
            std::string::npos);
  EXPECT_NE(complaint(model_text(), "\"ambient\"", "\"ambent\"").find("did you mean 'ambient'"), std::string::npos);
  EXPECT_NE(complaint(model_text(), "from = 0", "from = 7").find("cannot be used"), std::string::npos);
  EXPECT_NE(complaint(model_text(), "capacity_J_per_K = ", "capacity_J_per_K = -").find("cannot be used"),
            std::string::npos);
  EXPECT_NE(complaint(model_text(), "max_degC = 155", "max_degC = 1550").find("is no limit of a winding"),
            std::string::npos);
  EXPECT_NE(complaint(model_text(), "max_degC = 155", "").find("nothing would be protected"), std::string::npos);
  EXPECT_NE(complaint(model_text(), "gain = ", "gain = -").find("cannot be used"), std::string::npos);
  EXPECT_NE(complaint(model_text(), "format = 1", "format = 2").find("format must be 1"), std::string::npos);
}

}  // namespace

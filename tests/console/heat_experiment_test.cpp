// SPDX-License-Identifier: MIT
#include "console/heat_experiment.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "boards/host/heat_file.hpp"
#include "console/commands.hpp"
#include "console/dictionary.hpp"
#include "console/link/sim.hpp"
#include "firmware/heat_parameters.hpp"
#include "thermal/losses.hpp"
#include "thermal/motor_set.hpp"
#include "thermal/network.hpp"
#include "wire/pc/motor_file.hpp"
#include "wire/pc/user_error.hpp"

namespace {

console::Values believed() {
  return {{"phase_resistance_ohm", 0.5f}, {"inductance_d_H", 3e-5f},
          {"flux_linkage_Wb", 4.33e-3f},  {"pole_pairs", 1.0f},
          {"R1_K_per_W", 1.08f},          {"R2_K_per_W", 16.3f},
          {"C1_J_per_K", 1.13f},          {"C2_J_per_K", 18.04f},
          {"winding_max_degC", 155.0f},   {"ambient_degC", 40.0f},
          {"housing_noise_K", 0.5f},      {"housing_offset_K", 0.0f},
          {"housing_lag_s", 0.0f},        {"copper_coefficient_per_K", 0.00393f},
          {"current_limit_A", 20.0f}};
}

std::string file(const std::string& name, const std::string& text) {
  const std::string path = testing::TempDir() + name;
  std::ofstream(path) << text;
  return path;
}

TEST(HeatExperiment, TheContinuousCurrentHoldsTheLimitInTheEnd) {
  const double amplitude_A = console::continuous_A(believed());
  const double heat_W = 1.5 * 0.5 * (1 + 0.00393 * 130) * amplitude_A * amplitude_A;
  EXPECT_NEAR(heat_W * (1.08 + 16.3), 115.0, 1e-3);
}

TEST(HeatExperiment, NoCurrentOfTheCourseIsBeyondTheAxisLimit) {
  auto values = believed();
  EXPECT_EQ(console::course_A(values), console::continuous_A(values));
  values["current_limit_A"] = 5.0f;
  float most_A = 0;
  for (const auto& piece : console::cold_course(values)) most_A = std::max(most_A, piece.level);
  for (const auto& piece : console::designed_course(console::course_A(values), 17))
    most_A = std::max(most_A, piece.level);
  EXPECT_FLOAT_EQ(most_A, 5.0f);
}

TEST(HeatExperiment, AnUnsetParameterIsNamed) {
  auto values = believed();
  values["R2_K_per_W"] = std::nanf("");
  try {
    (void)console::continuous_A(values);
    FAIL();
  } catch (const wire::pc::UserError& error) {
    EXPECT_NE(std::string(error.what()).find("R2_K_per_W is unset"), std::string::npos) << error.what();
  }
}

TEST(HeatExperiment, TheCourseHasItsLengthAndNoBurstBeyondItsShare) {
  double length_s = 0, most_A = 0;
  for (const auto& piece : console::designed_course(4.0, 17)) {
    length_s += double{piece.seconds};
    most_A = std::max(most_A, double{piece.level});
  }
  EXPECT_NEAR(length_s, 17 * 60, 1e-3);
  EXPECT_DOUBLE_EQ(most_A, 10.0);
}

/// Its rotor coasts into the rest by which the log begins, and 1.8 and 2.5 times its continuous current are more than
/// the board gives.
TEST(HeatExperiment, OfAHeavyRotorOnABoardTooSmallForItTheWindingIsReadAsWell) {
  console::Console console([](const console::Options&) {
    return console::link::simulated_board(
        {.real_time = false, .motor_folder = HOTCORE_SOURCE_DIR "/boards/motors", .motor = "ec-powermax-30-24v"});
  });
  const std::string folder = testing::TempDir() + "heavy";
  testing::internal::CaptureStdout();
  (void)console::run_line(console, [&](CLI::App& app) {
    app.parse("--sim identify --turning --minutes 1 --ambient 25 --force --out " + folder);
  });
  testing::internal::GetCapturedStdout();
  const auto said = [&](const std::string& name) {
    std::ifstream in(folder + "/" + name);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  EXPECT_NE(said("answer.json").find("winding_ohm is read as core_degC"), std::string::npos) << said("answer.json");
  EXPECT_EQ(said("log.csv").find("speed_rad_per_s"), std::string::npos) << "at one speed nothing that goes by it shows";
}

TEST(HeatExperiment, TheSheetSaysWhatTheBoardBelieves) {
  const auto motor = wire::pc::read_motor(file("sheet.toml", console::sheet_of(believed(), "x")), "").motor;
  EXPECT_NEAR(motor.phase_resistance_ohm, 0.5, 1e-7);
  EXPECT_NEAR(motor.flux_linkage_Wb, 4.33e-3, 1e-9);
  EXPECT_NEAR(motor.C1_J_per_K, 1.13, 1e-6);
  EXPECT_NEAR(motor.C2_J_per_K, 18.04, 1e-5);
  EXPECT_NEAR(motor.R2_K_per_W, 16.3, 1e-5);
}

TEST(HeatExperiment, ASheetOfABoardThatWasToldASheetSaysTheSame) {
  for (const std::string& name : wire::pc::motor_names(HOTCORE_SOURCE_DIR "/boards/motors")) {
    const auto told = wire::pc::read_motor(name, HOTCORE_SOURCE_DIR "/boards/motors").motor;
    console::Values board = console::parameters_of_sheet(told, wire::bus_window(48, 12, 58), {{"ambient_degC", 40.0f}});
    EXPECT_FALSE(board.contains("ambient_degC")) << "that is the room's";
    board["ambient_degC"] = 40.0f;
    const auto again = wire::pc::read_motor(file("again.toml", console::sheet_of(board, name)), "").motor;
    const auto same = [&](double wire::Motor::*value) { EXPECT_NEAR(again.*value, told.*value, 1e-6 * told.*value); };
    EXPECT_EQ(again.pole_pairs, told.pole_pairs);
    for (const auto value : {&wire::Motor::phase_resistance_ohm, &wire::Motor::inductance_d_H,
                             &wire::Motor::flux_linkage_Wb, &wire::Motor::R1_K_per_W, &wire::Motor::R2_K_per_W,
                             &wire::Motor::C1_J_per_K, &wire::Motor::C2_J_per_K, &wire::Motor::winding_max_degC})
      same(value);
  }
}

const std::string two_resistors =
    "format = 1\n[[node]]\ncapacity_J_per_K = 0.5\n[[node]]\ncapacity_J_per_K = 20\n"
    "[[link]]\nfrom = 0\nto = 1\nlaw = \"constant\"\nconductance_W_per_K = 0.5\n"
    "[[link]]\nfrom = 1\nto = \"ambient\"\nlaw = \"constant\"\nconductance_W_per_K = 0.1\n"
    "[[source]]\nnode = 0\ndrive = \"current_A2\"\ngain = 0.75\ncoefficient_per_K = 0.004\n";

TEST(HeatExperiment, AModelOfTwoResistorsBecomesParameters) {
  std::string why;
  const auto found = console::parameters_of_model(
      file("model.toml", two_resistors + "[housing_sensor]\nnode = 1\nlag_s = 2\noffset_K = -1.5\ngain_error = 0\n"),
      believed(), why);
  const console::Values expected = {{"C1_J_per_K", 0.5f},
                                    {"C2_J_per_K", 20.0f},
                                    {"R1_K_per_W", 2.0f},
                                    {"R2_K_per_W", 10.0f},
                                    {"housing_lag_s", 2.0f},
                                    {"housing_offset_K", -1.5f},
                                    {"copper_coefficient_per_K", 0.004f}};
  EXPECT_EQ(found, expected) << why;
}

TEST(HeatExperiment, AModelWithoutAMassLeavesNothingOfOneToSave) {
  console::Values before = believed();
  before["third_mass_J_per_K"] = 80.0f, before["third_mass_path_K_per_W"] = 2.0f;
  std::string why;
  const auto found = console::parameters_of_model(file("model.toml", two_resistors), before, why);
  EXPECT_EQ(found.at("third_mass_J_per_K"), 0.0f);
  EXPECT_EQ(found.at("third_mass_path_K_per_W"), 1.0f);
}

TEST(HeatExperiment, AModelWithMoreInItIsNotForcedIntoParameters) {
  const auto refused = [](const std::string& text, const std::string& words) {
    std::string why;
    EXPECT_TRUE(console::parameters_of_model(file("model.toml", text), believed(), why).empty());
    EXPECT_NE(why.find(words), std::string::npos) << why;
  };
  refused(two_resistors + "[[node]]\ncapacity_J_per_K = 1\nmax_degC = 155\n", "hot spot");
  refused(two_resistors + "[[source]]\nnode = 1\ndrive = \"enabled\"\ngain = 0.1\n", "enabled");
  refused(two_resistors + "[[link]]\nfrom = 1\nto = \"frame\"\nlaw = \"constant\"\nconductance_W_per_K = 0.1\n",
          "frame");
  refused(two_resistors + "[[link]]\nfrom = 0\nto = \"ambient\"\nlaw = \"radiation\"\nconductance_W_per_K = 0.1\n",
          "radiation");
  refused(two_resistors + "[housing_sensor]\nnode = 0\n", "towards the winding");
  refused(two_resistors.substr(0, two_resistors.find("[[link]]\nfrom = 1")) +
              two_resistors.substr(two_resistors.find("[[source]]")),
          "no R2_K_per_W");
  // Firmware of before.
  refused(two_resistors + "[housing_sensor]\ngain_error = 0.1\n",
          "sensor_gain_share, which its firmware does not know");
}

/// All that this firmware can be told.
console::Values told_to_this_firmware(float value) {
  console::Values values = believed();
  for (const wire::ParameterInfo& p : firmware::heat_dictionary) {
    console::Description d;
    d.name = p.name;
    d.unit = wire::text_of(p.unit);
    values.try_emplace(console::full_name(d), value);
  }
  return values;
}

/// What identify wrote is the same heat network on a board, told in parameters, as in host-sim, read from the file.
TEST(HeatExperiment, ABoardRunsTheModelThatHostSimRuns) {
  const std::string head =
      "format = 1\n[[node]]\ncapacity_J_per_K = 0.9\nmax_degC = 155\n[[node]]\ncapacity_J_per_K = 20\n";
  const auto sink = [](const std::string& law) {
    return "[[link]]\nfrom = 0\nto = 1\nlaw = \"constant\"\nconductance_W_per_K = 0.8\n"
           "[[link]]\nfrom = 1\nto = \"ambient\"\nlaw = \"" +
           law + "\"\nconductance_W_per_K = 0.07\n" + (law == "constant" ? "" : "k = 0.3\n");
  };
  // Of a motor file that took the winding for twice the resistance of this board's.
  const std::string copper = "[[source]]\nnode = 0\ndrive = \"current_A2\"\ngain = 1.5\ncoefficient_per_K = 0.004\n";
  const std::string sensor = "[housing_sensor]\nnode = 1\nlag_s = 2\noffset_K = -1\ngain_error = 0.05\n";
  const auto source = [](int node, const std::string& drive, double gain, const std::string& more = "") {
    return fmt::format("[[source]]\nnode = {}\ndrive = \"{}\"\ngain = {}\n{}", node, drive, gain, more);
  };
  const std::string plain = head + sink("constant") + copper + sensor;
  const std::pair<const char*, std::string> models[] = {
      {"two resistors", plain},
      {"speed cooling", head + sink("speed") + copper + sensor},
      {"natural convection", head + sink("natural_convection") + copper + sensor},
      {"radiation", plain + "[[link]]\nfrom = 1\nto = \"ambient\"\nlaw = \"radiation\"\nconductance_W_per_K = 0.05\n"},
      {"neighbour", plain + "[[link]]\nfrom = 1\nto = \"neighbour\"\nlaw = \"constant\"\nconductance_W_per_K = 0.05\n"},
      {"further mass", head + "[[node]]\ncapacity_J_per_K = 60\n" + sink("constant") +
                           "[[link]]\nfrom = 1\nto = 2\nlaw = \"constant\"\nconductance_W_per_K = 0.2\n" + copper +
                           sensor},
      {"winding eddy", plain + source(0, "speed2_rad2_per_s2", 1e-5)},
      {"ac copper", plain + source(0, "current2_speed2", 1e-6, "coefficient_per_K = 0.004\n")},
      {"bridge loss", plain + source(0, "current_A", 0.5)},
      {"enabled loss", plain + source(0, "enabled", 2)},
      {"constant heat", plain + source(1, "one", -1.5)},
      {"speed loss", plain + source(1, "speed_rad_per_s", 2e-3)},
      {"its square", plain + source(1, "speed2_rad2_per_s2", 1e-5)},
      {"windage", plain + source(1, "speed3_rad3_per_s3", 1e-8)},
      {"load friction", plain + source(1, "current_speed", 1e-3)},
      {"board heat", plain + source(1, "current_A2", 0.1)},
      {"two of them", plain + source(1, "speed_rad_per_s", 2e-3) + source(0, "enabled", 2)},
  };
  std::vector<double> ends_degC;
  for (const auto& [name, text] : models) {
    const std::string path = file("model.toml", text);
    const thermal::HeatSet<double> host =
        thermal::split_phases(boards::host::read_heat_model(path).set, 0.2);  // of twice the resistance

    std::string why;
    console::Values values = told_to_this_firmware(1.0f);  // what the model has none of must not stay
    for (const auto& [key, value] : console::parameters_of_model(path, values, why)) values[key] = value;
    ASSERT_EQ(why, "") << name;
    float numbers[std::size(firmware::heat_dictionary)];
    for (std::size_t i = 0; i < std::size(numbers); ++i) {
      console::Description d;
      d.name = firmware::heat_dictionary[i].name;
      d.unit = wire::text_of(firmware::heat_dictionary[i].unit);
      numbers[i] = d.name == "phase_coupling" ? 0.1f : values.at(console::full_name(d));
    }
    firmware::HeatParameters p;
    std::memcpy(&p, numbers, sizeof p);
    p.winding_max_degC = 155;
    const thermal::HeatSet<double> board = firmware::heat_set(p, values.at("phase_resistance_ohm"));

    ASSERT_EQ(board.node_count, host.node_count) << name;
    EXPECT_NEAR(board.housing.gain_error, host.housing.gain_error, 1e-6) << name;
    const thermal::HeatNetwork<double> a(host), b(board);
    const auto steps_a = a.transition(0.1), steps_b = b.transition(0.1);
    thermal::HeatNetwork<double>::Vector at = thermal::HeatNetwork<double>::Vector::Constant(host.node_count, 25),
                                         bt = at;
    double apart_K = 0;
    for (int k = 0; k < 6000; ++k) {
      thermal::HeatInput<> in{};
      const double A2 = k % 900 < 300 ? 5 : 1, w = k % 700 < 300 ? 400 : 0;
      for (int phase = 0; phase < 3; ++phase) in[thermal::phase_drive(phase)] = A2 * (phase == 0 ? 1.0 : 0.25);
      in[thermal::Drive::current_A2] = A2;
      in[thermal::Drive::current_A] = std::sqrt(A2);
      in[thermal::Drive::enabled] = in[thermal::Drive::one] = 1;
      thermal::set_speed(in, w);
      in[thermal::Boundary::ambient] = 25;
      in[thermal::Boundary::neighbour] = 60;
      at = a.step(steps_a, at, in);
      bt = b.step(steps_b, bt, in);
      apart_K = std::max(apart_K, (at - bt).cwiseAbs().maxCoeff());
    }
    // A gain of twice the resistance is half of the heat at the same conductances: scaled, the same temperatures.
    EXPECT_LT(apart_K, 1e-3) << name << ": " << at.transpose() << " / " << bt.transpose();
    ends_degC.push_back(at.maxCoeff());
  }
  for (std::size_t i = 1; i < ends_degC.size(); ++i)
    EXPECT_GT(std::abs(ends_degC[i] - ends_degC[0]), 0.3) << models[i].first << " moves nothing, so nothing was shown";
}

nlohmann::json answer(double miss_K, bool determined) {
  const auto line = [&](const char* name, double value) {
    return nlohmann::json{{"name", name}, {"value", value}, {"determined", determined}, {"at_bound", false}};
  };
  return {{"baseline",
           {{"rmse_K", {{"housing", miss_K}, {"core", nullptr}}},
            {"parameters", {line("R1", 0.6), line("R2", 16.6), line("C1", 1.7), line("C2", 16.8)}}}}};
}

TEST(HeatExperiment, TheWindingsOwnValuesAreNeverOfferedFromTheHousingAlone) {
  const auto offered = console::offer(answer(0.1, true), file("model.toml", two_resistors), believed(), true);
  const console::Values expected = {{"C2_J_per_K", 20.0f}, {"R2_K_per_W", 10.0f}, {"copper_coefficient_per_K", 0.004f}};
  EXPECT_EQ(offered.values, expected);
}

TEST(HeatExperiment, TheWindingsOwnValuesAreOfferedWhereItWasReadAndTellsThem) {
  const std::string model = file("model.toml", two_resistors),
                    gain = file("gain.toml", two_resistors + "[housing_sensor]\ngain_error = 0.02\n");
  nlohmann::json read = answer(0.1, true);
  read["baseline"]["rmse_K"]["core"] = 0.8;
  const auto offered = console::offer(read, model, believed(), true);
  EXPECT_TRUE(offered.values.contains("R1_K_per_W") && offered.values.contains("C1_J_per_K")) << offered.note;
  EXPECT_EQ(offered.note.find("stay"), std::string::npos) << offered.note;
  // What the board cannot express is left out where two resistors do, and only there.
  EXPECT_FALSE(console::offer(read, gain, believed(), true).values.contains("R1_K_per_W"));
  read["verdict"] = "adequate";
  EXPECT_FLOAT_EQ(console::offer(read, gain, believed(), true).values.at("R1_K_per_W"), 0.6f);
  EXPECT_FLOAT_EQ(console::offer(read, gain, believed(), true).values.at("C1_J_per_K"), 1.7f);
  read["baseline"]["parameters"][0]["determined"] = false;
  EXPECT_FALSE(console::offer(read, model, believed(), true).values.contains("R1_K_per_W"));
}

/// With a fifth of leads in it the winding's resistance shows four fifths of each rise.
TEST(HeatExperiment, ASensorThatSeemsToReadTooMuchIsTakenForLeadsInTheWindingsResistance) {
  console::Values before = told_to_this_firmware(0);
  nlohmann::json read = answer(0.1, true);
  read["baseline"]["rmse_K"]["core"] = 0.8;
  const std::string much = file("model.toml", two_resistors + "[housing_sensor]\ngain_error = 0.25\n");
  const auto hot = console::offer(read, much, before, true);
  EXPECT_FLOAT_EQ(hot.values.at("R1_K_per_W"), 2.0f * 1.25f);
  EXPECT_FLOAT_EQ(hot.values.at("R2_K_per_W"), 10.0f * 1.25f);
  EXPECT_FLOAT_EQ(hot.values.at("C1_J_per_K"), 0.5f / 1.25f);
  EXPECT_FLOAT_EQ(hot.values.at("C2_J_per_K"), 20.0f / 1.25f);
  EXPECT_EQ(hot.values.at("sensor_gain_share"), 0.0f);
  EXPECT_EQ(hot.values.at("third_mass_path_K_per_W"), 1.0f) << "of a mass that is none";
  EXPECT_NE(hot.note.find("25 % too much is taken for leads"), std::string::npos) << hot.note;
  const std::string little = file("model.toml", two_resistors + "[housing_sensor]\ngain_error = -0.25\n");
  EXPECT_FLOAT_EQ(console::offer(read, little, before, true).values.at("sensor_gain_share"), -0.25f);
}

TEST(HeatExperiment, TrustInTheCoolingIsOfferedWhereTheRoomIsTold) {
  console::Values before = believed();
  before["trust_cooling_share"] = 0.2f;
  nlohmann::json read = answer(0.1, true);
  read["baseline"]["rmse_K"]["core"] = 0.8;
  const std::string sure = file("model.toml", two_resistors + "[trust]\ncooling = 0.01\n");
  EXPECT_FLOAT_EQ(console::offer(read, sure, before, true).values.at("trust_cooling_share"), 0.05f);
  EXPECT_FALSE(console::offer(read, sure, before, false).values.contains("trust_cooling_share"));
}

TEST(HeatExperiment, OfALogThatCannotTellNothingIsOffered) {
  nlohmann::json insufficient = answer(0.1, true);
  insufficient["verdict"] = "insufficient";
  const auto offered = console::offer(insufficient, file("model.toml", two_resistors), believed(), true);
  EXPECT_TRUE(offered.values.empty());
  EXPECT_NE(offered.note.find("cannot tell"), std::string::npos) << offered.note;
}

TEST(HeatExperiment, WhatWasToldOfTheSensorAndNotFoundStays) {
  const std::string none = file("model.toml", two_resistors + "[housing_sensor]\nlag_s = 0\noffset_K = 0\n");
  const auto offered = console::offer(answer(0.1, true), none, believed(), true).values;
  EXPECT_FALSE(offered.contains("housing_lag_s") || offered.contains("housing_offset_K"));
}

/// A log that begins above its room makes R2 too small and C2 too large, and says nothing of an offset.
TEST(HeatExperiment, NothingCoolerIsOfferedUnlessTheRoomIsTold) {
  console::Values before = believed();
  before["housing_offset_K"] = -2.0f;
  const std::string cooler =  // R2 10 K/W, C2 20 J/K
      file("model.toml", two_resistors + "[housing_sensor]\noffset_K = -1\n");
  EXPECT_EQ(console::offer(answer(0.1, true), cooler, before, true).values.size(), 4u);
  const auto offered = console::offer(answer(0.1, true), cooler, before, false);
  const console::Values left = {{"copper_coefficient_per_K", 0.004f}};
  EXPECT_EQ(offered.values, left);
  EXPECT_NE(offered.note.find("(--ambient DEGC): R2_K_per_W 10, C2_J_per_K 20, housing_offset_K -1"), std::string::npos)
      << offered.note;
  before["R2_K_per_W"] = 9.0f, before["C2_J_per_K"] = 21.0f, before["housing_offset_K"] = 0.0f;
  EXPECT_EQ(console::offer(answer(0.1, true), cooler, before, false).values.size(), 4u);
}

TEST(HeatExperiment, BeyondTheBoardsModelOnlyASmallMissIsForgiven) {
  const std::string model =
      file("model.toml", two_resistors + "[[source]]\nnode = 1\ndrive = \"speed_rad_per_s\"\ngain = 0.1\n");
  const console::Values housing = {{"C2_J_per_K", 16.8f}, {"R2_K_per_W", 16.6f}};
  EXPECT_EQ(console::offer(answer(0.18, true), model, believed(), true).values, housing);
  EXPECT_TRUE(console::offer(answer(0.18, false), model, believed(), true).values.empty());
  EXPECT_TRUE(console::offer(answer(0.9, true), model, believed(), true).values.empty());
  EXPECT_TRUE(console::offer(nlohmann::json(), model, believed(), true).values.empty());
}

}  // namespace

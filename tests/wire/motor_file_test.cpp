// SPDX-License-Identifier: MIT
#include "wire/pc/motor_file.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "wire/pc/user_error.hpp"

namespace {

using wire::pc::MotorFile;
using wire::pc::read_motor;
using wire::pc::UserError;

const std::string folder = HOTCORE_SOURCE_DIR "/boards/motors";

/// The EC 16 file with one line replaced, in a place of its own.
std::string file_with(const std::string& key, const std::string& line) {
  std::ifstream in(folder + "/ec-16-40w.toml");
  const std::string path =
      ::testing::TempDir() + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) + ".toml";
  std::ofstream out(path);
  for (std::string text; std::getline(in, text);) out << (text.rfind(key, 0) == 0 ? line : text) << '\n';
  return path;
}

std::string complaint(const std::string& which) {
  try {
    read_motor(which, folder);
  } catch (const UserError& error) {
    EXPECT_EQ(error.exit_code(), 2);
    return error.what();
  }
  ADD_FAILURE() << which << " was read without a complaint";
  return "";
}

TEST(MotorFile, EveryFileInTheFolderIsRead) {
  const auto names = wire::pc::motor_names(folder);
  ASSERT_GE(names.size(), 3u);
  for (const std::string& name : names) EXPECT_NO_THROW(read_motor(name, folder)) << name;
}

TEST(MotorFile, SheetUnitsBecomeSiPerPhase) {
  const MotorFile file = read_motor("ec-powermax-30-24v", folder);
  EXPECT_DOUBLE_EQ(file.motor.phase_resistance_ohm, 0.051);
  EXPECT_DOUBLE_EQ(file.motor.inductance_d_H, 8e-6);
  EXPECT_NEAR(file.motor.flux_linkage_Wb, 13.6e-3 / (std::sqrt(3.0) * 2), 1e-15);
  EXPECT_NEAR(file.motor.C1_J_per_K, 10.096, 1e-3);
  EXPECT_NEAR(file.motor.C2_J_per_K, 159.46, 1e-2);
  EXPECT_FALSE(file.surrogate);
  EXPECT_TRUE(read_motor("ec-16-40w", folder).surrogate);
}

TEST(MotorFile, AnUnknownMotorIsAnsweredWithTheNearest) {
  EXPECT_NE(complaint("ec-16-40W").find("did you mean 'ec-16-40w'?"), std::string::npos);
  EXPECT_NE(complaint("../secret").find("../secret: there is no such motor; give a .toml file, or one of: "),
            std::string::npos);
}

TEST(MotorFile, AMisspeltKeyIsAnsweredWithTheNearest) {
  const std::string text = complaint(file_with("tau_motor_s", "tau_motr_s = 294"));
  EXPECT_NE(text.find("unknown key 'tau_motr_s', did you mean 'tau_motor_s'?"), std::string::npos) << text;
}

TEST(MotorFile, NumbersThatCannotBeAreRefused) {
  EXPECT_NE(complaint(file_with("tau_winding_s", "tau_winding_s = -1.22")).find("tau_winding_s = -1.22 cannot be"),
            std::string::npos);
  EXPECT_NE(complaint(file_with("R1_K", "R1_K_per_W = nan")).find("of a motor it is 0.0001 to 10000"),
            std::string::npos);
  EXPECT_NE(complaint(file_with("winding_max", "winding_max_degC = 1e9")).find("it is 50 to 300"), std::string::npos);
  EXPECT_NE(complaint(file_with("R1_K", "R1_K_per_W = 1e-9")).find("cannot be"), std::string::npos);
  EXPECT_NE(complaint(file_with("pole_pairs", "pole_pairs = 1.5")).find("whole number"), std::string::npos);
  EXPECT_NE(complaint(file_with("R2_K", "R2_K_per_W = \"warm\"")).find("must be a number"), std::string::npos);
  EXPECT_NE(complaint(file_with("R2_K", "")).find("'R2_K_per_W' is missing"), std::string::npos);
  EXPECT_NE(complaint(file_with("R2_K", "R2_K_per_W = = 3")).find("line "), std::string::npos);
}

TEST(MotorFile, ASurrogateIsNotTakenForASheetWhereTheWordIsMisspelt) {
  EXPECT_NE(
      complaint(file_with("status", "status = \"surogate\"")).find("status = 'surogate' is none; say 'surrogate'"),
      std::string::npos);
  EXPECT_NE(complaint(file_with("name", "name = 16")).find("'name' must be a text in quotes"), std::string::npos);
}

}  // namespace

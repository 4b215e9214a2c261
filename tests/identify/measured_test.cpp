// SPDX-License-Identifier: MIT
// Motors that are nothing like ours: simulated drives of traction motors, and what others measured (not part of the
// repository).
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "identify/answer/held_out.hpp"
#include "identify/answer/report.hpp"
#include "identify/discover.hpp"
#include "identify/fit/fit.hpp"
#include "identify/search/problem_of.hpp"
#include "tests/identify/program.hpp"
#include "tests/identify/says.hpp"
#include "tests/identify/traction.hpp"

namespace {

using identify::Verdict;
using nlohmann::json;
using tests::Outcome;
using tests::run;
using tests::says;

const std::string data = HOTCORE_SOURCE_DIR "/../shared/data/";
const std::string maps = HOTCORE_SOURCE_DIR "/identify/maps/";

identify::Report foretold(std::uint64_t seed) {
  identify::HoldOut held;
  held.fraction = 0.25;
  return identify::discover(tests::traction_drives("hotcore_drive_" + std::to_string(seed) + ".csv", seed),
                            std::nullopt, held);
}

TEST(Traction, AMinuteSaysNothingOfAMotorWithoutASheet) {
  auto logs = tests::traction_drives("hotcore_minute.csv", 44);
  for (auto& column : logs[0].columns) column.resize(std::min<std::size_t>(column.size(), 120));
  const identify::Report report = identify::discover(logs, std::nullopt);
  EXPECT_EQ(report.verdict, Verdict::insufficient);
  says(report.sentence, "does not come near where it settles");
}

TEST(SlowTraction, AHeavyWindingIsNoSwappedColumnWhereTheLogReadsWorseSwapped) {
  const identify::Report report = foretold(37);
  EXPECT_EQ(report.verdict, Verdict::ambiguous) << report.sentence;
  EXPECT_LT(report.held_out->after.core_K, 0.5 * report.held_out->before.core_K);
  const auto hot_spot =
      std::find_if(report.causes.begin(), report.causes.end(), [](const auto& c) { return c.id == "hot_spot"; });
  ASSERT_NE(hot_spot, report.causes.end());
  EXPECT_EQ(hot_spot->parameters[0].unit, "J/K / ohm") << "no sheet says the resistance";
}

TEST(SlowTraction, TwoHoursAreNotTooShortForAHousingThatSettlesWithinMinutes) {
  // Two resistors, which miss the iron loss, take its time constant for 46,000 s, and for determined.
  EXPECT_EQ(foretold(87).sentence.find("record longer"), std::string::npos);
}

TEST(SlowTraction, WhereNothingExplainsALogTheNearestSetIsTriedOnWhatWasHeldOut) {
  const identify::Report report = foretold(4);
  EXPECT_EQ(report.verdict, Verdict::unknown_cause) << report.sentence;
  EXPECT_TRUE(report.causes.empty());
  EXPECT_EQ(report.held_out->nearest.size(), 2u);
  EXPECT_LT(report.held_out->after.core_K, 0.5 * report.held_out->before.core_K);
}

TEST(SlowTraction, IronLossThatBendsTwoResistorsBeyondTheirBoundsDoesNotBendWhereCausesStart) {
  const identify::Belief b =
      identify::problem_of(tests::traction_drives("hotcore_bent.csv", 13, 5), std::nullopt).belief;
  EXPECT_LT(b.R2_K_per_W * b.C2_J_per_K, 1000) << "s, of a yoke that settles within minutes; 6.5e7 by two resistors";
}

TEST(SlowTraction, ASlowWindingRecordedForHoursIsReadInLongBins) {
  const auto logs = tests::traction_drives("hotcore_hours.csv", 4, 5);
  const identify::Problem problem = identify::problem_of(logs, std::nullopt);
  identify::Problem fine = problem;
  fine.logs.clear();
  for (const identify::Log& log : logs) fine.logs.push_back(identify::bins_of(log, 0.5));
  EXPECT_EQ(fine.logs[0].width_s, 0.5);
  EXPECT_GT(problem.logs[0].width_s, 3);
  const identify::Physical found = identify::physical(identify::fit(problem, {}).x),
                           of_rows = identify::physical(identify::fit(fine, {}).x);
  EXPECT_NEAR(found.R1_K_per_W / of_rows.R1_K_per_W, 1, 0.01);
  EXPECT_NEAR(found.C1_J_per_K / of_rows.C1_J_per_K, 1, 0.01);
}

TEST(SlowMeasuredData, OneStillAirModelMissesTheFanRunByTensOfKelvin) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "skipped: no measured data at ../shared/data";
  const Outcome r = run(data + "tass_run1.csv " + data + "tass_run3.csv --hold-out " + data +
                        "tass_run4_fan.csv --map " + maps + "tass.toml --json -");
  ASSERT_EQ(r.code, 0) << r.out;
  const json j = json::parse(r.out);
  EXPECT_GT(j["held_out"]["rmse_before_K"]["core"], 20);
  EXPECT_GT(j["held_out"]["rmse_before_K"]["housing"], 20);
  EXPECT_GT(j["held_out"]["worst_before_K"], 50);
  EXPECT_LT(j["baseline"]["rmse_K"]["core"], 6);
}

TEST(SlowMeasuredData, AFanMakesNoSessionTooShort) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "skipped: no measured data at ../shared/data";
  const auto said = [&](const std::string& runs) { return run(runs + " --map " + maps + "tass.toml").out; };
  // The fan run determines its own time constant, about 420 s, and the session is longer; the still-air runs' is 2150
  // s.
  const std::string still = data + "tass_run1.csv " + data + "tass_run3.csv ";
  const std::string all = said(still + data + "tass_run4_fan.csv");
  EXPECT_EQ(all.find("Verdict: insufficient"), std::string::npos) << all;
  says(said(still), "less than the housing's time constant");
}

json answer(const std::string& arguments) {
  const Outcome r = run(arguments + " --json -");
  EXPECT_EQ(r.code, 0) << r.out;
  return json::parse(r.out);
}

const json& paderborn() {
  static const json j = answer(data + "paderborn_groupA.csv --map " + maps + "paderborn.toml");
  return j;
}

bool tied(const json& j, const std::vector<std::string>& ids) {
  return std::find(j["tied"].begin(), j["tied"].end(), json(ids)) != j["tied"].end();
}

TEST(SlowMeasuredData, EveryAnswerHoldsTheFanAndTheJointModelMissesByFiveKelvin) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "skipped: no measured data at ../shared/data";
  const json j = answer(data + "tass_run1.csv " + data + "tass_run3.csv " + data + "tass_run4_fan.csv --map " + maps +
                        "tass.toml");
  EXPECT_TRUE(tied(j, {"cooling_change", "power_share"})) << j["sentence"];
  for (const auto& ids : j["tied"]) EXPECT_EQ(ids[0], "cooling_change") << "whatever else, the fan: " << j["sentence"];
  EXPECT_LE(j["tied"].size(), 4u) << j["sentence"];
  EXPECT_LT(j["rmse_with_causes_K"]["core"], 5.3);
  EXPECT_LT(j["rmse_with_causes_K"]["housing"], 2.5);
  says(j["causes"][0]["name"], "tass_run4_fan");
}

TEST(SlowMeasuredData, AtOneSpeedHeatThatDoesNotFollowTheCurrentIsNoMoreThanThat) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "skipped: no measured data at ../shared/data";
  const json& j = paderborn();
  EXPECT_EQ(j["verdict"], "ambiguous");
  EXPECT_TRUE(tied(j, {"third_mass", "winding_eddy"}) && tied(j, {"enabled_loss", "third_mass"})) << j["sentence"];
  EXPECT_LE(j["tied"].size(), 6u) << "what misses by more than what is left is no rival";
  EXPECT_LT(j["rmse_with_causes_K"]["core"], 1.3);
  EXPECT_LT(j["rmse_with_causes_K"]["housing"], 0.85);
}

TEST(SlowMeasuredData, AtOneCurrentAndOneSpeedCopperAndSpeedLossCannotBeToldApart) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "skipped: no measured data at ../shared/data";
  std::ifstream whole(data + "paderborn_groupA.csv");
  const std::string path = (std::filesystem::temp_directory_path() / "hotcore_74_minutes.csv").string();
  std::ofstream first(path);
  std::string line;
  for (std::getline(whole, line), first << line << '\n'; std::getline(whole, line) && std::stod(line) < 74 * 60;)
    first << line << '\n';
  first.close();
  const json j = answer(path + " --map " + maps + "paderborn.toml");
  EXPECT_EQ(j["verdict"], "ambiguous");
  EXPECT_TRUE(tied(j, {"copper_coefficient", "third_mass"}) && tied(j, {"third_mass", "winding_eddy"}))
      << j["sentence"];
}

TEST(SlowMeasuredData, TwoCausesForetellTheQuarterThatWasNotFitted) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "skipped: no measured data at ../shared/data";
  const json j = answer(data + "paderborn_groupA.csv --map " + maps + "paderborn.toml --hold-out 0.25");
  EXPECT_GT(j["held_out"]["rmse_before_K"]["core"], 10);
  EXPECT_LT(j["held_out"]["rmse_after_K"]["core"], 4);
  EXPECT_LE(j["causes"].size(), 2u);
}

TEST(SlowMeasuredData, CoppersCoefficientMakesPaderbornWorse) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "skipped: no measured data at ../shared/data";
  const json& j = paderborn();
  ASSERT_EQ(j["baseline"]["variants"].size(), 2u);
  EXPECT_GT(j["baseline"]["variants"][0]["rmse_K"]["core"].get<double>(),
            1.2 * j["baseline"]["variants"][1]["rmse_K"]["core"].get<double>());
  EXPECT_FALSE(j["baseline"]["converged"].get<bool>());
  bool frozen = false;
  for (const auto& note : j["notes"]) frozen = frozen || note.get<std::string>().find("frozen") != std::string::npos;
  EXPECT_TRUE(frozen);
}

}  // namespace

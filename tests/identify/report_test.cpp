// SPDX-License-Identifier: MIT
#include "identify/report.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "identify/discover.hpp"
#include "identify/gain.hpp"
#include "identify/held_out.hpp"
#include "identify/table.hpp"
#include "tests/identify/bench_log.hpp"

namespace {

using nlohmann::json;

identify::Report report_of(const tests::BenchOptions& options, const identify::HoldOut& held = {}) {
  const std::string name =
      std::string("hotcore_") + ::testing::UnitTest::GetInstance()->current_test_info()->name() + ".csv";
  const auto logs = identify::logs_of(identify::read_table(tests::write_bench_log(name, options)), {}, std::nullopt);
  return identify::discover(logs, wire::pc::read_motor("ec-16-40w", HOTCORE_SOURCE_DIR "/boards/motors"), held);
}

struct Outcome {
  int code;
  std::string out;
};

Outcome run(const std::string& arguments) {
  const std::string out = (std::filesystem::temp_directory_path() / "hotcore_identify_out").string();
  const int status = std::system((std::string(IDENTIFY_PROGRAM) + " " + arguments + " > '" + out + "' 2>&1").c_str());
  std::ostringstream text;
  text << std::ifstream(out).rdbuf();
  return {WEXITSTATUS(status), text.str()};
}

const std::string data = HOTCORE_SOURCE_DIR "/../shared/data/";
const std::string maps = HOTCORE_SOURCE_DIR "/identify/maps/";

TEST(Report, JsonHoldsTheFieldsOfTheContract) {
  tests::BenchOptions options;
  options.core_every_s = 20;
  options.seconds = 900;
  identify::HoldOut held;
  held.fraction = 0.3;
  const json j = json::parse(identify::as_json(report_of(options, held)));
  EXPECT_EQ(j.at("format"), 1);
  for (const char* key : {"verdict", "sentence", "baseline", "causes", "held_out", "gain", "experiment", "model_file"})
    EXPECT_TRUE(j.contains(key)) << key;
  ASSERT_EQ(j.at("baseline").at("parameters").size(), 4u);
  for (const auto& p : j["baseline"]["parameters"]) {
    for (const char* key : {"name", "value", "unit", "std_error", "determined"}) EXPECT_TRUE(p.contains(key)) << key;
  }
  EXPECT_TRUE(j["baseline"]["rmse_K"]["housing"].is_number());
  EXPECT_TRUE(j["baseline"]["rmse_K"]["core"].is_number());
  EXPECT_TRUE(j["baseline"]["adequacy"]["ratio"].is_number());
  EXPECT_TRUE(j["baseline"]["adequacy"]["white_p"].is_number());
  EXPECT_TRUE(j["baseline"]["where"].is_array());
  for (const char* key : {"how", "rmse_before_K", "rmse_after_K", "worst_before_K", "worst_after_K"})
    EXPECT_TRUE(j["held_out"].contains(key)) << key;
  const json& interval = j["held_out"].at("interval_95_K");
  EXPECT_EQ(interval.at("of"), "core");
  const double error_K = j["held_out"]["rmse_before_K"]["core"];
  EXPECT_LE(interval.at("before").at(0).get<double>(), error_K);
  EXPECT_GE(interval.at("before").at(1).get<double>(), error_K);
}

TEST(Report, ACauseThatDoesNotGoOnIsRefusedByTheDataNotFitted) {
  tests::BenchOptions options;
  options.core_every_s = 20;
  options.seconds = 1200;
  const auto veto = [&](const char* id) {
    const auto path = tests::write_bench_log("hotcore_veto.csv", options);
    const auto logs = identify::logs_of(identify::read_table(path), {}, std::nullopt);
    const auto problem =
        identify::problem_of(logs, wire::pc::read_motor("ec-16-40w", HOTCORE_SOURCE_DIR "/boards/motors"));
    return identify::veto(problem, identify::fit(problem, {}),
                          identify::fit(problem, {{identify::cause_named(id), -1}}));
  };
  // A warm wind in the last of what is fitted looks like a drift, which the data after it does not go on with.
  options.extra_housing_W = [](double t, double, double) { return t > 750 && t < 900 ? 1.0 : 0.0; };
  EXPECT_NE(veto("ambient_drift").find("refused"), std::string::npos);
  options.extra_housing_W = [](double t, double, double) { return 0.001 * t; };
  EXPECT_EQ(veto("ambient_drift"), "");
}

TEST(Report, TheGainSaysWhatTheBoardWouldDoWithEachModel) {
  tests::BenchOptions options;
  options.core_every_s = 20;
  options.extra_housing_W = [](double, double current, double) { return 0.6 * current * current; };
  const identify::Report report = report_of(options);
  ASSERT_EQ(report.verdict, "explained") << report.sentence;
  ASSERT_TRUE(report.gain);
  EXPECT_LT(report.gain->overshoot_after_K, 0.5) << "the model that is the motor keeps its limit";
  EXPECT_GT(report.gain->burst_s_after, 0);
  EXPECT_NE(report.gain->continuous_A_before, report.gain->continuous_A_after);
  const json gain = json::parse(identify::as_json(report)).at("gain");
  for (const char* key : {"overshoot_before_K", "overshoot_after_K", "burst_s_before", "burst_s_after",
                          "continuous_A_before", "continuous_A_after"})
    EXPECT_TRUE(gain.at(key).is_number()) << key;
  EXPECT_NE(identify::as_text(report, false).find("What it is worth"), std::string::npos);
  EXPECT_NE(identify::as_html(report).find("What it is worth"), std::string::npos);
}

TEST(Report, OfModelsThatCannotBeToldApartTheMostCautiousIsTaken) {
  tests::BenchOptions options;
  options.core_every_s = 20;
  const auto path = tests::write_bench_log("hotcore_cautious.csv", options);
  const auto problem = identify::problem_of(identify::logs_of(identify::read_table(path), {}, std::nullopt),
                                            wire::pc::read_motor("ec-16-40w", HOTCORE_SOURCE_DIR "/boards/motors"));
  const identify::Fit found = identify::fit(problem, {});
  identify::Fit light = found, heavy = found;
  light.x[2] -= 0.5;  // ln of the winding's capacity
  heavy.x[2] += 0.5;
  EXPECT_EQ(&identify::most_cautious(problem, {&found, &light, &heavy}), &light);
  EXPECT_EQ(&identify::most_cautious(problem, {&heavy, &found}), &found);
}

TEST(Report, WhatIsAdequateHasNothingToGain) {
  tests::BenchOptions options;
  options.core_every_s = 20;
  const identify::Report report = report_of(options);
  EXPECT_EQ(report.verdict, "adequate");
  EXPECT_FALSE(report.gain);
}

/// A good log whose rows `edit` spoils: (time, current, speed, housing, ambient, winding or empty).
std::string spoilt(const std::function<bool(std::vector<std::string>&, int)>& edit) {
  tests::BenchOptions options;
  options.core_every_s = 20;
  options.seconds = 900;
  const std::string path = tests::write_bench_log("hotcore_spoilt.csv", options);
  std::ifstream in(path);
  std::string line, out;
  std::getline(in, line);
  out = line + "\n";
  for (int row = 0; std::getline(in, line); ++row) {
    std::vector<std::string> cells;
    std::istringstream text(line + ",");
    for (std::string cell; std::getline(text, cell, ',');) cells.push_back(cell);
    if (!edit(cells, row)) continue;
    for (std::size_t i = 0; i < cells.size(); ++i) out += (i > 0 ? "," : "") + cells[i];
    out += "\n";
  }
  in.close();
  std::ofstream(path) << out;
  return path;
}

/// What the program says of it: exit 3 with one sentence, or the verdict insufficient; never a name.
void refused(const std::string& path, const std::string& because) {
  const Outcome r = run(path + " --motor ec-16-40w");
  EXPECT_TRUE(r.code == 3 || r.out.find("Verdict: insufficient") != std::string::npos) << r.out;
  EXPECT_EQ(r.out.find("behaves"), std::string::npos) << r.out;
  EXPECT_NE(r.out.find(because), std::string::npos) << r.out;
}

TEST(BadInput, AGoodLogIsAnsweredUntilItIsSpoilt) {
  const Outcome r = run(spoilt([](auto&, int) { return true; }) + " --motor ec-16-40w");
  EXPECT_EQ(r.code, 0);
  EXPECT_NE(r.out.find("Verdict: adequate"), std::string::npos) << r.out;
}

TEST(BadInput, NothingThatVaries) {
  refused(spoilt([](auto& row, int) { return row[3] = "30.1", row[5] = "", true; }), "The temperatures move by 0.0 K");
}

TEST(BadInput, ShorterThanTheHousingsTimeConstant) {
  refused(spoilt([](auto&, int row) { return row < 1200; }), "less than the housing's time constant");
}

TEST(BadInput, FortyPercentMissing) {
  std::mt19937 random(4);
  refused(spoilt([&](auto&, int) { return random() % 10 >= 4; }), "40 % of the readings or rows are missing");
  refused(spoilt([&](auto& row, int) { return row[3] = random() % 10 < 4 ? "" : row[3], true; }),
          "40 % of the readings or rows are missing");
}

TEST(BadInput, TwoClocksTwoMinutesApart) {
  std::vector<std::string> earlier;
  refused(spoilt([&](auto& row, int number) {
            earlier.push_back(row[1]);
            row[1] = earlier[static_cast<std::size_t>(std::max(0, number - 1200))];
            return true;
          }),
          "two clocks");
}

TEST(BadInput, CurrentAndSpeedSwapped) {
  refused(spoilt([](auto& row, int number) {
            row[2] = row[1];
            row[1] = number / 300 % 2 == 0 ? "0" : "2.5";
            return true;
          }),
          "swapped");
}

TEST(Report, NothingIsCalledConvergedThatFailsACheck) {
  tests::BenchOptions options;
  options.core_every_s = 20;
  options.seconds = 600;
  EXPECT_TRUE(report_of(options).converged);
  options.extra_housing_W = [](double t, double, double) { return t > 200 && t < 350 ? 4.0 : 0.0; };
  EXPECT_FALSE(report_of(options).converged) << "the residual check";
  tests::BenchOptions poor;
  poor.seconds = 60;
  EXPECT_FALSE(report_of(poor).converged) << "the identifiability check";
}

TEST(Report, ThePageIsOneFileAndEscapesWhatItShows) {
  tests::BenchOptions options;
  options.seconds = 300;
  identify::Report report = report_of(options);
  report.notes.push_back("<script>alert(1)</script>");
  const std::string html = identify::as_html(report);
  EXPECT_NE(html.find("<svg"), std::string::npos);
  EXPECT_EQ(html.find("<script"), std::string::npos);
  EXPECT_EQ(html.find("src="), std::string::npos);
  EXPECT_EQ(html.find("<link"), std::string::npos);
}

TEST(Program, UnknownMotorIsAnsweredWithTheNearest) {
  tests::BenchOptions options;
  options.seconds = 60;
  const Outcome r = run(tests::write_bench_log("hotcore_motor.csv", options) + " --motor ec-16-40W");
  EXPECT_EQ(r.code, 2);
  EXPECT_NE(r.out.find("did you mean 'ec-16-40w'?"), std::string::npos) << r.out;
}

TEST(Program, BadDataEndsWithThreeAndWritesNothing) {
  const std::string path = (std::filesystem::temp_directory_path() / "hotcore_bad.csv").string(),
                    json_path = path + ".json";
  std::filesystem::remove(json_path);
  std::ofstream(path) << "time_s,current_A,housing_degC\n0,1\n";
  const Outcome r = run(path + " --json " + json_path);
  EXPECT_EQ(r.code, 3);
  EXPECT_EQ(std::count(r.out.begin(), r.out.end(), '\n'), 1) << r.out;
  EXPECT_FALSE(std::filesystem::exists(json_path));
}

TEST(Program, AWrongOptionIsUsage) {
  EXPECT_EQ(run("--nonsense").code, 2);
  EXPECT_EQ(run("").code, 2);
  EXPECT_EQ(run("--help").code, 0);
}

TEST(Program, ALogWithoutLoadCannotBeUsed) {
  tests::BenchOptions options;
  options.seconds = 120;
  options.current_A = [](double, std::mt19937_64&) { return 0.0; };
  const Outcome r = run(tests::write_bench_log("hotcore_idle.csv", options));
  EXPECT_EQ(r.code, 3);
  EXPECT_NE(r.out.find("no current and no power flows"), std::string::npos) << r.out;
}

TEST(MeasuredData, OneStillAirModelMissesTheFanRunByTensOfKelvin) {
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

TEST(MeasuredData, AFanMakesNoSessionTooShort) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "skipped: no measured data at ../shared/data";
  const auto said = [&](const std::string& runs) { return run(runs + " --map " + maps + "tass.toml").out; };
  // The fan run determines its own time constant, about 420 s, and the session is longer; the still-air runs' is 2150
  // s.
  const std::string still = data + "tass_run1.csv " + data + "tass_run3.csv ";
  const std::string all = said(still + data + "tass_run4_fan.csv");
  EXPECT_EQ(all.find("Verdict: insufficient"), std::string::npos) << all;
  EXPECT_NE(all.find("~ cooling_change"), std::string::npos) << all;
  EXPECT_NE(said(still).find("less than the housing's time constant"), std::string::npos);
}

TEST(MeasuredData, CoppersCoefficientMakesPaderbornWorse) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "skipped: no measured data at ../shared/data";
  const Outcome r = run(data + "paderborn_groupA.csv --map " + maps + "paderborn.toml --json -");
  ASSERT_EQ(r.code, 0) << r.out;
  const json j = json::parse(r.out);
  ASSERT_EQ(j["baseline"]["variants"].size(), 2u);
  EXPECT_GT(j["baseline"]["variants"][0]["rmse_K"]["core"].get<double>(),
            1.2 * j["baseline"]["variants"][1]["rmse_K"]["core"].get<double>());
  EXPECT_FALSE(j["baseline"]["converged"].get<bool>());
  bool frozen = false;
  for (const auto& note : j["notes"]) frozen = frozen || note.get<std::string>().find("frozen") != std::string::npos;
  EXPECT_TRUE(frozen);
}

}  // namespace

// SPDX-License-Identifier: MIT
// The program: its options, files and exit codes.
#include "tests/identify/program.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "identify/answer/held_out.hpp"
#include "identify/discover.hpp"
#include "identify/fit/parallel.hpp"
#include "identify/search/doing.hpp"
#include "tests/identify/bench.hpp"
#include "tests/identify/says.hpp"

namespace {

using nlohmann::json;
using tests::Outcome;
using tests::run;
using tests::says;

TEST(Program, UnknownMotorIsAnsweredWithTheNearest) {
  tests::BenchOptions options;
  options.seconds = 60;
  const Outcome r = run(tests::write_bench_log("hotcore_motor.csv", options) + " --motor ec-16-40W");
  EXPECT_EQ(r.code, 2);
  says(r.out, "did you mean 'ec-16-40w'?");
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

TEST(SlowProgram, NoBoardGetsASetOfALogThatCannotTellOrThatTellsAPower) {
  const std::string model = (std::filesystem::temp_directory_path() / "hotcore_no_model.toml").string();
  const auto asked = [&](const tests::BenchOptions& options) {
    std::filesystem::remove(model);
    const Outcome r = run(tests::write_bench_log("hotcore_no_model.csv", options) +
                          " --motor ec-16-40w --json - --write-model " + model);
    EXPECT_EQ(std::filesystem::exists(model), r.code == 0) << r.out;
    EXPECT_EQ(r.out.find("\"no_model\": null") != std::string::npos, r.code == 0) << r.out;
    says(r.out, "\"verdict\":");
    return r;
  };
  tests::BenchOptions options;
  EXPECT_EQ(asked(options).code, 0);
  options.seconds = 120;
  EXPECT_EQ(asked(options).code, 3);
  options.seconds = 900;
  options.power_gain = 1;
  const Outcome r = asked(options);
  EXPECT_EQ(r.code, 3);
  says(r.out, "not written: the log tells a power");
}

TEST(Program, AFolderThatIsNotThereIsNotMade) {
  tests::BenchOptions options;
  options.seconds = 60;
  const std::string log = tests::write_bench_log("hotcore_folder.csv", options);
  const std::string folder = (std::filesystem::temp_directory_path() / "hotcore_no_such").string();
  for (const char* option : {"--json", "--html", "--write-model", "--write-baseline"}) {
    const Outcome r = run(log + " " + option + " " + folder + "/x");
    EXPECT_EQ(r.code, 2);
    says(r.out, "there is no folder " + folder);
    EXPECT_FALSE(std::filesystem::exists(folder));
  }
}

TEST(Program, WhatAThreadThrowsReachesTheCaller) {
  EXPECT_THROW(identify::in_parallel(100, [](std::size_t) { throw std::runtime_error("part"); }), std::runtime_error);
}

TEST(Program, WhatIsBeingDoneIsSaidOnceItLasts) {
  const auto said = [](std::chrono::milliseconds silent, bool terminal) {
    testing::internal::CaptureStderr();
    {
      identify::Doing doing(silent, terminal);
      for (int i = 0; i < 3; ++i) {
        doing("fitting");
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
    }
    return testing::internal::GetCapturedStderr();
  };
  EXPECT_EQ(said(std::chrono::seconds(100), true), "");
  EXPECT_EQ(said(std::chrono::milliseconds(1), false), "") << "into a file";
  const std::string in_place = said(std::chrono::milliseconds(1), true);
  says(in_place, "\r\033[K  fitting, ");
  EXPECT_TRUE(in_place.ends_with("\r\033[K")) << "and leaves the line to the answer";
}

TEST(Program, EachPartOfTheWorkIsTold) {
  tests::BenchOptions options;
  options.seconds = 300;
  identify::HoldOut held;
  held.fraction = 0.25;
  std::string told;
  (void)identify::discover(tests::bench_logs({options}), tests::ec_16(), held,
                           [&](const std::string& what) { told += what + "; "; });
  EXPECT_EQ(told.find("fitting two resistors; fitting each cause alone; "), 0u) << told;
  says(told, "scoring what was held out; ");
}

TEST(Program, AWrongOptionIsUsage) {
  EXPECT_EQ(run("--nonsense").code, 2);
  EXPECT_EQ(run("").code, 2);
  EXPECT_EQ(run("--help").code, 0);
}

TEST(Program, ColumnsMayFollowOneWord) {
  tests::BenchOptions options;
  options.seconds = 60;
  const std::string path = tests::write_bench_log("hotcore_columns.csv", options);
  says(run("--column ambient_degC=sky coolant_degC=sea " + path).out, "column 'sky' for ambient_degC is missing");
  says(run(path + " --column ambient_degC=ambient_degC coolant_degC=sea").out,
       "column 'sea' for coolant_degC is missing");
  EXPECT_EQ(run("--column ambient_degC=sky coolant_degC=sea").code, 2) << "no log";
}

TEST(SlowProgram, AScoreEndsWithWhatWasTakenForWhat) {
  tests::BenchOptions options;
  options.core_every_s = 20;
  const std::string clean = tests::write_bench_log("hotcore_scored.csv", options);
  options.extra_housing_W = [](double, double current, double) { return 0.6 * current * current; };
  const std::string board = tests::write_bench_log("hotcore_scored_board.csv", options);
  const auto truth = [](const std::string& path, const char* ids) {
    std::ofstream(path + ".json") << "{\"causes\": [" << ids << "]}";
    return path + ".json";
  };
  const std::string none = truth(clean, ""), heat = truth(board, R"({"id": "board_heat"})"),
                    drag = truth(clean + "2", R"({"id": "windage"})");
  const Outcome r = run(clean + " " + board + " " + clean + " " + clean + " --motor ec-16-40w --score " + none + " " +
                        heat + " " + drag + " " + none);
  EXPECT_EQ(r.code, 0) << r.out;
  const auto row = [](const std::string& first, const char* counts) {
    return first + std::string(40 - first.size(), ' ') + counts + "\n";
  };
  const std::string table = row("truth \\ answer", "   1   2") + row("board_heat", "   .   1") +
                            row("nothing", "   2   .") + row("windage", "   1   .") +
                            "   1  adequate\n   2  board_heat\n";
  says(r.out, table);
}

TEST(Program, ALogWithoutLoadCannotBeUsed) {
  tests::BenchOptions options;
  options.seconds = 120;
  options.current_A = [](double, std::mt19937_64&) { return 0.0; };
  const Outcome r = run(tests::write_bench_log("hotcore_idle.csv", options));
  EXPECT_EQ(r.code, 3);
  says(r.out, "no current and no power flows");
}

}  // namespace

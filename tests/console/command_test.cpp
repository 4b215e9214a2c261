// SPDX-License-Identifier: MIT
// Every command as a person types it, against a board made of a script.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "console/commands.hpp"
#include "console/drive.hpp"
#include "console/live.hpp"
#include "console/plot.hpp"
#include "console/profile.hpp"
#include "console/recorder.hpp"
#include "tests/console/fake_board.hpp"

namespace {

using wire::Kind;

class Commands : public testing::Test {
 protected:
  struct Said {
    int code;
    std::string out, err;
  };

  Said say(const std::string& line) {
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    console_.options.json = false;
    const int code = console::run_line(console_, [&](CLI::App& app) { app.parse("--sim " + line); });
    return {code, testing::internal::GetCapturedStdout(), testing::internal::GetCapturedStderr()};
  }
  nlohmann::json json(const std::string& line) {
    const Said said = say(line + " --json");
    EXPECT_EQ(said.code, 0) << said.err;
    return nlohmann::json::parse(said.out, nullptr, false);
  }
  /// One sentence on standard error, nothing on standard output, the exit code.
  void refused(const std::string& line, int code, const std::string& words) {
    const Said said = say(line);
    EXPECT_EQ(said.code, code) << line << ": " << said.err;
    EXPECT_EQ(std::count(said.err.begin(), said.err.end(), '\n'), 1) << said.err;
    EXPECT_NE(said.err.find(words), std::string::npos) << line << ": " << said.err;
    EXPECT_EQ(said.out, "") << line;
    std::printf("  %s: %s", line.c_str(), said.err.c_str());
  }
  std::string path(const std::string& name) { return (folder_ / name).string(); }
  static std::string content(const std::string& path) {
    std::ifstream in(path);
    std::stringstream text;
    text << in.rdbuf();
    return text.str();
  }
  bool is_empty() const { return std::filesystem::is_empty(folder_); }

  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("hotcore_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::shared_ptr<FakeBoard> board_ = std::make_shared<FakeBoard>();
  console::Console console_{[this](const console::Options&) { return std::make_unique<FakeTransport>(board_); }};
  std::filesystem::path folder_;
};

// ---- what is right

TEST_F(Commands, GetShowsValueRangeAndMeaning) {
  const Said said = say("get axis1.current_limit_A");
  EXPECT_EQ(said.code, 0);
  EXPECT_NE(said.out.find("axis1.current_limit_A"), std::string::npos);
  EXPECT_NE(said.out.find("20   0 to 100"), std::string::npos) << said.out;
  EXPECT_EQ(json("get current_limit_A").size(), 2u);  // both axes
  EXPECT_EQ(json("get p*").size(), 4u);
  EXPECT_EQ(json("get").size(), 9u);  // four for each axis, one for the board
  EXPECT_EQ(json("get fan_delay_s")["fan_delay_s"]["unit"], "s");
}

TEST_F(Commands, SetChangesWhatItNamesAndNothingElse) {
  const FakeBoard::Values before = board_->in_force;
  EXPECT_EQ(say("set axis1.current_limit_A=12").code, 0);
  FakeBoard::Values expected = before;
  expected[{0x0111, 1}] = 12.0f;
  EXPECT_EQ(board_->in_force, expected);
  EXPECT_EQ(board_->saves, 0);
  const auto changed = json("set current_limit_A=10 pole_pairs=7 --save")["changed"];
  EXPECT_EQ(changed.size(), 4u);
  EXPECT_EQ(changed["axis1.current_limit_A"]["before"], 12.0);
  EXPECT_EQ(board_->saved, board_->in_force);
}

TEST_F(Commands, BackupThenRestoreBringsEachBitBack) {
  board_->in_force[{0x0101, 0}] = 0.1f + 0.2f;
  board_->in_force[{0x0101, 1}] = std::nextafter(1.0f, 2.0f);
  const FakeBoard::Values before = board_->in_force;
  EXPECT_EQ(say("backup " + path("mine.toml")).code, 0);
  EXPECT_NE(say("diff " + path("mine.toml")).out.find("No difference"), std::string::npos);
  EXPECT_EQ(say("set current_limit_A=3 phase_resistance_ohm=1").code, 0);
  EXPECT_EQ(json("diff " + path("mine.toml"))["differences"].size(), 4u);
  EXPECT_EQ(say("restore " + path("mine.toml")).code, 0);
  EXPECT_EQ(board_->in_force, before);
}

TEST_F(Commands, BothAxesAreWatchedOnTheSmallestUsualTerminal) {
  const console::TerminalSize size{80, 24};
  console::Live live(3);
  const std::string text = live.screen({}, 0, size, false);
  EXPECT_EQ(console::fitted(text, size.columns, size.rows).text, text) << text;
  EXPECT_NE(text.find("axis 1 iq"), std::string::npos) << text;
  EXPECT_EQ(text.find('\033'), std::string::npos);
}

TEST_F(Commands, RestoreSaysWhereTheFileIsAnotherBoards) {
  EXPECT_EQ(say("backup " + path("mine.toml")).code, 0);
  EXPECT_FALSE(json("restore " + path("mine.toml")).contains("note"));
  std::string other = content(path("mine.toml"));
  const std::string serial = "serial = \"";
  other.insert(other.find(serial) + serial.size(), "X");
  std::ofstream(path("other.toml")) << other;
  EXPECT_NE(json("restore " + path("other.toml"))["note"].get<std::string>().find("angle_offset_rad"),
            std::string::npos);
  EXPECT_NE(say("restore " + path("other.toml")).out.find("other.toml is of "), std::string::npos);
}

TEST_F(Commands, DiffTellsUnsetFromWhatTheFileDoesNotHave) {
  std::ofstream(path("p.toml")) << "[axis0]\nphase_resistance_ohm = nan\n";
  const auto differences = json("diff " + path("p.toml"))["differences"];
  EXPECT_TRUE(differences["axis0.phase_resistance_ohm"]["other"].is_null());
  EXPECT_TRUE(differences["axis0.phase_resistance_ohm"].contains("other"));
  EXPECT_FALSE(differences["axis0.current_limit_A"].contains("other"));
}

TEST_F(Commands, WhatStandsInCommonIsOfBothAxes) {
  std::ofstream(path("p.toml")) << "[common]\ncurrent_limit_A = 5\n";
  const auto changed = json("restore " + path("p.toml"))["changed"];
  EXPECT_EQ(changed["axis0.current_limit_A"]["after"], 5.0);
  EXPECT_EQ(changed["axis1.current_limit_A"]["after"], 5.0);
}

TEST_F(Commands, DiffAgainstDefaults) {
  EXPECT_EQ(json("diff")["differences"].size(), 2u);  // the resistance that has no default, on both axes
  EXPECT_EQ(say("set axis0.current_limit_A=3").code, 0);
  EXPECT_EQ(json("diff")["differences"]["axis0.current_limit_A"]["other"], 20.0);
}

TEST_F(Commands, SaveReachesTheBoard) {
  EXPECT_TRUE(json("save")["saved"]);
  EXPECT_EQ(board_->saves, 1);
}

TEST_F(Commands, RunArmsPlaysAndDisarms) {
  const auto summary = json("run \"5A 0.2s, 0A 0.1s\" --axis 1");
  EXPECT_NEAR(summary["seconds"], 0.3, 0.02);
  EXPECT_EQ(summary["peak_A"], 5.0);
  EXPECT_NEAR(board_->setpoints, 60, 4);  // 200 a second
  EXPECT_EQ(board_->armed, 0);
  EXPECT_NEAR(json("run \"5A 0.2s, 0A 0.1s\" --times 3")["seconds"], 0.9, 0.02);
  refused("run \"5A 1s\" --times 0", 2, "it may be 1 to 1000");
}

TEST_F(Commands, ABoardThatDoesNotAnswerADisarmIsNotCalledDisarmed) {
  board_->before = [](Kind kind) { return kind != Kind::disarm; };
  const Said said = say("run \"1A 0.1s\"");
  EXPECT_EQ(said.code, 7);
  EXPECT_NE(said.err.find("no answer when asked to disarm axis 0"), std::string::npos) << said.err;
  EXPECT_EQ(said.out.find("Done"), std::string::npos) << said.out;
}

TEST_F(Commands, NoTemperatureIsToldThatTheBoardDidNotSay) {
  for (const std::string line : {"arm --seconds 0", "run \"1A 0.0000001ms\""}) {
    const auto shortest = json(line);
    EXPECT_EQ(shortest["core_start_degC"], 30.0) << line;
    EXPECT_EQ(shortest["core_peak_degC"], 30.0) << line;
  }
  board_->temperature_degC = -10.0f;
  EXPECT_EQ(json("run \"1A 0.1s\"")["core_peak_degC"], -10.0);
}

TEST_F(Commands, OfBothAxesEachIsTold) {
  board_->axis1_limit = static_cast<std::uint8_t>(wire::Limit::core_hot);
  const auto both = json("run \"2A 0.5s\" --axis both");
  EXPECT_EQ(both["axis0"]["held_back_s"], 0.0);
  EXPECT_GT(both["axis1"]["held_back_s"], 0.4);
  EXPECT_EQ(both["axis1"]["limit"], "core_hot");
  const std::string out = say("run \"2A 0.5s\" --axis both").out;
  EXPECT_NE(out.find("Axis 0: done in 0.5"), std::string::npos) << out;
  EXPECT_NE(out.find("Axis 1: done in 0.5"), std::string::npos) << out;
  EXPECT_NE(out.find("because the winding is close to its limit"), std::string::npos) << out;
}

TEST_F(Commands, TheModeIsChosenToldAndKeptToItsUnit) {
  EXPECT_EQ(json("mode")["axis1"]["control"], "current");
  EXPECT_EQ(json("mode torque --axis 1")["axis1"]["control"], "torque");
  EXPECT_EQ(say("mode").out, "axis 0: current mode, setpoints in A\naxis 1: torque mode, setpoints in N m\n");
  EXPECT_NE(say("watch --json --seconds 0").out.find("\"control\":\"torque\""), std::string::npos);
  EXPECT_NE(say("watch --seconds 0").out.find("torque "), std::string::npos);
  EXPECT_EQ(json("run \"50mNm 0.1s, 0Nm 0.1s\" --axis 1")["peak_A"].get<float>(),
            0.05f);  // the script's board: as asked
  EXPECT_EQ(say("arm --torque 0.2 --seconds 0.1 --axis 1").code, 0);
  refused("run \"20A 1s\" --axis 1", 8,
          "Axis 1 is in torque mode and takes no A; a board of --sim is gone with its process, so say "
          "'mode current --axis 1' at the prompt of 'hotcore --sim', then this.");
  refused("identify --axis 1 --out " + path("torque"), 8, "Axis 1 is in torque mode and takes no A");
  refused("run \"1Nm 1s\"", 8, "Axis 0 is in current mode and takes no N m");
  refused("arm --torque 0.01 --axis both", 8, "'mode torque --axis 0'");
  EXPECT_EQ(board_->armed, 0);
  board_->armed = 2;
  refused("mode current", 8, "refused to put both axes in current mode: axis 0: the axis is armed");
  refused("mode voltage", 2, "MODE");
  refused("run \"1A 1s, 1Nm 1s\"", 2, "has another unit than the pieces before it");
  refused("arm --iq 1 --torque 1", 2, "excludes");
}

TEST_F(Commands, AShaftThatShouldTurnAndStandsIsToldBeforeAnythingIsMadeOfIt) {
  console::Session session(std::make_unique<FakeTransport>(board_));
  const auto play = [&](float turning_rad_per_s) {
    console::Armed armed(session, 1);
    return console::drive(
        session, 1, {{1.0f, 12.0f}}, console::Along::d, [](const wire::State&, double) {}, turning_rad_per_s)[0];
  };
  EXPECT_NEAR(play(0).seconds, 12, 0.1);
  try {
    (void)play(120);
    FAIL();
  } catch (const wire::pc::UserError& error) {
    EXPECT_EQ(error.exit_code(), 3);
    EXPECT_NE(std::string(error.what()).find("The shaft of axis 0 does not turn"), std::string::npos) << error.what();
  }
  EXPECT_EQ(board_->armed, 0);
}

TEST_F(Commands, ArmedIsSaidOnceItIs) {
  EXPECT_EQ(say("arm --iq 2 --seconds 0.1").err, "Armed at 2 A; Ctrl-C disarms.\n");
  refused("arm --iq 1e9", 8, "Axis 0 refused the setpoint 1e+09 A: the setpoint is not a number or beyond any board");
  board_->fault = static_cast<std::uint8_t>(wire::Fault::over_current);
  refused("arm --iq 2", 8, "refused to arm axis 0: the axis has tripped");
  EXPECT_EQ(board_->armed, 0);
}

TEST_F(Commands, AWrongModeIsToldWithTheCommandThatHelps) {
  EXPECT_EQ(say("mode").code, 0);  // there is a board now, and from here on it counts as a real one
  console_.options.sim = false;
  testing::internal::CaptureStderr();
  const int code = console::run_line(console_, [&](CLI::App& app) { app.parse("arm --torque 0.01 --axis 1"); });
  EXPECT_EQ(code, 8);
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "Axis 1 is in current mode and takes no N m; say 'hotcore mode torque --axis 1' first.\n");
  EXPECT_EQ(board_->armed, 0);
}

TEST_F(Commands, AFaultIsClearedInEitherMode) {
  board_->control[0] = wire::ControlMode::torque;
  board_->fault = static_cast<std::uint8_t>(wire::Fault::over_current);
  board_->evidence = {{}, board_->fault, 0, 0, 31.5f, 30.0f, 2.0f};
  board_->before = [&](Kind kind) {
    EXPECT_TRUE(kind != Kind::clear || board_->setpoints == 1);
    return true;
  };
  EXPECT_TRUE(json("fault --axis 0 --clear")["axis0"]["cleared"]);
  EXPECT_EQ(json("watch --seconds 0")["axes"][0]["fault"], "none");
}

TEST_F(Commands, StopDisarms) {
  board_->armed = 3;
  EXPECT_EQ(say("stop").code, 0);
  EXPECT_EQ(board_->armed, 0);
}

TEST_F(Commands, AFaultIsToldWithEvidenceAndAdvice) {
  board_->fault = static_cast<std::uint8_t>(wire::Fault::over_current);
  board_->evidence = {{}, board_->fault, 0, 0, 31.5f, 30.0f, 2.0f};
  const std::string out = say("fault --axis 0").out;
  for (const char* words : {"passed the trip level", "31.5 A", "30 A", "2.0 s ago", "check the motor leads"})
    EXPECT_NE(out.find(words), std::string::npos) << out;
  EXPECT_TRUE(json("fault --axis 0 --clear")["axis0"]["cleared"]);
  EXPECT_EQ(board_->fault, 0);
}

TEST_F(Commands, AskSaysWhatWouldHappen) {
  const auto outlook = json("ask \"20A 0.3s, 6A 5s\"");
  EXPECT_FALSE(outlook["feasible"]);
  EXPECT_NEAR(outlook["share_before_limit"].get<double>(), 0.8, 1e-6);
  EXPECT_NE(say("ask \"20A 0.3s\"").out.find("after 0.21 s"), std::string::npos);
}

TEST_F(Commands, AskAnswersForARotorThatStandsUnlessItIsSaidToTurn) {
  const Said said = say("ask \"20A 0.3s\"");
  EXPECT_EQ(said.out,
            "Not in full where the rotor stands; --turning answers for one that turns.\n"
            "  standing, the hottest phase at any angle:  the limit is met after 0.21 s and 80 % of the "
            "ampere-seconds; from there on "
            "less is delivered (unlimited, doubt included, the winding would reach 171 degC).\n"
            "  turning, all phases share the heat:        the hottest winding would reach 98.0 degC, doubt included.\n"
            "  It does not fit after any rest that the board can look beyond, 60 s with the course itself.\n");
  const auto outlook = json("ask \"20A 0.3s\"");
  EXPECT_EQ(outlook["assumed"], "standing");
  EXPECT_FALSE(outlook["standing"]["feasible"]);
  EXPECT_TRUE(outlook["turning"]["feasible"]);
  EXPECT_EQ(say("ask \"20A 0.3s\" --turning").out.find("Yes, as long as it turns."), 0u);
  EXPECT_TRUE(json("ask \"20A 0.3s\" --turning")["feasible"]);
  std::swap(board_->standing, board_->turning);  // no board should say so; then the colder answer is not taken
  EXPECT_FALSE(json("ask \"20A 0.3s\"")["feasible"]);
  board_->standing = board_->turning;
  EXPECT_EQ(say("ask \"20A 0.3s\" --turning").out.find("Not in full, standing or turning."), 0u);
}

TEST_F(Commands, AskSaysHowLongToRest) {
  board_->enough_rest_s = 12;
  EXPECT_NEAR(json("ask \"20A 0.3s\"")["wait_s"].get<double>(), 12.3, 0.3);
  EXPECT_NE(say("ask \"20A 0.3s\"").out.find("  After 12 s of rest it fits.\n"), std::string::npos);
  EXPECT_EQ(json("ask \"20A 0.3s\" --turning")["wait_s"], 0.0) << "it fits at once";
  board_->enough_rest_s = 0.2f;
  EXPECT_NEAR(json("ask \"20A 0.3s\"")["wait_s"].get<double>(), 0.205, 0.006);
  board_->enough_rest_s = 50;
  EXPECT_TRUE(json("ask \"20A 11s\"")["wait_s"].is_null()) << "the board does not look that far";
}

TEST_F(Commands, AskCountsTorqueAsTheAxisWould) {
  board_->standing = board_->turning;
  ASSERT_EQ(say("set axis1.pole_pairs=7 axis1.flux_linkage_Wb=0.002").code, 0);
  ASSERT_EQ(say("ask \"210mNm 0.3s, -0.021Nm 1s\" --axis 1").code, 0);
  ASSERT_EQ(board_->course.size(), 2u);
  EXPECT_NEAR(board_->course[0].current_A, 10, 1e-3);
  EXPECT_NEAR(board_->course[1].current_A, -1, 1e-4);
  ASSERT_EQ(say("set axis1.current_limit_A=9").code, 0);
  refused("ask \"210mNm 0.3s\" --axis 1", 2, "10 A is more than the axis ever gives, axis1.current_limit_A is 9");
}

TEST_F(Commands, AskSaysNoYesToWhatTheAxisNeverGives) {
  ASSERT_EQ(say("set axis1.current_limit_A=12").code, 0);
  refused("ask \"1A 1s, -13A 1ms\" --axis 1", 2, "-13 A is more than the axis ever gives, axis1.current_limit_A is 12");
  EXPECT_EQ(say("ask \"13A 1ms\" --axis 0").code, 0);
}

TEST_F(Commands, CalibrateTellsOffsets) { EXPECT_EQ(json("calibrate")["axis1"]["offset_A"].size(), 3u); }

TEST_F(Commands, WatchGivesALineForEachState) {
  const Said said = say("watch --json --seconds 1 --rate 10");
  EXPECT_EQ(std::count(said.out.begin(), said.out.end(), '\n'), 11);
  const Said curves = say("watch axis0.iq_A --seconds 1");
  EXPECT_NE(curves.out.find("axis0.iq_A 22"), std::string::npos) << curves.out;
}

TEST_F(Commands, AWatchEndsWhenItShouldThoughTheBoardIsSlowerThanItsRate) {
  board_->before = [&](Kind kind) {
    if (kind == Kind::state) board_->pass(0.01);
    return true;
  };
  const Said said = say("watch --json --rate 1000 --seconds 1");
  EXPECT_EQ(said.code, 0) << said.err;
  EXPECT_LT(board_->now_s, 1.1);
  const auto states = std::count(said.out.begin(), said.out.end(), '\n');
  EXPECT_TRUE(states > 90 && states < 105) << states;
}

TEST_F(Commands, CtrlCEndsAWatchThatWaitsForItsNextState) {
  board_->passing = [&] {
    if (board_->now_s > 5) std::raise(SIGINT);
  };
  console::interrupted();  // from here on noted only
  EXPECT_EQ(say("watch --json --rate 0.01").code, 0);
  console::forget_interrupt();
  EXPECT_LT(board_->now_s, 6);
}

TEST_F(Commands, RowsOfAnEarlierSubscriptionStayOutOfALog) {
  ASSERT_EQ(say("log axis0.iq_A --out " + path("a.csv") + " --seconds 0.1 --rate 1000").code, 0);
  // One that was broken off left its telemetry on; some of it is under way while the next one is ordered.
  int orders = 0;
  board_->before = [&](Kind kind) {
    if (kind == Kind::subscribe && ++orders == 2) board_->unplugged = true;
    return true;
  };
  EXPECT_EQ(say("log axis0.iq_A --out " + path("b.csv") + " --seconds 0.1 --rate 1000").code, 7);
  board_->unplugged = false;
  board_->before = [&](Kind kind) {
    if (kind == Kind::subscribe) board_->pass(0.01);
    return true;
  };
  board_->to_pc.clear();
  ASSERT_EQ(say("log axis0.bus_V --out " + path("c.csv") + " --seconds 0.1 --rate 100").code, 0);
  EXPECT_EQ(content(path("c.csv")).find(",22\n"), std::string::npos) << content(path("c.csv"));  // iq_A
}

TEST_F(Commands, LogHasUnitsAPreambleAndIdentifysNames) {
  const auto said = json("log --out " + path("x.csv") + " --seconds 2 --rate 50");
  EXPECT_NEAR(said["rows"], 101, 1);
  const std::string text = content(path("x.csv"));
  EXPECT_NE(text.find("# board: fake FAKE01\n# firmware: 0.1\n# parameters: "), std::string::npos) << text;
  EXPECT_NE(text.find("\ntime_s,id_A,iq_A,speed_rad_per_s,bus_V,housing_degC,core_a_degC,mode,limit\n"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("\n0.020000,21,22,36,34,91,85,37,38\n"), std::string::npos) << text;
  EXPECT_NE(text.find("\n# mode: 0 off, 1 ready, 2 running, 3 tripped\n# limit: 0 none, 97 hardware, 98 core_hot, "),
            std::string::npos)
      << text;
  const std::string limits = text.substr(text.find("# limit:"), text.find("time_s,") - text.find("# limit:"));
  EXPECT_NE(limits.find(", 106 thermal_late"), std::string::npos) << limits;
  for (const char* no_limit : {"over_current", "parameters_unset"})
    EXPECT_EQ(limits.find(no_limit), std::string::npos) << limits;
  EXPECT_FALSE(std::filesystem::exists(path("x.csv.part")));
}

TEST_F(Commands, CaptureWritesRowsAroundItsTrigger) {
  const auto said =
      json("capture axis0.iq_A axis1.iq_A --trigger axis0.id_A --edge rising --level 2 --pre 30 --post 70 --out " +
           path("c.csv"));
  EXPECT_EQ(said["rows"], 100);
  const std::string text = content(path("c.csv"));
  EXPECT_NE(text.find("\n-0.001500,0,0\n"), std::string::npos) << text;
  EXPECT_NE(text.find("\n0.003450,99,99\n"), std::string::npos);
}

TEST_F(Commands, PeriodsThatABoardLostAreTimeInItsCapture) {
  board_->lost_periods = 2000;  // 0.1 s
  ASSERT_EQ(say("capture axis0.iq_A --pre 30 --post 400 --out " + path("c.csv")).code, 0);
  const std::string text = content(path("c.csv"));
  EXPECT_NE(text.find("\n-0.001500,0\n"), std::string::npos) << text;  // as without a gap
  EXPECT_NE(text.find("\n0.000000,30\n"), std::string::npos) << text;
  EXPECT_NE(text.find("\n0.119950,429\n"), std::string::npos) << text;
}

TEST_F(Commands, ATriggerIsOneSignal) {
  refused("capture axis1.iq_A --trigger iq_A --edge rising --out " + path("c.csv"), 2,
          "this may be axis0.iq_A or axis1.iq_A; say which");
  EXPECT_TRUE(is_empty());
}

TEST_F(Commands, TheListNamesTheSimulatedBoard) { EXPECT_EQ(json("list")[0]["serial"], "FAKE01"); }

TEST_F(Commands, UdevPrintsARule) {
  EXPECT_NE(say("udev").out.find("ATTR{idVendor}==\"1209\", ATTR{idProduct}==\"0001\""), std::string::npos);
}

TEST_F(Commands, CompletionKnowsTheBoardsOwnNames) {
  console_.options.sim = true;
  using Words = std::vector<std::string>;
  EXPECT_EQ(console::completions(console_, "ca", "ca"), (Words{"calibrate", "capture"}));
  EXPECT_EQ(console::completions(console_, "set axis1.cur", "axis1.cur"), Words{"axis1.current_limit_A="});
  EXPECT_EQ(console::completions(console_, "watch sp", "sp"), Words{"speed_rad_per_s"});
  EXPECT_EQ(console::completions(console_, "fault --c", "--c"), Words{"--clear"});
  EXPECT_EQ(console::completions(console_, "mode t", "t"), Words{"torque"});
  EXPECT_EQ(console::completions(console_, "dance --c", "--c"), Words{});
}

// ---- what is wrong
// ----------------------------------------------------------------------------------------------------

TEST_F(Commands, AnUnknownParameterGetsTheNearest) {
  refused("get axis0.current_", 2, "did you mean 'axis0.current_limit_A'");
  refused("get curent_limit_A", 2, "did you mean 'current_limit_A'");
  refused("set axis0.current_limt_A=3", 2, "did you mean 'axis0.current_limit_A'");
  refused("watch axis0.coer_a_degC", 2, "did you mean 'axis0.core_a_degC'");
}

TEST_F(Commands, AValueOutOfRangeGetsTheRange) {
  const auto before = board_->in_force;
  refused("set axis0.current_limit_A=500", 2, "0 to 100 A");
  refused("set pole_pairs=3.5", 2, "whole number");
  refused("set pole_pairs=seven", 2, "not a number");
  refused("set axis0.current_limit_A=12 axis0.pole_pairs=99", 2, "1 to 50");
  EXPECT_EQ(board_->in_force, before);
}

TEST_F(Commands, ASetThatContradictsItselfIsRefusedAsAWhole) {
  const auto before = board_->in_force;
  refused("set axis0.current_limit_A=90 axis0.phase_resistance_ohm=40", 8, "axis0.current_limit_A (0 to 100 A)");
  EXPECT_EQ(board_->in_force, before);
  EXPECT_EQ(say("set axis1.current_limit_A=9").code, 0);  // and nothing of it stays behind
  EXPECT_EQ(board_->in_force.at({0x0111, 0}), before.at({0x0111, 0}));
}

TEST_F(Commands, AnotherProtocolIsSaidSo) {
  board_->protocol = wire::protocol_version + 1;
  refused("get", 9, "use a newer hotcore");
  board_->protocol = 0;
  refused("get", 9, "update the firmware");
  board_->twist = [](Kind k, std::vector<std::uint8_t>& payload) {
    if (k == Kind::hello) payload.resize(12);  // an older one may be shorter
  };
  refused("get", 9, "speaks protocol 0 and this program");
}

TEST_F(Commands, ABoardThatGoesAwayDuringSaveSaysSo) {
  board_->before = [&](Kind kind) { return kind != Kind::save || !(board_->unplugged = true); };
  refused("save", 7, "unplugged when asked to save");
}

TEST_F(Commands, ASilentBoardIsGivenUp) {
  board_->before = [](Kind kind) { return kind != Kind::save; };
  refused("save", 7, "no answer when asked to save");
  EXPECT_EQ(say("get").code, 0);  // the next command looks anew
}

TEST_F(Commands, AnAnswerThatComesTooLateIsNotTakenForTheNext) {
  console::Session session(std::make_unique<FakeTransport>(board_));
  board_->late = Kind::state;
  EXPECT_THROW((void)session.state(), wire::pc::UserError);
  board_->temperature_degC = 99.0f;
  EXPECT_EQ(session.state().axis[0].core_degC, 99.0f);
}

TEST_F(Commands, AFileThatIsThereStaysUnlessForceIsSaid) {
  const auto old = [&](const std::string& name) { std::ofstream(path(name)) << "old"; };
  const std::string to_log = "log --seconds 0.1 --out ", to_capture = "capture axis0.iq_A --out ";
  for (const std::string& line : {to_log + path("x.csv"), to_capture + path("c.csv"), "backup " + path("b.toml")}) {
    const std::string name = line.substr(line.rfind('/') + 1);
    old(name);
    refused(line, 2, name + ": there is such a file already; choose another name, or say --force to write over it.");
    EXPECT_EQ(content(path(name)), "old");
    EXPECT_EQ(say(line + " --force").code, 0);
    EXPECT_GT(content(path(name)).size(), 10u);
  }
  std::filesystem::create_directories(path("i"));
  old("i/log.csv");
  refused("identify --out " + path("i"), 2, "i/log.csv: there is such a file already");
  EXPECT_EQ(content(path("i/log.csv")), "old");
}

/// Left by a hotcore that was killed, or in the hands of one that runs.
TEST_F(Commands, RowsThatWaitForTheirNameAreNotWrittenOver) {
  std::ofstream(path("x.csv.part")) << "old";
  refused("log --seconds 0.1 --out " + path("x.csv"), 2, "x.csv.part: another hotcore writes it now, or was killed");
  EXPECT_EQ(content(path("x.csv.part")), "old");
  EXPECT_EQ(say("log --force --seconds 0.1 --out " + path("x.csv")).code, 0);
}

TEST_F(Commands, AFullDiskEndsALogAtOnceAndLeavesWholeRows) {
  rlimit usual{};
  getrlimit(RLIMIT_FSIZE, &usual);
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit full = usual;
  full.rlim_cur = 10'000;
  setrlimit(RLIMIT_FSIZE, &full);
  const Said said = say("log --out " + path("x.csv") + " --seconds 1000");
  setrlimit(RLIMIT_FSIZE, &usual);
  std::signal(SIGXFSZ, SIG_DFL);
  EXPECT_EQ(said.code, 2);
  EXPECT_LT(board_->now_s, 100);
  const std::string text = content(path("x.csv"));
  EXPECT_GT(text.size(), 9'000u);
  EXPECT_EQ(text.back(), '\n');
  const auto rows = std::count(text.begin(), text.end(), '\n') - std::count(text.begin(), text.end(), '#') - 1;
  EXPECT_NE(said.err.find("the disk is full; make room and log again; " + path("x.csv") + " holds the " +
                          std::to_string(rows) + " rows until then.\n"),
            std::string::npos)
      << said.err << rows;
}

TEST_F(Commands, ADiskThatIsFullFromTheStartLeavesNoFile) {
  rlimit usual{};
  getrlimit(RLIMIT_FSIZE, &usual);
  std::signal(SIGXFSZ, SIG_IGN);
  board_->before = [&](Kind kind) {
    rlimit full = usual;
    if (kind == Kind::get) full.rlim_cur = 10, setrlimit(RLIMIT_FSIZE, &full);  // the preamble's
    return true;
  };
  const int code = console::run_line(console_, [&](CLI::App& app) { app.parse("--sim log --out " + path("x.csv")); });
  setrlimit(RLIMIT_FSIZE, &usual);
  std::signal(SIGXFSZ, SIG_DFL);
  EXPECT_EQ(code, 2);
  EXPECT_TRUE(is_empty());  // no .part either: the next log would take it for another's
}

TEST_F(Commands, ADeviceIsWrittenToAndNotPutAway) {
  for (const char* device : {"/dev/full", "/dev/null"}) {
    const std::string link = path(std::string(device).substr(5));
    std::filesystem::create_symlink(device, link);
    for (const std::string line : {"log --seconds 0.1 --out ", "capture axis0.iq_A --out ", "backup "}) {
      const Said said = say(line + link);
      EXPECT_EQ(said.code, device == std::string("/dev/full") ? 2 : 0) << line << said.err;
      EXPECT_TRUE(std::filesystem::is_symlink(link)) << line;
    }
  }
}

TEST_F(Commands, WhateverEndsALogItsRowsAreTold) {
  const std::string place = path("x.csv");
  console::LogFile file(place, "", {"iq_A"});
  const wire::pc::UserError stopped(wire::pc::Exit::interrupted, "Stopped and disarmed.");
  EXPECT_THROW(file.end(stopped), wire::pc::UserError);
  file.add(0.0, {1.0f});
  try {
    file.end(stopped);
  } catch (const wire::pc::UserError& error) {
    EXPECT_EQ(error.what(), "Stopped and disarmed; " + place + " holds the 1 rows until then.");
    EXPECT_EQ(error.exit_code(), 130);
  }
}

TEST_F(Commands, AFolderThatIsMissingIsToldAndNotMade) {
  for (const std::string line : {"log --seconds 0.1 --out ", "capture axis0.iq_A --out ", "backup "}) {
    refused(line + path("no/x"), 2, "no/x: there is no folder " + path("no") + "; make it, or choose another place.");
    refused(line + folder_.string(), 2, "this is a folder");
  }
  EXPECT_TRUE(is_empty());
  EXPECT_EQ(board_->setpoints, 0);
}

TEST_F(Commands, ABoardThatGoesAwayDuringBackupLeavesNoFile) {
  int gets = 0;
  board_->before = [&](Kind kind) { return kind != Kind::get || !(board_->unplugged = ++gets == 1); };
  refused("backup " + path("mine.toml"), 7, "check cable and power");
  EXPECT_TRUE(is_empty());
}

TEST_F(Commands, ABackupKeepsTheOldFileWhenItFails) {
  std::ofstream(path("mine.toml")) << "old";
  board_->before = [&](Kind kind) { return kind != Kind::get; };
  refused("backup --force " + path("mine.toml"), 7, "no answer");
  EXPECT_EQ(content(path("mine.toml")), "old");
}

TEST_F(Commands, ABoardThatGoesAwayWhileLoggingLeavesTheRowsUntilThen) {
  board_->twist = [&](Kind kind, std::vector<std::uint8_t>&) {
    if (kind == Kind::telemetry && board_->now_s > 1.0) board_->unplugged = true;
    EXPECT_FALSE(std::filesystem::exists(path("x.csv")));  // not under its name before its end
  };
  const Said said = say("log --out " + path("x.csv") + " --seconds 5 --rate 50");
  EXPECT_EQ(said.code, 7) << said.err;
  EXPECT_NE(said.err.find("x.csv holds the 51 rows until then.\n"), std::string::npos) << said.err;
  const std::string text = content(path("x.csv"));
  EXPECT_GT(std::count(text.begin(), text.end(), '\n'), 40);
  EXPECT_EQ(text.back(), '\n');
  EXPECT_FALSE(std::filesystem::exists(path("x.csv.part")));
}

TEST_F(Commands, ABoardThatGoesAwayWhileHandingOverACaptureLeavesTheRowsUntilThen) {
  int reads = 0;
  board_->before = [&](Kind kind) { return kind != Kind::capture_read || !(board_->unplugged = ++reads == 3); };
  refused("capture axis0.iq_A axis1.iq_A --pre 100 --post 100 --out " + path("c.csv"), 7,
          "c.csv holds the 116 rows until then.");
  const std::string text = content(path("c.csv"));
  EXPECT_NE(text.find("\n0.000750,115,115\n"), std::string::npos) << text;
  EXPECT_EQ(text.back(), '\n');
  EXPECT_FALSE(std::filesystem::exists(path("c.csv.part")));
}

TEST_F(Commands, ABoardThatGoesAwayBeforeTheFirstRowLeavesNoFile) {
  board_->before = [&](Kind kind) { return kind != Kind::capture_read || !(board_->unplugged = true); };
  refused("capture axis0.iq_A --out " + path("c.csv"), 7, "hand over the capture; check cable and power");
  EXPECT_TRUE(is_empty());
}

/// The prompt goes on after Ctrl-C, and what the board still sends has nobody to go to.
TEST_F(Commands, TelemetryAfterARecordingThatWasBrokenOffIsThrownAway) {
  console::Session session(std::make_unique<FakeTransport>(board_));
  {
    console::Recorder recorder(session, path("x.csv"), "axis 0", console::usual_signals(session.signals(), 0), 100);
    session.wait_until(session.now_s() + 0.5);
    EXPECT_GT(recorder.rows(), 40);
  }
  session.wait_until(session.now_s() + 0.5);  // asan sees it if somebody takes these
}

TEST_F(Commands, ABoardThatTripsEndsTheRunWithItsReason) {
  int seen = 0;
  board_->before = [&](Kind kind) {
    if (kind == Kind::setpoint && ++seen == 20) {
      board_->fault = static_cast<std::uint8_t>(wire::Fault::bus_over_voltage);
      board_->evidence = {{}, board_->fault, 0, 0, 59.0f, 58.0f, 0.0f};
    }
    return true;
  };
  const Said said = say("run \"5A 1s\"");
  EXPECT_EQ(said.code, 8);
  EXPECT_NE(said.err.find("the bus voltage passed its upper limit: 59 V"), std::string::npos) << said.err;
  EXPECT_EQ(board_->armed, 0);
  refused("run \"5A 1s\"", 8, "refused to arm axis 0: the axis has tripped");
}

TEST_F(Commands, CtrlCDisarms) {
  int seen = 0;
  board_->before = [&](Kind kind) {
    if (kind == Kind::setpoint && ++seen == 20) std::raise(SIGINT);
    return true;
  };
  const Said said = say("arm --iq 2");
  EXPECT_EQ(said.code, 130);
  EXPECT_EQ(seen, 20);
  EXPECT_EQ(board_->armed, 0);
  console::forget_interrupt();
}

TEST_F(Commands, AnAnswerThatIsCutShortIsNotBelieved) {
  for (const Kind kind : {Kind::hello, Kind::describe_parameter, Kind::get, Kind::ask, Kind::calibrate, Kind::fault}) {
    board_ = std::make_shared<FakeBoard>();
    console_.hang_up();
    board_->twist = [kind](Kind k, std::vector<std::uint8_t>& payload) {
      if (k == kind) payload.resize(payload.size() / 2);
    };
    const std::string line = kind == Kind::ask         ? "ask \"1A 1s\""
                             : kind == Kind::calibrate ? "calibrate"
                             : kind == Kind::fault     ? "fault"
                                                       : "get";
    refused(line, 9, "does not understand");
  }
}

TEST_F(Commands, ASheetAsksForTheEncodersAngleAndForABoardThatKnowsAllOfIt) {
  const std::string sheet = "motor " HOTCORE_SOURCE_DIR "/boards/motors/ec-16-40w.toml --yes --supply 48";
  refused(sheet, 2, "This board's firmware knows no C1_J_per_K");
  board_->parameters.push_back({0x0106, "angle_offset", "rad", "", -4.0f, 4.0f, std::nanf("")});
  for (const auto axis : {std::uint8_t{0}, std::uint8_t{1}}) board_->in_force[{0x0106, axis}] = std::nanf("");
  console_.hang_up();
  refused(sheet, 2, "axis0.angle_offset_rad is unset: say what the encoder reads");
  refused(sheet + " --angle-offset 1", 2, "knows no C1_J_per_K");
  refused("motor nowhere.toml --supply 48", 2, "nowhere.toml");
}

TEST_F(Commands, FilesThatAreWrongAreNamed) {
  const auto write = [&](const std::string& text) { std::ofstream(path("p.toml")) << text; };
  refused("restore " + path("nowhere.toml"), 2, "nowhere.toml: there is no such file");
  write("[axis0]\ncurrent_limit_A = 500\n");
  refused("restore " + path("p.toml"), 2, "p.toml: axis0.current_limit_A = 500 is out of range; it may be 0 to 100 A");
  write("[axis0]\ncurrent_limt_A = 5\n");
  refused("restore " + path("p.toml"), 2, "p.toml: the board has no parameter 'axis0.current_limt_A', did you mean");
  write("[axis0]\ncurrent_limit_A = \"much\"\n");
  refused("restore " + path("p.toml"), 2, "is no number");
  write("[axis0\n");
  refused("restore " + path("p.toml"), 2, "p.toml");
  write("[axis1]\ncurrent_limit_A = 5\n[common]\ncurrent_limit_A = 7\n");
  refused("restore " + path("p.toml"), 2, "p.toml: axis1.current_limit_A is given twice; give it one value.");
  write("");
  refused("restore " + path("p.toml"), 2, "no parameter in it");
}

TEST_F(Commands, WrongCommandLinesGetOneSentence) {
  refused("run \"5 bananas\"", 2, "no piece of a course");
  refused("run \"5A\"", 2, "no piece");
  refused("ask \"5A -1s\"", 2, "no piece");
  refused("arm --axis 2", 2, "--axis");
  refused("set current_limit_A", 2, "write name=value");
  refused("capture axis0.iq_A --pre 2000 --post 2000", 2, "at most 1024 rows");
  refused("log --out /proc/x.csv --seconds 1", 2, "cannot be written");
  refused("captre iq_A", 2, "There is no command 'captre', did you mean 'capture'?");
  refused("stop now", 2, "'now' was not expected");
  refused("get --bogus", 2, "'--bogus' was not expected");
  refused("set current_limit_A=5 axis1.current_limit_A=6", 2, "axis1.current_limit_A is given twice");
}

TEST_F(Commands, ANumberOutOfRangeGetsTheRangeBeforeAnythingMoves) {
  refused("arm --seconds -1", 2, "--seconds: -1 is out of range; it may be 0 to 1e+09");
  refused("watch --rate nan", 2, "nan is out of range; it may be 0.01 to 2000");
  refused("log --out " + path("x.csv") + " --rate 0", 2, "it may be 0.5 to 1e+06");
  refused("log --out " + path("x.csv") + " --rate fast", 2, "'fast' is not a number");
  refused("capture iq_A --pre -1", 2, "it may be 0 to 65535");
  refused("capture iq_A --post 0", 2, "it may be 1 to 65535");
  refused("capture iq_A --edge rising --level nan", 2, "nan is out of range");
  refused("ask \"5A 2min\"", 2, "The course lasts 120 s; the board looks 60 s ahead");
  EXPECT_TRUE(is_empty());
}

TEST_F(Commands, ALogIsOfOneAxisAndLeavesNothingOutInSilence) {
  refused("log --out " + path("x.csv") + " axis0.iq_A axis1.iq_A --seconds 0.1", 2, "axis1.iq_A is not of axis 0");
  EXPECT_TRUE(is_empty());
  EXPECT_EQ(say("log --out " + path("x.csv") + " axis1.iq_A bus_V --axis 1 --seconds 0.1").code, 0);
  EXPECT_NE(content(path("x.csv")).find("time_s,iq_A,bus_V\n"), std::string::npos);
}

TEST_F(Commands, WithJsonAnErrorIsJsonToo) {
  const Said said = say("get curent_limit_A --json");
  EXPECT_EQ(nlohmann::json::parse(said.out)["exit_code"], 2);
}

// ---- small parts
// ------------------------------------------------------------------------------------------------------

TEST_F(Commands, WithJsonWhatIsNoUtf8IsReplacedAndEndsNothing) {
  const Said said = say("--json get \xE4");
  EXPECT_EQ(said.code, 2);
  EXPECT_EQ(nlohmann::json::parse(said.out, nullptr, false)["exit_code"], 2) << said.out;
  EXPECT_TRUE(json("backup " + path("\xE4.toml")).contains("written"));
}

TEST_F(Commands, ACommandForAnotherBoardIsNotObeyedByThisOne) {
  ASSERT_EQ(say("stop").code, 0);
  EXPECT_EQ(say("stop --serial FAKE").code, 0);  // this one
  refused("run \"1A 0.1s\" --serial OTHER", 2, "This prompt talks to fake FAKE01; end it");
  console_.options.serial.clear();
  EXPECT_EQ(console::run_line(console_, [&](CLI::App& app) { app.parse("run \"1A 0.1s\" --motor other --sim"); }), 2);
  EXPECT_EQ(board_->setpoints, 0);
}

TEST(Profile, UnitsAreUnderstood) {
  const auto pieces = console::profile_in("20A 0.3s, -500mA 200 ms,6 2min", 10);
  ASSERT_EQ(pieces.size(), 3u);
  EXPECT_FLOAT_EQ(pieces[1].level, -0.5f);
  EXPECT_FLOAT_EQ(pieces[1].seconds, 0.2f);
  EXPECT_FLOAT_EQ(pieces[2].seconds, 120.0f);
}

TEST(Profile, BlanksAndSemicolonsAreTakenAsAPersonWritesThem) {
  const auto pieces = console::profile_in(" 20 A 0.3 s; 6A 5s ,\t-1.5 A  20 ms \t;", 10);
  ASSERT_EQ(pieces.size(), 3u);
  EXPECT_FLOAT_EQ(pieces[0].level, 20.0f);
  EXPECT_FLOAT_EQ(pieces[0].seconds, 0.3f);
  EXPECT_FLOAT_EQ(pieces[1].seconds, 5.0f);
  EXPECT_FLOAT_EQ(pieces[2].level, -1.5f);
  const auto torque = console::profile_in("50 mNm 0.3 s; 0 Nm 1 s", 10);
  EXPECT_EQ(torque.front().mode, wire::ControlMode::torque);
  EXPECT_FLOAT_EQ(torque.front().level, 0.05f);
  for (const char* wrong : {"", ";", "5A 1s;;5A 1s", "5A: 1s", "5 5 5", "A 1s"})
    EXPECT_THROW((void)console::profile_in(wrong, 10), wire::pc::UserError) << wrong;
}

TEST(Plot, AStepIsConnectedAndStaysInsideItsFrame) {
  console::Scale scale{"A", 1};
  const std::string text = console::plot({{"x", {0, 0, 0, 8, 8, 8}}}, scale, 24, 2, false);
  EXPECT_EQ(text,
            "         8 A          \u28B8\u2809\n"
            "         0 A         \u28C0\u2878 \n"
            "             x\n")
      << text;
  const float huge = std::numeric_limits<float>::max();
  for (const std::vector<float>& values :
       {std::vector<float>{huge, -huge, std::nanf(""), INFINITY}, {}, {0.0f}, {huge}, {1e-30f}}) {
    console::Scale fresh{"A", 1e-3};
    const std::string shown = console::plot({{"x", values}}, fresh, 20, 3, false);
    EXPECT_EQ(std::count(shown.begin(), shown.end(), '\n'), 4) << shown;
    EXPECT_TRUE(std::isfinite(fresh.low) && std::isfinite(fresh.high));
  }
}

TEST(Plot, TheScaleHasItsUnitEndsAtRoundNumbersAndOnlyGrows) {
  console::Scale scale{"degC", 10};
  const auto first_line = [&](const std::vector<float>& values) {
    const std::string text = console::plot({{"core", values}}, scale, 40, 4, false);
    return text.substr(0, text.find("C ") + 1);
  };
  EXPECT_EQ(first_line({29.28f}), "     36 degC");
  EXPECT_EQ(scale.low, 24);
  EXPECT_EQ(first_line({29.1f}), "     36 degC");  // inside: as it was
  EXPECT_EQ(first_line({38.4f}), "     40 degC");
  EXPECT_EQ(scale.low, 20);
  double low = scale.low, high = scale.high;
  for (float value = 30; value < 200; value += value * 0.05f) {
    (void)first_line({value, 60 - value});
    EXPECT_TRUE(scale.low <= low && scale.high >= high) << value;
    EXPECT_TRUE(scale.low <= double{60 - value} && scale.high >= double{value}) << value;
    low = scale.low, high = scale.high;
  }
}

TEST(Plot, WhatIsDrawnAgainFitsItsTerminal) {
  const std::string text = std::string(110, 'x') + "\n\033[36m\xe2\xa3\xbf\xe2\xa3\xbf\033[0m\n\nlast\n";
  EXPECT_EQ(console::fitted(text, 110, 24).rows, 4);
  EXPECT_EQ(console::fitted(text, 80, 24).rows, 5);  // the long line goes on below
  EXPECT_EQ(console::fitted(text, 2, 1000).rows, 55 + 1 + 1 + 2);
  EXPECT_EQ(console::fitted(text, 80, 24).text, text);
  EXPECT_EQ(console::fitted(text, 80, 5).text, text.substr(0, text.size() - 5));  // the cursor stands in the last row
}

}  // namespace

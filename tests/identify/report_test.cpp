// SPDX-License-Identifier: MIT
#include "identify/answer/report.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "identify/answer/answer.hpp"
#include "identify/answer/baseline.hpp"
#include "identify/answer/gain.hpp"
#include "identify/answer/held_out.hpp"
#include "identify/discover.hpp"
#include "identify/fit/fit.hpp"
#include "identify/fit/leeway.hpp"
#include "identify/fit/replayed.hpp"
#include "identify/search/problem_of.hpp"
#include "tests/identify/bench.hpp"
#include "tests/identify/says.hpp"

namespace {

using identify::Verdict;
using nlohmann::json;
using tests::says;

identify::Report report_of(const tests::BenchOptions& options, const identify::HoldOut& held = {}) {
  return identify::discover(tests::bench_logs({options}), tests::ec_16(), held);
}

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
  EXPECT_TRUE(j["experiment"].is_null());
  EXPECT_EQ(j.at("no_experiment"), "no causes tie");
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
    const auto problem = identify::problem_of(tests::bench_logs({options}), tests::ec_16());
    return identify::veto(problem, identify::fit(problem, {}),
                          identify::fit(problem, {{identify::cause_named(id), -1}}));
  };
  // A warm wind in the last of what is fitted looks like a drift, which the data after it does not go on with.
  options.extra_housing_W = [](double t, double, double) { return t > 750 && t < 900 ? 1.0 : 0.0; };
  says(veto("ambient_drift"), "refused");
  options.extra_housing_W = [](double t, double, double) { return 0.001 * t; };
  EXPECT_EQ(veto("ambient_drift"), "");
}

TEST(Report, AFanInOneLogIsNotCarriedIntoAnother) {
  tests::BenchOptions fan, still, unseen;
  for (auto* o : {&fan, &still, &unseen}) o->core_every_s = 20;
  fan.motor.R2 /= 4;
  still.seed = 2;
  unseen.seed = 3;
  const auto problem = identify::problem_of(tests::bench_logs({fan, still}), tests::ec_16());
  int cause = identify::cause_named("cooling_change");
  while (identify::causes()[static_cast<std::size_t>(cause)].edit != identify::Edit::cooling_of_log) ++cause;
  identify::HoldOut held;
  held.logs = tests::bench_logs({unseen});
  identify::Report report;
  const auto base = identify::fit(problem, {}), extended = identify::fit(problem, {{cause, 0}});
  const auto scored =
      identify::score_held_out(identify::unseen_of(problem, {}, held), problem, held, base, extended, report);
  EXPECT_LT(scored.after.core_K, 0.5);
  EXPECT_GT(scored.before.core_K, 2);
}

TEST(Report, AMotorThatWouldGlowUnderWhatWasHeldOutIsSaidTo) {
  const auto problem = identify::problem_of(tests::bench_logs({{}}), tests::ec_16());
  identify::HoldOut held;
  held.logs = tests::bench_logs({{}});
  identify::Fit base = identify::fit(problem, {}), lost = base;
  lost.x.head(2).array() += 6;  // as of a log without load: R1 and R2 are anything
  const auto scored = [&](const identify::Fit& before, const identify::Fit& after) {
    identify::Report report;
    return identify::score_held_out(identify::unseen_of(problem, {}, held), problem, held, before, after, report);
  };
  says(scored(lost, lost).against, "the model as fitted would glow");
  const identify::HeldOutScore better = scored(lost, base);
  says(better.against, "two resistors as fitted would glow");
  EXPECT_TRUE(std::isnan(better.before.housing_K));
  EXPECT_LT(better.after.housing_K, 1);
  EXPECT_EQ(scored(base, base).against, "");
}

/// Two logs of one motor, the second of which differs in one thing.
template <class Change>
identify::Report of_two_logs(Change change) {
  tests::BenchOptions one, other;
  for (auto* o : {&one, &other}) o->core_every_s = 20;
  other.seed = 2;
  auto logs = tests::bench_logs({one, other});
  logs[0].name = "one.csv";
  logs[1].name = "other.csv";
  change(logs[1]);
  return identify::discover(logs, tests::ec_16());
}

TEST(SlowReport, WhatIsOtherInOneLogAloneIsNamedForIt) {
  const auto expect = [](const identify::Report& report, const char* id) {
    ASSERT_EQ(report.causes.size(), 1u) << report.sentence;
    EXPECT_TRUE(names_causes(report.verdict)) << report.sentence;
    EXPECT_EQ(report.causes[0].id, id);
    says(report.causes[0].name, "here: other.csv");
    // Of that log, and not of the motor that a board is handed.
    EXPECT_EQ(report.model_toml.find("\"one\""), std::string::npos) << report.model_toml;
  };
  expect(of_two_logs([](identify::Log& log) {
           for (double& x : log.of(identify::Role::housing)) x += 3;
         }),
         "sensor_offset");
  expect(of_two_logs([](identify::Log& log) {
           for (double& x : log.of(identify::Role::housing)) x += 0.08 * (x - 25);
         }),
         "sensor_gain");
  expect(of_two_logs([](identify::Log& log) {
           for (double& x : log.of(identify::Role::ambient)) x += 5;
         }),
         "constant_heat");
}

/// Heat that goes by a speed: a bench's rotor stands, and is said to turn.
identify::Log turning(std::uint64_t seed, const char* name) {
  tests::BenchOptions options;
  options.core_every_s = 20;
  options.seed = seed;
  const auto speed = [seed](double t) {
    return std::fmod(t, 70.0 + 20.0 * static_cast<double>(seed)) < 60 ? 100.0 : 0.0;
  };
  options.extra_housing_W = [speed](double t, double, double) { return 0.02 * speed(t); };
  identify::Log log = tests::bench_logs({options}).front();
  log.name = name;
  for (std::size_t k = 0; k < log.of(identify::Role::time).size(); ++k)
    log.of(identify::Role::speed)[k] = speed(log.of(identify::Role::time)[k]);
  return log;
}

TEST(SlowReport, ALogWithoutTheColumnThatTheOthersAreExplainedByDoesNotSpeakAgainstThem) {
  const identify::Log told = turning(1, "told.csv");
  identify::Log untold = turning(2, "untold.csv");
  untold.of(identify::Role::speed).clear();
  identify::HoldOut held;
  held.logs = {untold};
  const identify::Report alone = identify::discover({told}, tests::ec_16(), held);
  ASSERT_EQ(alone.causes.size(), 1u) << alone.sentence;
  EXPECT_EQ(alone.sentence.find("do not rely"), std::string::npos) << alone.sentence;
  says(alone.sentence, "speed_rad_per_s, which what was found goes by, is missing in untold.csv");
  const identify::Report both = identify::discover({told, untold}, tests::ec_16());
  ASSERT_EQ(both.causes.size(), 1u) << both.sentence;
  EXPECT_EQ(both.causes[0].id, alone.causes[0].id) << both.sentence;
  says(both.sentence, "untold.csv was left out: speed_rad_per_s is missing in it");
}

TEST(SlowReport, MassesThatAFanInOneLogBendsAreNotTakenForSwappedColumns) {
  std::vector<identify::Log> logs;
  for (const std::uint64_t seed : {10, 11, 12}) {
    tests::BenchOptions options;
    options.seed = seed;
    options.seconds = 1800;
    options.rate_Hz = 2;
    options.core_every_s = 30;
    options.core_white_K = 0.8;
    options.motor.C2 = 10;
    if (seed == 12) options.motor.R2 /= 2.2;
    double mass_degC = options.start_degC;  // stepped with each of the four stages of 20 ms
    options.extra_housing_W = [&](double, double, double housing_degC) {
      const double taken_W = (housing_degC - mass_degC) / 3;
      mass_degC += 0.005 * taken_W / 12;
      return -taken_W;
    };
    logs.push_back(tests::bench_logs({options}).front());
  }
  const identify::Report report = identify::discover(logs, std::nullopt);
  EXPECT_EQ(report.sentence.find("swapped"), std::string::npos) << report.sentence;
  ASSERT_FALSE(report.tied.empty()) << report.sentence;
  for (const auto& ids : report.tied)
    EXPECT_NE(std::find(ids.begin(), ids.end(), "cooling_change"), ids.end()) << report.sentence;
  says(report.sentence, "noisy by 0.8 K");  // and not by what a fan alone leaves
}

TEST(SlowReport, AMassBesideARoomThatNobodyRecordedMayBeThatRoom) {
  tests::BenchOptions options;
  options.seconds = 1800;
  options.core_every_s = 20;
  double mass_degC = options.start_degC;  // stepped with each of the four stages of 20 ms
  options.extra_housing_W = [&](double, double, double housing_degC) {
    const double taken_W = (housing_degC - mass_degC) / 3;
    mass_degC += 0.005 * taken_W / 12;
    return -taken_W;
  };
  auto logs = tests::bench_logs({options});
  logs[0].of(identify::Role::ambient).clear();
  const identify::Report report = identify::discover(logs, tests::ec_16());
  says(report.sentence, "third_mass");
  says(report.sentence, "No ambient was recorded");
}

TEST(SlowReport, TwoEntriesOfOneIdAreToldApart) {
  tests::BenchOptions draught, fan;
  for (auto* o : {&draught, &fan}) o->core_every_s = 20;
  fan.motor.R2 /= 4;
  for (auto* o : {&draught, &fan}) {
    const double R2 = o->motor.R2;
    o->extra_housing_W = [R2](double t, double, double housing) { return t > 400 ? -(housing - 24) / R2 : 0; };
  }
  fan.seed = 2;
  const identify::Report report = identify::discover(tests::bench_logs({draught, fan}), tests::ec_16());
  EXPECT_EQ(report.tied.front(), (std::vector<std::string>{"cooling_change", "cooling_change"})) << report.sentence;
  says(report.sentence, "cooling_change at a moment");
  says(report.sentence, "cooling_change of one log");
  ASSERT_TRUE(report.gain);
  says(report.gain->like, "cooling_change at a moment");
}

TEST(SlowReport, WhatWasHeldOutMaySpeakAgainstTheAnswer) {
  tests::BenchOptions fitted, held_out;
  for (auto* o : {&fitted, &held_out}) o->core_every_s = 20;
  held_out.seed = 2;
  const auto sentence = [&] {
    identify::HoldOut held;
    held.logs = tests::bench_logs({held_out});
    const identify::Report report = identify::discover(tests::bench_logs({fitted}), tests::ec_16(), held);
    EXPECT_NE(report.verdict, Verdict::unknown_cause);
    const json told = json::parse(identify::as_json(report))["held_out"]["against"];
    EXPECT_EQ(told.is_null(), report.sentence.find("held out") == std::string::npos) << told;
    return report.sentence;
  };
  EXPECT_EQ(sentence().find("held out"), std::string::npos);
  held_out.motor.R2 *= 2;  // in still air, say
  says(sentence(), "something in it is not in what was fitted");
  held_out.motor.R2 /= 2;
  fitted.extra_housing_W = [](double t, double, double) { return 0.003 * t; };  // a room that warms, but there
  says(sentence(), "do not rely on it");
}

TEST(SlowReport, WhereTheHeatDoesNotDependOnTheWindingNoWindingIsStatedFromTheHousing) {
  tests::BenchOptions options;
  options.seconds = 2400;
  EXPECT_EQ(identify::discover(tests::bench_logs({options}), tests::ec_16()).core_refusal, "");
  options.motor.copper = 0;
  const identify::Report report = identify::discover(tests::bench_logs({options}), tests::ec_16());
  ASSERT_EQ(report.causes.size(), 1u) << report.sentence;
  EXPECT_EQ(report.causes[0].id, "copper_coefficient");
  EXPECT_NE(report.core_refusal, "");
  EXPECT_FALSE(report.gain);
}

TEST(SlowReport, EachOfTwoCausesHasEvidenceOfItsOwnAndTheNextBestInItsPlace) {
  tests::BenchOptions options;
  options.core_every_s = 20;
  options.seconds = 1800;
  options.extra_housing_W = [](double, double current, double) { return 0.6 * current * current; };
  const json one = json::parse(identify::as_json(report_of(options)));
  ASSERT_EQ(one["causes"].size(), 1u) << one["sentence"];
  ASSERT_EQ(one["verdict"], "explained");
  EXPECT_GE(one["causes"][0]["rivals"].size(), 1u);
  EXPECT_LE(one["causes"][0]["rivals"].size(), 3u);
  options.extra_housing_W = [](double t, double current, double) {
    return 0.6 * current * current + (t > 900 ? 2 : 0);
  };
  const json two = json::parse(identify::as_json(report_of(options)));
  ASSERT_EQ(two["causes"].size(), 2u) << two["sentence"];
  const double alone = one["causes"][0]["delta_bic"], first = two["causes"][0]["delta_bic"],
               second = two["causes"][1]["delta_bic"];
  EXPECT_NE(first, second);
  EXPECT_GT(std::min(first, second), 10) << "what a second cause must gain";
  EXPECT_GT(alone, 10);
}

TEST(SlowReport, APowerOfWhichTheWindingGetsAnotherShareInOneLogIsNamed) {
  tests::BenchOptions one, other;
  for (auto* o : {&one, &other}) o->core_every_s = 2;
  one.power_gain = 1;
  other.power_gain = 1.4;  // recorded over true
  other.seed = 2;
  const identify::Report report = identify::discover(tests::bench_logs({one, other}), tests::ec_16());
  ASSERT_EQ(report.verdict, Verdict::explained) << report.sentence;
  ASSERT_EQ(report.causes.size(), 1u) << report.sentence;
  EXPECT_EQ(report.causes[0].id, "power_share");
  EXPECT_NEAR(std::abs(std::log(report.causes[0].parameters[0].value)), std::log(1.4), 0.02);
  other.power_gain = 1;
  EXPECT_EQ(identify::discover(tests::bench_logs({one, other}), tests::ec_16()).verdict, Verdict::adequate);
}

TEST(SlowReport, ACurrentThatOneLogScalesOtherwiseIsNamed) {
  tests::BenchOptions one, other;
  for (auto* o : {&one, &other}) o->core_every_s = 2;
  other.seed = 2;
  std::vector<identify::Log> logs = tests::bench_logs({one, other});
  EXPECT_EQ(identify::discover(logs, tests::ec_16()).verdict, Verdict::adequate);
  for (double& A : logs[1].of(identify::Role::current)) A *= 0.95;
  const identify::Report report = identify::discover(logs, tests::ec_16());
  ASSERT_EQ(report.verdict, Verdict::explained) << report.sentence;
  ASSERT_EQ(report.causes.size(), 1u) << report.sentence;
  EXPECT_EQ(report.causes[0].id, "current_scale");
  EXPECT_NEAR(std::abs(std::log(report.causes[0].parameters[0].value)), -std::log(0.95), 0.01);
}

TEST(Report, TwoResistorsAreComparedAsNearAsTheyCome) {
  tests::BenchOptions options;
  options.extra_housing_W = [mass_degC = options.ambient_degC](double, double, double housing_degC) mutable {
    const double to_mass_W = (housing_degC - mass_degC) / 4;
    mass_degC += 0.005 * to_mass_W / 100;  // four times in a step of 20 ms
    return -to_mass_W;
  };
  options.current_A = [](double t, std::mt19937_64&) { return std::fmod(t, 60) < 30 ? 4 : 1; };
  identify::Problem problem = identify::problem_of(tests::bench_logs({options}), std::nullopt);
  identify::Fit averaging = identify::fit(problem, {});
  problem.leeway = identify::ordinary_leeway(problem, averaging);
  averaging = identify::fit(problem, {}, {&averaging});
  const identify::Fit near = identify::closest(problem, averaging);
  const auto missed_K = [&](const identify::Fit& f) { return identify::rmse_of(problem, f).housing_K; };
  EXPECT_LT(missed_K(near), 0.9 * missed_K(averaging));
  for (int i = 0; i < identify::base_count; ++i) {
    for (const double step : {-0.05, 0.05}) {
      identify::Fit other = near;
      other.x[i] += step;
      EXPECT_GT(missed_K(other), 0.99 * missed_K(near)) << i;
    }
  }
}

TEST(Report, TheSentenceIsOfTheChannelThatShowsMore) {
  identify::Found found;
  found.verdict = Verdict::explained;
  found.tied = {{"sensor_lag"}};
  found.noise.core_white_K = 1;
  identify::Report report;
  const auto told_of = [&](const identify::Rmse& two_resistors, const identify::Rmse& extended) {
    report.baseline_rmse = two_resistors;
    report.extended_rmse = extended;
    identify::say({}, found, report);
    return report.sentence;
  };
  says(told_of({.housing_K = 0.13, .core_K = 1.11}, {.housing_K = 0.26, .core_K = 1.01}), "misses the winding");
  says(told_of({.housing_K = 0.26, .core_K = 1.11}, {.housing_K = 0.13, .core_K = 1.01}), "misses the housing");
  says(told_of({.housing_K = 0.26, .core_K = 3.0}, {.housing_K = 0.13, .core_K = 1.01}), "misses the winding");
  const double none = identify::missing;
  says(told_of({.housing_K = none, .core_K = 1.11}, {.housing_K = none, .core_K = 1.01}), "misses the winding");
  says(told_of({.housing_K = 0.26, .core_K = none}, {.housing_K = 0.13, .core_K = none}), "misses the housing");
}

TEST(Report, TheGainSaysWhatTheBoardWouldDoWithEachModel) {
  tests::BenchOptions options;
  options.core_every_s = 20;
  options.extra_housing_W = [](double, double current, double) { return 0.6 * current * current; };
  const identify::Report report = report_of(options);
  ASSERT_EQ(report.verdict, Verdict::explained) << report.sentence;
  ASSERT_TRUE(report.gain);
  EXPECT_LT(report.gain->overshoot_after_K, 0.5) << "the model that is the motor keeps its limit";
  EXPECT_GT(report.gain->burst_s_after, 0);
  EXPECT_NE(report.gain->continuous_A_before, report.gain->continuous_A_after);
  const json gain = json::parse(identify::as_json(report)).at("gain");
  for (const char* key : {"overshoot_before_K", "overshoot_after_K", "burst_s_before", "burst_s_after",
                          "continuous_A_before", "continuous_A_after"})
    EXPECT_TRUE(gain.at(key).is_number()) << key;
  says(identify::as_text(report, false), "What it is worth");
  says(identify::as_html(report), "What it is worth");
}

TEST(Report, OfModelsThatCannotBeToldApartTheMostCautiousIsTaken) {
  tests::BenchOptions options;
  options.core_every_s = 20;
  const auto problem = identify::problem_of(tests::bench_logs({options}), tests::ec_16());
  const identify::Fit found = identify::fit(problem, {});
  identify::Fit light = found, heavy = found;
  light.x[2] -= 0.5;  // ln of the winding's capacity
  heavy.x[2] += 0.5;
  const auto offer = [](const identify::Fit& f) { return identify::Offer{f, thermal::identified_trust}; };
  EXPECT_EQ(identify::most_cautious(problem, {offer(found), offer(light), offer(heavy)}).fit.x, light.x);
  EXPECT_EQ(identify::most_cautious(problem, {offer(heavy), offer(found)}).fit.x, found.x);
  identify::Fit wrapped = found;
  wrapped.x[1] += 0.3;  // ln R2: a third more of the rise, which a push does not show
  const identify::Offer given = identify::most_cautious(problem, {offer(light), offer(wrapped)});
  EXPECT_EQ(given.fit.x, light.x);
  EXPECT_NEAR(given.trust.cooling, 0.5 * (std::exp(0.3) - 1), 0.05) << "doubted by what the other carries less";
  EXPECT_EQ(identify::most_cautious(problem, {offer(light), offer(found)}).trust.cooling,
            thermal::identified_trust.cooling);
}

TEST(Report, WhatOnlyOneLogHasIsSaidOfTheOthers) {
  tests::BenchOptions options;
  options.seconds = 120;
  auto logs = tests::bench_logs({options, options});
  logs[1].name = "the other";
  logs[1].of(identify::Role::speed).clear();
  const auto notes = identify::discover(logs, std::nullopt).notes;
  EXPECT_EQ(std::count(
                notes.begin(), notes.end(),
                "the other: speed_rad_per_s is missing, which another log has; nothing in it is taken to go by speed."),
            1);
}

TEST(SlowReport, LogsOfOneNameAreToldApartByTheirFolders) {
  tests::BenchOptions options;
  options.seconds = 120;
  auto logs = tests::bench_logs({options, options, options});
  logs[0].name = "out/d5/log.csv";
  logs[1].name = "out/d7/log.csv";
  logs[2].name = "out/d7/fan.csv";
  const auto plots = identify::discover(logs, std::nullopt).plots;
  EXPECT_EQ(plots[0].name, "d5/log.csv");
  EXPECT_EQ(plots[1].name, "d7/log.csv");
  EXPECT_EQ(plots[2].name, "fan.csv");
}

TEST(Report, WhatIsSoOfEveryLogIsSaidOnce) {
  tests::BenchOptions options;
  options.seconds = 120;
  auto logs = tests::bench_logs({options, options});
  logs[1].name = "the other";
  for (auto& log : logs) log.notes = {"bus_V is not used."};
  logs[1].notes.push_back("A hole.");
  const auto notes = identify::discover(logs, std::nullopt).notes;
  EXPECT_EQ(std::count(notes.begin(), notes.end(), "bus_V is not used."), 1);
  EXPECT_EQ(std::count(notes.begin(), notes.end(), "the other: A hole."), 1);
  EXPECT_EQ(std::count(notes.begin(), notes.end(), "the other: bus_V is not used."), 0);
}

TEST(Report, WithoutASheetTheOhmIsSaidToBeThreeQuartersOfTheTerminals) {
  tests::BenchOptions options;
  options.seconds = 120;
  std::string said;
  for (const std::string& note : identify::discover(tests::bench_logs({options}), std::nullopt).notes)
    said += note + "\n";
  says(said, "3/4 of the resistance between two terminals, 3/2 of a phase's");
}

TEST(SlowReport, OfALogThatTellsNoRoomTheRoomIsARival) {
  tests::BenchOptions options;
  options.seconds = 1800;
  options.start_degC = 40;
  auto logs = tests::bench_logs({options});
  EXPECT_EQ(identify::discover(logs, tests::ec_16()).verdict, Verdict::adequate);
  logs[0].of(identify::Role::ambient).clear();
  const identify::Report report = identify::discover(logs, tests::ec_16());
  ASSERT_NE(report.verdict, Verdict::adequate);
  says(report.sentence, "No ambient was recorded: a room that is not as warm as what the log begins at");
  EXPECT_EQ(report.model_toml.find("gain = -"), std::string::npos) << "heat out of the housing, for a board";
}

TEST(SlowReport, ARoomThatSwungUnwatchedByTenthsOfAKelvinIsNoCause) {
  int seen = 0;
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    tests::BenchOptions options;
    options.seconds = 2400;
    options.room_K = 0.4;
    options.core_every_s = 10;
    options.current_A = [](double t, std::mt19937_64&) {  // never at rest, where the room's swing would count as noise
      return 1 + 2.5 * std::fmod(std::floor(t / 45) * 0.618, 1.0);
    };
    options.white_K = 0.05;
    options.step_K = 0.01;
    options.slow_K = 0.02;
    options.seed = seed;
    auto logs = tests::bench_logs({options});
    EXPECT_EQ(identify::discover(logs, tests::ec_16()).verdict, Verdict::adequate) << seed;
    logs[0].of(identify::Role::ambient).clear();
    EXPECT_EQ(identify::discover(logs, tests::ec_16()).verdict, Verdict::adequate) << seed << ", room not told";
    logs[0].of(identify::Role::ambient).assign(logs[0].of(identify::Role::time).size(), 24);
    seen += identify::discover(logs, tests::ec_16()).verdict != Verdict::adequate;
    logs[0].sink_typed = true;
    EXPECT_EQ(identify::discover(logs, tests::ec_16()).verdict, Verdict::adequate) << seed << ", room typed";
  }
  EXPECT_GE(seen, 2) << "of four that are told a still room: what this test is about";
}

TEST(SlowReport, R1OfAnUnseenWindingIsAsUnsureAsItIsWrong) {
  double most = 0, most_of_curvature = 0;
  const std::optional<wire::pc::MotorFile> sheets[] = {std::nullopt, tests::ec_16()};
  for (const double exponent : {0.05, 0.1}) {
    tests::BenchOptions options;
    options.seconds = 1200;
    options.white_K = 0.05;
    options.slow_K = 0.02;
    options.step_K = 0.02;
    options.extra_housing_W = [&](double, double, double housing_degC) {
      const double rise_K = std::max(0.0, housing_degC - options.ambient_degC);
      return rise_K / options.motor.R2 * (1 - std::pow(rise_K / 30, exponent));
    };
    const auto logs = tests::bench_logs({options});
    for (const auto& sheet : sheets) {
      const double right = std::log(options.motor.R1 * (sheet ? 1 : options.motor.ohm));  // else in units of one ohm
      const auto off = [&](const identify::ParameterLine& R1) {
        return std::abs(std::log(R1.value) - right) / (R1.std_error / R1.value);
      };
      most = std::max(most, off(identify::discover(logs, sheet).baseline[0]));
      const identify::Problem problem = identify::problem_of(logs, sheet);
      most_of_curvature =
          std::max(most_of_curvature, off(identify::base_lines(problem, identify::fit_baseline(problem), 1)[0]));
    }
  }
  EXPECT_LT(most, 3);
  EXPECT_GT(most_of_curvature, 3) << "what this test is about";
}

TEST(SlowReport, ALateSensorInTheWindingIsNamedAndTheMotorBehindItFound) {
  for (const double lag_s : {0.0, 2.0, 8.0}) {
    tests::BenchOptions options;
    options.seconds = 1800;
    options.core_every_s = 0.1;
    options.core_lag_s = lag_s;
    const identify::Report report = report_of(options);
    if (lag_s == 0) {
      EXPECT_EQ(report.verdict, Verdict::adequate) << report.sentence;
      continue;
    }
    ASSERT_EQ(report.causes.size(), 1u) << lag_s << ": " << report.sentence;
    EXPECT_EQ(report.causes[0].id, "winding_sensor_lag") << lag_s;
    EXPECT_NEAR(report.causes[0].parameters[0].value, lag_s, 0.1 * lag_s);
    EXPECT_NEAR(report.extended[0].value, options.motor.R1, 0.05 * options.motor.R1);
    EXPECT_NEAR(report.extended[2].value, options.motor.C1, 0.1 * options.motor.C1);
  }
}

TEST(SlowReport, ALoadThatAlternatesBetweenRowsIsNoCause) {
  tests::BenchOptions options;
  options.seconds = 1200;
  options.current_A = [](double t, std::mt19937_64&) {  // steps of 1.3 Hz, in spells of a minute
    return std::fmod(t, 1 / 1.3) < 0.3 && std::fmod(t, 120) < 60 ? 4.0 : 0.0;
  };
  auto logs = tests::bench_logs({options});
  EXPECT_EQ(identify::discover(logs, tests::ec_16()).verdict, Verdict::adequate);
  for (auto& column : logs[0].columns) {  // a row a second
    for (std::size_t i = 0; 10 * i < column.size(); ++i) column[i] = column[10 * i];
    column.resize(column.size() / 10);
  }
  const identify::Report report = identify::discover(logs, tests::ec_16());
  EXPECT_EQ(report.verdict, Verdict::insufficient);
  says(report.sentence, "may be of the load alone: it changes between rows 1 s apart");
}

/// A row in `every`, of what a bench wrote ten times a second.
std::vector<identify::Log> one_row_in(std::size_t every, const tests::BenchOptions& options) {
  auto logs = tests::bench_logs({options});
  for (auto& column : logs[0].columns) {
    for (std::size_t i = 0; every * i < column.size(); ++i) column[i] = column[every * i];
    column.resize(column.size() / every);
  }
  return logs;
}

TEST(SlowReport, AveragesTellWhatDrawsOfAGaitCannot) {
  tests::BenchOptions options;
  options.seconds = 1800;
  options.core_every_s = 30;
  options.current_A = [](double t, std::mt19937_64&) {  // steps of 1.3 Hz, in spells of a minute
    return std::fmod(t, 1 / 1.3) < 0.3 && std::fmod(t, 120) < 60 ? 4.0 : 0.0;
  };
  options.extra_housing_W = [](double, double, double) { return 0.4; };
  identify::Log log = one_row_in(10, options).front();
  const auto raw = tests::bench_logs({options}).front().of(identify::Role::current);
  auto& rms_A = log.of(identify::Role::current);
  for (std::size_t i = 1; i < rms_A.size(); ++i) {  // of what flowed in the second before the row
    double sum2 = 0;
    for (std::size_t k = 10 * (i - 1); k < 10 * i; ++k) sum2 += raw[k] * raw[k] / 10;
    rms_A[i] = std::sqrt(sum2);
  }
  const identify::Report as_draws = identify::discover({log}, tests::ec_16());
  EXPECT_EQ(as_draws.verdict, Verdict::insufficient);
  says(as_draws.sentence, "or say --averaged if a row tells its rms");
  log = identify::loaded_before(std::move(log), "it was said");
  log.averaged = true;
  const identify::Report report = identify::discover({log}, tests::ec_16());
  ASSERT_FALSE(report.causes.empty()) << report.sentence;
  says(report.sentence, "constant_heat");
}

TEST(SlowReport, RowsThatAreDrawsOfAGaitHideNoLargeCause) {
  for (const std::uint64_t seed : {1, 2}) {
    tests::BenchOptions options;
    options.seconds = 1800;
    options.seed = seed;
    double until_s = 0, hold_A = 0;
    options.current_A = [&](double t, std::mt19937_64& random) {  // steps of 0.3 to 1 s, in spells of a minute
      std::uniform_real_distribution<double> uniform;
      if (t >= until_s) {
        hold_A = hold_A > 0 ? 0 : 2 + uniform(random);
        until_s = t + 0.3 + 0.7 * uniform(random);
      }
      return std::fmod(t, 120) < 60 ? hold_A : 0.0;
    };
    options.extra_housing_W = [&](double t, double, double housing_degC) {  // a fan from the middle on
      return t > 900 ? -(housing_degC - options.ambient_degC) / options.motor.R2 : 0.0;
    };
    const identify::Report report = identify::discover(one_row_in(5, options), tests::ec_16());
    ASSERT_FALSE(report.causes.empty()) << report.sentence;
    EXPECT_EQ(report.causes[0].id, "cooling_change") << report.sentence;
  }
}

TEST(SlowReport, AWindingThatFollowsWhatRowsDoNotTellIsNoLateSensor) {
  tests::BenchOptions options;
  options.motor = {.ohm = 0.5, .R1 = 1, .R2 = 3.5, .C1 = 12, .C2 = 160, .coupling = 2};
  options.seconds = 5400;
  options.core_every_s = 0.1;
  double until_s = 60, amplitude_A = 0, Hz = 1;
  options.current_A = [&](double t, std::mt19937_64& random) {  // gaits of 0.3 to 1.4 Hz, for minutes each
    std::uniform_real_distribution<double> uniform;
    if (t >= until_s) {
      amplitude_A = amplitude_A > 0 ? 0 : 2 + 6 * uniform(random);
      Hz = 0.3 + 1.1 * uniform(random);
      until_s = t + 60 + 500 * uniform(random);
    }
    return amplitude_A * std::sin(2 * std::numbers::pi * Hz * t);
  };
  options.extra_housing_W = [](double, double, double) { return 2.0; };
  const identify::Report report = identify::discover(one_row_in(5, options), std::nullopt);
  for (const auto& cause : report.causes) EXPECT_NE(cause.id, "winding_sensor_lag") << report.sentence;
}

TEST(SlowReport, LoadsThatBeginBetweenRowsAreNoCause) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    tests::BenchOptions options;
    options.seconds = 1200;
    options.seed = seed;
    options.white_K = 0.05;
    options.core_every_s = 0.1;
    double until_s = 0, hold_A = 0;
    options.current_A = [&](double t, std::mt19937_64& random) {  // for 2 to 20 s each
      std::uniform_real_distribution<double> uniform;
      if (t >= until_s) {
        until_s = t + 2 + 18 * uniform(random);
        hold_A = uniform(random) < 0.5 ? 0 : 5 * uniform(random);
      }
      return hold_A;
    };
    auto logs = tests::bench_logs({options});
    for (auto& column : logs[0].columns) {  // a row a second
      for (std::size_t i = 0; 10 * i < column.size(); ++i) column[i] = column[10 * i];
      column.resize(column.size() / 10);
    }
    const identify::Report report = identify::discover(logs, tests::ec_16());
    EXPECT_EQ(report.verdict, Verdict::insufficient) << seed;
    says(report.sentence, "may be of the load alone: it changes between rows 1 s apart");
  }
}

TEST(SlowReport, LoadsThatBeginWithTheRowsHideNoCause) {
  for (const std::uint64_t seed : {1, 2}) {
    tests::BenchOptions options;
    options.seconds = 1200;
    options.seed = seed;
    double until_s = 0, hold_A = 0;
    options.current_A = [&](double t, std::mt19937_64& random) {  // pulses that 0.1 s matters to
      std::uniform_real_distribution<double> uniform;
      if (t >= until_s) {
        hold_A = hold_A > 0 ? 0 : 5 + 5 * uniform(random);
        until_s = t + (hold_A > 0 ? 0.5 + uniform(random) : 5 + 15 * uniform(random));
      }
      return hold_A;
    };
    options.extra_housing_W = [&](double t, double, double housing_degC) {  // a draught in the second half
      return t < 600 ? 0.0 : -0.002 * (housing_degC - options.ambient_degC);
    };
    const identify::Report report = identify::discover(tests::bench_logs({options}), tests::ec_16());
    ASSERT_EQ(report.verdict, Verdict::explained) << report.sentence;
    EXPECT_EQ(report.causes[0].id, "cooling_change") << seed;
  }
}

TEST(SlowReport, WhatIsMissedBesideCausesIsOfTheirNearestFitToo) {
  tests::BenchOptions options;
  options.seconds = 1200;
  options.white_K = 0.05;
  options.slow_K = 0.02;
  options.step_K = 0.02;
  options.extra_housing_W = [&](double, double, double housing_degC) {  // cools by more where it is hotter
    return -0.001 * (housing_degC - options.ambient_degC) * (housing_degC - options.ambient_degC);
  };
  auto logs = tests::bench_logs({options});
  auto& housing = logs[0].of(identify::Role::housing);
  std::rotate(housing.begin(), housing.end() - 15, housing.end());  // 1.5 s late, which the fit averages over
  std::fill(housing.begin(), housing.begin() + 15, options.start_degC);
  const identify::Report report = identify::discover(logs, tests::ec_16());
  ASSERT_EQ(report.verdict, Verdict::explained) << report.sentence;
  EXPECT_LT(report.extended_rmse.housing_K, 0.12);  // twice the noise
}

TEST(SlowReport, ACurrentThatItsSensorCutsOffNamesNoCause) {
  tests::BenchOptions options;
  options.seconds = 1200;
  options.current_A = [](double t, std::mt19937_64& random) {
    const double hold_A = std::fmod(t, 100) < 20 ? 4.0 : std::fmod(t, 100) < 60 ? 1.5 : 0.0;
    return hold_A + 0.03 * std::normal_distribution<double>()(random);
  };
  auto logs = tests::bench_logs({options});
  EXPECT_EQ(identify::discover(logs, tests::ec_16()).verdict, Verdict::adequate);
  for (double& amps : logs[0].of(identify::Role::current)) amps = std::min(amps, 3.0);
  const identify::Report report = identify::discover(logs, tests::ec_16());
  EXPECT_EQ(report.verdict, Verdict::insufficient);
  says(report.sentence, "current_A stands at its largest value, 3, in 2400 rows and is noisy elsewhere");
}

TEST(Report, OfATorqueWithoutTheMotorsConstantNoAmperesAreTold) {
  tests::BenchOptions options;
  options.seconds = 300;
  auto logs = tests::bench_logs({options});
  logs[0].torque_for_A = true;
  const identify::Report report = identify::discover(logs, std::nullopt);
  EXPECT_EQ(report.no_model, "the log tells a torque and a board measures a current; give --motor FILE");
  EXPECT_FALSE(report.gain || report.experiment);
  EXPECT_EQ(report.plots.front().heat_label, "torque, N m");
}

TEST(Report, WhatIsAdequateHasNothingToGain) {
  tests::BenchOptions options;
  options.core_every_s = 20;
  const identify::Report report = report_of(options);
  EXPECT_EQ(report.verdict, Verdict::adequate);
  EXPECT_FALSE(report.gain);
}

TEST(SlowReport, MassesThatTwoResistorsExchangeAreNotHeldAgainstTheSheet) {
  tests::BenchOptions options;
  options.motor.R1 = 0.69;
  options.motor.R2 = 11.8;
  options.core_every_s = 30;
  options.core_white_K = 2;
  options.seconds = 1200;
  options.extra_housing_W = [](double, double, double) { return -0.54; };  // into a colder frame
  const identify::Report report = report_of(options);
  ASSERT_EQ(report.verdict, Verdict::explained) << report.sentence;
  EXPECT_GT(report.baseline[2].value, 4 * tests::ec_16().motor.C1_J_per_K);
  says(report.sentence, "misses the winding, whose readings are noisy by 1.");
  EXPECT_EQ(identify::as_text(report, false).find("-0.0 "), std::string::npos) << "in the ladder";
  const std::string notes = fmt::format("{}", fmt::join(report.notes, " "));
  EXPECT_EQ(notes.find("C1 comes out"), std::string::npos) << notes;
  says(notes, "Two resistors alone take C1 for ");
}

/// As an inverter's logger averages: what flowed in the five seconds before a row, beside a winding of 50 s.
TEST(SlowReport, ARowsLoadMayBeWhatFlowedBeforeIt) {
  tests::BenchOptions options;
  options.motor = {.ohm = 0.75, .R1 = 1.0, .R2 = 4.0, .C1 = 50, .C2 = 300};
  options.rate_Hz = 0.2;
  options.seconds = 3600;
  options.core_every_s = 5;
  options.core_white_K = 0.1;
  const auto said = [](const std::vector<identify::Log>& logs) {
    const identify::Report report = identify::discover(logs, std::nullopt);
    return identify::word(report.verdict) + (": " + report.notes.front());
  };
  auto logs = tests::bench_logs({options});
  says(said(logs), "adequate: No motor file");
  auto& current = logs[0].of(identify::Role::current);
  std::rotate(current.begin(), current.end() - 1, current.end());
  says(said(logs), "adequate: Current and speed of a row are taken for those since the row before it");
}

/// A winding that answers within 14 s, and a housing within two minutes: a drone's.
tests::BenchOptions fast_winding() {
  tests::BenchOptions options;
  options.motor = {.ohm = 1.3, .R1 = 0.8, .R2 = 2.2, .C1 = 17.5, .C2 = 50};
  return options;
}

TEST(SlowReport, ASensorThatFeelsALittleOfAFastWindingIsBelievedAsAHousingIs) {
  tests::BenchOptions options = fast_winding();
  options.sensor_share = 0.15;
  options.rate_Hz = 1;
  for (options.seed = 1; options.seed <= 3; ++options.seed) {
    const identify::Report report = identify::discover(tests::bench_logs({options}), std::nullopt);
    says(report.sentence, "sensor_placement");  // "adequate" while a whole winding was granted its unevenness
  }
}

TEST(SlowReport, RowsMayBeBehindWhereASensorIsToo) {
  tests::BenchOptions options = fast_winding();
  options.sensor_share = 0.15;
  options.rate_Hz = 0.5;
  options.white_K = 0.1;
  for (options.seed = 1; options.seed <= 3; ++options.seed) {
    auto logs = tests::bench_logs({options});
    auto& current = logs[0].of(identify::Role::current);
    std::rotate(current.begin(), current.end() - 1, current.end());
    const identify::Report report = identify::discover(logs, std::nullopt);
    EXPECT_EQ(report.sentence.find("clock_delay"), std::string::npos) << report.sentence;
  }
}

TEST(SlowReport, NothingIsCalledConvergedThatFailsACheck) {
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
  says(html, "<svg");
  EXPECT_EQ(html.find("<script"), std::string::npos);
  EXPECT_EQ(html.find("src="), std::string::npos);
  EXPECT_EQ(html.find("<link"), std::string::npos);
}

TEST(Report, APictureNamesWhatItShows) {
  identify::Report report;
  identify::LogPlot plot;
  for (auto* of :
       {&plot.time_s, &plot.heat, &plot.measured_housing, &plot.simulated_housing, &plot.measured_core,
        &plot.simulated_core, &plot.extended_housing, &plot.extended_core, &plot.residual_housing, &plot.residual_core})
    *of = {1, 2, 3};
  report.plots = {plot};
  const auto shown = [&](const std::string& part) {
    const std::string html = identify::as_html(report);
    int count = 0;
    for (std::size_t at = html.find(part); at != std::string::npos; at = html.find(part, at + 1)) ++count;
    return count;
  };
  EXPECT_EQ(shown("tinted"), 0);
  EXPECT_EQ(shown("<text>housing, extended<"), 2) << "temperature and residual";
  EXPECT_EQ(shown("<text>winding, two resistors<"), 2) << "longer labels leave the curves less room";
  report.structure.wrong = {{0, "winding", 1, 2, 1.5, "current"}};
  EXPECT_EQ(shown("tinted"), 1);
}

}  // namespace

// SPDX-License-Identifier: MIT
// Logs that are spoilt get a plain sentence, and never a confident name.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <sstream>

#include "identify/answer/refusals.hpp"
#include "identify/answer/report.hpp"
#include "identify/answer/untold.hpp"
#include "identify/discover.hpp"
#include "identify/fit/fit.hpp"
#include "identify/search/problem_of.hpp"
#include "tests/identify/bench.hpp"
#include "tests/identify/hidden_log.hpp"
#include "tests/identify/program.hpp"
#include "tests/identify/says.hpp"

namespace {

using tests::Outcome;
using tests::run;
using tests::says;

/// A good log whose rows `edit` spoils: (time, current, speed, housing, ambient, winding or empty).
std::string spoilt(const std::function<bool(std::vector<std::string>&, int)>& edit, tests::BenchOptions options = {}) {
  options.core_every_s = 20;
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
  says(r.out, because);
}

TEST(BadInput, AGoodLogIsAnsweredUntilItIsSpoilt) {
  const std::string good = spoilt([](auto&, int) { return true; }) + " --motor ec-16-40w";
  const Outcome r = run(good);
  EXPECT_EQ(r.code, 0);
  says(r.out, "Verdict: adequate");
  says(run(good + " --averaged").out, "since the row before it: it was said that they are averaged");
}

TEST(BadInput, ReadingsHeldOverFasterRowsCountOnce) {
  std::string housing, core;
  const Outcome r = run(spoilt([&](auto& row, int i) {
                          if (i > 0 && i % 10 == 1) housing = row[3];
                          if (i > 0 && !row[5].empty()) core = row[5];
                          if (i > 0) row[3] = housing, row[5] = core;
                          return true;
                        }) +
                        " --motor ec-16-40w");
  says(r.out, "Verdict: adequate");
  says(r.out, "housing_degC was filled in by repeating between readings about 1 s apart");
}

TEST(SlowBadInput, ALoadThatNeverChanges) {
  const auto as_it_is = [](auto&, int) { return true; };
  tests::BenchOptions options;
  options.current_A = [](double, std::mt19937_64&) { return 2.0; };
  refused(spoilt(as_it_is, options), "The load never changes");
  options.current_A = [](double t, std::mt19937_64&) { return t < 120 ? 0.0 : 2.0; };
  const Outcome rests = run(spoilt(as_it_is, options) + " --motor ec-16-40w");
  EXPECT_EQ(rests.out.find("The load never changes"), std::string::npos) << rests.out;
}

TEST(BadInput, NoTemperatureBeforeWhatIsHeldOut) {
  const std::string path = spoilt([](auto& row, int i) {
    row[4] = "";  // no ambient: the first reading would be taken for it
    row[3] = i < 8000 ? "" : std::to_string(30 + 0.01 * (i - 8000));
    return row[5] = "", true;
  });
  const Outcome r = run(path + " --motor ec-16-40w --hold-out 0.25");
  EXPECT_EQ(r.code, 3);
  says(r.out, "no temperature is read in its 675 s; hold out less");
}

TEST(SlowBadInput, AMotorWithoutASheetThatDoesNotSettleGetsNoName) {
  // A housing of twenty minutes over five: a third mass was named of a sensor that feels the winding.
  tests::HiddenLogOptions o;
  o.core = tests::Core::none;
  o.seed = 3;
  o.seconds = 300;
  o.effects = {"sensor_placement"};
  const std::string path = (std::filesystem::temp_directory_path() / "hotcore_five_minutes.csv").string();
  tests::make_hidden_log(o, path);
  const Outcome r = run(path);
  says(r.out, "does not come near where it settles");
}

TEST(BadInput, AHousingThatSettledIsNotSaidToHaveNotWhereItsCoolingIsOpen) {
  // Five hours of forty minutes, in whole degrees: convection and radiation share what grows with the rise.
  tests::BenchOptions hours;
  hours.motor = {.ohm = 1.5, .R1 = 0.08, .R2 = 0.12, .C1 = 4000, .C2 = 20000};
  hours.seconds = 18000, hours.rate_Hz = 1.0 / 60;
  hours.core_white_K = 0.3, hours.white_K = 0.3, hours.step_K = 1;
  hours.current_A = [](double t, std::mt19937_64&) { return t < 10800 ? 18 : 0; };
  hours.extra_housing_W = [](double, double, double housing_degC) {
    const double rise_K = housing_degC - 24;
    return -rise_K / 0.12 * 0.2 * rise_K / 20;
  };
  const auto in_degrees = [](auto& row, int) {
    row[5] = fmt::format("{:.0f}", std::stod(row[5]));
    return true;
  };
  const Outcome r = run(spoilt(in_degrees, hours));
  EXPECT_EQ(r.out.find("where it settles"), std::string::npos) << r.out;
  says(r.out, "this log leaves open how well the housing is cooled");
}

TEST(BadInput, NothingThatVaries) {
  refused(spoilt([](auto& row, int) { return row[3] = "30.1", row[5] = "", true; }), "same in all rows");
}

TEST(BadInput, ShorterThanTheHousingsTimeConstant) {
  const std::string path = spoilt([](auto&, int row) { return row < 1200; });
  refused(path, "This log cannot tell what the simulation gets wrong. It lasts 120 s, less than the housing's time");
  const std::string again = path + ".again.csv";
  std::filesystem::copy_file(path, again, std::filesystem::copy_options::overwrite_existing);
  refused(path + " " + again, "These logs cannot tell what the simulation gets wrong. Together they last 240 s");
}

TEST(SlowBadInput, WhatTwoResistorsMissIsSaidOfALogTooShortToSayWhy) {
  tests::BenchOptions options;
  options.extra_housing_W = [](double t, double, double) { return 10 * (1 + std::sin(t / 9)); };
  const std::string path = spoilt([](auto&, int row) { return row < 2000; }, options);
  refused(path, "The two-resistor model misses the ");
  refused(path, " K rms, more than the noise explains; why, this log cannot tell. It lasts 200 s, less than");
}

TEST(SlowBadInput, TimeInMilliseconds) {
  const auto in_ms = [](auto& row, int number) { return row[0] = std::to_string(number * 100), true; };
  refused(spoilt(in_ms), "check the units of current and time");
  const Outcome without_sheet = run(spoilt(in_ms));
  says(without_sheet.out, "--column time_s=time_s:ms");
}

TEST(SlowBadInput, TimeInMillisecondsOfAMotorThatHasACause) {
  tests::BenchOptions options;
  options.extra_housing_W = [](double, double current, double) { return 0.6 * current * current; };
  const Outcome r =
      run(spoilt([](auto& row, int number) { return row[0] = std::to_string(number * 100), true; }, options));
  says(r.out, "Verdict: insufficient");
  says(r.out, "--column time_s=time_s:ms");
}

TEST(SlowBadInput, TimeInMinutes) {
  const auto in_min = [](auto& row, int) { return row[0] = std::to_string(std::stod(row[0]) / 60), true; };
  tests::BenchOptions options;
  options.seconds = 1800;
  const Outcome r = run(spoilt(in_min, options) + " --explain");
  says(r.out, "Verdict: insufficient");
  says(r.out, "--column time_s=time_s:min");
  says(r.out, "Two resistors were fitted by likelihood");
}

TEST(BadInput, TimeInHoursOrDays) {
  for (const double unit_s : {3600.0, 86400.0}) {
    const auto in_unit = [&](auto& row, int) {
      return row[0] = fmt::format("{:.8f}", std::stod(row[0]) / unit_s), true;
    };
    refused(spoilt(in_unit), "say --column time_s=time_s:min, if in hours or days :h or :d");
  }
}

TEST(SlowBadInput, LongHoldsInALongDayAreNoReasonToCallAMotorImpossible) {
  // At the resistance that the most it rises by would need of the mean heat, each hold makes the winding glow.
  tests::BenchOptions options;
  options.motor = {0.225, 0.00393, 0.56, 2.1, 108, 860};
  options.seconds = 50000;
  options.rate_Hz = 0.2;
  options.seed = 3;
  options.current_A = [until = 0.0, held_A = 0.0](double t, std::mt19937_64& random) mutable {
    std::uniform_real_distribution<double> uniform;
    if (t >= until) {
      held_A = until == 0 || uniform(random) < 0.9 ? 0 : 12 + 4 * uniform(random);
      until = t + 300 + 2700 * uniform(random);
    }
    return held_A;
  };
  const Outcome r = run(tests::write_bench_log("hotcore_long_holds.csv", options));
  EXPECT_EQ(r.code, 0) << r.out;
  says(r.out, "Verdict: adequate");
}

TEST(SlowBadInput, ALightHousingOnAHeavyMassIsAMotorAllTheSame) {
  tests::BenchOptions options;
  options.motor = {0.75, 0.00393, 1.0, 8, 0.6, 0.9};
  options.white_K = 0.05;
  options.step_K = 0.01;
  double mass_degC = options.ambient_degC;
  options.extra_housing_W = [&](double, double, double housing_degC) {
    const double to_mass_W = (housing_degC - mass_degC) / 2;
    mass_degC += 0.005 * to_mass_W / 30;  // four times in a step of 20 ms
    return -to_mass_W;
  };
  const identify::Report report = identify::discover(tests::bench_logs({options}), std::nullopt);
  EXPECT_EQ(report.sentence.find("as that of no motor does"), std::string::npos) << report.sentence;
}

TEST(SlowBadInput, TheSheetOfAnotherMotor) {
  const auto as_it_is = [](auto&, int) { return true; };
  const Outcome near = run(spoilt(as_it_is) + " --motor ec-powermax-30-48v");
  says(near.out, "times the sheet's; see whether maxon EC-powermax 30");
  tests::BenchOptions insulated;
  insulated.motor.R1 = 45;
  insulated.current_A = [](double t, std::mt19937_64&) { return std::fmod(t, 200) < 100 ? 1.2 : 0.3; };
  refused(spoilt(as_it_is, insulated), "30 times off the sheet");
}

TEST(SlowBadInput, ACurrentThatIsReadTooSmall) {
  // Registers of Dynamixel's X series count 2.69 mA (control table of the XM430, e-Manual), and may be read as mA.
  const auto in_mA = [](auto& row, int i) {
    if (i > 0) row[1] = fmt::format("{:.5f}", std::stod(row[1]) / 2.69), row[5] = "";
    return true;
  };
  says(run(spoilt(in_mA) + " --motor ec-16-40w").out,
       "a current that is read 2.7 times too small; see the current's unit");
}

TEST(SlowBadInput, AStepSoonAfterALogBeganWarmIsNoSecondClock) {
  // The load that a later clock would have moved away with the readings that it had moved.
  tests::BenchOptions warm;
  warm.seconds = 2600, warm.rate_Hz = 0.5;
  warm.core_every_s = 2, warm.core_white_K = 0.1;
  warm.white_K = 0.05, warm.step_K = 0.01;
  warm.current_A = [](double t, std::mt19937_64&) { return t < 1500 ? 3 : 1.4; };
  warm.extra_housing_W = [](double, double, double housing_degC) {
    const double rise_K = housing_degC - 24;
    return -rise_K / 16.3 * 0.3 * rise_K / 20;
  };
  std::vector<identify::Log> logs = tests::bench_logs({warm});
  for (auto& column : logs[0].columns) {
    if (!column.empty()) column.erase(column.begin(), column.begin() + 740);
  }
  for (double& t : logs[0].of(identify::Role::time)) t -= 1480;
  const identify::Report report = identify::discover(logs, std::nullopt);
  EXPECT_EQ(report.sentence.find("two clocks; align"), std::string::npos) << report.sentence;
  says(report.sentence, "natural_convection");
}

TEST(SlowBadInput, AMassThatIsStillColdWhereALogBeginsSoonAfterItsMotorIsNoSecondCause) {
  // A frame that takes minutes has hardly warmed while the housing rose by 20 K: behind by nearly all of it.
  tests::BenchOptions soon;
  soon.seconds = 960, soon.rate_Hz = 2;
  soon.core_every_s = 0.5, soon.core_white_K = 0.1;
  soon.white_K = 0.05, soon.step_K = 0.01;
  soon.current_A = [](double t, std::mt19937_64&) { return std::fmod(t, 150) < 75 ? 4 : 0; };
  double mass_degC = soon.ambient_degC;
  soon.extra_housing_W = [&](double, double, double housing_degC) {
    const double to_mass_W = (housing_degC - mass_degC) / 10;
    mass_degC += 0.005 * to_mass_W / 14;  // four times in a step of 20 ms
    return -to_mass_W;
  };
  std::vector<identify::Log> logs = tests::bench_logs({soon});
  for (auto& column : logs[0].columns) {
    if (!column.empty()) column.erase(column.begin(), column.begin() + 120);
  }
  for (double& t : logs[0].of(identify::Role::time)) t -= 60;
  says(identify::discover(logs, std::nullopt).sentence, "The motor behaves like third_mass:");
}

TEST(BadInput, HowFarAWindingMovesBetweenTheRowsOfATableIsNoNoise) {
  // Ten minutes on and ten off, read every five: neighbouring readings are 17 K apart.
  const auto discovered = [](double to_mass_K_per_W) {
    tests::BenchOptions table;
    table.motor = {.ohm = 1.5, .R1 = 0.08, .R2 = 0.12, .C1 = 4000, .C2 = 20000};
    table.seconds = 14400, table.rate_Hz = 1.0 / 300;
    table.core_every_s = 300, table.core_white_K = 0.3;
    table.white_K = 0.3;
    table.current_A = [](double t, std::mt19937_64&) { return std::fmod(t, 1200) < 600 ? 22 : 0; };
    double mass_degC = table.ambient_degC;
    table.extra_housing_W = [&](double, double, double housing_degC) {
      const double to_mass_W = (housing_degC - mass_degC) / to_mass_K_per_W;
      mass_degC += 0.005 * to_mass_W / 30000;  // four times in a step of 20 ms
      return -to_mass_W;
    };
    return identify::discover(tests::bench_logs({table}), std::nullopt);
  };
  const identify::Report clean = discovered(1e9), wrong = discovered(0.3);
  EXPECT_EQ(clean.verdict, identify::Verdict::adequate) << clean.sentence;
  says(clean.sentence, "noisy by 0.");
  EXPECT_NE(wrong.verdict, identify::Verdict::adequate) << wrong.sentence;
}

TEST(SlowBadInput, AHousingCooledAsByNoFlangeIsAskedForItsSensor) {
  const auto no_core = [](auto& row, int i) {
    if (i > 0) row[5] = "";
    return true;
  };
  tests::BenchOptions controller, flange;
  controller.motor.R1 = 0.5, controller.motor.R2 = 1.3, controller.motor.C2 = 60;
  flange.motor.R2 = 16.3 / 5, flange.motor.C2 = 60;
  const std::string asked = "less than a flange leaves of it: see whether the sensor sits on the motor";
  says(run(spoilt(no_core, controller) + " --motor ec-16-40w").out, asked);
  const Outcome cooled = run(spoilt(no_core, flange) + " --motor ec-16-40w");
  EXPECT_EQ(cooled.out.find(asked), std::string::npos) << cooled.out;
}

TEST(BadInput, APauseInWhichTheMotorRanOn) {
  const auto paused = [](auto&, int row) { return row < 4000 || row > 4600; };
  const Outcome r = run(spoilt(paused) + " --motor ec-16-40w");
  says(r.out, "Verdict: adequate");
  says(r.out, "Nothing tells the heat input for 60 s from 400 s");
}

TEST(SlowBadInput, RowsTooFarApartForTheLoadThatTheyTell) {
  tests::BenchOptions options;
  options.core_every_s = 2;
  options.seconds = 3600;
  const auto rows = [&](int apart) {
    return run(spoilt([&](auto&, int row) { return row % apart == 0; }, options) + " --motor ec-16-40w").out;
  };
  says(rows(1), "Verdict: adequate");
  says(rows(20), "between rows 2 s apart");
}

TEST(BadInput, WhereNothingIsLeftTheLoadBetweenRowsIsNoReason) {
  tests::BenchOptions options;
  options.rate_Hz = 0.5;
  options.seconds = 1800;
  options.slow_K = 0;
  options.current_A = [](double t, std::mt19937_64&) { return 1.2 + 0.8 * std::sin(t / 40); };
  const auto motor = tests::ec_16();
  const auto refusal = [&] {
    const auto logs = tests::bench_logs({options});
    const auto problem = identify::problem_of(logs, motor);
    identify::Found found;
    found.verdict = identify::Verdict::unknown_cause;
    found.baseline.fit = found.chosen.fit = identify::fit(problem, {});
    return identify::too_sparse(problem, found, logs);
  };
  EXPECT_EQ(refusal(), "");
  options.extra_housing_W = [](double t, double, double) { return 0.02 * std::sin(t / 90); };
  EXPECT_NE(refusal(), "") << "what is left is no more than the load between rows may do";
}

TEST(BadInput, FortyPercentMissing) {
  std::mt19937 random(4);
  refused(spoilt([&](auto&, int) { return random() % 10 >= 4; }), "40 % of the readings or rows are missing");
  refused(spoilt([&](auto& row, int) { return row[3] = random() % 10 < 4 ? "" : row[3], true; }),
          "40 % of the readings or rows are missing");
  const auto in_one_stretch = [](int row) { return row > 2700 && row < 6300; };
  const char* untold = "nothing tells the heat input for 40 % of its time";
  refused(spoilt([&](auto&, int row) { return !in_one_stretch(row); }), untold);
  refused(spoilt([&](auto& row, int number) { return row[1] = in_one_stretch(number) ? "" : row[1], true; }), untold);
}

TEST(BadInput, ASingleRowIsTooFewAndNoClockThatStands) {
  const std::string path = spoilt([](auto&, int row) { return row == 0; });
  refused(path, "only 1 row over 0.0 s");
  says(run(path + " --motor ec-16-40w --hold-out 0.25").out, "only 1 row over 0.0 s");
}

TEST(BadInput, ATemperatureReadEightTimes) {
  refused(spoilt([](auto& row, int number) {
            if (number % 1200 != 0) row[3] = "";
            return row[5] = "", true;
          }),
          "8 readings of a temperature are too few");
}

TEST(SlowBadInput, CausesThatAColumnIsMissingForAreNamed) {
  const Outcome r = run(spoilt([](auto& row, int) { return row[2] = "", true; }) + " --motor ec-16-40w --explain");
  EXPECT_EQ(r.code, 0);
  says(r.out, "Not tried, since a column does not tell: speed_rad_per_s is missing (speed_loss_linear, ");
  const Outcome stands =
      run(spoilt([](auto& row, int) { return row[2] = "0", true; }) + " --motor ec-16-40w --explain");
  says(stands.out, "speed_rad_per_s never moves (");
}

TEST(SlowBadInput, ASpeedThatMovesBesideAPowerIsNotSaidToStand) {
  tests::BenchOptions options;
  options.power_gain = 1;
  auto logs = tests::bench_logs({options});
  auto& speed = logs[0].of(identify::Role::speed);
  for (std::size_t i = 0; i < speed.size(); ++i) speed[i] = i / 500 % 2 == 0 ? 100 : 0;
  const identify::Report report = identify::discover(logs, std::nullopt);
  std::string said;
  for (const auto& lines : {report.notes, report.reasoning})
    for (const std::string& line : lines) said += line + "\n";
  EXPECT_EQ(said.find("never moves"), std::string::npos) << said;
  says(said, "power_W tells no current (ac_copper_loss, ");
}

std::string fahrenheit(const std::string& degC) {
  return degC.empty() ? "" : std::to_string(std::stod(degC) * 1.8 + 32);
}

TEST(SlowBadInput, OneTemperatureInFahrenheitBesideOthersInCelsius) {
  refused(spoilt([](auto& row, int) { return row[3] = fahrenheit(row[3]), true; }),
          "--column housing_degC=housing_degC:degF");
  refused(spoilt([](auto& row, int) { return row[5] = fahrenheit(row[5]), true; }),
          "--column core_degC=core_degC:degF");
  refused(spoilt([](auto& row, int) { return row[3] = fahrenheit(row[3]), row[5] = fahrenheit(row[5]), true; }),
          "--column housing_degC=housing_degC:degF --column core_degC=core_degC:degF");
}

TEST(SlowBadInput, AWindingInFahrenheitBesideAnEffectOfItsOwn) {
  double sensor_degC = NAN;
  refused(spoilt([&](auto& row, int) {
            const double housing_degC = std::stod(row[3]);
            if (std::isnan(sensor_degC)) sensor_degC = housing_degC;
            sensor_degC += (housing_degC - sensor_degC) * (0.1 / 40);  // a sensor of 40 s, a row every 0.1 s
            row[3] = std::to_string(sensor_degC);
            row[5] = fahrenheit(row[5]);
            return true;
          }),
          "--column core_degC=core_degC:degF");
}

TEST(SlowBadInput, CurrentAndSpeedSwapped) {
  refused(spoilt([](auto& row, int number) {
            row[2] = row[1];
            row[1] = number / 300 % 2 == 0 ? "0" : "2.5";
            return true;
          }),
          "follow the square of the speed column and not that of the current: the two columns are swapped");
}

TEST(SlowBadInput, CurrentAndSpeedAreNotSwappedWhereTheSetThatWasChosenExplainsTheLog) {
  const auto speed_rad_per_s = [](double t) { return std::fmod(t, 200) < 100 ? 2 : 0.5; };
  tests::BenchOptions options;
  options.current_A = [](double t, std::mt19937_64&) { return std::fmod(t, 130) < 60 ? 0.4 : 0.1; };
  options.extra_housing_W = [&](double t, double, double) { return std::pow(speed_rad_per_s(t), 2); };
  auto logs = tests::bench_logs({options});
  for (std::size_t i = 0; i < logs[0].of(identify::Role::time).size(); ++i)
    logs[0].of(identify::Role::speed)[i] = speed_rad_per_s(logs[0].of(identify::Role::time)[i]);
  const auto problem = identify::problem_of(logs, std::nullopt);
  const auto fitted = [&](const char* id) {
    identify::Candidate out;
    out.fit = identify::fit(problem, {{identify::cause_named(id)}});
    return out;
  };
  identify::Found found;
  found.verdict = identify::Verdict::explained;
  found.plain_baseline = found.baseline.fit = identify::fit(problem, {});
  found.singles = {fitted("sensor_offset")};
  found.chosen = found.singles.front();
  EXPECT_NE(identify::suspicion(problem, found, logs, std::nullopt).find("the two columns are swapped"),
            std::string::npos);
  found.chosen = fitted("speed_loss_quadratic");
  EXPECT_EQ(identify::suspicion(problem, found, logs, std::nullopt), "");
}

}  // namespace

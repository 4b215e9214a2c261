// SPDX-License-Identifier: MIT
// Does the model that identify finds help the motor it was found on? For each seed: record a hidden motor through the
// firmware under protection, let identify read the log, and play a push that outlasts the winding with the two-resistor
// model as fitted, with the model found, and with an oracle that knows the true winding temperature.
//   build/host/bin/gain --seeds 40 [--first 1] [--excitation duty|designed] [--minutes 20] [--clean] [--json]
// --clean: the motor of the sheet, nothing hidden. Two resistors are then to be called adequate.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "boards/host/record.hpp"
#include "boards/host/run_scene.hpp"
#include "identify/discover.hpp"
#include "tests/identify/chance.hpp"
#include "wire/pc/files.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/program.hpp"

namespace {

using namespace boards::host;

const std::string root = HOTCORE_SOURCE_DIR;
// The promise: true overshoot, and the share of the burst that the truth allows.
constexpr double most_overshoot_K = 3, least_share = 0.9;

struct Push {
  double overshoot_K, share;  // of the winding's true limit; of the oracle's impulse
  bool kept() const { return overshoot_K <= most_overshoot_K && share >= least_share; }
};

struct Known {
  double off, by;  // shares of the value: from the true one; standard error
};

struct Case {
  std::uint64_t seed;
  std::string truth, answer;
  bool named;     // told what it is, or most of it
  bool misnamed;  // named, and the truth is not in it; or, with nothing hidden, anything but adequate
  Push before, after;
  Known R1, C1;  // of the model found
};

/// Impulse of the push and how far the true winding passes its limit; without a `model` the board has its sheet.
Trace push(const HiddenMotor& motor, Limiter limiter, const std::string& model) {
  Scene scene = read_scene("get-up", root + "/host-sim/scenes", {});
  scene.limiters = {limiter};
  scene.trust = model.empty() ? "sheet" : "identified";
  scene.model = model;
  const RunOptions options{.motor_folder = root + "/boards/motors", .plant_motor = motor.motor, .hidden = motor.hidden};
  return run_scene(scene, options).traces.at(0);
}

Case played(RecordOptions options, bool clean, std::uint64_t seed, const std::string& folder) {
  options.seed = seed;
  if (!clean) options.hide = seed;
  const Recording recording = record(options);
  const std::string log = folder + "/log.csv", before = folder + "/before.toml", after = folder + "/after.toml";
  wire::pc::write_whole(log, recording.log_csv);
  const auto sheet = wire::pc::read_motor(options.motor, options.motor_folder);
  const auto report = identify::discover(identify::logs_of(identify::read_table(log), {}, sheet.motor), sheet);
  wire::pc::write_whole(before, report.baseline_toml);
  wire::pc::write_whole(after, report.model_toml);

  const HiddenMotor motor =
      clean ? HiddenMotor{sheet.motor, {}, {}} : hidden_motor(seed, options.motor, options.motor_folder);
  const double limit_degC = sheet.motor.winding_max_degC;
  const double best_As = push(motor, Limiter::oracle, "").impulse_As;
  const auto outcome = [&](const std::string& model) {
    const Trace trace = push(motor, Limiter::governor, report.no_model.empty() ? model : "");
    return Push{std::max(0.0, trace.hottest_true_degC - limit_degC), trace.impulse_As / best_As};
  };
  const auto& found = report.extended.empty() ? report.baseline : report.extended;
  const auto known = [&](std::size_t i, double truth) {
    return Known{found[i].value / truth - 1, found[i].std_error / found[i].value};
  };
  const bool named = identify::names_causes(report.verdict);
  Case c{.seed = seed,
         .truth = clean ? "nothing" : nlohmann::json::parse(motor.truth_json)["causes"][0]["id"],
         .answer = identify::word(report.verdict),
         .named = named,
         .misnamed = clean ? report.verdict != identify::Verdict::adequate : named,
         .before = outcome(before),
         .after = outcome(after),
         .R1 = known(0, motor.motor.R1_K_per_W),
         .C1 = known(2, motor.motor.C1_J_per_K)};
  for (const auto& cause : report.causes) {
    c.answer += " " + cause.id;
    c.misnamed = c.misnamed && cause.id != c.truth;
  }
  return c;
}

struct Asked {
  int seeds = 10;
  std::uint64_t first = tests::rotating_seed();
  bool json = false, check = false, clean = false;
};

int gain(const RecordOptions& options, const Asked& asked) {
  const std::string folder =
      (std::filesystem::temp_directory_path() / fmt::format("hotcore_gain_{}", getpid())).string();
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  int missed = 0, helped = 0, harmed = 0, too_hot = 0, misnamed = 0;
  for (int s = 0; s < asked.seeds; ++s) {
    const Case c = played(options, asked.clean, asked.first + static_cast<std::uint64_t>(s), folder);
    missed += !c.before.kept();
    helped += !c.before.kept() && c.after.kept();
    const bool hotter = c.after.overshoot_K > std::max(most_overshoot_K, c.before.overshoot_K);
    harmed += (c.before.kept() && !c.after.kept()) || hotter;
    too_hot += c.named && c.after.overshoot_K > most_overshoot_K;
    misnamed += c.misnamed;
    list.push_back({{"seed", c.seed},
                    {"truth", c.truth},
                    {"answer", c.answer},
                    {"overshoot_K", {c.before.overshoot_K, c.after.overshoot_K}},
                    {"share_of_burst", {c.before.share, c.after.share}},
                    {"R1_off_and_known_by", {c.R1.off, c.R1.by}},
                    {"C1_off_and_known_by", {c.C1.off, c.C1.by}}});
    fmt::print(stderr,
               "{:>3}/{} seed {:<8} {:<22} overshoot {:5.1f} -> {:5.1f} K, burst {:5.3f} -> {:5.3f}{}  {} (R1 {:+.0f} "
               "+- {:.0f} %, C1 {:+.0f} +- {:.0f} %)\n",
               s + 1, asked.seeds, c.seed, c.truth, c.before.overshoot_K, c.after.overshoot_K, c.before.share,
               c.after.share, c.after.kept() ? "" : " MISSED", c.answer, 100 * c.R1.off, 100 * c.R1.by, 100 * c.C1.off,
               100 * c.C1.by);
  }
  std::filesystem::remove_all(folder);
  if (asked.json)
    fmt::print("{}\n", nlohmann::ordered_json{{"missed_by_two_resistors", missed},
                                              {"helped", helped},
                                              {"harmed", harmed},
                                              {"named_and_too_hot", too_hot},
                                              {"misnamed", misnamed},
                                              {"cases", list}}
                           .dump(2));
  else
    fmt::print(
        "{} motors; two resistors, fitted, miss {} (overshoot above {:g} K or less than {:g} % of the burst); the "
        "model found puts {} of these right and spoils {} of the others; {} with a cause named pass the limit by more "
        "than {:g} K, {} are given a name that is not the truth\n",
        asked.seeds, missed, most_overshoot_K, 100 * least_share, helped, harmed, too_hot, most_overshoot_K, misnamed);
  return asked.check && harmed + too_hot + misnamed > 0 ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "What identify's model gains on the motor that was recorded, in host-sim\n"
      "\n"
      "Examples\n"
      "  gain --seeds 10                              ten motors on a robot's duty, half a minute each\n"
      "  gain --excitation designed --first 501 --seeds 8\n"
      "  gain --clean --seeds 2 --check\n"
      "Exit codes: 0 done, 1 --check found a motor that is served worse, 2 the command line is wrong.\n"};
  wire::pc::use_help(app, "gain");
  Asked asked;
  RecordOptions options{.motor_folder = root + "/boards/motors", .scene_folder = root + "/host-sim/scenes"};
  app.add_option("--seeds", asked.seeds, "motors")->capture_default_str()->check(wire::pc::between(1, 1e6));
  app.add_option("--first", asked.first, "first seed")
      ->capture_default_str()
      ->check(wire::pc::between(0, wire::pc::most_seed));
  app.add_option("--excitation", options.excitation, "duty, designed or step")->capture_default_str();
  app.add_option("--minutes", options.minutes, "of each log")
      ->capture_default_str()
      ->check(wire::pc::between(0.1, 1440.0));
  app.add_flag("--clean", asked.clean, "nothing is hidden in the motors");
  app.add_flag("--thermocouple", options.thermocouple, "a winding temperature in every line of the log");
  app.add_flag(
      "--check", asked.check,
      "end with an error when a motor is served worse than by two resistors, is named and too hot, or misnamed");
  app.add_flag("--json", asked.json, "the cases as JSON");
  return wire::pc::run_program(app, argc, argv, [&] { return gain(options, asked); });
}

// SPDX-License-Identifier: MIT
// A motor that is nothing like ours, without a sheet: does what is found foretell the winding where it was not fitted?
// For each seed drives of one motor are recorded (traction.hpp); the first three quarters of each are fitted and chosen
// on, the last is foretold.
//   build/host/bin/traction --seeds 20 [--first 1] [--drives 5] [--json]
#include "tests/identify/traction.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <ctime>
#include <nlohmann/json.hpp>

#include "identify/discover.hpp"
#include "identify/log/median.hpp"
#include "tests/identify/chance.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/program.hpp"

namespace {

// The promise for a measured drive of this kind: rms of the winding where nothing was fitted.
constexpr double most_K = 4;

int foretell(int seeds, int drives, std::uint64_t first, bool json) {
  identify::HoldOut held;
  held.fraction = 0.25;
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  std::vector<double> before, after;
  int answered = 0, kept = 0, kept_by_two = 0;
  double recorded_h = 0, worked_s = 0;  // by all cores
  for (int s = 0; s < seeds; ++s) {
    const std::uint64_t seed = first + static_cast<std::uint64_t>(s);
    const auto logs = tests::traction_drives(fmt::format("hotcore_traction_{}.csv", getpid()), seed, drives);
    for (const identify::Log& log : logs) recorded_h += log.of(identify::Role::time).back() / 3600;
    const std::clock_t begun = std::clock();
    const auto report = identify::discover(logs, std::nullopt, held);
    worked_s += static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC;
    const double two_K = report.held_out->before.core_K, found_K = report.held_out->after.core_K;
    before.push_back(two_K);
    after.push_back(found_K);
    answered += report.verdict != identify::Verdict::unknown_cause && report.verdict != identify::Verdict::insufficient;
    kept += found_K <= most_K;
    kept_by_two += two_K <= most_K;
    std::string tied;
    for (const auto& ids : report.tied) tied += fmt::format(" {}", fmt::join(ids, "+"));
    list.push_back({{"seed", seed},
                    {"verdict", identify::word(report.verdict)},
                    {"unseen_winding_K", {two_K, found_K}},
                    {"sets", tied}});
    fmt::print(stderr, "{:>3}/{} seed {:<8} {:<17} unseen winding {:6.2f} -> {:5.2f} K {}\n", s + 1, seeds, seed,
               identify::word(report.verdict), two_K, found_K, tied);
  }
  const auto worst = [](const std::vector<double>& of) { return *std::max_element(of.begin(), of.end()); };
  if (json)
    fmt::print("{}\n", nlohmann::ordered_json{{"answered", answered},
                                              {"within", kept},
                                              {"recorded_h", recorded_h},
                                              {"worked_s", worked_s},
                                              {"motors", list}}
                           .dump(2));
  else
    fmt::print(
        "{} motors, {} answered; on the last quarter, not fitted, the winding is missed by {:.1f} K rms in the median "
        "({:.1f} at worst; two resistors: {:.1f} and {:.1f}), by {:g} or less in {} (two resistors: {})\n"
        "{:.0f} h, each of {:.1f} s on one core\n",
        seeds, answered, identify::median(after), worst(after), identify::median(before), worst(before), most_K, kept,
        kept_by_two, recorded_h, worked_s / recorded_h);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "What identify foretells of traction motors of five masses\n"
      "\n"
      "Examples\n"
      "  traction --seeds 40 --first 121              one drive each\n"
      "  traction --seeds 20 --drives 5 --first 121   five each\n"
      "Exit codes: 0 done, 2 the command line is wrong.\n"};
  wire::pc::use_help(app, "traction");
  int seeds = 20, drives = 1;
  std::uint64_t first = tests::rotating_seed();
  bool json = false;
  app.add_option("--seeds", seeds, "motors")->capture_default_str()->check(wire::pc::between(1, 1e6));
  app.add_option("--drives", drives, "of each motor")->capture_default_str()->check(wire::pc::between(1, 1e3));
  app.add_option("--first", first, "first seed")
      ->capture_default_str()
      ->check(wire::pc::between(0, wire::pc::most_seed));
  app.add_flag("--json", json, "the drives as JSON");
  return wire::pc::run_program(app, argc, argv, [&] { return foretell(seeds, drives, first, json); });
}

// SPDX-License-Identifier: MIT
// Hides effects in logs, lets identify find them, and prints a table of all outcomes.
//   build/host/bin/score --duty robot --core sparse --seeds 20 [--first 1000] [--what
//   causes|clean|outside|pairs|eleven]
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <map>

#include "identify/search.hpp"
#include "identify/table.hpp"
#include "tests/identify/hidden_log.hpp"

namespace {

struct Outcome {
  std::string truth, answer;
  identify::Search found;
};

struct Tally {
  int logs = 0, named = 0, wrong = 0, tied_right = 0, tied_wrong = 0, silent = 0, unknown = 0;
};

std::string joined(const std::vector<std::string>& ids) {
  std::string out;
  for (const auto& id : ids) out += (out.empty() ? "" : "+") + id;
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Scores identify on logs with hidden effects"};
  std::string duty = "robot", core = "sparse", what = "causes", only, removed;
  int seeds = 5;
  std::uint64_t first = 1;
  double structure = 0.1, strength = 1;
  bool verbose = false;
  identify::Margins margins;
  app.add_option("--duty", duty, "robot or designed");
  app.add_option("--core", core, "none, sparse or dense");
  app.add_option("--what", what, "causes, clean, outside, pairs, eleven");
  app.add_option("--seeds", seeds, "logs a cause");
  app.add_option("--first", first, "first seed");
  app.add_option("--only", only, "one cause");
  app.add_option("--remove", removed, "take a cause out of the table");
  app.add_option("--structure", structure, "how far the clean motor is from two nodes, 1 = host-sim's default");
  app.add_option("--strength", strength, "of the effects, 1 = 1..10 K");
  app.add_option("--detect", margins.detect, "");
  app.add_option("--second", margins.second, "");
  app.add_option("--tie", margins.tie, "");
  app.add_option("--ratio", margins.adequate_ratio, "");
  app.add_option("--explained", margins.explained_share, "");
  app.add_flag("--verbose", verbose, "one line a log");
  CLI11_PARSE(app, argc, argv);

  const std::string path =
      (std::filesystem::temp_directory_path() / fmt::format("hotcore_score_{}.csv", getpid())).string();
  std::vector<std::vector<std::string>> truths;
  if (what == "clean")
    truths.push_back({});
  else if (what == "outside") {
    for (const auto& id : tests::outside()) truths.push_back({id});
  } else if (what == "pairs") {
    const auto all = tests::hideable();
    for (std::size_t i = 0; i < all.size(); ++i) truths.push_back({all[i], all[(i * 7 + 5) % all.size()]});
  } else {
    for (const auto& id : tests::hideable()) truths.push_back({id});
  }
  std::map<std::string, Tally> tallies;
  std::map<std::string, int> confusions;
  Tally all;
  double search_s = 0;
  int inside = 0, stated = 0;
  for (const auto& truth : truths) {
    if (!only.empty() && (truth.empty() || truth.front() != only)) continue;
    for (int s = 0; s < seeds; ++s) {
      tests::HiddenLogOptions o;
      o.duty = duty == "designed" ? tests::Duty::designed : tests::Duty::robot;
      o.core = core == "none" ? tests::Core::none : core == "dense" ? tests::Core::dense : tests::Core::sparse;
      o.effects = truth;
      o.strength = strength;
      o.structure = structure;
      o.small_ones = what == "eleven";
      o.seed = (first + static_cast<std::uint64_t>(s)) * 1000 + std::hash<std::string>()(joined(truth)) % 997;
      const auto log = tests::make_hidden_log(o, path);
      wire::pc::MotorFile file;
      file.motor = log.sheet;
      file.name = log.motor;
      const auto logs = identify::logs_of(identify::read_table(path), {}, log.sheet);
      const std::clock_t t0 = std::clock();
      const auto problem = identify::problem_of(logs, file);
      const auto found = identify::search(
          problem, margins, removed.empty() ? std::vector<std::string>{} : std::vector<std::string>{removed});
      search_s += static_cast<double>(std::clock() - t0) / CLOCKS_PER_SEC;

      auto sorted = truth;
      std::sort(sorted.begin(), sorted.end());
      Tally& t = tallies[joined(truth)];
      using identify::Verdict;
      const bool named = found.verdict == Verdict::explained || found.verdict == Verdict::partly_explained;
      const bool in_set = std::find(found.tied.begin(), found.tied.end(), sorted) != found.tied.end();
      std::string answer = identify::word(found.verdict);
      for (Tally* x : {&t, &all}) {
        ++x->logs;
        if (named && found.tied.front() == sorted)
          ++x->named;
        else if (named)
          ++x->wrong;
        else if (found.verdict == Verdict::ambiguous)
          ++(in_set ? x->tied_right : x->tied_wrong);
        else if (found.verdict == Verdict::adequate)
          ++x->silent;
        else
          ++x->unknown;
      }
      if (named || found.verdict == Verdict::ambiguous) {
        answer = named ? "" : "tie:";
        for (const auto& ids : found.tied) answer += (answer.empty() || answer == "tie:" ? "" : " | ") + joined(ids);
      }
      if (!(named && found.tied.front() == sorted)) ++confusions[joined(truth) + " -> " + answer];
      if (verbose) {
        fmt::print(
            "{} seed {} {} {:.1f} K: {} (base ratio {:.2f}, chosen {:.2f}, gain {:.1f}, explained {:.2f}, noise {:.3f} "
            "{:.3f} core {:.2f}) idle {:.0f}\n",
            joined(truth), o.seed, log.motor, log.core_error_K, answer, found.base.ratio, found.chosen.ratio,
            found.chosen.gain, found.chosen.explained, problem.noise.housing_white_K, problem.noise.housing_slow_K,
            problem.noise.core_white_K, problem.noise.idle_s);
        for (std::size_t i = 0; i < std::min<std::size_t>(4, found.singles.size()); ++i) {
          const auto& f = found.singles[i].fit;
          fmt::print("    {} {:.1f} at {:.3g}{}", joined(identify::ids_of(f.chosen)), found.singles[i].gain, f.x[4],
                     f.settled ? "" : " UNSETTLED");
        }
        fmt::print("\n");
        std::fflush(stdout);
      }
    }
  }
  (void)inside;
  (void)stated;
  fmt::print("{:<24} {:>5} {:>6} {:>6} {:>9} {:>9} {:>7} {:>8}\n", "truth", "logs", "named", "wrong", "tie+truth",
             "tie-truth", "silent", "unknown");
  for (const auto& [name, t] : tallies) {
    fmt::print("{:<24} {:>5} {:>6} {:>6} {:>9} {:>9} {:>7} {:>8}\n", name.empty() ? "(clean)" : name, t.logs, t.named,
               t.wrong, t.tied_right, t.tied_wrong, t.silent, t.unknown);
  }
  const double n = std::max(1, all.logs);
  fmt::print(
      "all {}: named right {:.3f}, named wrong {:.3f}, right or tied with the truth {:.3f}, other tie {:.3f}, silent "
      "{:.3f}, unknown {:.3f}; {:.2f} s a search\n",
      all.logs, all.named / n, all.wrong / n, (all.named + all.tied_right) / n, all.tied_wrong / n, all.silent / n,
      all.unknown / n, search_s / n);
  for (const auto& [what_, count] : confusions) fmt::print("  {} x {}\n", count, what_);
  std::filesystem::remove(path);
  return 0;
}

// SPDX-License-Identifier: MIT
// Hides effects in logs, lets identify find them, and holds the answers against what was promised.
//   build/host/bin/score                            the whole table, hours; --seeds 2 for a first look
//   build/host/bin/score designed-sparse outside-duty --seeds 3 --verbose
//   build/host/bin/score --list                     the rows
// With --check the end is an error when a figure of a row, or of all rows together, misses beyond bad luck what is held
// (score_table.hpp). Seeds rotate with HOTCORE_SEED.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/identify/chance.hpp"
#include "tests/identify/score_case.hpp"
#include "tests/identify/score_table.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/program.hpp"

namespace {

using identify::Verdict;
using tests::CaseResult, tests::Core, tests::Duty, tests::Outcome, tests::Table;

enum class Hidden { each_cause, nothing, outside, pairs, dominant, removed, zero };

struct Bound {
  const char* what;
  bool (*hit)(const CaseResult&);
  bool at_least;
  double promised;
  double held;  // the promise; or, where README tells that less is found, what was: there and with --first 2500000
};

bool right(const CaseResult& r) { return r.outcome() == Outcome::right; }
bool wrong(const CaseResult& r) { return r.outcome() == Outcome::wrong; }
bool covered(const CaseResult& r) { return right(r) || r.outcome() == Outcome::tied_right; }
bool alarm(const CaseResult& r) { return r.verdict != Verdict::adequate; }
bool unknown(const CaseResult& r) { return r.verdict == Verdict::unknown_cause; }
bool named(const CaseResult& r) { return r.named(); }
/// "Unknown" names nothing, though it prints what came closest.
bool dominant(const CaseResult& r) {
  if (!r.named() && r.verdict != Verdict::ambiguous) return false;
  return std::any_of(r.answer.begin(), r.answer.end(),
                     [&](const auto& ids) { return std::find(ids.begin(), ids.end(), r.truth.front()) != ids.end(); });
}

struct Row {
  const char* key;
  const char* title;
  Hidden hidden;
  Duty duty;
  Core core;
  int per_seed;  // logs per --seeds; 0: one for each thing hidden
  std::vector<Bound> bounds;
};

const std::vector<Row>& rows() {
  using enum Hidden;
  static const std::vector<Row> all = {
      {"duty-none",
       "robot duty, housing only",
       each_cause,
       Duty::robot,
       Core::none,
       0,
       {{"named right", right, true, 0.75, 0.74},
        {"named wrong", wrong, false, 0.015, 0.03},
        {"right or tied with the truth", covered, true, 0.85, 0.85}}},
      {"duty-sparse",
       "robot duty, housing + sparse winding",
       each_cause,
       Duty::robot,
       Core::sparse,
       0,
       {{"named right", right, true, 0.85, 0.85},
        {"named wrong", wrong, false, 0.01, 0.01},
        {"right or tied with the truth", covered, true, 0.92, 0.88}}},
      {"designed-sparse",
       "designed profile, housing + sparse winding",
       each_cause,
       Duty::designed,
       Core::sparse,
       0,
       {{"named right", right, true, 0.92, 0.91},
        {"named wrong", wrong, false, 0.01, 0.01},
        {"right or tied with the truth", covered, true, 0.97, 0.94}}},
      {"designed-dense",
       "designed profile, housing + dense winding",
       each_cause,
       Duty::designed,
       Core::dense,
       0,
       {{"named right", right, true, 0.97, 0.96},
        {"named wrong", wrong, false, 0.005, 0.005},
        {"right or tied with the truth", covered, true, 0.98, 0.97}}},
      {"clean-duty",
       "nothing hidden, robot duty",
       nothing,
       Duty::robot,
       Core::sparse,
       25,
       {{"alarms", alarm, false, 0.01, 0.01}}},
      {"clean-designed",
       "nothing hidden, designed profile",
       nothing,
       Duty::designed,
       Core::sparse,
       25,
       {{"alarms", alarm, false, 0.01, 0.01}}},
      {"clean-dense",
       "nothing hidden, designed profile, winding read all the time",
       nothing,
       Duty::designed,
       Core::dense,
       5,
       {{"alarms", alarm, false, 0.01, 0.01}}},
      {"outside-duty",
       "effects that the table does not know, robot duty",
       outside,
       Duty::robot,
       Core::sparse,
       0,
       {{"called unknown", unknown, true, 0.85, 0.69}, {"outside named", named, false, 0.05, 0.18}}},
      {"outside-designed",
       "effects that the table does not know, designed",
       outside,
       Duty::designed,
       Core::sparse,
       0,
       {{"called unknown", unknown, true, 0.95, 0.64}, {"outside named", named, false, 0.01, 0.21}}},
      {"pairs-duty",
       "two effects at once, robot duty",
       pairs,
       Duty::robot,
       Core::sparse,
       0,
       {{"named exactly", right, true, 0.85, 0.65}}},
      {"pairs-designed",
       "two effects at once, designed profile",
       pairs,
       Duty::designed,
       Core::sparse,
       0,
       {{"named exactly", right, true, 0.93, 0.80}}},
      {"eleven",
       "one effect over eleven small ones, designed",
       Hidden::dominant,
       Duty::designed,
       Core::sparse,
       0,
       {{"in the set", ::dominant, true, 0.90, 0.85}}},
      // Ours: what must not happen when the truth is not in the table, and when there is none.
      {"removed",
       "the hidden cause taken out of the table, designed",
       removed,
       Duty::designed,
       Core::sparse,
       0,
       {{"another one named", named, false, 0.05, 0.19}}},
      {"zero",
       "effects of strength zero, robot duty",
       zero,
       Duty::robot,
       Core::sparse,
       0,
       {{"alarms", alarm, false, 0.01, 0.01}}},
  };
  return all;
}

std::vector<std::vector<std::string>> effects_of(Hidden hidden) {
  std::vector<std::vector<std::string>> out;
  const auto all = tests::hideable();
  if (hidden == Hidden::nothing) return {{}};
  if (hidden == Hidden::outside) {
    for (const auto& id : tests::outside()) out.push_back({id});
  } else if (hidden == Hidden::pairs) {
    for (std::size_t i = 0; i < all.size(); ++i) out.push_back({all[i], all[(i + 9) % all.size()]});
  } else {
    for (const auto& id : all) out.push_back({id});
  }
  return out;
}

struct Arguments {
  std::vector<std::string> keys;
  std::string only, remove;
  int seeds = 20, at_most = 0;
  std::uint64_t first = tests::rotating_seed();
  double structure = 0.1, strength = 1, step_K = 0.1, current_noise = 0;
  bool mostly_small = false, verbose = false, explain = false, json = false, check = false, quick = false,
       blind = false;
  identify::Margins margins;
};

/// A row's logs, one after the other. Where few are drawn, each row draws its own: the same motors with the same causes
/// in all rows would be bad luck four times over, and chance is counted for logs that do not know of each other.
std::vector<tests::CaseOptions> cases_of(const Row& row, const Arguments& a) {
  const std::uint64_t first = a.first + (a.at_most > 0 ? 10'000 * static_cast<std::uint64_t>(&row - rows().data()) : 0);
  std::vector<tests::CaseOptions> out;
  for (int s = 0; s < a.seeds * std::max(1, row.per_seed); ++s) {
    for (const auto& effects : effects_of(row.hidden)) {
      if (!a.only.empty() && std::find(effects.begin(), effects.end(), a.only) == effects.end()) continue;
      tests::CaseOptions c;
      c.log.duty = row.duty;
      c.log.core = row.core;
      c.log.effects = effects;
      c.log.strength = row.hidden == Hidden::zero ? 0 : a.strength;
      c.log.mostly_small = a.mostly_small;
      c.log.structure = a.structure;
      c.log.step_K = a.step_K;
      c.log.current_noise = a.current_noise;
      c.blind = a.blind;
      c.log.small_ones = row.hidden == Hidden::dominant;
      std::uint64_t mixed = 0;
      for (const char letter : tests::joined(effects)) mixed = mixed * 131 + static_cast<unsigned char>(letter);
      c.log.seed = (first + static_cast<std::uint64_t>(s)) * 1000 + mixed % 997;
      if (row.hidden == Hidden::removed) c.removed = effects;
      if (!a.remove.empty()) c.removed.push_back(a.remove);
      c.margins = a.margins;
      c.gain = row.hidden == Hidden::each_cause && !a.quick;
      c.separability = !a.quick && (row.hidden == Hidden::each_cause || row.hidden == Hidden::pairs ||
                                    row.hidden == Hidden::removed || row.hidden == Hidden::outside);
      c.follow = row.hidden == Hidden::each_cause && row.core == Core::sparse && !a.quick;
      out.push_back(std::move(c));
    }
  }
  if (a.at_most > 0 && row.hidden != Hidden::nothing && out.size() > static_cast<std::size_t>(a.at_most)) {
    std::mt19937_64 random(first);
    for (std::size_t i = out.size() - 1; i > 0; --i) std::swap(out[i], out[random() % (i + 1)]);
    out.resize(static_cast<std::size_t>(a.at_most));
  }
  return out;
}

/// What a row's answers say beside its own bounds.
void add_measures(const Row& row, const std::vector<CaseResult>& results, Table& table) {
  int far = 0, far_named = 0, near = 0, near_named = 0, seen = 0, seen_named = 0, seen_covered = 0, ties = 0,
      resolved = 0, parameters = 0, parameters_right = 0, worse = 0, far_answered = 0, far_unknown = 0;
  std::vector<double> ratios;
  for (const CaseResult& r : results) {
    if (r.D && *r.D > 40) ++far, far_named += right(r), far_answered += r.named(), far_unknown += unknown(r);
    if (r.D && *r.D < 3) ++near, near_named += r.named();
    if (r.D && *r.D >= 3) ++seen, seen_named += right(r), seen_covered += covered(r);
    if (r.resolved) ++ties, resolved += *r.resolved;
    parameters += r.parameters;
    parameters_right += r.parameters_right;
    if (!r.core_before_K) continue;
    ratios.push_back(*r.core_before_K / std::max(*r.core_after_K, 1e-3));
    worse += *r.core_after_K > *r.core_before_K + 0.05;  // K: half a step of the housing sensor
  }
  if (row.hidden == Hidden::removed && far > 0)
    table.add(row.key, "D > 40 another one named", far_answered, far, false, row.bounds[0].promised, 0.15);
  if (row.hidden == Hidden::outside && far > 0) {
    table.add(row.key, "D > 40 called unknown", far_unknown, far, true, row.bounds[0].promised, 0.83);
    table.add(row.key, "D > 40 outside named", far_answered, far, false, row.bounds[1].promised, 0.17);
  }
  if (row.hidden == Hidden::pairs && seen > 0) {
    table.add(row.key, "D >= 3 named exactly", seen_named, seen, true, row.bounds[0].promised, 0.84);
    table.add(row.key, "D > 40 named exactly", far_named, far, true, row.bounds[0].promised, row.bounds[0].promised);
  }
  if (ratios.empty()) return;
  table.add_median(row.key, "winding unseen: error before/after", ratios, row.duty == Duty::designed ? 5 : 3, 1.0);
  table.add(row.key, "winding unseen: worse", worse, static_cast<int>(ratios.size()), false, 0.02, 0.04);
  table.add(row.key, "D > 40 named right", far_named, far, true, 0.93, 0.93);
  // What some rival imitates to within the noise cannot be named, and the line on D < 3 forbids to try.
  table.add(row.key, "D >= 3 named right", seen_named, seen, true, row.bounds[0].promised, row.bounds[0].promised);
  table.add(row.key, "D >= 3 right or tied", seen_covered, seen, true, row.bounds[2].promised, row.bounds[2].promised);
  table.add(row.key, "D < 3 named", near_named, near, false, 0.05, 0.15);
  table.add(row.key, "parameters within 2 std. errors", parameters_right, parameters, true, 0.90, 0.90);
  if (row.core == Core::sparse) table.add(row.key, "ties that the advice resolves", resolved, ties, true, 0.80, 0.80);
  // Honesty: against the truths of other logs the answers must be worth nothing.
  int by_chance = 0;
  for (std::size_t i = 0; i < results.size(); ++i)
    by_chance += results[i].outcome_for(results[(i + 1) % results.size()].truth) == Outcome::right;
  table.add(row.key, "right against shuffled truths", by_chance, static_cast<int>(results.size()), false, 0.05, 0.05);
}

void print_confusions(const std::vector<CaseResult>& results) {
  std::map<std::string, int> counts;
  for (const CaseResult& r : results) {
    if (!right(r))
      ++counts[fmt::format("{} -> {}", r.truth.empty() ? "(nothing)" : tests::joined(r.truth), r.answer_text())];
  }
  for (const auto& [what, count] : counts) fmt::print("    {} x {}\n", count, what);
}

/// Says from time to time how far it is.
class Progress {
 public:
  explicit Progress(std::size_t all) : all_(all) {}
  void operator()(const std::string& row) {
    ++done_;
    const auto now = std::chrono::steady_clock::now();
    if (now - said_ < std::chrono::seconds(isatty(STDERR_FILENO) != 0 ? 1 : 30)) return;
    said_ = now;
    const double spent_s = std::chrono::duration<double>(now - start_).count();
    fmt::print(stderr, "{} of {} logs ({}), {:.0f} s to go\n", done_, all_, row,
               spent_s / static_cast<double>(done_) * static_cast<double>(all_ - done_));
  }

 private:
  std::size_t all_, done_ = 0;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point said_ = start_;
};

int score(const Arguments& a) {
  std::vector<std::pair<const Row*, std::vector<tests::CaseOptions>>> plan;
  std::size_t all = 0;
  for (const Row& row : rows()) {
    if (!a.keys.empty() && std::find(a.keys.begin(), a.keys.end(), row.key) == a.keys.end()) continue;
    plan.emplace_back(&row, cases_of(row, a));
    all += plan.back().second.size();
  }
  const std::string path =
      (std::filesystem::temp_directory_path() / fmt::format("hotcore_score_{}.csv", getpid())).string();
  Table table;
  Progress progress(all);
  double search_s = 0;
  for (const auto& [row, cases] : plan) {
    std::vector<CaseResult> results;
    for (const tests::CaseOptions& c : cases) {
      results.push_back(tests::play(c, path));
      const CaseResult& r = results.back();
      search_s += r.search_s;
      if (a.verbose) {
        fmt::print(
            "{} seed {}: {}; {}{}{}\n", tests::joined(r.truth), c.log.seed, r.answer_text(), r.remarks,
            r.D ? fmt::format(" D {:.1f};", *r.D) : "",
            r.core_before_K ? fmt::format(" winding {:.2f} -> {:.2f} K", *r.core_before_K, *r.core_after_K) : "");
        for (const std::string& step : r.steps) {
          if (a.explain) fmt::print("    {}\n", step);
        }
        std::fflush(stdout);
      }
      progress(row->key);
    }
    const std::size_t before = table.size();
    for (const Bound& b : row->bounds) {
      table.add(row->key, b.what, static_cast<int>(std::count_if(results.begin(), results.end(), b.hit)),
                static_cast<int>(results.size()), b.at_least, b.promised, b.held);
    }
    add_measures(*row, results, table);
    if (a.json) continue;
    fmt::print("{}", table.text(before));
    if (!a.quick) print_confusions(results);
    std::fflush(stdout);
  }
  std::filesystem::remove(path);
  const Table pooled = table.pooled();
  if (a.json)
    fmt::print(
        "{}\n",
        nlohmann::ordered_json{
            {"first_seed", a.first}, {"structure", a.structure}, {"figures", table.json()}, {"all_rows", pooled.json()}}
            .dump(2));
  else
    fmt::print("{}{} logs, first seed {}, structure {:g}, {:.2f} s a search\n", pooled.text(), all, a.first,
               a.structure, search_s / static_cast<double>(std::max<std::size_t>(all, 1)));
  return a.check && !(table.holds() && pooled.holds()) ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Scores identify on logs with hidden effects\n"
      "\n"
      "Examples\n"
      "  score --list                                   the rows, and what each hides in what\n"
      "  score --seeds 2                                all of them, each figure beside what was promised\n"
      "  score duty-sparse --seeds 2 --first 770 --quick\n"
      "  score duty-sparse --only hot_spot --verbose --explain\n"
      "Exit codes: 0 done, 1 --check found less than is held, 2 the command line is wrong.\n"};
  wire::pc::use_help(app, "score");
  Arguments a;
  bool list = false;
  app.add_option("row", a.keys, "rows of the table; none: all")->check([](const std::string& key) {
    for (const Row& row : rows()) {
      if (key == row.key) return std::string();
    }
    return "there is no row '" + key + "' in --list";
  });
  app.add_flag("--list", list, "the rows");
  app.add_option("--seeds", a.seeds, "logs for each hidden thing")
      ->capture_default_str()
      ->check(wire::pc::between(1, 1e6));
  app.add_option("--at-most", a.at_most,
                 "logs of a row that hides something, drawn by the first seed and other in each row")
      ->check(wire::pc::between(0, 1e6));
  app.add_option("--first", a.first, "first seed")
      ->capture_default_str()
      ->check(wire::pc::between(0, wire::pc::most_seed));
  const auto named = [](std::vector<std::string> all) {
    return [all](const std::string& id) {
      if (std::find(all.begin(), all.end(), id) != all.end()) return std::string();
      const std::string hint = wire::pc::did_you_mean(id, all);
      return "there is no '" + id + "'" + (hint.empty() ? "" : hint);
    };
  };
  std::vector<std::string> hidden = tests::hideable(), known;
  for (const std::string& id : tests::outside()) hidden.push_back(id);
  for (const identify::Cause& cause : identify::causes()) known.push_back(cause.id);
  app.add_option("--only", a.only, "logs that hide this effect")->check(named(hidden));
  app.add_option("--remove", a.remove, "take a cause out of the table")->check(named(known));
  app.add_option("--structure", a.structure, "how far the clean motor is from two nodes, 1 = host-sim's default")
      ->check(wire::pc::between(0.01, 1))  // of no size at all, teeth and yoke have no time constant
      ->capture_default_str();
  app.add_option("--step", a.step_K, "K, of what the sensors tell: 1 = whole degrees")
      ->capture_default_str()
      ->check(wire::pc::between(0.001, 10));
  app.add_option("--current-noise", a.current_noise, "white, of the current's rms")
      ->capture_default_str()
      ->check(wire::pc::between(0, 10));
  app.add_option("--strength", a.strength, "of the effects, 1 = 1..10 K")
      ->capture_default_str()
      ->check(wire::pc::between(0, 100));
  app.add_flag("--mostly-small", a.mostly_small, "sizes of 1..10 K even in their logarithm: half below 3.2 K");
  const struct {
    const char* option;
    double* margin;
    const char* what;
  } margins[] = {{"--detect", &a.margins.detect, "evidence asked for a first cause"},
                 {"--second", &a.margins.second, "for a second one"},
                 {"--tie", &a.margins.tie, "lead asked for a name of two causes"},
                 {"--tie-alone", &a.margins.tie_alone, "lead asked for a name of one"},
                 {"--worth", &a.margins.worth_K, "K that a first cause must move"},
                 {"--noticeable", &a.margins.noticeable_K, "K that a second one must move"}};
  for (const auto& [option, margin, what] : margins)
    app.add_option(option, *margin, what)->capture_default_str()->check(wire::pc::between(0, 1e6));
  auto* quick = app.add_flag("--quick", a.quick, "answers only: no gain, no parameters' rivals, no experiments");
  app.add_flag("--blind", a.blind, "identify is given no motor sheet")->needs(quick);
  app.add_flag("--check", a.check, "end with an error where what is held is missed");
  app.add_flag("--verbose", a.verbose, "one line a log");
  app.add_flag("--explain", a.explain, "with --verbose, identify's reasoning");
  app.add_flag("--json", a.json, "the table as JSON");
  return wire::pc::run_program(app, argc, argv, [&] {
    if (!list) return score(a);
    for (const Row& row : rows()) fmt::print("{:<18} {}\n", row.key, row.title);
    return 0;
  });
}

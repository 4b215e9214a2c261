// SPDX-License-Identifier: MIT
#include "tests/identify/score_case.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>

#include "identify/answer/answer.hpp"
#include "identify/answer/experiment.hpp"
#include "identify/discover.hpp"
#include "identify/fit/leeway.hpp"
#include "identify/fit/replayed.hpp"
#include "identify/log/table.hpp"
#include "identify/search/problem_of.hpp"

namespace tests {
namespace {

using identify::Fit, identify::Problem, identify::Found, identify::Verdict;

constexpr double row_s = 0.1;

std::vector<identify::Log> read(const HiddenLog& log, const std::string& path) {
  return identify::logs_of(identify::read_table(path), {}, log.sheet.motor);
}

/// rms of the simulated winding against the truth, log 0 of the problem.
double core_error_K(const Problem& problem, const Fit& fit, const std::vector<double>& truth_degC) {
  const auto replayed = identify::replayed(problem, fit, 0);
  const identify::Bins& log = problem.logs.front();
  double sum = 0;
  int n = 0;
  for (std::size_t k = 0; k < log.bins.size(); ++k) {
    const double place = (static_cast<double>(k) + static_cast<double>(log.bins[k].core_at)) * log.width_s / row_s;
    const auto row = static_cast<std::size_t>(std::lround(place));
    if (row >= truth_degC.size()) break;
    sum += std::pow(replayed.core_degC[k] - truth_degC[row], 2);
    ++n;
  }
  return std::sqrt(sum / std::max(n, 1));
}

void measure_gain(const CaseOptions& options, const HiddenLog& log, const Problem& problem, const Found& found,
                  const std::string& path, CaseResult& result) {
  HiddenLogOptions other = options.log;
  other.again = 1;
  const HiddenLog second = make_hidden_log(other, path);
  Problem unseen = problem;
  unseen.logs = identify::problem_of(read(log, path), log.sheet).logs;
  const bool extends = found.verdict != Verdict::adequate && found.verdict != Verdict::unknown_cause;
  result.core_before_K = core_error_K(unseen, identify::transferred(unseen, found.baseline.fit), second.core_degC);
  result.core_after_K = extends
                            ? core_error_K(unseen, identify::transferred(unseen, found.chosen.fit), second.core_degC)
                            : *result.core_before_K;
}

void check_parameters(const HiddenLog& log, const Problem& problem, const Found& found, CaseResult& result) {
  if (result.outcome() != Outcome::right) return;
  const Fit& fit = found.chosen.fit;
  for (std::size_t c = 0; c < fit.chosen.size(); ++c) {
    const auto lines = identify::cause_lines(problem, fit, c);
    const auto truth = log.parameters.find(identify::causes()[static_cast<std::size_t>(fit.chosen[c].cause)].id);
    if (truth == log.parameters.end()) continue;
    for (std::size_t p = 0; p < lines.size() && p < truth->second.size(); ++p) {
      const bool right = std::abs(lines[p].value - truth->second[p]) <= 2 * lines[p].std_error;
      ++result.parameters;
      result.parameters_right += right;
      if (!right)
        result.remarks += fmt::format(" {} {:.4g} +- {:.2g}, truly {:.4g};", lines[p].name, lines[p].value,
                                      lines[p].std_error, truth->second[p]);
    }
  }
}

/// The log as the fitted truth makes it, without noise.
Problem without_noise(const Problem& problem, const std::vector<std::string>& truth) {
  Problem out = problem;
  std::vector<identify::Chosen> chosen;
  for (const std::string& id : truth) chosen.push_back({identify::cause_named(id), -1});
  const auto replayed = identify::replayed(problem, identify::fit(problem, chosen), 0);
  for (std::size_t k = 0; k < out.logs.front().bins.size(); ++k) {
    identify::Bin& bin = out.logs.front().bins[k];
    if (bin.housing_n > 0) bin.housing_degC = replayed.housing_degC[k];
    if (bin.core_n > 0) bin.core_degC = replayed.core_degC[k];
  }
  return out;
}

/// The log itself without noise, of an effect that the table does not know; what no motor is without is averaged over.
Problem as_it_was(const HiddenLogOptions& options, const Problem& problem, const HiddenLog& log,
                  const std::string& path) {
  HiddenLogOptions quiet = options;
  quiet.noisy = false;
  make_hidden_log(quiet, path);
  Problem out = identify::problem_of(read(log, path), log.sheet);
  out.noise = problem.noise;
  out.leeway = identify::ordinary_leeway(out, identify::fit(out, {}));
  return out;
}

/// How far the nearest rival stays behind on a log without noise: of the sets with no more causes than the truth, or
/// with two where the table does not hold the truth.
double separability(const Problem& clean, const std::vector<std::string>& truth,
                    const std::vector<std::string>& removed) {
  const auto out_of_table = [&](const identify::Cause& cause) {
    return std::find(removed.begin(), removed.end(), cause.id) != removed.end();
  };
  const Fit base = identify::fit(clean, {});
  double D = 2 * base.misfit;
  std::vector<Fit> singles;
  for (std::size_t c = 0; c < identify::causes().size(); ++c) {
    const identify::Cause& cause = identify::causes()[c];
    if (!clean.possible(cause) || identify::of_one_log(cause) || out_of_table(cause) ||
        truth == std::vector<std::string>{cause.id})
      continue;
    singles.push_back(identify::fit(clean, {{static_cast<int>(c), -1}}, {&base}));
    D = std::min(D, 2 * singles.back().misfit);
  }
  const bool known = identify::cause_named(truth.front()) >= 0 && removed.empty();
  if (truth.size() == 1 && known) return D;
  std::sort(singles.begin(), singles.end(), [](const Fit& a, const Fit& b) { return a.misfit < b.misfit; });
  for (std::size_t a = 0; a < singles.size(); ++a) {
    for (std::size_t b = a + 1; b < singles.size(); ++b) {
      const std::vector<identify::Chosen> pair = {singles[a].chosen.front(), singles[b].chosen.front()};
      const identify::Cause &x = identify::cause_of(pair[0]), &y = identify::cause_of(pair[1]);
      const bool one_slot = x.edit == identify::Edit::sink_law && y.edit == identify::Edit::sink_law;
      if (one_slot || std::string(x.id) == y.id || identify::ids_of(pair) == truth) continue;
      constexpr int look_steps = 3, most_steps = 20;
      const Fit look = identify::fit(clean, pair, {&singles[a], &singles[b]}, look_steps);
      if (!look.valid() || 2 * (look.misfit - 2 * look.promise) > D) continue;
      D = std::min(D, 2 * identify::fit(clean, pair, {&look}, most_steps).misfit);
    }
  }
  return D;
}

/// Plays the advised experiment once and asks again with both logs.
void follow(const CaseOptions& options, const HiddenLog& log, const std::vector<identify::Log>& first,
            const Problem& problem, const Found& found, const std::string& path, CaseResult& result) {
  const auto advice = identify::experiment(problem, found);
  if (!advice) return;
  HiddenLogOptions bench = options.log;
  bench.again = 2;
  for (const identify::ProfileStep& p : advice->profile)
    bench.profile.push_back({p.seconds, p.current_A, p.speed_rad_per_s});
  make_hidden_log(bench, path);
  auto both = first;
  for (identify::Log& more : read(log, path)) both.push_back(std::move(more));
  CaseResult again;
  Problem joint = identify::problem_of(both, log.sheet);
  const Found now = identify::search(joint, options.margins, options.removed);
  again.truth = result.truth;
  again.verdict = now.verdict;
  again.answer = now.tied;
  result.resolved = again.outcome() == Outcome::right;
  result.remarks += fmt::format(" after the advised experiment ({}): {};", advice->why, again.answer_text());
}

}  // namespace

std::string joined(const std::vector<std::string>& ids) {
  std::string out;
  for (const auto& id : ids) out += (out.empty() ? "" : "+") + id;
  return out;
}

bool CaseResult::named() const { return identify::names_causes(verdict); }

Outcome CaseResult::outcome_for(const std::vector<std::string>& ids) const {
  const bool among = std::find(answer.begin(), answer.end(), ids) != answer.end();
  if (named()) return !ids.empty() && answer.front() == ids ? Outcome::right : Outcome::wrong;
  if (verdict == Verdict::ambiguous) return among ? Outcome::tied_right : Outcome::tied_wrong;
  return verdict == Verdict::adequate ? Outcome::silent : Outcome::unknown;
}

std::string CaseResult::answer_text() const {
  if (!named() && verdict != Verdict::ambiguous) return identify::word(verdict);
  std::string out;
  for (const auto& ids : answer) out += (out.empty() ? "" : " | ") + joined(ids);
  return (named() ? "" : "tie: ") + out;
}

CaseResult play(const CaseOptions& options, const std::string& path) {
  const HiddenLog log = make_hidden_log(options.log, path);
  const auto logs = read(log, path);
  CaseResult result;
  result.truth = options.log.effects;
  std::sort(result.truth.begin(), result.truth.end());
  const std::clock_t start = std::clock();
  Problem problem = identify::problem_of(logs, options.blind ? std::nullopt : std::optional(log.sheet));
  const Found found = identify::search(problem, options.margins, options.removed);
  result.search_s = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  result.verdict = found.verdict;
  result.answer = found.tied;
  result.steps = found.steps;
  result.remarks = fmt::format("{} {:.1f} K, ratio {:.2f} -> {:.2f};", log.sheet.name, log.core_error_K,
                               found.baseline.ratio, found.chosen.ratio);
  if (!options.blind) check_parameters(log, problem, found, result);
  if (options.separability) {
    const bool outside = identify::cause_named(result.truth.front()) < 0;
    result.D = separability(outside ? as_it_was(options.log, problem, log, path) : without_noise(problem, result.truth),
                            result.truth, options.removed);
  }
  if (options.gain) measure_gain(options, log, problem, found, path, result);
  if (options.follow && found.verdict == Verdict::ambiguous) follow(options, log, logs, problem, found, path, result);
  return result;
}

}  // namespace tests

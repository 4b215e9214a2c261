// SPDX-License-Identifier: MIT
#include "identify/search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "identify/baseline.hpp"

namespace identify {
namespace {

// Two causes at most: three at once imitate nearly anything (of seven forms that the table does not know, five were
// "explained" by some three of it); two do not.
//
// Every pair is looked at with a few Newton steps, and those that may come near the best are fitted to the end. A look
// errs by less than this in evidence, as far as the best pair is concerned.
constexpr int look_steps = 2;
constexpr double look_errs = 40;
constexpr std::size_t most_finished = 24;
constexpr std::size_t beam = 3;  // best singles whose partners start from every place, not only where they ended alone

double ratio_of(const Fit& f) { return std::sqrt(2 * f.misfit / std::max(1, f.readings)); }

Candidate candidate(const Candidate& base, Fit f) {
  Candidate c;
  c.gain = base.fit.bic() - f.bic();
  c.ratio = ratio_of(f);
  const double before = base.ratio * base.ratio - 1, after = c.ratio * c.ratio - 1;
  c.explained = before > 0 ? 1 - std::max(0.0, after) / before : 0;
  c.fit = std::move(f);
  return c;
}

void sort(std::vector<Candidate>& list) {
  std::sort(list.begin(), list.end(), [](const Candidate& a, const Candidate& b) { return a.gain > b.gain; });
}

/// Two causes that claim the same slot of the model cannot both be applied.
bool compatible(const std::vector<Chosen>& have, const Chosen& more) {
  const Cause& b = causes()[static_cast<std::size_t>(more.cause)];
  int nodes = b.edit == Edit::mass || b.edit == Edit::hot_spot;
  for (const Chosen& c : have) {
    const Cause& a = causes()[static_cast<std::size_t>(c.cause)];
    if (c.cause == more.cause && (b.edit != Edit::cooling_of_log || c.log == more.log)) return false;
    if (a.edit == Edit::sink_law && b.edit == Edit::sink_law) return false;
    nodes += a.edit == Edit::mass || a.edit == Edit::hot_spot;
  }
  return nodes <= 2;
}

std::vector<Chosen> available(const Problem& problem, const std::vector<std::string>& without) {
  std::vector<Chosen> out;
  for (std::size_t c = 0; c < causes().size(); ++c) {
    const Cause& cause = causes()[c];
    if (!problem.possible(cause) || std::find(without.begin(), without.end(), cause.id) != without.end()) continue;
    if (cause.edit != Edit::cooling_of_log) {
      out.push_back({static_cast<int>(c), -1});
      continue;
    }
    for (std::size_t l = 0; l < problem.logs.size(); ++l) out.push_back({static_cast<int>(c), static_cast<int>(l)});
  }
  return out;
}

/// Where the residual is more than noise, it is a model's error: larger than noise and alike for minutes. Differences
/// between models are then as uncertain, and evidence counts by so much less: by the excess variance and by the number
/// of neighbouring residuals that say the same (the integrated autocorrelation).
double bluntness(const Problem& problem, const Candidate& c, double adequate_ratio) {
  if (c.ratio < adequate_ratio) return 1;
  double zero = 0;
  std::vector<double> e;
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    const Replayed r = replayed(problem, c.fit, static_cast<int>(l));
    for (const double w : r.whitened) {
      if (!std::isnan(w)) e.push_back(w), zero += w * w;
    }
  }
  double alike = 1;
  for (std::size_t lag = 1; lag < e.size() / 4; ++lag) {
    double sum = 0;
    for (std::size_t i = lag; i < e.size(); ++i) sum += e[i] * e[i - lag];
    if (sum < 0.05 * zero) break;
    alike += 2 * sum / zero;
  }
  return c.ratio * c.ratio * alike;
}

/// How far two fits differ, rms over the logs: the larger of winding and housing reading.
double moved_K(const Problem& problem, const Fit& a, const Fit& b) {
  double core = 0, housing = 0, n = 0;
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    const Replayed x = replayed(problem, a, static_cast<int>(l)), y = replayed(problem, b, static_cast<int>(l));
    for (std::size_t k = 0; k < x.core_degC.size(); ++k) {
      core += std::pow(x.core_degC[k] - y.core_degC[k], 2);
      housing += std::pow(x.housing_degC[k] - y.housing_degC[k], 2);
      n += 1;
    }
  }
  return std::sqrt(std::max(core, housing) / n);
}

/// The error on the last quarter of each log of a set fitted to the rest: of the winding where it is read.
double unseen_error_K(const Problem& problem, const std::vector<Chosen>& chosen, const Fit& warm) {
  const Problem first = first_part(problem, 0.25);
  const Fit f = fit(first, chosen, {&warm});
  if (f.x.size() == 0) return 1e300;
  const Rmse e = rmse_of(last_part(problem, 0.25), f);
  return std::isnan(e.core_K) ? e.housing_K : e.core_K;
}

std::string listed(const std::vector<Chosen>& chosen) {
  std::string out;
  for (const std::string& id : ids_of(chosen)) out += (out.empty() ? "" : " + ") + id;
  return out;
}

/// A winding read now and then does not show its own noise. The best model's residuals do.
void refine_core_noise(Problem& problem, const Fit& best) {
  double sum = 0;
  int n = 0;
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    for (const double r : replayed(problem, best, static_cast<int>(l)).core_residual_K) {
      if (!std::isnan(r)) sum += r * r, ++n;
    }
  }
  if (n >= 10) problem.noise.core_white_K = std::clamp(std::sqrt(sum / n), 0.5, 3.0);
}

/// Every cause alone, best first.
std::vector<Candidate> singles_of(const Problem& problem, const std::vector<Chosen>& all, const Candidate& base,
                                  const std::vector<Candidate>& before) {
  std::vector<Candidate> out;
  for (const Chosen& c : all) {
    const auto known = std::find_if(before.begin(), before.end(),
                                    [&](const Candidate& b) { return b.fit.chosen == std::vector<Chosen>{c}; });
    Fit f = known == before.end() ? fit(problem, {c}, {&base.fit}) : fit(problem, {c}, {&known->fit});
    if (f.x.size() > 0) out.push_back(candidate(base, std::move(f)));
  }
  sort(out);
  return out;
}

/// The pairs that may come near the best one, fitted to the end, best first.
std::vector<Candidate> pairs_of(const Problem& problem, const Candidate& base, const std::vector<Candidate>& singles) {
  const auto hoped = [](const Fit& f) { return f.bic() - 2 * f.promise; };
  std::vector<Fit> looks;
  for (std::size_t a = 0; a < singles.size(); ++a) {
    const Fit& better = singles[a].fit;
    for (std::size_t b = a + 1; b < singles.size(); ++b) {
      if (!compatible(better.chosen, singles[b].fit.chosen.front())) continue;
      const std::vector<Chosen> set = {better.chosen.front(), singles[b].fit.chosen.front()};
      Fit f = fit(problem, set, {&better, &singles[b].fit}, look_steps);
      if (a < beam) {
        Fit anew = fit(problem, set, {&better}, look_steps);
        if (anew.x.size() > 0 && (f.x.size() == 0 || hoped(anew) < hoped(f))) f = std::move(anew);
      }
      if (f.x.size() > 0) looks.push_back(std::move(f));
    }
  }
  std::sort(looks.begin(), looks.end(), [&](const Fit& a, const Fit& b) { return hoped(a) < hoped(b); });
  std::vector<Candidate> out;
  double best = 1e300;
  for (std::size_t i = 0; i < std::min(most_finished, looks.size()); ++i) {
    if (hoped(looks[i]) > best + look_errs) break;
    Fit f = fit(problem, looks[i].chosen, {&looks[i]});
    best = std::min(best, f.bic());
    out.push_back(candidate(base, std::move(f)));
  }
  sort(out);
  return out;
}

/// Why the best pair is not believed; empty when it is.
std::string why_no_pair(const Problem& problem, const std::vector<Candidate>& pairs, const Candidate& single,
                        const Margins& margins) {
  const std::string first = listed(single.fit.chosen);
  if (pairs.empty()) return fmt::format("No further cause goes with {}.", first);
  const Candidate& pair = pairs.front();
  const std::string both = listed(pair.fit.chosen);
  const double more = pair.gain - single.gain;
  if (!(more > margins.second * bluntness(problem, pair, margins.adequate_ratio)))
    return fmt::format("A further cause would gain {:.1f} at most, less than {:.0f}: stopped at {}.", more,
                       margins.second, first);
  const double moved = moved_K(problem, pair.fit, single.fit);
  if (moved < margins.noticeable_K)
    return fmt::format(
        "{} would gain {:.1f} more, but moves no temperature by more than {:.2f} K rms: not worth a name.", both, more,
        moved);
  // Veto: where something else is wrong, one more cause can fit the past and spoil the future.
  if (pair.ratio > margins.adequate_ratio || single.ratio > margins.adequate_ratio) {
    const double fewer_K = unseen_error_K(problem, single.fit.chosen, single.fit);
    const double more_K = unseen_error_K(problem, pair.fit.chosen, pair.fit);
    if (more_K > 1.1 * fewer_K)
      return fmt::format(
          "{} fits better, but misses the last quarter by {:.1f} K where {} misses it by {:.1f} K: refused.", both,
          more_K, first, fewer_K);
  }
  return "";
}

}  // namespace

const char* word(Verdict v) {
  switch (v) {
    case Verdict::adequate:
      return "adequate";
    case Verdict::explained:
      return "explained";
    case Verdict::partly_explained:
      return "partly_explained";
    case Verdict::ambiguous:
      return "ambiguous";
    case Verdict::unknown_cause:
      return "unknown_cause";
    case Verdict::insufficient:
      return "insufficient";
  }
  return "insufficient";
}

std::vector<std::string> ids_of(const std::vector<Chosen>& chosen) {
  std::vector<std::string> out;
  for (const Chosen& c : chosen) out.emplace_back(causes()[static_cast<std::size_t>(c.cause)].id);
  std::sort(out.begin(), out.end());
  return out;
}

Search search(const Problem& given, const Margins& margins, const std::vector<std::string>& without) {
  Problem problem = given;
  Search out;
  const auto all = available(problem, without);
  const bool sparse_core = problem.any_core() && problem.noise.core_slow_K == 0;
  for (int pass = 0; pass < (sparse_core ? 2 : 1); ++pass) {
    Candidate base;
    base.fit = pass == 0 ? fit(problem, {}) : fit(problem, {}, {&out.base.fit});
    base.ratio = ratio_of(base.fit);
    out.base = std::move(base);
    out.singles = singles_of(problem, all, out.base, out.singles);
    if (pass == 0 && sparse_core && !out.singles.empty()) {
      refine_core_noise(problem, out.singles.front().gain > 0 ? out.singles.front().fit : out.base.fit);
    }
  }
  out.chosen = out.base;
  out.steps.push_back(
      fmt::format("The two-resistor model was fitted; what it leaves is {:.2f} times the noise.", out.base.ratio));
  const bool detected = !out.singles.empty() && out.singles.front().gain > margins.detect;
  const double first_moves = detected ? moved_K(problem, out.singles.front().fit, out.base.fit) : 0;
  if (!detected || (first_moves < margins.noticeable_K && out.base.ratio < margins.adequate_ratio)) {
    out.verdict = out.base.ratio < margins.adequate_ratio ? Verdict::adequate : Verdict::unknown_cause;
    out.steps.push_back(
        detected
            ? fmt::format(
                  "{} gains {:.1f} in evidence, but moves no temperature by more than {:.2f} K rms: not worth a name.",
                  listed(out.singles.front().fit.chosen), out.singles.front().gain, first_moves)
            : fmt::format("No single cause gains more than {:.0f} in evidence (the best, {}, gains {:.1f}).",
                          margins.detect, out.singles.empty() ? "none" : listed(out.singles.front().fit.chosen),
                          out.singles.empty() ? 0.0 : out.singles.front().gain));
    return out;
  }

  out.sets = out.singles;
  std::vector<Candidate> pairs = pairs_of(problem, out.base, out.singles);
  // A second cause may only have helped the first out of a poor valley: each alone starts again from where the pair
  // ended, and the pair must beat that.
  for (std::size_t i = 0; i < std::min(beam, pairs.size()); ++i) {
    for (Candidate& alone : out.sets) {
      const auto& both = pairs[i].fit.chosen;
      if (std::find(both.begin(), both.end(), alone.fit.chosen.front()) == both.end()) continue;
      Fit again = fit(problem, alone.fit.chosen, {&pairs[i].fit});
      if (again.x.size() > 0 && again.cost < alone.fit.cost) alone = candidate(out.base, std::move(again));
    }
  }
  sort(out.sets);
  if (const std::string refusal = why_no_pair(problem, pairs, out.sets.front(), margins); refusal.empty()) {
    out.steps.push_back(fmt::format("{} gains {:.1f}, {:.1f} more than {}.", listed(pairs.front().fit.chosen),
                                    pairs.front().gain, pairs.front().gain - out.sets.front().gain,
                                    listed(out.sets.front().fit.chosen)));
    out.sets = std::move(pairs);
  } else {
    out.steps.push_back(refusal);
  }
  out.sets.front().chosen = true;
  out.chosen = out.sets.front();
  const std::vector<std::string> best_ids = ids_of(out.chosen.fit.chosen);
  out.tied.push_back(best_ids);
  // Where even the best is not adequate, sets that explain the same to one part in a hundred cannot be ranked at all.
  const double blunt = bluntness(problem, out.chosen, margins.adequate_ratio);
  const double tie = blunt > 1 ? std::max(margins.tie * blunt, 0.01 * out.chosen.gain) : margins.tie;
  for (Candidate& c : out.sets) {
    if (c.chosen || out.chosen.gain - c.gain >= tie) continue;
    const auto ids = ids_of(c.fit.chosen);
    if (std::find(out.tied.begin(), out.tied.end(), ids) != out.tied.end()) continue;
    c.tied = true;
    out.tied.push_back(ids);
  }

  std::string best;
  for (std::size_t i = 0; i < std::min<std::size_t>(6, out.sets.size()); ++i) {
    best += fmt::format("{}{} {:.1f}", i > 0 ? ", " : "", listed(out.sets[i].fit.chosen), out.sets[i].gain);
  }
  out.steps.push_back("The best sets and their evidence: " + best + ".");
  const bool adequate = out.chosen.ratio < margins.adequate_ratio;
  const bool mostly = out.chosen.explained > margins.explained_share;
  // One cause far ahead of every other is named for what it is, the largest part, even if much remains.
  const auto next_id = std::find_if(out.singles.begin(), out.singles.end(), [&](const Candidate& c) {
    return ids_of(c.fit.chosen) != ids_of(out.singles.front().fit.chosen);
  });
  const bool dominant = out.chosen.fit.chosen.size() == 1 && out.chosen.explained > 0.5 &&
                        (next_id == out.singles.end() || out.chosen.gain > margins.dominance * next_id->gain);
  const std::string remains =
      fmt::format("the residual is {:.2f} times the noise, {:.0f} % of the misfit are explained", out.chosen.ratio,
                  100 * out.chosen.explained);
  if (!adequate && !mostly && !dominant) {
    out.verdict = Verdict::unknown_cause;
    out.steps.push_back("With the best, " + listed(out.chosen.fit.chosen) + ", " + remains +
                        ": none of the known causes explains this.");
  } else if (out.tied.size() > 1 && !(dominant && !adequate)) {
    out.verdict = Verdict::ambiguous;
    out.steps.push_back(
        fmt::format("{} other sets of causes come within {:.0f}: they cannot be told apart with this data; {}.",
                    out.tied.size() - 1, tie, remains));
  } else {
    out.tied.resize(1);
    out.verdict = adequate ? Verdict::explained : Verdict::partly_explained;
    out.steps.push_back(fmt::format("No other set comes within {:.0f}; {}.", tie, remains));
  }
  return out;
}

}  // namespace identify

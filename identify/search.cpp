// SPDX-License-Identifier: MIT
#include "identify/search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace identify {
namespace {

constexpr std::size_t most_causes = 3;
constexpr std::size_t beam =
    4;  // sets kept when one more cause is tried: the best first cause is not always in the best pair

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

bool same_set(const std::vector<Chosen>& a, const std::vector<Chosen>& b) {
  return a.size() == b.size() &&
         std::all_of(a.begin(), a.end(), [&](const Chosen& c) { return std::find(b.begin(), b.end(), c) != b.end(); });
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
    out.singles.clear();
    out.base = {};
    out.base.fit = fit(problem, {});
    out.base.ratio = ratio_of(out.base.fit);
    for (const Chosen& c : all) out.singles.push_back(candidate(out.base, fit(problem, {c}, &out.base.fit)));
    sort(out.singles);
    if (pass == 0 && sparse_core && !out.singles.empty()) {
      refine_core_noise(problem, out.singles.front().gain > 0 ? out.singles.front().fit : out.base.fit);
    }
  }
  out.chosen = out.base;
  out.steps.push_back(
      fmt::format("The two-resistor model was fitted; what it leaves is {:.2f} times the noise.", out.base.ratio));
  if (out.singles.empty() || !(out.singles.front().gain > margins.detect)) {
    const bool fine = out.base.ratio < margins.adequate_ratio;
    out.verdict = fine ? Verdict::adequate : Verdict::unknown_cause;
    out.steps.push_back(fmt::format("No single cause gains more than {:.0f} in evidence (the best, {}, gains {:.1f}).",
                                    margins.detect,
                                    out.singles.empty() ? "none" : listed(out.singles.front().fit.chosen),
                                    out.singles.empty() ? 0.0 : out.singles.front().gain));
    return out;
  }

  std::vector<Candidate> level = out.singles;
  std::vector<Candidate> best_level = level;
  while (level.front().fit.chosen.size() < most_causes) {
    std::vector<Candidate> next;
    for (std::size_t b = 0; b < std::min(beam, level.size()); ++b) {
      for (const Chosen& more : all) {
        if (!compatible(level[b].fit.chosen, more)) continue;
        auto set = level[b].fit.chosen;
        set.push_back(more);
        if (std::any_of(next.begin(), next.end(), [&](const Candidate& c) { return same_set(c.fit.chosen, set); }))
          continue;
        next.push_back(candidate(out.base, fit(problem, set, &level[b].fit)));
      }
    }
    sort(next);
    // Re-test: a second cause may only have helped the first out of a poor valley. The smaller set starts again from
    // where the larger one ended, and the larger one must beat that.
    for (std::size_t b = 0; b < std::min(beam, level.size()); ++b) {
      const auto child = std::find_if(next.begin(), next.end(), [&](const Candidate& c) {
        return std::equal(level[b].fit.chosen.begin(), level[b].fit.chosen.end(), c.fit.chosen.begin());
      });
      if (child == next.end() || child->gain - level[b].gain < margins.second) continue;
      Candidate again = candidate(out.base, fit(problem, level[b].fit.chosen, &child->fit));
      if (again.gain > level[b].gain) best_level[b] = level[b] = std::move(again);
    }
    sort(best_level);
    if (next.empty() || !(next.front().gain - best_level.front().gain > margins.second)) {
      out.steps.push_back(fmt::format("A further cause would gain {:.1f} at most, less than {:.0f}: stopped at {}.",
                                      next.empty() ? 0.0 : next.front().gain - best_level.front().gain, margins.second,
                                      listed(best_level.front().fit.chosen)));
      break;
    }
    out.steps.push_back(fmt::format("{} gains {:.1f}, {:.1f} more than {}.", listed(next.front().fit.chosen),
                                    next.front().gain, next.front().gain - best_level.front().gain,
                                    listed(best_level.front().fit.chosen)));
    level = best_level = std::move(next);
  }
  out.sets = std::move(best_level);
  out.sets.front().chosen = true;
  out.chosen = out.sets.front();
  const std::vector<std::string> best_ids = ids_of(out.chosen.fit.chosen);
  out.tied.push_back(best_ids);
  for (Candidate& c : out.sets) {
    if (c.chosen || out.chosen.gain - c.gain >= margins.tie) continue;
    const auto ids = ids_of(c.fit.chosen);
    if (std::find(out.tied.begin(), out.tied.end(), ids) != out.tied.end()) continue;
    c.tied = true;
    out.tied.push_back(ids);
  }

  const bool adequate = out.chosen.ratio < margins.adequate_ratio;
  const bool mostly = out.chosen.explained > margins.explained_share;
  if (!adequate && !mostly) {
    out.verdict = Verdict::unknown_cause;
    out.steps.push_back(
        fmt::format("With it the residual is still {:.2f} times the noise and {:.0f} % of the misfit are explained: "
                    "none of the known causes "
                    "explains this.",
                    out.chosen.ratio, 100 * out.chosen.explained));
  } else if (out.tied.size() > 1) {
    out.verdict = Verdict::ambiguous;
    out.steps.push_back(
        fmt::format("{} other sets of causes come within {:.0f}: they cannot be told apart with this data.",
                    out.tied.size() - 1, margins.tie));
  } else {
    out.verdict = adequate ? Verdict::explained : Verdict::partly_explained;
    out.steps.push_back(
        fmt::format("No other set comes within {:.0f}; the residual is {:.2f} times the noise, {:.0f} % of the misfit "
                    "are explained.",
                    margins.tie, out.chosen.ratio, 100 * out.chosen.explained));
  }
  return out;
}

}  // namespace identify

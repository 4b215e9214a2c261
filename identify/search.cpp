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
// Every pair is looked at with a few Newton steps, and those that may come near the best are fitted to the end: a look
// errs by about so much evidence, or by this share of what the pair gains.
constexpr int look_steps = 2;
constexpr double look_errs = 40, look_errs_share = 0.05;
constexpr std::size_t most_finished = 24;
constexpr double least_slow_K = 0.02;  // below it a thermistor's slow noise hides behind its steps
constexpr std::size_t beam = 3;  // best singles whose partners start from every place, not only where they ended alone

double ratio_of(const Fit& f) { return std::sqrt(2 * f.misfit / std::max(1, f.readings)); }

Candidate candidate(const Candidate& base, Fit f) {
  Candidate c;
  c.gain = base.fit.surprise() - f.surprise();
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

/// A slow disturbance of the readings without a name, beside a set of causes: the one that makes the set's residual
/// likeliest. Where it gains much over the noise alone, the set leaves something that is not noise.
struct Disturbance {
  Noise noise;
  double gain = 0;      // over the noise alone
  double evidence = 0;  // of the set with it; to compare sets that leave different disturbances
};

Disturbance disturbance_of(const Problem& problem, const Fit& undisturbed) {
  const auto evidence = [](const Problem& p, const Fit& f) { return -f.surprise() - 2 * cost_of_noise(p); };
  const double own = evidence(problem, undisturbed);
  Disturbance out{problem.noise, 0, own};
  // One to four minutes: slower ones are the model's own time constants, faster ones the sensor's wander. Half as large
  // again each time: coarser than that loses a gain of three.
  for (const double slow_s : {60.0, 240.0}) {
    Problem disturbed = problem;
    disturbed.noise.disturbance_s = slow_s;
    Fit warm = undisturbed;
    for (double factor = 0.6; factor < 1000; factor *= 1.6) {
      disturbed.noise.disturbance_K = factor * problem.noise.housing_slow_K;
      Fit f = fit(disturbed, undisturbed.chosen, {&warm}, 10);
      if (f.x.size() == 0) break;
      const double reached = evidence(disturbed, f);
      if (reached > out.evidence) out = {disturbed.noise, reached - own, reached};
      if (reached < out.evidence - 20) break;  // past the top
      warm = std::move(f);
    }
  }
  return out;
}

/// Rest shows the housing's slow noise, and with it what still flows inside the motor: never less than the noise. Where
/// the best model's residual is likelier with less, less is taken; never more: the noise would swallow what is wrong.
void refine_housing_noise(Problem& problem, const Fit& best) {
  const auto evidence = [&](const Problem& p) {
    return -fit(p, best.chosen, {&best}).surprise() - 2 * cost_of_noise(p);
  };
  Problem less = problem;
  double most = evidence(problem);
  for (less.noise.housing_slow_K *= 0.8; less.noise.housing_slow_K > least_slow_K; less.noise.housing_slow_K *= 0.8) {
    const double reached = evidence(less);
    if (reached < most) return;
    most = reached;
    problem.noise.housing_slow_K = less.noise.housing_slow_K;
  }
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
  const auto hoped = [](const Fit& f) { return f.surprise() - 2 * f.promise; };
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
    const double errs = std::max(look_errs, look_errs_share * (base.fit.surprise() - best));
    if (i > 0 && hoped(looks[i]) > best + errs) break;
    Fit f = fit(problem, looks[i].chosen, {&looks[i]});
    best = std::min(best, f.surprise());
    out.push_back(candidate(base, std::move(f)));
  }
  sort(out);
  return out;
}

/// Every cause alone and the pairs worth fitting, each best first, under the noise of the problem.
struct Field {
  Candidate base;
  std::vector<Candidate> singles, pairs;
};

void fit_alone(const Problem& problem, const std::vector<Chosen>& all, Field& field) {
  Candidate base;
  base.fit = field.base.fit.x.size() == 0 ? fit(problem, {}) : fit(problem, {}, {&field.base.fit});
  base.ratio = ratio_of(base.fit);
  field.base = std::move(base);
  field.singles = singles_of(problem, all, field.base, field.singles);
}

void fit_pairs(const Problem& problem, Field& field) {
  field.pairs = pairs_of(problem, field.base, field.singles);
  // A second cause may only have helped the first out of a poor valley: each alone starts again from where the pair
  // ended, and the pair must beat that.
  for (std::size_t i = 0; i < std::min(beam, field.pairs.size()); ++i) {
    for (Candidate& alone : field.singles) {
      const auto& both = field.pairs[i].fit.chosen;
      if (std::find(both.begin(), both.end(), alone.fit.chosen.front()) == both.end()) continue;
      Fit again = fit(problem, alone.fit.chosen, {&field.pairs[i].fit});
      if (again.x.size() > 0 && again.cost < alone.fit.cost) alone = candidate(field.base, std::move(again));
    }
  }
  sort(field.singles);
}

/// Why the best pair is not believed; empty when it is.
std::string why_no_pair(const Problem& problem, const Field& field, const Margins& margins) {
  const Candidate& single = field.singles.front();
  const std::string first = listed(single.fit.chosen);
  if (field.pairs.empty()) return fmt::format("No further cause goes with {}.", first);
  const Candidate& pair = field.pairs.front();
  const std::string both = listed(pair.fit.chosen);
  const double more = pair.gain - single.gain;
  if (!(more > margins.second))
    return fmt::format("A further cause would gain {:.1f} at most, less than {:.0f}: stopped at {}.", more,
                       margins.second, first);
  const double moved = moved_K(problem, pair.fit, single.fit);
  if (moved < margins.noticeable_K)
    return fmt::format(
        "{} would gain {:.1f} more, but moves no temperature by more than {:.2f} K rms: not worth a name.", both, more,
        moved);
  const double nameless = disturbance_of(problem, single.fit).gain;
  if (!(more > nameless + margins.second))
    return fmt::format("{} would gain {:.1f} more than {}, a slow disturbance without a name {:.1f}: stopped there.",
                       both, more, first, nameless);
  // Veto: where something else is wrong, one more cause can fit the past and spoil the future.
  const double fewer_K = unseen_error_K(problem, single.fit.chosen, single.fit);
  const double more_K = unseen_error_K(problem, pair.fit.chosen, pair.fit);
  if (more_K > 1.1 * fewer_K && disturbance_of(problem, pair.fit).gain > margins.remains)
    return fmt::format(
        "{} fits better, but misses the last quarter by {:.1f} K where {} misses it by {:.1f} K: refused.", both,
        more_K, first, fewer_K);
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
  Field field;
  const auto all = available(problem, without);
  const auto say = [&](std::string step) { out.steps.push_back(std::move(step)); };
  problem.ordinary = ordinary_imperfections(problem, fit(problem, {}));
  // A board runs the model alone: what is handed on was fitted without leeway, to the noise that was judged by.
  const auto hand_on = [&](Problem exact) {
    exact.ordinary.clear();
    const auto refit = [&](Fit& f) { f = fit(exact, f.chosen, {&f}); };
    refit(out.base.fit);
    refit(out.chosen.fit);
    for (Candidate& c : out.sets) {
      if (c.tied) refit(c.fit);
    }
  };
  fit_alone(problem, all, field);
  if (!field.singles.empty()) {
    const Fit& best = field.singles.front().gain > 0 ? field.singles.front().fit : field.base.fit;
    const bool sparse_core = problem.any_core() && problem.noise.core_slow_K == 0;
    refine_housing_noise(problem, best);
    if (sparse_core) refine_core_noise(problem, best);
    fit_alone(problem, all, field);
  }
  out.base = out.chosen = field.base;
  out.singles = field.singles;
  say(fmt::format("The two-resistor model was fitted; what it leaves is {:.2f} times the noise.", out.base.ratio));

  // Is anything missing?
  const Disturbance without_causes = disturbance_of(problem, out.base.fit);
  const double gain = field.singles.empty() ? 0 : field.singles.front().gain;
  const std::string first = field.singles.empty() ? "none" : listed(field.singles.front().fit.chosen);
  const double moves = gain > margins.detect ? moved_K(problem, field.singles.front().fit, out.base.fit) : 0;
  const bool disturbed =
      without_causes.gain > margins.remains && without_causes.noise.disturbance_K > margins.noticeable_K;
  if (gain <= margins.detect || (moves < margins.noticeable_K && !disturbed)) {
    out.verdict = disturbed ? Verdict::unknown_cause : Verdict::adequate;
    say(gain > margins.detect
            ? fmt::format(
                  "{} gains {:.1f} in evidence, but moves no temperature by more than {:.2f} K rms: not worth a "
                  "name.",
                  first, gain, moves)
            : fmt::format("No single cause gains more than {:.0f} in evidence (the best, {}, gains {:.1f}).",
                          margins.detect, first, gain));
    if (disturbed)
      say(fmt::format("Yet a slow disturbance of {:.2f} K gains {:.0f}.", without_causes.noise.disturbance_K,
                      without_causes.gain));
    hand_on(problem);
    return out;
  }

  // Where even the best leaves a disturbance, all are judged again with that counted as noise: a model that is known to
  // be off cannot rank causes by what is smaller than its error.
  fit_pairs(problem, field);
  const auto& leader = field.pairs.empty() || field.pairs.front().gain < field.singles.front().gain + margins.second
                           ? field.singles.front()
                           : field.pairs.front();
  const Disturbance left_by_leader = disturbance_of(problem, leader.fit);
  Problem judged = problem;
  if (left_by_leader.gain > margins.remains) {
    judged.noise = left_by_leader.noise;
    say(fmt::format("Even the best set, {}, leaves a slow disturbance of {:.2f} K, which from here on counts as noise.",
                    listed(leader.fit.chosen), judged.noise.disturbance_K));
    fit_alone(judged, all, field);
    fit_pairs(judged, field);
  }

  // One cause or two?
  const std::string refusal = why_no_pair(judged, field, margins);
  if (refusal.empty()) {
    say(fmt::format("{} gains {:.1f}, {:.1f} more than {}.", listed(field.pairs.front().fit.chosen),
                    field.pairs.front().gain, field.pairs.front().gain - field.singles.front().gain,
                    listed(field.singles.front().fit.chosen)));
    out.sets = std::move(field.pairs);
  } else {
    say(refusal);
    out.sets = std::move(field.singles);
  }
  out.sets.front().chosen = true;
  out.chosen = out.sets.front();
  const bool single = out.chosen.fit.chosen.size() == 1;
  const std::string best = listed(out.chosen.fit.chosen);

  // What does the best leave, and does it explain more than a disturbance without a name would?
  const Disturbance left = disturbance_of(problem, fit(problem, out.chosen.fit.chosen, {&out.chosen.fit}));
  const double explains = left.evidence - without_causes.evidence;
  const bool complete = left.gain < margins.remains;
  const Rmse missed = rmse_of(problem, out.base.fit);
  const double before_K = std::isnan(missed.housing_K) ? missed.core_K : missed.housing_K;
  const double after_K = left.noise.disturbance_K;
  const bool mostly = (single && explains > margins.dominance * left.gain) || after_K < margins.small_part * before_K;
  const std::string remains = fmt::format(
      "{:.2f} K were missed, beside it a slow disturbance of {:.2f} K would gain {:.1f}; over a disturbance alone it "
      "gains {:.1f}",
      before_K, after_K, left.gain, explains);
  // Which sets are as good? What is left over may belong to any of them.
  const double tie = complete ? margins.tie : margins.tie + left.gain;
  out.tied.push_back(ids_of(out.chosen.fit.chosen));
  for (Candidate& c : out.sets) {
    if (c.chosen || out.chosen.gain - c.gain >= tie) continue;
    const auto ids = ids_of(c.fit.chosen);
    if (std::find(out.tied.begin(), out.tied.end(), ids) != out.tied.end()) continue;
    c.tied = true;
    out.tied.push_back(ids);
  }
  std::string ladder;
  for (std::size_t i = 0; i < std::min<std::size_t>(6, out.sets.size()); ++i)
    ladder += fmt::format("{}{} {:.1f}", i > 0 ? ", " : "", listed(out.sets[i].fit.chosen), out.sets[i].gain);
  say("The best sets and their evidence: " + ladder + ".");

  if (explains < margins.detect || (!complete && !mostly)) {
    out.verdict = Verdict::unknown_cause;
    say(fmt::format("The best is {}, but {}: none of the known causes explains this.", best, remains));
  } else if (out.tied.size() > 1) {
    out.verdict = Verdict::ambiguous;
    say(fmt::format("{} other sets of causes come within {:.0f}: they cannot be told apart with this data; {}.",
                    out.tied.size() - 1, tie, remains));
  } else {
    out.verdict = complete ? Verdict::explained : Verdict::partly_explained;
    say(fmt::format("No other set comes within {:.0f}; {}.", margins.tie, remains));
  }
  hand_on(judged);
  return out;
}

}  // namespace identify

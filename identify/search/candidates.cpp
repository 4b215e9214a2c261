// SPDX-License-Identifier: MIT
#include "identify/search/candidates.hpp"

#include <algorithm>
#include <string_view>

#include "identify/fit/parallel.hpp"
#include "identify/fit/replayed.hpp"

namespace identify {
namespace {

// Every pair is looked at with a few Newton steps, and those that may come near the best are fitted to the end: a look
// errs by about so much evidence, or by this share of what the pair gains. Chosen for speed: half or double of all but
// the bins at once changes no answer of 20 logs (score duty-sparse designed-sparse pairs-designed zero --first 770
// --at-most 5 --quick), nor do three eighths of the bins. Three times as many change none of 288 (ten rows, --first
// 34000 and 35000, and --blind, 36000).
constexpr int look_steps = 2;
constexpr double look_errs = 40, look_errs_share = 0.05;
constexpr std::size_t most_finished = 24;
constexpr std::size_t least_look_bins = 2000;  // of twice as many, looks see every two as one
constexpr std::size_t beam = 3;  // best singles whose partners start from every place, not only where they ended alone

Candidate candidate(const Candidate& baseline, Fit f) {
  Candidate c;
  c.evidence = baseline.fit.surprise() - f.surprise();
  c.ratio = f.ratio();
  c.fit = std::move(f);
  return c;
}

void sort(std::vector<Candidate>& list) {
  std::sort(list.begin(), list.end(), [](const Candidate& a, const Candidate& b) { return a.evidence > b.evidence; });
}

/// Two causes that claim the same slot of the model cannot both be applied. And a current that one log scales otherwise
/// must explain all: beside another cause it takes up what that leaves of how the logs' loads differ (traction, seed
/// 130, five drives: the winding foretold worse than by two resistors).
bool compatible(const std::vector<Chosen>& have, const Chosen& more) {
  const Cause& b = cause_of(more);
  int nodes = b.edit == Edit::mass || b.edit == Edit::hot_spot;
  for (const Chosen& c : have) {
    const Cause& a = cause_of(c);
    if (c.cause == more.cause && (!of_one_log(b) || c.log == more.log)) return false;
    if (a.edit == Edit::sink_law && b.edit == Edit::sink_law) return false;
    if (a.edit == Edit::current_of_log || b.edit == Edit::current_of_log) return false;
    nodes += a.edit == Edit::mass || a.edit == Edit::hot_spot;
  }
  return nodes <= 2;
}

/// For looks and starts at a long log: fewer, longer bins. What `best` simulates differs in them, of a winding above
/// all, whose time constant may be shorter; the readings are moved by that, so that it leaves what it left before.
Problem coarse(const Problem& problem, const Fit& best) {
  std::size_t bins = 0;
  for (const Bins& log : problem.logs) bins += log.bins.size();
  const std::size_t together = bins / least_look_bins;
  Problem out = problem;
  if (together < 2) return out;
  for (std::size_t l = 0; l < out.logs.size(); ++l) {
    Bins& log = out.logs[l];
    Bins simulated = log;
    const Replayed fine = replayed(problem, best, l);
    for (std::size_t k = 0; k < log.bins.size(); ++k) {
      simulated.bins[k].housing_degC = fine.housing_degC[k];
      simulated.bins[k].core_degC = fine.core_degC[k];
    }
    for (Leeway& leeway : out.leeway) {
      Bins moved = log;
      for (std::size_t k = 0; k < log.bins.size(); ++k) {
        moved.bins[k].housing_degC = leeway.housing_K[l][k];
        moved.bins[k].core_degC = leeway.core_K[l][k];
      }
      moved = merged(moved, together);
      leeway.housing_K[l].clear();
      leeway.core_K[l].clear();
      for (const Bin& bin : moved.bins) {
        leeway.housing_K[l].push_back(bin.housing_degC);
        leeway.core_K[l].push_back(bin.core_degC);
      }
    }
    log = merged(log, together);
    simulated = merged(simulated, together);
    const Replayed rough = replayed(out, best, l);
    for (std::size_t k = 0; k < log.bins.size(); ++k) {
      log.bins[k].housing_degC += rough.housing_degC[k] - simulated.bins[k].housing_degC;
      log.bins[k].core_degC += rough.core_degC[k] - simulated.bins[k].core_degC;
    }
  }
  return out;
}

bool is_shorter(const Problem& rough, const Problem& problem) {
  return rough.logs.front().bins.size() < problem.logs.front().bins.size();
}

/// Every cause alone, best first: from where it was or two resistors are, and from the sheet, since both may be bent
/// into a poor valley by what is missing. Of a long log those far behind are left as its longer bins show them.
std::vector<Candidate> singles_of(const Problem& problem, const std::vector<Chosen>& all, const Candidate& baseline,
                                  const std::vector<Candidate>& before) {
  const Problem rough = coarse(problem, baseline.fit);
  const bool shorter = is_shorter(rough, problem);
  Candidate rough_baseline = baseline;
  if (shorter) rough_baseline.fit = fit(rough, {}, {&baseline.fit});
  std::vector<Fit> fits(all.size());
  in_parallel(all.size(), [&](std::size_t i) {
    const std::vector<Chosen> alone = {all[i]};
    const auto known =
        std::find_if(before.begin(), before.end(), [&](const Candidate& b) { return b.fit.chosen == alone; });
    fits[i] = fit(rough, alone, {known == before.end() ? &baseline.fit : &known->fit});
    Fit anew = fit(rough, alone);
    if (anew.cost < fits[i].cost) fits[i] = std::move(anew);
    if (fits[i].cost < rough_baseline.fit.cost + 1) return;
    Fit beside = fit(rough, alone, {&rough_baseline.fit});  // where it was is a poor valley by now
    if (beside.cost < fits[i].cost) fits[i] = std::move(beside);
  });
  std::erase_if(fits, [](const Fit& f) { return !f.valid(); });
  double most = 0;
  for (const Fit& f : fits) most = std::max(most, rough_baseline.fit.surprise() - f.surprise());
  // Where the winding bends within such a bin, a short delay is lost in it.
  const Physical motor = physical(baseline.fit.x);
  const bool bends = rough.logs.front().width_s > motor.R1_K_per_W * motor.C1_J_per_K / 4;
  std::vector<Candidate> out(fits.size());
  in_parallel(fits.size(), [&](std::size_t i) {
    out[i] = candidate(rough_baseline, std::move(fits[i]));
    if (!shorter) return;
    const std::vector<Chosen> chosen = out[i].fit.chosen;
    Fit whole;
    if (out[i].evidence >= most - look_errs - look_errs_share * most) whole = fit(problem, chosen, {&out[i].fit});
    if (bends && cause_of(chosen.front()).edit == Edit::delay) {
      const Fit prompt = with_cause(baseline.fit, cause_of(chosen.front()).id, {0.0});
      Fit late = fit(problem, chosen, {&prompt});
      if (late.cost < whole.cost) whole = std::move(late);
    }
    if (whole.valid()) out[i] = candidate(baseline, std::move(whole));
  });
  sort(out);
  return out;
}

/// The pairs that may come near the best one, fitted to the end, best first.
std::vector<Candidate> pairs_of(const Problem& problem, const Candidate& baseline,
                                const std::vector<Candidate>& singles) {
  if (singles.empty()) return {};
  struct Pair {
    std::vector<Chosen> set;
    const Fit *better, *other;
    bool anew;
  };
  std::vector<Pair> pairs;
  for (std::size_t a = 0; a < singles.size(); ++a) {
    for (std::size_t b = a + 1; b < singles.size(); ++b) {
      const Fit &better = singles[a].fit, &other = singles[b].fit;
      if (compatible(better.chosen, other.chosen.front()))
        pairs.push_back({{better.chosen.front(), other.chosen.front()}, &better, &other, a < beam});
    }
  }
  const auto hoped = [](const Fit& f) { return f.surprise() - 2 * f.promise; };
  const Fit& leader = singles.front().fit;
  const Problem rough = coarse(problem, leader);
  std::vector<Fit> looks(pairs.size());
  in_parallel(pairs.size(), [&](std::size_t i) {
    const Pair& pair = pairs[i];
    looks[i] = fit(rough, pair.set, {pair.better, pair.other}, look_steps);
    if (!pair.anew) return;
    Fit anew = fit(rough, pair.set, {pair.better}, look_steps);
    if (anew.valid() && (!looks[i].valid() || hoped(anew) < hoped(looks[i]))) looks[i] = std::move(anew);
  });
  std::erase_if(looks, [](const Fit& f) { return !f.valid(); });
  const auto order = [&] {
    std::sort(looks.begin(), looks.end(), [&](const Fit& a, const Fit& b) { return hoped(a) < hoped(b); });
  };
  order();
  const bool shorter = is_shorter(rough, problem);
  if (shorter) {  // a fit to the end is cheap there, and leaves less to finish here
    looks.resize(std::min(most_finished, looks.size()));
    in_parallel(looks.size(), [&](std::size_t i) { looks[i] = fit(rough, looks[i].chosen, {&looks[i]}); });
    order();
  }

  double best = 1e300, more = 0;  // what all bins surprise more than the rough ones, as the best shows
  const auto worth_it = [&](std::size_t i) {
    const double errs = std::max(look_errs, look_errs_share * (baseline.fit.surprise() - best));
    return i < std::min(most_finished, looks.size()) && (i == 0 || hoped(looks[i]) + more <= best + errs);
  };
  std::vector<Candidate> out;
  while (worth_it(out.size())) {
    const std::size_t done = out.size();
    std::vector<Fit> next(std::min<std::size_t>(most_threads, looks.size() - done));
    in_parallel(next.size(), [&](std::size_t i) {
      const Fit& look = looks[done + i];
      next[i] = fit(problem, look.chosen, {&look});
    });
    for (std::size_t i = 0; i < next.size() && worth_it(done + i); ++i) {  // as one thread would
      if (next[i].surprise() < best) {
        best = next[i].surprise();
        if (shorter) more = best - looks[done + i].surprise();
      }
      out.push_back(candidate(baseline, std::move(next[i])));
    }
  }
  sort(out);
  return out;
}

/// A second cause may only have helped the first out of a poor valley: each alone starts again from where the best
/// pairs ended, and a pair must beat that.
void start_singles_again(const Problem& problem, Field& field) {
  struct Again {
    Candidate* alone;
    const Fit* both;
    Fit fit;
  };
  std::vector<Again> all;
  for (std::size_t i = 0; i < std::min(beam, field.pairs.size()); ++i) {
    const Fit& both = field.pairs[i].fit;
    for (Candidate& alone : field.singles) {
      if (std::find(both.chosen.begin(), both.chosen.end(), alone.fit.chosen.front()) != both.chosen.end())
        all.push_back({&alone, &both, {}});
    }
  }
  in_parallel(all.size(), [&](std::size_t i) { all[i].fit = fit(problem, all[i].alone->fit.chosen, {all[i].both}); });
  for (Again& again : all) {
    if (!again.fit.valid()) continue;
    Candidate anew = candidate(field.baseline, std::move(again.fit));
    if (anew.evidence > again.alone->evidence) *again.alone = std::move(anew);
  }
  sort(field.singles);
}

}  // namespace

std::vector<std::string> ids_of(const std::vector<Chosen>& chosen) {
  std::vector<std::string> out;
  for (const Chosen& c : chosen) out.emplace_back(cause_of(c).id);
  std::sort(out.begin(), out.end());
  return out;
}

std::vector<std::string> names_of(const std::vector<Chosen>& chosen) {
  std::vector<std::string> out;
  bool one_named = false;
  for (const Chosen& c : chosen) {
    const Cause& cause = cause_of(c);
    const bool twice = std::count_if(chosen.begin(), chosen.end(), [&](const Chosen& other) {
                         return std::string_view(cause_of(other).id) == cause.id;
                       }) > 1;
    const char* which = !of_one_log(cause) ? " at a moment" : one_named ? " of another log" : " of one log";
    out.push_back(std::string(cause.id) + (twice ? which : ""));
    one_named = one_named || (twice && of_one_log(cause));
  }
  std::stable_sort(out.begin(), out.end(), [](const std::string& a, const std::string& b) {
    return a.substr(0, a.find(' ')) < b.substr(0, b.find(' '));
  });
  return out;
}

std::vector<Chosen> available(const Problem& problem, const std::vector<std::string>& without) {
  std::vector<Chosen> out;
  for (std::size_t c = 0; c < causes().size(); ++c) {
    const Cause& cause = causes()[c];
    if (!problem.possible(cause) || std::find(without.begin(), without.end(), cause.id) != without.end()) continue;
    if (!of_one_log(cause)) {
      out.push_back({static_cast<int>(c), -1});
      continue;
    }
    for (std::size_t l = 0; l < problem.logs.size(); ++l) out.push_back({static_cast<int>(c), static_cast<int>(l)});
  }
  return out;
}

void fit_alone(const Problem& problem, const std::vector<Chosen>& all, Field& field) {
  Candidate baseline;
  baseline.fit = field.baseline.fit.valid() ? fit(problem, {}, {&field.baseline.fit}) : fit(problem, {});
  // An unseen winding under one cycle has valleys without number: a baseline that is stuck in one makes a cause of the
  // rest.
  if (baseline.fit.valid()) {
    const Fit near = closest(problem, baseline.fit);
    Fit other = fit(problem, {}, {&near});
    if (other.cost < baseline.fit.cost) baseline.fit = std::move(other);
  }
  baseline.ratio = baseline.fit.ratio();
  field.baseline = std::move(baseline);
  if (!field.baseline.fit.valid()) return field.singles.clear();
  field.singles = singles_of(problem, all, field.baseline, field.singles);
}

void fit_pairs(const Problem& problem, Field& field) {
  field.pairs = pairs_of(problem, field.baseline, field.singles);
  start_singles_again(problem, field);
}

void add_neighbours(const Problem& problem, const Field& field, std::vector<Candidate>& sets) {
  const Candidate best = sets.front();
  struct Neighbour {
    std::vector<Chosen> pair;
    const Fit* other;
    Fit fit;
  };
  std::vector<Neighbour> all;
  for (const Chosen& kept : best.fit.chosen) {
    for (const Candidate& other : field.singles) {
      const Chosen more = other.fit.chosen.front();
      const std::vector<Chosen> pair = {kept, more};
      const auto same = [&](const Candidate& c) {
        return std::is_permutation(pair.begin(), pair.end(), c.fit.chosen.begin(), c.fit.chosen.end());
      };
      if (compatible({kept}, more) && std::none_of(sets.begin(), sets.end(), same))
        all.push_back({pair, &other.fit, {}});
    }
  }
  const Problem rough = coarse(problem, best.fit);
  const bool shorter = is_shorter(rough, problem);
  const double near = fit(rough, best.fit.chosen, {&best.fit}).surprise() + look_errs + look_errs_share * best.evidence;
  in_parallel(all.size(), [&](std::size_t i) {
    Neighbour& n = all[i];
    n.fit = fit(rough, n.pair, {&best.fit, n.other});
    if (shorter) n.fit = n.fit.valid() && n.fit.surprise() < near ? fit(problem, n.pair, {&n.fit}) : Fit{};
  });
  for (Neighbour& n : all) {
    if (n.fit.valid()) sets.push_back(candidate(field.baseline, std::move(n.fit)));
  }
  sort(sets);
}

Fit best_alone(const Problem& problem) {
  Field field;
  fit_alone(problem, available(problem, {}), field);
  const bool better = !field.singles.empty() && field.singles.front().evidence > 0;
  return better ? field.singles.front().fit : field.baseline.fit;
}

}  // namespace identify

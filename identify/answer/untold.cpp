// SPDX-License-Identifier: MIT
#include "identify/answer/untold.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <random>

#include "identify/fit/replayed.hpp"
#include "identify/log/filled.hpp"
#include "identify/log/impossible.hpp"
#include "identify/log/pauses.hpp"
#include "identify/search/disturbance.hpp"

namespace identify {
namespace {

/// As it was told last, and as it is told next, where that is not now.
std::vector<double> told_last(std::vector<double> load) {
  for (std::size_t i = 1; i < load.size(); ++i) {
    if (std::isnan(load[i])) load[i] = load[i - 1];
  }
  return load;
}
std::vector<double> told_next(std::vector<double> load) {
  for (std::size_t i = load.size(); i-- > 1;) {
    if (std::isnan(load[i - 1])) load[i - 1] = load[i];
  }
  return load;
}

/// A row sooner than that.
std::vector<double> told_sooner(std::vector<double> load) { return a_row_sooner(told_next(std::move(load))); }

/// As it was told last, but for where it steps: there drawn, last or `sooner`, or the `other` of the two. A load that
/// goes smoothly does not. Of columns that tell one current together, alike.
std::vector<double> told_either(const std::vector<double>& load, const std::vector<double>& sooner, unsigned draw,
                                bool other) {
  constexpr double steps = 2;  // times what it changes by in the rows before and after, and more
  std::mt19937 random(draw);
  const std::vector<double> last = told_last(load);
  std::vector<double> out = last;
  const auto change = [&](std::size_t i) { return i + 1 < last.size() ? std::abs(last[i + 1] - last[i]) : 0; };
  for (std::size_t i = 0; i < out.size(); ++i) {
    const bool drawn = (random() % 2 == 0) != other;
    if (drawn && change(i) > steps * std::max(i > 0 ? change(i - 1) : 0, change(i + 1))) out[i] = sooner[i];
  }
  return out;
}

/// In each row the most, or the least, that it and its neighbours tell.
std::vector<double> told_around(const std::vector<double>& told, bool most) {
  std::vector<double> out = told;
  for (std::size_t i = 1; i + 1 < told.size(); ++i) {
    for (const double x : {told[i - 1], told[i + 1]}) {
      if (most ? std::abs(x) > std::abs(out[i]) : std::abs(x) < std::abs(out[i])) out[i] = x;
    }
  }
  return out;
}

/// Rows that keep step with a gait come to the same few places of it again, and may miss its mean by one part in as
/// many, all the time: that share, for each row. Zero where rows are draws, for those miss it now so, now so.
std::vector<double> shares_in_step(const std::vector<double>& told) {
  constexpr std::size_t rows = 60, places = 10;  // looked at together; so few that one of them weighs much
  // Of two variances. By what repeats itself within ten rows as well as that, 60 rows come to few other places.
  constexpr double repeats = 0.005;
  std::vector<double> out(told.size(), 0.0);
  for (std::size_t from = 0; from < told.size(); from += rows) {
    const std::size_t to = std::min(from + rows, told.size()), n = to - from;
    double sum = 0, square = 0;
    for (std::size_t i = from; i < to; ++i) sum += std::abs(told[i]), square += told[i] * told[i];
    const double mean = sum / static_cast<double>(n), variance = square / static_cast<double>(n) - mean * mean;
    for (std::size_t q = 2; q <= places && q < n; ++q) {
      double apart2 = 0;
      for (std::size_t i = from + q; i < to; ++i) apart2 += std::pow(std::abs(told[i]) - std::abs(told[i - q]), 2);
      if (!(apart2 < 2 * repeats * variance * static_cast<double>(n - q))) continue;
      std::fill(out.begin() + static_cast<std::ptrdiff_t>(from), out.begin() + static_cast<std::ptrdiff_t>(to),
                1 / static_cast<double>(q));
      break;
    }
  }
  return out;
}

/// As far towards the most or the least as rows that keep step may be off.
std::vector<double> told_in_step(std::vector<double> load, bool most) {
  std::vector<double> out = told_next(std::move(load));
  const std::vector<double> end = told_around(out, most), share = shares_in_step(out);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] += share[i] * (end[i] - out[i]);
  return out;
}
std::vector<double> told_at_crests(std::vector<double> load) { return told_in_step(std::move(load), true); }
std::vector<double> told_in_troughs(std::vector<double> load) { return told_in_step(std::move(load), false); }

/// The most or the least, drawn for each row, or the `other` of the two.
std::vector<double> told_somewhere(std::vector<double> load, unsigned draw, bool other) {
  std::mt19937 random(draw);
  std::vector<double> out = told_next(std::move(load));
  const std::vector<double> most = told_around(out, true), least = told_around(out, false);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = ((random() % 2 == 0) != other ? most : least)[i];
  return out;
}

/// The same logs under a load that is `as` makes it of what was measured.
Problem under(const Problem& problem, std::vector<Log> logs,
              const std::function<std::vector<double>(std::vector<double>)>& as) {
  for (Log& log : logs) {
    for (const Role role : {Role::power, Role::current, Role::iq, Role::id}) {
      if (log.has(role)) log.of(role) = as(without_lines(log, role));
    }
  }
  return unseen_by(problem, logs);
}

/// How far it moves the housing, or the winding read alone, when the load changes between the rows that tell it. Steps
/// that come each at a moment of their own move it as no cause does: by no more than the best set leaves, `left_K`.
double left_open_K(const Problem& problem, const Fit& baseline, const std::vector<Log>& logs, double left_K) {
  // Of averages only cells that were not read leave anything open.
  const auto early = logs.front().averaged ? told_next : told_sooner;
  const Problem last = under(problem, logs, told_last), next = under(problem, logs, told_next),
                sooner = under(problem, logs, early);
  std::vector<Problem> drawn;  // pairs: one may end where it began by chance
  for (unsigned i = 0; i < 8; ++i) {
    drawn.push_back(under(problem, logs, [&](const std::vector<double>& load) {
      return told_either(load, early(load), i / 2, i % 2 == 1);
    }));
  }
  double moved2 = 0, drawn2 = 0, less2 = 0, less_rise = 0, rise2 = 0, bins = 0;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const auto of = problem.logs[l].has_housing ? &Replayed::housing_degC : &Replayed::core_degC;
    const auto run = [&](const Problem& p) { return replayed(p, baseline, l).*of; };
    const std::vector<double> line = run(problem), a = run(last), b = run(next), c = run(sooner);
    std::vector<std::vector<double>> draws;
    std::transform(drawn.begin(), drawn.end(), std::back_inserter(draws), run);
    for (std::size_t k = 0; k < line.size(); ++k) {
      // A line across a step heats less than the step; by a part of all heat, a fit takes that for the motor's.
      const double less_K = (a[k] + b[k]) / 2 - line[k], rise_K = line[k] - line[0];
      moved2 += (a[k] - c[k]) * (a[k] - c[k]);
      for (std::size_t i = 0; i < draws.size(); i += 2) {
        const double off_K = (draws[i][k] - draws[i + 1][k]) / 2;
        drawn2 += off_K * off_K / (static_cast<double>(draws.size()) / 2);
      }
      less2 += less_K * less_K;
      less_rise += less_K * rise_K;
      rise2 += rise_K * rise_K;
      ++bins;
    }
  }
  // A load that steps somewhere between two rows, evenly likely, is off by the interval over sqrt(12): all steps alike,
  // or each for itself, where their heat no longer adds up. Drawn was one end or the other, half the interval off.
  const double each2 = std::min(drawn2 / 3, left_K * left_K * bins);
  return std::sqrt((moved2 / 12 + each2 + less2 - less_rise * less_rise / std::max(rise2, 1e-9)) / bins);
}

/// Does the load alternate faster than rows are written, so that each is a draw? From one row to the next but one a
/// load that steps changes twice as much, squared, as from row to row, and one that goes smoothly four times. What is
/// small beside all heat is noise.
bool alternates_between_rows(const std::vector<Log>& logs) {
  constexpr double least = 1.7;  // of white noise it is 1, of gaits of 0.8 to 2 Hz in rows of a second 1.1 to 1.6
  constexpr double much = 0.1;   // of gaits of 0.6 to 6 Hz in rows of 0.1 to 2 s 0.3 to 0.7
  double once = 0, twice = 0, all = 0;
  for (const Log& log : logs) {
    std::vector<double> heat = told_next(log.of(heat_of(log)));
    if (!log.has(Role::power)) std::transform(heat.begin(), heat.end(), heat.begin(), [](double A) { return A * A; });
    for (std::size_t i = 2; i < heat.size(); ++i) {
      const double one = heat[i] - heat[i - 1], two = heat[i] - heat[i - 2];
      if (!std::isnan(one) && !std::isnan(two)) once += one * one, twice += two * two, all += heat[i] * heat[i];
    }
  }
  return twice < least * once && once > much * all;
}

/// How far two simulations of the logs differ, rms.
struct Apart {
  double housing_K, core_K;
};
Apart apart(const Problem& a, const Fit& fit_a, const Problem& b, const Fit& fit_b) {
  double housing2 = 0, core2 = 0, bins = 0;
  for (std::size_t l = 0; l < a.logs.size(); ++l) {
    const Replayed one = replayed(a, fit_a, l), other = replayed(b, fit_b, l);
    for (std::size_t k = 0; k < one.core_degC.size(); ++k) {
      housing2 += std::pow(one.housing_degC[k] - other.housing_degC[k], 2);
      core2 += std::pow(one.core_degC[k] - other.core_degC[k], 2);
    }
    bins += static_cast<double>(one.core_degC.size());
  }
  return {std::sqrt(housing2 / bins), std::sqrt(core2 / bins)};
}

/// Of the housing; of the winding, where no housing was read.
double judged_K(const Problem& problem, const Apart& a) {
  return problem.logs.front().has_housing ? a.housing_K : a.core_K;
}

/// Of all that is read.
double both_K(const Problem& problem, const Apart& a) {
  const bool housing = problem.logs.front().has_housing, core = problem.any_core();
  return std::hypot(housing ? a.housing_K : 0, core ? a.core_K : 0);
}

/// How far a load that alternates faster than rows are written may move them.
Apart open_by_gait(const Problem& problem, const Fit& baseline, const std::vector<Log>& logs) {
  const auto between = [&](const auto& as, const auto& as_well) {
    return apart(under(problem, logs, as), baseline, under(problem, logs, as_well), baseline);
  };
  const Apart in_step = between(told_at_crests, told_in_troughs);
  Apart drawn2{};
  constexpr unsigned draws = 4;
  for (unsigned i = 0; i < draws; ++i) {
    const auto drawn = [i](bool other) {
      return [i, other](std::vector<double> load) { return told_somewhere(std::move(load), i, other); };
    };
    const Apart one = between(drawn(false), drawn(true));
    drawn2.housing_K += one.housing_K * one.housing_K / draws;
    drawn2.core_K += one.core_K * one.core_K / draws;
  }
  // Half of the way between the ends. Of three draws the ends are 0.85 standard deviations from the middle.
  return {std::hypot(in_step.housing_K, std::sqrt(drawn2.housing_K)) / 2,
          std::hypot(in_step.core_K, std::sqrt(drawn2.core_K)) / 2};
}

}  // namespace

std::string clipped(const Found& found, const std::vector<Log>& logs) {
  if (found.verdict == Verdict::adequate) return "";
  constexpr double least_share = 0.005, often = 3;  // of the rows; times as often as any other value is told
  for (const Log& log : logs) {
    for (const Role role : {Role::current, Role::iq, Role::power}) {
      const double top = largest_magnitude(log.of(role));
      std::map<double, int> rows;
      std::vector<double> below;
      for (const double x : log.of(role)) {
        if (std::abs(x) > 0.1 * top) ++rows[std::abs(x)];
        below.push_back(std::abs(x) == top ? missing : x);
      }
      if (rows.size() < 2) continue;
      const int at_top = rows.rbegin()->second;
      rows.erase(top);
      const auto most =
          std::max_element(rows.begin(), rows.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
      if (at_top < least_share * static_cast<double>(below.size()) || at_top < often * most->second ||
          !is_noisy(below, top))
        continue;
      return fmt::format(
          "{} stands at its largest value, {:g}, in {} rows and is noisy elsewhere: its sensor seems to reach no "
          "further, so what flowed then is not known; record it with a wider range.",
          own_name(role), top, at_top);
    }
  }
  return "";
}

std::string too_sparse(const Problem& problem, const Found& found, const std::vector<Log>& logs) {
  if (found.verdict == Verdict::adequate) return "";
  const Fit &baseline = found.baseline.fit, &chosen = found.chosen.fit;
  const double left_K = disturbance_of(problem, fit(problem, chosen.chosen, {&chosen})).noise.disturbance_K;
  double open_K = left_open_K(problem, baseline, logs, left_K);
  const bool alternates = !logs.front().averaged && alternates_between_rows(logs);
  const Apart by_gait = alternates ? open_by_gait(problem, baseline, logs) : Apart{};
  open_K = std::max(open_K, judged_K(problem, by_gait));
  // Of a name all that it explains is asked for: what imitates what flowed between the rows leaves nothing.
  const bool unknown = found.verdict == Verdict::unknown_cause;
  const double asked_K = unknown ? left_K : judged_K(problem, apart(problem, baseline, problem, chosen));
  // Clean logs, rows 10 s apart or a fifth of the currents missing, left 1.3 to 2.2 times that, for it is a mean over
  // quiet stretches as well; effects outside the table in rows of a second 11 times and more.
  constexpr double times = 2.5, worth_K = 0.02;
  const auto told = [](double asked, double open) { return std::min(open, asked) < worth_K || asked > times * open; };
  std::string what;
  double of_load_K = asked_K;
  if (!told(asked_K, open_K)) what = unknown ? "no cause explains" : "was found beside two resistors";
  // A winding swings by a load that rows told by chance: more than a housing, and a lag or a hot spot smooths it.
  for (std::size_t i = 0;
       what.empty() && both_K(problem, by_gait) > worth_K && names_causes(found.verdict) && i < chosen.chosen.size();
       ++i) {
    std::vector<Chosen> others = chosen.chosen;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const Apart more = apart(problem, fit(problem, others, {&chosen}), problem, chosen);
    if (!(both_K(problem, more) < times * both_K(problem, by_gait))) continue;
    what = fmt::format("{} explains", cause_of(chosen.chosen[i]).id);
    of_load_K = both_K(problem, more);
  }
  if (what.empty()) return "";
  double apart_s = 0;
  for (const Bins& log : problem.logs) apart_s = std::max(apart_s, log.interval_s);
  return fmt::format(
      "What {}, {:.2f} K, may be of the load alone: it changes between rows {:g} s apart or "
      "in cells that were not measured, and when exactly moves the {} by as much; record the {} in every row and "
      "more often{}.",
      what, of_load_K, apart_s, problem.logs.front().has_housing ? "housing" : "winding", heat_word(logs.front()),
      logs.front().averaged ? "" : ", or say --averaged if a row tells its rms (a power's mean) since the row before");
}

}  // namespace identify

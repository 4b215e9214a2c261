// SPDX-License-Identifier: MIT
#include "identify/answer/refusals.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "identify/answer/baseline.hpp"
#include "identify/fit/parallel.hpp"
#include "identify/log/impossible.hpp"
#include "identify/log/units.hpp"
#include "identify/search/problem_of.hpp"

namespace identify {
namespace {

using thermal::Drive;

/// Rows without a clock have the period that somebody said.
bool by_row(const Log& log) { return log.called[static_cast<std::size_t>(Role::time)] == "--period"; }

std::string in_milliseconds(const Log& log) {
  if (by_row(log))
    return "At this period of its rows the motor hardly follows the load, and a thousandth of it "
           "explains more; say the right --period, in seconds.";
  return fmt::format(
      "Read in milliseconds, or less, the time column makes a motor that follows the load, and in seconds none; say "
      "{}, or :us.",
      column_in(log, Role::time, "ms"));
}

/// What follows the load where it is read otherwise leaves clearly less than the best as it stands, a likelihood e^20
/// times as great where a mistaken unit makes it e^100 and more, and a fraction of what two resistors leave.
constexpr double clearly = 20, fraction_left = 0.25;

/// Are R2 and C2 known from this data?
bool determines_housing(const Problem& problem, const Fit& f) {
  const auto lines = base_lines(problem, f, std::max(1.0, f.ratio()));
  return lines[1].determined && lines[3].determined;
}

/// A motor a thousand times as slow fits as well where no sheet says otherwise. A housing of 28 hours is none: a
/// traction machine of 50 kW settles within hours.
bool far_too_slow(const Problem& problem, const Fit& f) {
  const Physical p = physical(f.x);
  return !problem.belief.known && p.R2_K_per_W * p.C2_J_per_K > 1e5 && determines_housing(problem, f);
}

/// Of all its parts: what hangs on the housing, or is hot in the winding, may take up most of the heat.
double heat_capacity_J_per_K(const Problem& problem, const Fit& f) {
  const Physical p = physical(f.x);
  double out = p.C1_J_per_K + p.C2_J_per_K;
  Eigen::Index at = base_count;
  for (const Chosen& chosen : f.chosen) {
    const Cause& cause = cause_of(chosen);
    for (std::size_t i = 0; i < cause.parameters.size(); ++i, ++at) {
      if (std::string_view(cause.parameters[i].unit) == "J/K")
        out += parameter_value(problem, cause, static_cast<int>(i), f.x[at]);
    }
  }
  return out;
}

/// The heat that a winding takes up, of what its housing does; a cause may imitate what the other column was.
double winding_of_housing(const Found& found) {
  std::vector<const Fit*> fits = {&found.baseline.fit, &found.chosen.fit};
  if (!found.singles.empty()) fits.push_back(&found.singles.front().fit);
  double most = 0;
  for (const Fit* f : fits) most = std::max(most, physical(f->x).C1_J_per_K / physical(f->x).C2_J_per_K);
  return most;
}

/// Nor is a housing in air that settles within this: of motors of 4 mm, the smallest sold, it takes a minute.
constexpr double fastest_housing_s = 20;

std::string in_minutes(const Log& log) {
  if (by_row(log)) return "see whether --period tells the seconds from row to row";
  return fmt::format("if the time column is in minutes say {}, if in hours or days :h or :d",
                     column_in(log, Role::time, "min"));
}

std::string far_too_fast(const Problem& problem, const Found& found, const std::vector<Log>& logs) {
  const bool in_air = std::none_of(logs.begin(), logs.end(), [](const Log& log) { return log.has(Role::coolant); });
  for (const Fit* f : {&found.baseline.fit, &found.chosen.fit}) {
    const double settles_s = physical(f->x).R2_K_per_W * heat_capacity_J_per_K(problem, *f);
    if (in_air && settles_s < fastest_housing_s && determines_housing(problem, *f))
      return fmt::format("The housing would settle within {:g} s, as that of no motor does: {}{}.", fastest_housing_s,
                         in_minutes(logs.front()),
                         problem.logs.front().sink_assumed
                             ? ", and if the log begins warm say how warm the room is, --ambient DEGC"
                             : "");
  }
  return "";
}

/// A sheet whose winding the data contradicts by all the room there is, a factor of 30, is of another motor. What a
/// housing is mounted on, no sheet knows; but that makes it heavier, and cools it.
std::string unlike_the_sheet(const Problem& problem, const Found& found) {
  if (!problem.belief.known) return "";
  // Where something else is wrong, what heats slowly may pass for a winding: masses change places.
  const ParameterLine C1 = base_lines(problem, found.chosen.fit, std::max(1.0, found.chosen.fit.ratio()))[2];
  if (!found.chosen.fit.chosen.empty() && C1.determined && !holds_a_winding(problem, found.chosen.fit))
    return fmt::format(
        "Beside {} the winding would take up {:.3g} J/K, {:.2g} times its sheet: another mass stands in its place. "
        "Read the winding{}, or see whether {} is this motor.",
        fmt::join(names_of(found.chosen.fit.chosen), " and "), C1.value, C1.value / problem.belief.C1_J_per_K,
        problem.any_core() ? " more often" : " (core_degC or winding_ohm)", problem.belief.motor);
  const auto lines = base_lines(problem, found.chosen.fit, 1);
  const Physical p = physical(found.chosen.fit.x);
  const bool off[] = {true, p.R2_K_per_W > problem.belief.R2_K_per_W, true, p.C2_J_per_K < problem.belief.C2_J_per_K};
  for (std::size_t i = 0; i < std::size(off); ++i) {
    const ParameterLine& line = lines[i];
    if (off[i] && line.at_bound)
      return fmt::format(
          "{} would be {:.3g} {}, 30 times off the sheet: see whether {} is this motor, current_A its own current, "
          "core_degC and housing_degC two sensors; or leave --motor away.",
          line.name, line.value, line.unit, problem.belief.motor);
  }
  return "";
}

/// What a fit misses over what noise alone would leave.
double excess(const Fit& f) { return f.misfit - 0.5 * f.readings; }

/// Nonsense is nonsense in long bins too: a reading that leaves more than `look_share` there of what two resistors
/// leave is not tried any further. Twice what is asked in the end; a log of 20 min has hardly more bins.
constexpr std::size_t look_bins = 4000;
constexpr double look_share = 2 * fraction_left;
Problem in_long_bins(Problem problem) {
  std::size_t bins = 0;
  for (const Bins& log : problem.logs) bins += log.bins.size();
  for (Bins& log : problem.logs) log = merged(log, 1 + bins / look_bins);
  return problem;
}

/// What two resistors leave there.
double left_in_a_look(const Problem& problem, const Found& found) {
  return excess(fit(in_long_bins(problem), {}, {&found.plain_baseline}));
}

/// The logs with these columns read in this unit.
std::vector<Log> read_in(const Unit& unit, const std::vector<Role>& roles, std::vector<Log> logs) {
  for (Log& log : logs) {
    for (const Role role : roles) {
      for (double& x : log.of(role)) x = unit.factor * (x + unit.offset);
    }
  }
  return logs;
}

/// Two columns swapped, a temperature in Fahrenheit, time in milliseconds? Then two resistors, or one cause, on the
/// columns read otherwise leave less than the best cause does on these. Empty when nothing helps.
std::string misread_columns(const Problem& problem, const Found& found, const std::vector<Log>& logs,
                            const std::optional<wire::pc::MotorFile>& motor) {
  // All to the noise of the recording, and over it: what was found may count as noise what it could not explain.
  const auto left_by = [&](const Fit& f) { return excess(fit(problem, f.chosen, {&f})); };
  const Fit& plain = found.plain_baseline;
  const double as_it_stands = excess(plain), by_one = left_by(found.singles.front().fit);
  const double in_a_look = left_in_a_look(problem, found);
  const auto leaves_less = [&](const Problem& read, const std::vector<Chosen>& chosen, double explained) {
    const Fit look = fit(in_long_bins(read), chosen);
    if (!look.valid() || excess(look) > look_share * in_a_look) return false;
    const double left = excess(fit(read, chosen));
    return left + clearly < explained && left < fraction_left * as_it_stands;
  };
  const auto follows_better = [&](const std::vector<Log>& otherwise, double explained) {
    const Problem read = problem_of(otherwise, motor);
    return leaves_less(read, {}, explained) || leaves_less(read, best_alone(read).chosen, explained);
  };
  const bool turns = std::all_of(logs.begin(), logs.end(), [](const Log& log) {
    return log.has(Role::current) && largest_magnitude(log.of(Role::speed)) > 0;
  });
  // Where speed tells the current, with less noise, the temperatures follow either.
  const bool either =
      std::any_of(problem.logs.begin(), problem.logs.end(), [](const Bins& log) { return log.noisy_share < 1; });
  if (turns && !either && !problem.heated_by_power()) {
    std::vector<Log> swapped = logs;
    for (Log& log : swapped) std::swap(log.of(Role::current), log.of(Role::speed));
    // Of a unit that would prove nothing: a gain and an offset imitate Fahrenheit.
    const double explained = std::min(by_one, left_by(found.chosen.fit));
    if (leaves_less(problem_of(swapped, motor), {}, explained))
      return "The temperatures follow the square of the speed column and not that of the current: the two columns are "
             "swapped; map them with --column.";
  }
  // Both masses as large as they may be: a motor that answers far too slowly.
  const auto at_most = [&](Eigen::Index i, double believed) {
    return plain.at_bound[static_cast<std::size_t>(i)] && std::exp(plain.x[i]) > believed;
  };
  if (at_most(2, problem.belief.C1_J_per_K) && at_most(3, problem.belief.C2_J_per_K) &&
      follows_better(read_in(*unit_named("ms"), {Role::time}, logs), by_one))
    return in_milliseconds(logs.front());
  // A column that is ever below 50 would be below 10 degC: no room where motors are measured. Nor is what heats colder
  // than what cools it: a log that begins warm would be.
  const Unit degF = *unit_named("degF");
  const auto may_be_fahrenheit = [&](Role role) {
    return std::all_of(logs.begin(), logs.end(), [&](const Log& log) {
      constexpr double sensors_K = 3;  // two may differ by
      const double least = lowest(log.of(role)), sink_degC = lowest(log.of(sink_of(log)));
      return log.has(role) && least >= 50 && !(degF.factor * (least + degF.offset) < sink_degC - sensors_K);
    });
  };
  // Degrees that are 1.8 times too large, from another zero, leave kelvins: 5 to 9 in six logs that began warm, where
  // effects of 8 K left less than half one of the housing, and of the winding no more than its noise of 2 K and half.
  constexpr double kelvins = 2;
  const Rmse missed = rmse_of(problem, plain);
  if (!(missed.housing_K > kelvins) && !(missed.core_K > kelvins + 1.5 * problem.noise.core_white_K)) return "";
  // What was found may imitate it, by a gain and an offset, or be what is true.
  const double explained = std::min(by_one, left_by(found.chosen.fit) + 2 * clearly);
  const std::vector<Role> together[] = {{Role::housing}, {Role::core}, {Role::housing, Role::core}};
  for (const std::vector<Role>& roles : together) {
    if (!std::all_of(roles.begin(), roles.end(), may_be_fahrenheit) ||
        !follows_better(read_in(degF, roles, logs), explained))
      continue;
    std::string columns;
    for (const Role role : roles) columns += " " + column_in(logs.front(), role, "degF");
    return fmt::format("Read as Fahrenheit a temperature column follows the load, and as Celsius it does not; say{}.",
                       columns);
  }
  return "";
}

/// The same logs with the load so many seconds later, or sooner where that is negative, without the rows that then have
/// none or nothing else; `moves` false: those readings with the load as it was. None where that would leave less than
/// three quarters of a log, or a pause stands in it.
std::vector<Log> loaded_later(double late_s, const Problem& problem, std::vector<Log> logs, bool moves = true) {
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const auto rows = static_cast<std::ptrdiff_t>(std::abs(late_s) / problem.logs[l].interval_s);
    if (4 * rows > std::ssize(logs[l].of(Role::time)) || !logs[l].resumes_s.empty()) return {};
    for (std::size_t role = 0; role < role_count; ++role) {
      std::vector<double>& column = logs[l].columns[role];
      if (column.empty()) continue;
      const bool load =
          std::find(std::begin(load_roles), std::end(load_roles), static_cast<Role>(role)) != std::end(load_roles);
      // Time goes on from zero either way.
      if (static_cast<Role>(role) == Role::time || (load && moves) == (late_s > 0))
        column.erase(column.end() - rows, column.end());
      else
        column.erase(column.begin(), column.begin() + rows);
    }
  }
  return logs;
}

/// Of two clocks farther apart than a clock_delay may be: by how much the temperatures are late; 0: by none. Until they
/// are put right, a motor that warms where nothing flows makes rest look noisy.
double clocks_apart_s(const Problem& problem, const Found& found, const std::vector<Log>& logs) {
  const Chosen clock = {cause_named("clock_delay"), -1};
  const double reach_s = cause_of(clock).parameters[0].high;
  double late_s = 0, apart_s = 0, least = fraction_left * excess(found.plain_baseline);
  for (const Fit* f : {&found.singles.front().fit, &found.chosen.fit})
    least = std::min(least, excess(fit(problem, f->chosen, {f})) - clearly);
  const double in_a_look = left_in_a_look(problem, found);
  const double tried_s[] = {-4 * reach_s, -2 * reach_s, 2 * reach_s, 4 * reach_s};
  Fit fits[std::size(tried_s)];
  in_parallel(std::size(tried_s), [&](std::size_t i) {
    const std::vector<Log> moved = loaded_later(tried_s[i], problem, logs);
    if (moved.empty()) return;
    const Problem apart = unseen_by(problem, moved);
    const Fit look = fit(in_long_bins(apart), {clock});
    if (look.valid() && excess(look) < look_share * in_a_look) fits[i] = fit(apart, {clock});
  });
  for (std::size_t i = 0; i < std::size(tried_s); ++i) {
    if (!fits[i].valid() || excess(fits[i]) >= least) continue;
    least = excess(fits[i]);
    apart_s = tried_s[i];
    late_s = apart_s + fits[i].x[coordinate_of(fits[i], Edit::delay)];
  }
  if (late_s == 0) return 0;
  // What no model followed may have gone with the rows that were taken away: one step of the load near an end.
  const Problem as_it_was = unseen_by(problem, loaded_later(apart_s, problem, logs, false));
  const double in_place = std::min(excess(fit(as_it_was, {})), excess(fit(as_it_was, {clock})));
  return least + clearly < in_place && least < fraction_left * in_place ? late_s : 0;
}

/// With the two temperatures swapped, does one cause leave clearly less than the best does as they stand?
bool follows_better_swapped(const Problem& problem, const Found& found, std::vector<Log> logs,
                            const std::optional<wire::pc::MotorFile>& motor) {
  const Fit& best = found.singles.front().fit;
  for (Log& log : logs) std::swap(log.of(Role::core), log.of(Role::housing));
  const Problem swapped = problem_of(logs, motor);
  const auto left_by_best = [&](const Problem& p) { return excess(fit(p, best.chosen, {&best})); };
  const double in_a_look = left_by_best(in_long_bins(problem));
  if (!(excess(best_alone(in_long_bins(swapped))) < in_a_look + std::abs(in_a_look) + clearly)) return false;
  // What was found may explain all as it is read: two resistors, and one cause, are then bent by what it is of.
  const double left =
      std::min(left_by_best(problem), excess(fit(problem, found.chosen.fit.chosen, {&found.chosen.fit})));
  return excess(best_alone(swapped)) + clearly < std::min(left, fraction_left * left);
}

/// From half a minute to the next the heat stays within a fifth, and so it does from log to log.
bool never_changes(const Problem& problem) {
  constexpr double same = 0.8;
  double least = 1e300, most = 0;
  for (const Bins& log : problem.logs) {
    const double together_s = std::min(30.0, log.duration_s() / 20);
    const Bins coarse = merged(log, static_cast<std::size_t>(std::max(1.0, std::round(together_s / log.width_s))));
    for (const Bin& bin : coarse.bins) {
      const double heat = std::abs(bin.input[log.has_power ? Drive::power_W : Drive::current_A2]);
      least = std::min(least, heat), most = std::max(most, heat);
    }
  }
  return least > same * most;
}

}  // namespace

std::string too_poor(const Problem& problem, const std::vector<Log>& logs) {
  // Cautious: of two hidden logs both were named rightly with three fifths of the housing's readings gone at random; of
  // the load a seventh was too much already (masks.cpp), and of gaps three, 22 s of 20 min. One with two fifths of its
  // load gone in one stretch was named rightly as well.
  constexpr double most_missing = 0.35, most_in_gaps = 0.3;
  constexpr double least_span_K = 2;  // a thermistor wanders by 0.05 K: resistances are then known to 3 percent at best
  double span = 0, lasts_s = 0;
  for (const Bins& log : problem.logs) lasts_s += log.duration_s();
  if (lasts_s < fastest_housing_s)
    return fmt::format("{} {:.2g} s, in which no motor's housing settles; {}.",
                       problem.logs.size() > 1 ? "Together they last" : "It lasts", lasts_s, in_minutes(logs.front()));
  for (const Bins& log : problem.logs) {
    if (log.missing_share > most_missing)
      return fmt::format("{}: {:.0f} % of the readings or rows are missing or frozen; record it again.", log.name,
                         100 * log.missing_share);
    if (log.gap_share > most_in_gaps)
      return fmt::format("{}: gaps make up {:.0f} % of its time; record it again.", log.name, 100 * log.gap_share);
    std::size_t paused = 0;
    for (const Start& start : log.starts) paused += start.paused;
    if (const double share = static_cast<double>(paused) / static_cast<double>(log.bins.size()); share > most_missing)
      return fmt::format(
          "{}: nothing tells the heat input for {:.0f} % of its time; record it again, or, where its parts are "
          "recordings of their own, tell them apart by a column (--column session=NAME).",
          log.name, 100 * share);
    double low = 1e300, high = -1e300;
    for (const Bin& bin : log.bins) {
      const double T = bin.housing_n > 0 ? bin.housing_degC : bin.core_degC;
      if (!std::isnan(T)) low = std::min(low, T), high = std::max(high, T);
    }
    span = std::max(span, high - low);
  }
  // Four parameters and two initial temperatures follow any few readings; some must be left to judge by.
  for (const Bins& log : problem.logs) {
    float housing = 0, core = 0;
    for (const Bin& bin : log.bins) housing += bin.housing_n, core += bin.core_n;
    const float least = log.housing_step_K == 0 ? 20 : 10;  // a step tells its moment, and no noise hides it
    if (std::max(housing, core) < least)
      return fmt::format("{}: {:.0f} readings of a temperature are too few, {:.0f} the least; read it more often.",
                         log.name, static_cast<double>(std::max(housing, core)), static_cast<double>(least));
  }
  if (span == 0)
    return "The temperature is the same in all rows, as of a sensor that does not work; see whether it is connected.";
  if (span < least_span_K)
    return fmt::format("The temperatures move by {:.1f} K only; load the motor until it is warm.", span);
  return "";
}

std::string too_short(const Problem& problem, const Found& found) {
  const Fit& plain = found.plain_baseline;
  // A baseline that is wrong may stretch its time constant without end; what the search started from may not. Logs that
  // differ in their cooling (a fan) have no time constant in common: the shortest that one of them determines counts.
  const auto time_constant_s = [](const Fit& f) {
    const Physical p = physical(f.x);
    return p.R2_K_per_W * p.C2_J_per_K;
  };
  double housing_s = std::min(time_constant_s(plain), problem.belief.R2_K_per_W * problem.belief.C2_J_per_K);
  for (std::size_t l = 0; problem.logs.size() > 1 && l < problem.logs.size(); ++l) {
    Problem one = problem;
    one.logs = {problem.logs[l]};
    const Fit alone = fit(one, {});
    if (alone.valid() && determines_housing(one, alone)) housing_s = std::min(housing_s, time_constant_s(alone));
  }
  // Two resistors that miss much may see no cooling, or a slow one, where the causes found let it be seen.
  const bool explains = found.verdict != Verdict::adequate && found.verdict != Verdict::unknown_cause;
  if (explains && determines_housing(problem, found.chosen.fit))
    housing_s = std::min(housing_s, time_constant_s(found.chosen.fit));
  double lasts_s = 0;
  for (const Bins& log : problem.logs) lasts_s += log.duration_s();
  if (lasts_s < housing_s) {
    const bool known = problem.belief.known || determines_housing(problem, plain);
    return fmt::format("{} {:.0f} s, less than the housing's time constant{}; record longer.",
                       problem.logs.size() > 1 ? "Together they last" : "It lasts", lasts_s,
                       known ? fmt::format(" of about {:.0f} s", housing_s) : ", which it does not determine");
  }
  constexpr double settled = 3;  // time constants: 95 percent of the way
  const auto settles = [&](const Fit& f) { return problem.belief.known || base_lines(problem, f, 1)[1].determined; };
  if ((found.verdict == Verdict::adequate && !settles(plain)) || (explains && !settles(found.chosen.fit)))
    return explains && settles(plain) && lasts_s > settled * housing_s
               ? fmt::format(
                     "Beside {} this log leaves open how well the housing is cooled; hold loads of several "
                     "sizes, each until the temperatures stand.",
                     fmt::join(names_of(found.chosen.fit.chosen), " and "))
               : fmt::format("In {:.0f} s the housing does not come near where it settles; record longer.", lasts_s);
  if (never_changes(problem))
    return "The load never changes, so heat and cooling cannot be told apart; record rests between loads of several "
           "sizes.";
  return "";
}

std::string suspicion(const Problem& problem, const Found& found, const std::vector<Log>& logs,
                      const std::optional<wire::pc::MotorFile>& motor) {
  for (const Fit* f : {&found.baseline.fit, &found.chosen.fit}) {
    if (far_too_slow(problem, *f)) return in_milliseconds(logs.front());
  }
  // A winding heavier than its housing is another matter (masses_in_each_others_place).
  if (winding_of_housing(found) <= heaviest_winding) {
    if (const std::string fast = far_too_fast(problem, found, logs); !fast.empty()) return fast;
  }
  if (found.verdict == Verdict::adequate || found.singles.empty()) return "";
  // Singles were fitted to the noise of the recording alone; what was chosen may count a disturbance as noise.
  const Fit& best = found.singles.front().fit;
  if (const double late_s = clocks_apart_s(problem, found, logs); late_s != 0)
    return fmt::format("The temperatures follow the current {:.0f} s {}: two clocks; align the recordings first.",
                       std::abs(late_s), late_s > 0 ? "late" : "early");
  const int delay = coordinate_of(best, Edit::delay);
  if (delay >= 0 && best.at_bound[static_cast<std::size_t>(delay)]) {
    return fmt::format("Temperatures and current are more than {:.0f} s apart: two clocks; align the recordings first.",
                       cause_of(best.chosen.front()).parameters[0].high);
  }
  return misread_columns(problem, found, logs, motor);
}

std::string masses_in_each_others_place(const Problem& problem, const Found& found, const std::vector<Log>& logs,
                                        const std::optional<wire::pc::MotorFile>& motor) {
  const bool both = std::all_of(problem.logs.begin(), problem.logs.end(),
                                [](const Bins& log) { return log.has_core && log.has_housing; });
  const double share = winding_of_housing(found);
  if (found.verdict != Verdict::adequate && !found.singles.empty() && both && share > heaviest_winding &&
      follows_better_swapped(problem, found, logs, motor))
    return fmt::format(
        "The winding would take up {:.0f} times the heat of the housing, as in no motor: see whether core_degC and "
        "housing_degC are swapped.",
        share);
  if (names_causes(found.verdict) && !problem.belief.known && !holds_a_winding(problem, found.chosen.fit))
    return fmt::format(
        "Beside {} the winding would take up more heat than any housing: another mass stands in its place. Say which "
        "motor this is (--motor).",
        fmt::join(names_of(found.chosen.fit.chosen), " and "));
  const std::string fast = far_too_fast(problem, found, logs);
  return fast.empty() ? unlike_the_sheet(problem, found) : fast;
}

}  // namespace identify

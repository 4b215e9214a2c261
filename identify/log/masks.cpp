// SPDX-License-Identifier: MIT
#include "identify/log/masks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "identify/log/bins.hpp"
#include "identify/log/median.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

using wire::pc::refuse_data;

/// Share of readings that are missing from a channel which is otherwise sampled at every row. A channel written every
/// n-th row (a sparse winding reading) is judged on its own grid.
double holes(const std::vector<double>& v) {
  std::vector<double> spacing;
  std::size_t last = 0, seen = 0;
  for (std::size_t i = 0; i < v.size(); ++i) {
    if (std::isnan(v[i])) continue;
    if (seen++ != 0) spacing.push_back(static_cast<double>(i - last));
    last = i;
  }
  if (seen < 2) return 1;
  const double grid = median(spacing);
  return std::max(0.0, 1.0 - static_cast<double>(seen) * grid / static_cast<double>(v.size()));
}

void mask_frozen(Log& log, Role role) {
  std::vector<double>& v = log.of(role);
  const auto runs = frozen_runs(v);
  if (runs.empty()) return;
  const auto& t = log.of(Role::time);
  std::size_t rows = 0;
  double longest_s = 0, from_s = 0;
  double most = v[runs.front().first];
  for (const double x : v) most = std::fmax(most, x);
  const bool at_its_end = std::all_of(runs.begin(), runs.end(), [&](const auto& run) { return v[run.first] == most; });
  for (const auto& [from, to] : runs) {
    // The first reading of a run was measured, and its repetitions were not; of a sensor that was not up when the log
    // began neither.
    const bool began =
        std::all_of(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(from), [](double x) { return std::isnan(x); });
    for (std::size_t i = began ? from : from + 1; i < to; ++i) v[i] = missing, ++rows;
    if (t[to - 1] - t[from] > longest_s) longest_s = t[to - 1] - t[from], from_s = t[from];
  }
  log.notes.push_back(fmt::format(
      "{} stood frozen at one value in {} stretch{} ({} rows, the longest {:.0f} s from {:.0f} s){}; masked.",
      own_name(role), runs.size(), runs.size() == 1 ? "" : "es", rows, longest_s, from_s,
      at_its_end
          ? fmt::format(", {:g}, the highest that it tells, as where a sensor or an input reaches no further", most)
          : ""));
}

/// Of each reading and those around it, within half a second and ten rows either way (half of hurry_s; more rows cost):
/// noise that reaches over the next step now and then is no step.
std::vector<double> medians_around(const std::vector<double>& v, double usual_s) {
  const auto reach = static_cast<std::size_t>(std::clamp(0.5 / usual_s, 0.0, 10.0));
  std::vector<double> out = v, near;
  for (std::size_t i = 0; i < v.size(); ++i) {
    if (std::isnan(v[i])) continue;
    near.clear();
    for (std::size_t k = i - std::min(i, reach); k <= std::min(i + reach, v.size() - 1); ++k) {
      if (!std::isnan(v[k])) near.push_back(v[k]);
    }
    out[i] = median(near);
  }
  return out;
}

/// From the first row that told another degree to the last of a flutter about the same step.
struct Step {
  std::size_t first, last;
  double degC;
};

/// Steps at one degree are one flutter while they follow each other within a share of the time that the way to another
/// degree takes: in longer the truth may have left it and come back.
std::vector<Step> flutters_of(const std::vector<Step>& steps, const std::vector<double>& t, double share,
                              double least_s) {
  std::vector<Step> out;
  for (std::size_t from = 0, to = 0; from < steps.size(); from = to) {
    while (to < steps.size() && steps[to].degC == steps[from].degC) ++to;
    double degree_s = t.back();
    if (from > 0) degree_s = t[steps[from].first] - t[steps[from - 1].last];
    if (to < steps.size()) degree_s = std::min(degree_s, t[steps[to].first] - t[steps[to - 1].last]);
    const double flutter_s = std::max(least_s, share * degree_s);
    for (std::size_t k = from; k < to; ++k) {
      if (k == from || t[steps[k].first] - t[out.back().last] > flutter_s) out.push_back(steps[k]);
      out.back().last = steps[k].last;
    }
  }
  return out;
}

/// A sensor that tells whole degrees says where it is only as it steps: there the truth lies half way, and in between
/// it may be anywhere. A flutter about one step is one reading, at its middle; of a housing none where it ends as it
/// began, while a winding does go and come back within seconds. Of steps to different degrees that follow each other
/// within a second the moments are not known well enough.
void read_between_steps(Log& log, Role role) {
  // Chosen: half or double of all but flutter_s, and of what medians_around reaches, at once leaves the answer on a log
  // in whole degrees. Of the steps of housings none followed another within a second; of sensors that feel a winding, a
  // tenth and more did (score's motors, whole degrees, seeds 1 to 5).
  constexpr double flutter_s = 2, hurry_s = 1, most_hurried = 0.1;
  constexpr std::size_t least_steps = 4;
  std::vector<double>& v = log.of(role);
  const auto& t = log.of(Role::time);
  const double step_K = step_of(v);
  if (step_K < coarse_K) return;
  if (role == Role::core) log.core_step_K = step_K;
  if (2 * count_told(v) < v.size()) return;

  std::vector<Step> steps;
  const double usual_s = t.back() / static_cast<double>(t.size() - 1), apart_s = std::max(hurry_s, 2.5 * usual_s);
  const std::vector<double> settled = medians_around(v, usual_s);
  for (std::size_t i = 1; i < v.size(); ++i) {
    const double moved_K = std::abs(settled[i] - settled[i - 1]);
    if (std::isnan(moved_K) || moved_K == 0) continue;
    if (t[i] - t[i - 1] > apart_s) continue;  // when in a gap is not known
    steps.push_back({i, i, (settled[i] + settled[i - 1]) / 2});
  }
  const double share = role == Role::housing ? 0.25 : 0;  // at an eighth a long flutter is two (tests: Masks)
  steps = flutters_of(steps, t, share, std::max(flutter_s, apart_s));
  if (role == Role::housing)
    std::erase_if(steps, [&](const Step& step) { return settled[step.last] == settled[step.first - 1]; });
  const auto hurried = [&](const Step& one, const Step& next) {
    return one.degC != next.degC && t[next.first] - t[one.last] < apart_s;
  };
  std::vector<Step> unhurried;
  for (std::size_t k = 0; k < steps.size(); ++k) {
    if ((k == 0 || !hurried(steps[k - 1], steps[k])) && (k + 1 == steps.size() || !hurried(steps[k], steps[k + 1])))
      unhurried.push_back(steps[k]);
  }
  if (unhurried.size() < least_steps) return;
  if (role == Role::housing) {
    // It feels the winding, and that shows in its hurry: then all readings are used.
    if (static_cast<double>(unhurried.size()) < (1 - most_hurried) * static_cast<double>(steps.size())) return;
    log.housing_step_K = step_K;
  }
  std::fill(v.begin(), v.end(), missing);
  for (const Step& step : unhurried) v[(step.first + step.last) / 2] = step.degC;
  log.notes.push_back(fmt::format(
      "{} moves in steps of {:g} K; used are the moments of {} of its {} steps, each as a reading half way (a sensor "
      "that rounds down then shows half a step too little).",
      own_name(role), step_K, unhurried.size(), steps.size()));
}

/// Share of a channel that is missing. One that comes regularly but not in every row, as from a bus whose messages were
/// written one a row, is judged by its own interval.
double missing_of_input(const Log& log, Role role) {
  const auto &v = log.of(role), &t = log.of(Role::time);
  std::vector<double> spacing_s;
  double last_s = missing, pauses_s = 0;
  for (std::size_t i = 0; i < v.size(); ++i) {
    if (std::isnan(v[i])) continue;
    if (resumes(log, last_s, t[i]))
      pauses_s += t[i] - last_s;
    else if (!std::isnan(last_s))
      spacing_s.push_back(t[i] - last_s);
    last_s = t[i];
  }
  const double grid_s = median(spacing_s);
  constexpr double late_times = 1.5;  // half way to where one is missing
  const auto late =
      std::count_if(spacing_s.begin(), spacing_s.end(), [&](double s) { return s > late_times * grid_s; });
  const double of_rows = static_cast<double>(v.size() - count_told(v)) / static_cast<double>(v.size());
  if (spacing_s.size() < 10 || 10 * static_cast<std::size_t>(late) > spacing_s.size()) return of_rows;
  const double of_time =
      1 - static_cast<double>(spacing_s.size() + 1) * grid_s / (t.back() - t.front() - pauses_s + grid_s);
  return std::clamp(of_time, 0.0, of_rows);  // rows that are missing are counted as such
}

/// What heats. A hole in it is bridged by its neighbours, which is only honest for short ones.
void note_missing_input(Log& log) {
  // With 15 and 29 percent of the cells gone two hidden logs of two got no name in the end (too_sparse); this says so
  // at once.
  constexpr double most_missing = 0.3;
  std::vector<Role> input = {heat_of(log)};
  if (input.front() == Role::iq && log.has(Role::id))
    input.push_back(Role::id);
  else if (input.front() == Role::iq)
    log.notes.push_back("id_A is missing; all current is taken to make torque.");
  for (const Role role : input) {
    const double share = missing_of_input(log, role);
    log.missing_share = std::max(log.missing_share, share);
    if (share > most_missing) {
      refuse_data(
          fmt::format("{}: {} is missing in {:.0f} % of the rows, so the heat that went in is not known; record it "
                      "again with every row filled.",
                      log.name, own_name(role), 100 * share));
    }
    if (share > 5e-4)
      log.notes.push_back(fmt::format("{} is missing in {:.1f} % of the rows; bridged by its neighbours.",
                                      own_name(role), 100 * share));
  }
}

void note_missing_readings(Log& log) {
  for (const Role role : {Role::housing, Role::core}) {
    if (!log.has(role)) continue;
    const double share = holes(log.of(role));
    if (share > 0.02)
      log.notes.push_back(
          fmt::format("{} is missing in {:.0f} % of its readings; left out of the fit.", own_name(role), 100 * share));
    if (role == Role::housing || !log.has(Role::housing)) log.missing_share = std::max(log.missing_share, share);
  }
}

void note_gaps(Log& log) {
  const auto& t = log.of(Role::time);
  const std::vector<double> spacing_s = spacing(t);
  const double usual_s = row_period_s(t);
  double lost_s = 0, held_s = 0;
  int gaps = 0;
  for (std::size_t i = 0; i < spacing_s.size(); ++i) {
    const double dt_s = spacing_s[i];
    if (resumes(log, t[i], t[i + 1])) {
      lost_s += dt_s - usual_s;
      continue;
    }
    // Five missed rows in a row are a gap, less is jitter; and what a bin may hold goes into its mean.
    if (dt_s > std::max(5 * usual_s, longest_bin_s)) held_s += dt_s - usual_s, ++gaps;
  }
  const double duration_s = t.back() - t.front();
  log.gap_share = duration_s > 0 ? held_s / duration_s : 0;
  if (gaps > 0) {
    log.notes.push_back(fmt::format("{} gap{} in time, {:.0f} s of {:.0f} s together; the input is held across {}.",
                                    gaps, gaps == 1 ? "" : "s", held_s, duration_s, gaps == 1 ? "it" : "them"));
  }
  // Rows that are missing one by one among the others: the current that flowed in them is not known either.
  const double rows_lost =
      duration_s > 0 ? 1 - (static_cast<double>(t.size() - 1) * usual_s + lost_s + held_s) / duration_s : 0;
  // Where nearly all come at whole multiples of the usual, a logger drops rows; elsewhere they jitter.
  const auto on_beat = std::count_if(spacing_s.begin(), spacing_s.end(), [&](double dt_s) {
    return std::abs(dt_s / usual_s - std::round(dt_s / usual_s)) < 0.1;
  });
  const bool drops = static_cast<double>(on_beat) > 0.9 * static_cast<double>(spacing_s.size());
  if (rows_lost > (drops ? 0.01 : 0.1)) {
    log.notes.push_back(fmt::format("About {:.0f} % of the rows are missing among the others ({:g} s apart).",
                                    100 * rows_lost, usual_s));
  }
  log.missing_share = std::max(log.missing_share, rows_lost);
}

/// Rows of readings, up to three in a row, that jump away and back as no temperature can.
std::vector<std::size_t> temperature_glitches(const Log& log, Role role) {
  // Chosen: half or double of these at once leaves the answer on a log with four such glitches.
  constexpr double jump_K = 10;  // and back; beyond any thermistor's noise
  constexpr std::size_t most = 3;
  // Nothing that warms by so much is back within these times: a winding cools in 1 s and more, a housing in minutes.
  // Water and air may change as fast as a winding.
  constexpr double fast_s = 2.5, housing_s = 60;
  constexpr double back_share = 0.1;  // so near to where it came from
  const auto &v = log.of(role), &t = log.of(Role::time);
  const auto& sink = log.of(sink_of(log));
  std::vector<std::size_t> read;
  std::vector<double> early;
  for (std::size_t i = 0; i < v.size(); ++i) {
    if (std::isnan(v[i])) continue;
    read.push_back(i);
    if (early.size() < 5) early.push_back(v[i]);
  }
  const bool motor = role == Role::core || role == Role::housing;
  const double first_degC = median(early);
  const double within_s = role == Role::housing ? housing_s : fast_s;
  // Readings k to m-1, away from number `from`, with number `to` as near to it as before?
  const auto glitch = [&](std::size_t k, std::size_t m, std::size_t from, std::size_t to) {
    const std::size_t first = std::min({read[k], read[from], read[to]}), last = std::max(read[m - 1], read[to]);
    double away_K = 1e300;
    // Than all around and than itself at first, before and after, which no load makes a motor.
    const auto cold = [&](std::size_t i) { return v[read[i]] < std::min(sink[read[i]], first_degC) - jump_K; };
    bool colder = motor && !sink.empty() && !cold(from) && !cold(to);
    for (std::size_t i = k; i < m; ++i) {
      const double change_K = v[read[i]] - v[read[from]];
      away_K = std::min(away_K, std::abs(change_K));
      colder = colder && change_K < 0 && cold(i);
    }
    if (away_K < jump_K) return false;
    if (colder && v[read[to]] > v[read[k]] + jump_K) return true;
    // On its way up already: a peak.
    if (from > 0 && from < k && std::abs(v[read[from]] - v[read[from - 1]]) > back_share * away_K) return false;
    return t[last] - t[first] <= within_s && std::abs(v[read[to]] - v[read[from]]) < back_share * away_K;
  };
  std::vector<std::size_t> glitches;
  for (std::size_t k = 0; k < read.size(); ++k) {
    for (std::size_t m = k + 1; m <= std::min(k + most, read.size()); ++m) {
      const std::size_t left = read.size() - m;
      const bool is_glitch = k > 0 && left > 0 ? glitch(k, m, k - 1, m)
                             : left > 1        ? glitch(k, m, m, m + 1)
                                               : k > 1 && glitch(k, m, k - 1, k - 2);
      if (!is_glitch) continue;
      for (std::size_t i = k; i < m; ++i) glitches.push_back(read[i]);
      read.erase(read.begin() + static_cast<std::ptrdiff_t>(k), read.begin() + static_cast<std::ptrdiff_t>(m));
      --k;
      break;
    }
  }
  return glitches;
}

/// Rows between two steps, away and back, in which a sensor had come off, or its wire: no housing and no room makes one
/// such step, and a winding does.
std::vector<std::size_t> readings_of_a_loose_sensor(const Log& log, Role role) {
  constexpr double step_K = 20, at_once_s = 3, longest_s = 300, back_share = 0.25;
  if (role == Role::core) return {};
  const auto &v = log.of(role), &t = log.of(Role::time);
  std::vector<std::size_t> read, loose;
  for (std::size_t i = 0; i < v.size(); ++i) {
    if (!std::isnan(v[i])) read.push_back(i);
  }
  const auto step = [&](std::size_t k) {
    const std::size_t i = read[k], before = read[k - 1];
    return t[i] - t[before] <= at_once_s && std::abs(v[i] - v[before]) >= step_K ? v[i] - v[before] : 0;
  };
  for (std::size_t k = 1; k < read.size(); ++k) {
    const double away_K = step(k);
    if (away_K == 0) continue;
    for (std::size_t m = k + 1; m < read.size() && t[read[m]] - t[read[k]] <= longest_s; ++m) {
      if (step(m) * away_K >= 0 || std::abs(v[read[m]] - v[read[k - 1]]) > back_share * std::abs(away_K)) continue;
      loose.insert(loose.end(), read.begin() + static_cast<std::ptrdiff_t>(k),
                   read.begin() + static_cast<std::ptrdiff_t>(m));
      k = m;
      break;
    }
  }
  return loose;
}

/// Rows that say more than so many times what ever lasts for two: an overload of one row is a load, and comes again; a
/// hundred times the heat of what lasts is none. None where they are many.
std::vector<std::size_t> load_glitches(const Log& log, Role role, double times) {
  constexpr double most_share = 0.01;
  const std::vector<double>& v = log.of(role);
  double lasting = 0, before = 0;
  for (const double x : v) {
    if (std::isnan(x)) continue;
    lasting = std::max(lasting, std::min(std::abs(x), std::abs(before)));
    before = x;
  }
  std::vector<std::size_t> glitches;
  for (std::size_t i = 0; i < v.size(); ++i) {
    if (lasting > 0 && std::abs(v[i]) > times * lasting) glitches.push_back(i);
  }
  if (static_cast<double>(glitches.size()) > most_share * static_cast<double>(count_told(v))) glitches.clear();
  return glitches;
}

}  // namespace

double step_of(const std::vector<double>& v) {
  constexpr double finest = 1e-5;  // what files and single precision leave of a measured value
  double step = 0, last = missing;
  for (const double x : v) {
    if (std::isnan(x)) continue;
    // The largest number that divides all changes (Euclid).
    double change = std::isnan(last) ? 0 : std::abs(x - last);
    while (change > 0.1 * finest) {
      const double rest = std::fmod(step, change);
      step = change;
      change = rest;
    }
    last = x;
    if (step > 0 && step < finest) return 0;
  }
  return step;
}

std::vector<std::pair<std::size_t, std::size_t>> frozen_runs(const std::vector<double>& values) {
  struct Run {
    std::size_t from, to;
    double readings;
  };
  std::vector<Run> runs;
  std::vector<double> lengths, steps;
  double last = missing;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double x = values[i];
    if (std::isnan(x)) continue;
    if (!runs.empty() && x == last) {
      runs.back().to = i + 1;
      ++runs.back().readings;
      continue;
    }
    if (!runs.empty()) steps.push_back(std::abs(x - last));
    runs.push_back({i, i + 1, 1});
    last = x;
  }
  std::vector<std::pair<std::size_t, std::size_t>> frozen;
  if (runs.size() < 10) return frozen;  // a typed constant, or a recording of nothing: no motion to compare with
  for (const Run& run : runs) lengths.push_back(run.readings);
  std::sort(lengths.begin(), lengths.end());
  const double usual = lengths[lengths.size() * 9 / 10];
  // White noise of 0.4 to 20 steps stands still for 7.9 times its usual at most (88 times 12,000 rows). Of a log with
  // three frozen stretches half of this masks the same.
  constexpr double longer = 8;
  const double step = median(steps);
  for (std::size_t r = 0; r < runs.size(); ++r) {
    if (runs[r].readings < longer * usual) continue;
    // A coarse channel rests at one step for long when nothing happens. It was frozen only if it then jumps by several.
    const bool fine = usual <= 2;
    const bool jumps = r + 1 < runs.size() && steps[r] > 4 * step;
    // Where a smooth channel turns round, it dwells on the values before and after as well, one step away.
    const bool turns = r > 0 && r + 1 < runs.size() && std::max(steps[r - 1], steps[r]) < 2 * step &&
                       6 * std::max(runs[r - 1].readings, runs[r + 1].readings) > runs[r].readings;
    if ((fine && !turns) || jumps) frozen.emplace_back(runs[r].from, runs[r].to);
  }
  return frozen;
}

void forget_glitches(Log& log) {
  const auto forget = [&](Role role, const std::vector<std::size_t>& rows, const std::string& because, const char* one,
                          const char* several) {
    if (rows.empty()) return;
    for (const std::size_t i : rows) log.of(role)[i] = missing;
    log.notes.push_back(fmt::format("{} {} {} {} masked, the first at {:.1f} s.", own_name(role), because, rows.size(),
                                    rows.size() == 1 ? one : several, log.of(Role::time)[rows.front()]));
  };
  for (const Role role :
       {Role::coolant, Role::ambient, Role::core, Role::housing, Role::frame, Role::neighbour, Role::board}) {
    forget(role, temperature_glitches(log, role), "jumps away and back as no temperature can:", "reading", "readings");
    forget(role, readings_of_a_loose_sensor(log, role), "steps away and back at once, as of a loose sensor:", "reading",
           "readings");
  }
  for (const Role role : {Role::current, Role::id, Role::iq, Role::power}) {
    const double times = role == Role::power ? 100 : 10;
    forget(role, load_glitches(log, role, times),
           fmt::format("exceeds {:g} times what it ever holds for two rows, in", times), "single row;", "single rows;");
  }
}

void mask(Log& log) {
  for (const Role role : temperatures) {
    if (log.has(role)) mask_frozen(log, role);
  }
  note_missing_input(log);
  note_missing_readings(log);
  note_gaps(log);
  if (log.has(Role::housing)) read_between_steps(log, Role::housing);
  if (log.has(Role::core)) read_between_steps(log, Role::core);
  if (!log.has(Role::housing) && !log.has(Role::core))
    refuse_data(log.name + ": no temperature of the motor is left; record the housing or the winding.");
}

}  // namespace identify

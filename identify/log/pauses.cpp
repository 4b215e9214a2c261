// SPDX-License-Identifier: MIT
#include "identify/log/pauses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "identify/log/masks.hpp"
#include "identify/log/median.hpp"

namespace identify {
namespace {

// Held over five seconds, a wrong current moves a small motor's winding (1 to 20 s) by kelvins. After ten minutes a
// housing and what it is mounted on have moved as well.
constexpr double pause_s = 5, long_s = 600, pause_rows = 5;
constexpr std::size_t most_pauses = 24;  // each costs two initial temperatures, and a step the cube of them
constexpr double most_share = 0.02;      // of the rows: more are a logger that writes now and then
// Of a part, so that also what is held out of it leaves enough to be fitted: twice what is asked for there and more
// (bins_of: 30 rows, too_poor: 20 readings).
constexpr std::size_t least_rows = 100, least_readings = 40;

/// Forgets a heat input that stands still under load although its noise shows elsewhere.
void forget_frozen_input(Log& log) {
  constexpr double least_s = 30;
  const Role role = heat_of(log);
  std::vector<double>& v = log.of(role);
  const auto& t = log.of(Role::time);
  const double range = largest_magnitude(v);
  const auto frozen = frozen_runs(v);
  std::vector<double> elsewhere = v;
  for (const auto& [from, to] : frozen) {
    for (std::size_t i = from; i < to; ++i) elsewhere[i] = missing;
  }
  if (!is_noisy(elsewhere, range)) return;
  for (const auto& [from, to] : frozen) {
    const double stood_s = t[to - 1] - t[from];
    if (v[from] == 0 || stood_s < least_s) continue;
    if (std::abs(v[from]) < 0.1 * range) {  // rest, told by a coarse sensor, looks alike
      log.notes.push_back(fmt::format(
          "{} stands still at {:.4g} for {:.0f} s from {:.0f} s; if it was not measured there, leave those rows out.",
          own_name(role), v[from], stood_s, t[from]));
      continue;
    }
    log.notes.push_back(fmt::format("{} stood frozen at {:.4g} for {:.0f} s from {:.0f} s; what flowed is not known.",
                                    own_name(role), v[from], stood_s, t[from]));
    for (std::size_t i = from + 1; i < to; ++i) v[i] = missing;
  }
}

/// Rows from .. to, time from 0; of surroundings that are told now and then, what was last told.
Log part_of(const Log& log, std::size_t from, std::size_t to) {
  Log part;
  const auto& t = log.of(Role::time);
  part.name = from == 0 ? fmt::format("{} (to {:.0f} s)", log.name, t[to - 1])
                        : fmt::format("{} (from {:.0f} s)", log.name, t[from]);
  for (std::size_t c = 0; c < role_count; ++c) {
    const auto& all = log.columns[c];
    if (all.empty()) continue;
    auto& some = part.columns[c];
    some.assign(all.begin() + static_cast<std::ptrdiff_t>(from), all.begin() + static_cast<std::ptrdiff_t>(to));
    const auto role = static_cast<Role>(c);
    if (role == Role::ambient || role == Role::coolant || role == Role::frame || role == Role::neighbour) {
      for (std::size_t i = from; std::isnan(some.front()) && i-- > 0;) some.front() = all[i];
    }
    if (count_told(some) == 0) some.clear();
  }
  for (double& time : part.of(Role::time)) time -= t[from];
  for (const double s : log.resumes_s) {
    if (s > t[from] && s <= t[to - 1]) part.resumes_s.push_back(s - t[from]);
  }
  return part;
}

/// Where a pause ends, among the rows that tell the heat: those that come after far longer than both their neighbours.
std::vector<std::size_t> ends_of_pauses(const std::vector<double>& told_s) {
  const std::vector<double> spacing_s = spacing(told_s);
  const double usual_s = median(spacing_s);
  std::vector<std::size_t> ends;
  for (std::size_t k = 0; k < spacing_s.size(); ++k) {
    const auto at = [&](std::size_t i) { return i < spacing_s.size() ? spacing_s[i] : 0; };
    // One row alone in a pause ends none.
    const double around_s = std::max({usual_s, std::min(at(k - 1), at(k + 1)), at(k - 2), at(k + 2)});
    if (spacing_s[k] > std::max(pause_s, pause_rows * around_s)) ends.push_back(k + 1);
  }
  if (static_cast<double>(ends.size()) > std::max(1.0, most_share * static_cast<double>(told_s.size()))) return {};
  std::stable_sort(ends.begin(), ends.end(),
                   [&](std::size_t a, std::size_t b) { return spacing_s[a - 1] > spacing_s[b - 1]; });
  ends.resize(std::min(ends.size(), most_pauses));
  std::sort(ends.begin(), ends.end());
  return ends;
}

/// Takes out the rows that tell no heat and lie in a pause, or before the first or after the last that does.
void take_out_pauses(Log& log) {
  const auto& heat = log.of(heat_of(log));
  std::vector<std::size_t> told;
  std::vector<double> told_s;
  for (std::size_t i = 0; i < heat.size(); ++i) {
    if (!std::isnan(heat[i])) told.push_back(i), told_s.push_back(log.of(Role::time)[i]);
  }
  if (told.size() < 2) return;
  std::vector<bool> keep(heat.size(), true);
  const auto drop = [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) keep[i] = false;
  };
  std::string pauses;
  const auto say = [&](double from_s, double to_s) {
    pauses += fmt::format("{}{:.0f} s from {:.0f} s", pauses.empty() ? "" : ", ", to_s - from_s, from_s);
  };
  const double begin_s = log.of(Role::time).front(), end_s = log.of(Role::time).back();
  if (told_s.front() - begin_s > pause_s) drop(0, told.front()), say(begin_s, told_s.front());
  for (const std::size_t k : ends_of_pauses(told_s)) {
    drop(told[k - 1] + 1, told[k]);
    say(told_s[k - 1], told_s[k]);
    log.resumes_s.push_back(told_s[k]);
  }
  if (end_s - told_s.back() > pause_s) drop(told.back() + 1, heat.size()), say(told_s.back(), end_s);
  if (pauses.empty()) return;
  for (std::vector<double>& column : log.columns) {
    std::size_t row = 0;
    std::erase_if(column, [&](double) { return !keep[row++]; });
    if (count_told(column) == 0) column.clear();
  }
  const double first_s = log.of(Role::time).front();
  for (double& t : log.of(Role::time)) t -= first_s;
  for (double& t : log.resumes_s) t -= first_s;
  log.notes.push_back(
      fmt::format("Nothing tells the heat input for {}; the motor goes on as warm as its next readings say.", pauses));
}

}  // namespace

bool is_noisy(const std::vector<double>& v, double range) {
  double last = missing, change = 0;
  int rows = 0, turns = 0;
  for (const double x : v) {
    if (std::isnan(x)) continue;
    if (std::abs(x) > 0.1 * range) {
      ++rows;
      turns += change * (x - last) < 0 && std::abs(x - last) < 0.1 * range;
    }
    change = std::isnan(last) ? 0 : x - last;
    last = x;
  }
  return turns > 0.4 * rows;  // of white noise two thirds turn
}

std::vector<Log> parts_between_pauses(Log log) {
  forget_frozen_input(log);
  take_out_pauses(log);
  const auto& t = log.of(Role::time);
  std::vector<std::size_t> ends;  // rows
  for (const double s : log.resumes_s) {
    const auto row = static_cast<std::size_t>(std::lower_bound(t.begin(), t.end(), s) - t.begin());
    if (t[row] - t[row - 1] > long_s) ends.push_back(row);
  }
  if (ends.empty() || (!log.has(Role::housing) && !log.has(Role::core))) return {std::move(log)};
  ends.push_back(t.size());
  std::vector<Log> parts;
  double left_out_s = 0;
  std::size_t from = 0;
  for (const std::size_t to : ends) {
    Log part = part_of(log, from, to);
    part.called = log.called;
    part.sink_degC = first_degC(log);
    part.sink_typed = log.sink_typed;
    part.torque_for_A = log.torque_for_A;
    part.speed_guessed = log.speed_guessed;
    part.core_reference = log.core_reference;
    const std::size_t readings = std::max(count_told(part.of(Role::housing)), count_told(part.of(Role::core)));
    if (to - from >= least_rows && readings >= least_readings)
      parts.push_back(std::move(part));
    else
      left_out_s += t[to - 1] - t[from];
    from = to;
  }
  if (parts.empty()) return {std::move(log)};
  parts.front().notes = log.notes;
  if (left_out_s > 0)
    parts.front().notes.push_back(fmt::format(
        "{:.0f} s between pauses of more than ten minutes are left out: too few rows or readings.", left_out_s));
  return parts;
}

}  // namespace identify

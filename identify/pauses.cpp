// SPDX-License-Identifier: MIT
#include "identify/pauses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "identify/masks.hpp"
#include "identify/median.hpp"

namespace identify {
namespace {

// Held over five seconds, a wrong current moves a small motor's winding (1 to 20 s) by kelvins.
constexpr double pause_s = 5, pause_rows = 5;
constexpr std::size_t most_parts = 8;   // each part costs two initial temperatures, and a fit of what is of one log
constexpr std::size_t least_rows = 30;  // as bins.cpp asks of a log

Role heat_of(const Log& log) {
  for (const Role role : {Role::power, Role::current}) {
    if (log.has(role)) return role;
  }
  return Role::iq;
}

/// A measured current goes up and down from row to row; a commanded one, which may well stand still, does not.
bool is_noisy(const std::vector<double>& v) {
  double last = missing, before = missing;
  int moves = 0, turns = 0;
  for (const double x : v) {
    if (std::isnan(x) || x == last) continue;
    if (!std::isnan(before)) {
      ++moves;
      turns += (x > last) != (last > before);
    }
    before = last;
    last = x;
  }
  return moves > 0 && turns > 0.4 * moves;  // of white noise two thirds turn
}

/// Forgets a heat input that stands still, not at zero, for longer than a pause.
void forget_frozen_input(Log& log) {
  const Role role = heat_of(log);
  std::vector<double>& v = log.of(role);
  const auto& t = log.of(Role::time);
  if (!is_noisy(v)) return;
  for (const auto& [from, to] : frozen_runs(v)) {
    const double stood_s = t[to - 1] - t[from];
    if (v[from] == 0 || stood_s < 2 * pause_s) continue;
    log.notes.push_back(fmt::format("{} stood frozen at {:.4g} for {:.0f} s from {:.0f} s; what flowed is not known.",
                                    own_name(role), v[from], stood_s, t[from]));
    std::fill(v.begin() + static_cast<std::ptrdiff_t>(from) + 1, v.begin() + static_cast<std::ptrdiff_t>(to), missing);
  }
}

Log part_of(const Log& log, std::size_t from, std::size_t to) {
  Log part;
  part.name = fmt::format("{} (from {:.0f} s)", log.name, log.of(Role::time)[from]);
  for (std::size_t c = 0; c < role_count; ++c) {
    const auto& all = log.columns[c];
    if (all.empty()) continue;
    auto& some = part.columns[c];
    some.assign(all.begin() + static_cast<std::ptrdiff_t>(from), all.begin() + static_cast<std::ptrdiff_t>(to));
    if (std::all_of(some.begin(), some.end(), [](double x) { return std::isnan(x); })) some.clear();
  }
  for (double& t : part.of(Role::time)) t -= log.of(Role::time)[from];
  return part;
}

/// Of a log that tells no sink, all parts have the one it began at.
void settle_sink(Log& log) {
  if (log.has(Role::ambient) || log.has(Role::coolant)) return;
  const auto& y = log.of(log.has(Role::housing) ? Role::housing : Role::core);
  const auto first = std::find_if(y.begin(), y.end(), [](double x) { return !std::isnan(x); });
  log.of(Role::ambient).assign(y.size(), *first);
  log.notes.push_back(
      fmt::format("No ambient temperature was recorded; the first reading, {:.1f} degC, is taken for it.", *first));
}

}  // namespace

std::vector<Log> parts_between_pauses(Log log) {
  forget_frozen_input(log);
  const auto& t = log.of(Role::time);
  const auto& heat = log.of(heat_of(log));
  std::vector<std::size_t> told;  // rows that tell the heat input
  std::vector<double> spacing_s;
  for (std::size_t i = 0; i < t.size(); ++i) {
    if (std::isnan(heat[i])) continue;
    if (!told.empty()) spacing_s.push_back(t[i] - t[told.back()]);
    told.push_back(i);
  }
  if (spacing_s.empty()) return {std::move(log)};
  const double usual_s = std::max(pause_s, pause_rows * median(spacing_s));
  // Of more pauses than that the short ones are bridged.
  std::vector<std::size_t> longest(spacing_s.size());
  std::iota(longest.begin(), longest.end(), std::size_t{0});
  std::stable_sort(longest.begin(), longest.end(),
                   [&](std::size_t a, std::size_t b) { return spacing_s[a] > spacing_s[b]; });
  longest.resize(std::min(longest.size(), most_parts - 1));
  std::erase_if(longest, [&](std::size_t k) { return spacing_s[k] <= usual_s; });
  std::sort(longest.begin(), longest.end());

  struct Rows {
    std::size_t from, to;
  };
  std::vector<Rows> between = {{t[told.front()] > usual_s ? told.front() : 0, 0}};
  std::string pauses;
  const auto pause = [&](std::size_t before, double seconds) {
    pauses += fmt::format("{}{:.0f} s from {:.0f} s", pauses.empty() ? "" : ", ", seconds, t[before]);
  };
  if (between.front().from > 0) pause(0, t[told.front()]);
  for (const std::size_t k : longest) {
    between.back().to = told[k] + 1;
    between.push_back({told[k + 1], 0});
    pause(told[k], spacing_s[k]);
  }
  const double unknown_s = t.back() - t[told.back()];
  between.back().to = unknown_s > usual_s ? told.back() + 1 : t.size();
  if (unknown_s > usual_s) pause(told.back(), unknown_s);
  if (pauses.empty()) return {std::move(log)};

  if (log.has(Role::housing) || log.has(Role::core)) settle_sink(log);
  std::vector<Log> parts;
  double left_out_s = 0;
  for (const auto& [from, to] : between) {
    Log part = part_of(log, from, to);
    if (to - from >= least_rows && (part.has(Role::housing) || part.has(Role::core)))
      parts.push_back(std::move(part));
    else
      left_out_s += t[to - 1] - t[from];
  }
  if (parts.empty()) return {std::move(log)};
  parts.front().notes = log.notes;
  parts.front().notes.push_back(fmt::format(
      "Nothing tells the heat input for {}: each part between is taken as a log of its own, as warm as its first "
      "readings say{}.",
      pauses, left_out_s > 0 ? fmt::format("; {:.0f} s in parts too short for that are left out", left_out_s) : ""));
  return parts;
}

}  // namespace identify

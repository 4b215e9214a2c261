// SPDX-License-Identifier: MIT
#include "identify/log/clock.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "identify/log/median.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

using wire::pc::refuse_data;

constexpr double day_s = 86400;

/// The day that each row of a column of dates tells, since 1970.
std::vector<double> days_of(const Table& table, std::size_t column) {
  std::vector<double> days(table.rows(), missing);
  for (std::size_t r = 0; r < table.rows(); ++r) {
    const double told_s = table.columns[column][r];
    if (std::fmod(told_s, day_s) == 0) days[r] = told_s / day_s;
    if (std::isnan(told_s) && !day_in(table.words[column].in_row(r), days[r])) days[r] = missing;
  }
  return days;
}

}  // namespace

void check_epoch(const Log& log, double first_cell) {
  const auto& t = log.of(Role::time);
  // No recording lasts for three years; one of microseconds since its clock began does in two minutes.
  constexpr double most_s = 1e8;
  if (const double lasts_s = t.back() - t.front(); t.front() < 1e11 && lasts_s > most_s)
    refuse_data(fmt::format(
        "{}: it would last {:.0f} days, as no recording does; say in what its time counts, {}, or :ms or :ns.",
        log.name, lasts_s / day_s, column_in(log, Role::time, "us")));
  if (t.front() < 1e11) return;
  const std::string unit = first_cell > 1e17 ? "ns" : first_cell > 1e14 ? "us" : first_cell > 1e11 ? "ms" : "s";
  refuse_data(fmt::format("{}: the first time is {:.0f}, which looks like {} since 1970; say {}.", log.name, first_cell,
                          unit, column_in(log, Role::time, unit)));
}

void check_time(const Table& table, const Log& log, const std::vector<std::size_t>& rows) {
  const auto& t = log.of(Role::time);
  const std::vector<double> spacing_s = spacing(t);
  std::vector<std::size_t> falls;
  for (std::size_t i = 1; i < t.size(); ++i) {
    if (t[i] < t[i - 1]) falls.push_back(i);
  }
  if (falls.empty()) return;
  constexpr double correction_s = 5;  // a clock that is set right by another jumps by less
  constexpr double hour_s = 3600;
  const std::size_t first = falls.front();
  const double missing_s = t[first - 1] - t[first] + median(spacing_s);
  const std::string what_to_do =
      falls.size() == 1 && std::abs(missing_s - hour_s) < correction_s
          ? "(by an hour, as where summer time ends); add 3600 s to the times from there on if it is that, else split "
            "the file there or give it a session column"
      : *std::min_element(spacing_s.begin(), spacing_s.end()) < -correction_s
          ? "(two recordings joined, or two clocks); split the file there or give it a session column"
      : falls.size() > 2
          ? fmt::format("and in {} places (rows out of order); sort the rows by time", falls.size())
          : fmt::format(
                "(a clock that was set while it recorded); add {:.3g} s to the times from there on, or split "
                "the file there",
                missing_s);
  refuse_data(fmt::format("{}, line {}: time runs backwards from {:.12g} to {:.12g} s {}.", table.file,
                          table.line[rows[first]], t[first - 1], t[first], what_to_do));
}

void check_rows_follow(const Log& log, std::size_t read) {
  constexpr double few = 0.05;  // of the readings: a sensor's own glitches
  const std::size_t left = count_told(log.of(Role::housing)) + count_told(log.of(Role::core));
  if (static_cast<double>(read - left) <= few * static_cast<double>(read)) return;
  refuse_data(
      fmt::format("{}: its temperatures leap from row to row and back as no motor's do, as if the rows were sorted by "
                  "another column, or shuffled; give them in the order in which they were recorded, or their time_s.",
                  log.name));
}

std::size_t put_in_order(std::vector<std::size_t>& rows, const std::vector<double>& time) {
  constexpr std::size_t most_late = 5;
  constexpr double most_share = 0.05;
  std::size_t moved = 0, latest = 0;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    if (time[rows[i]] >= time[rows[latest]]) {
      latest = i;
      continue;
    }
    const bool alone = latest + 1 == i;
    if (!alone || (i > most_late && time[rows[i]] < time[rows[i - most_late - 1]])) return 0;
    ++moved;
  }
  if (static_cast<double>(moved) > most_share * static_cast<double>(rows.size())) return 0;
  std::stable_sort(rows.begin(), rows.end(), [&](std::size_t a, std::size_t b) { return time[a] < time[b]; });
  return moved;
}

void spread_shared_times(Log& log) {
  std::vector<double>& t = log.of(Role::time);
  std::vector<std::size_t> first = {0};
  for (std::size_t i = 1; i < t.size(); ++i) {
    if (t[i] != t[i - 1]) first.push_back(i);
  }
  // Of two rows a second some are missing, or were the same and left out.
  if (first.size() < 3 || 2 * t.size() < 3 * first.size()) return;
  const std::vector<double> told_s = t;
  std::vector<double> steps_s;
  for (std::size_t k = 1; k < first.size(); ++k) steps_s.push_back(told_s[first[k]] - told_s[first[k - 1]]);
  const double step_s = median(steps_s);
  std::vector<double> rows;
  for (std::size_t k = 1; k < first.size(); ++k) rows.push_back(static_cast<double>(first[k] - first[k - 1]));
  const double usual = median(rows);
  first.push_back(t.size());
  for (std::size_t k = 0; k + 1 < first.size(); ++k) {
    // The log may begin and end within a step; what is missing of the first is missing before it.
    const double count = std::max(usual, static_cast<double>(first[k + 1] - first[k]));
    const double skipped = k == 0 ? count - static_cast<double>(first[1]) : 0;
    for (std::size_t i = first[k]; i < first[k + 1]; ++i)
      t[i] = told_s[i] + step_s * (static_cast<double>(i - first[k]) + skipped) / count;
  }
  log.notes.push_back(
      fmt::format("About {:g} rows share each time; they are spread over the {:g} s to the next.", usual, step_s));
}

std::size_t drop_repeated(std::vector<std::size_t>& rows, const Table& table, const std::vector<double>& time) {
  const auto same = [&](std::size_t a, std::size_t b) {
    return time[a] == time[b] && std::all_of(table.columns.begin(), table.columns.end(), [&](const auto& column) {
             return column[a] == column[b] || (std::isnan(column[a]) && std::isnan(column[b]));
           });
  };
  const auto end = std::unique(rows.begin(), rows.end(), same);
  const auto repeated = static_cast<std::size_t>(rows.end() - end);
  rows.erase(end, rows.end());
  return repeated;
}

int date_column(const Table& table) {
  int found = -1;
  for (std::size_t c = 0; c < table.names.size(); ++c) {
    const std::string low = in_small(trimmed(table.names[c]));
    if ((low != "date" && low != "datum") || count_told(days_of(table, c)) < table.rows()) continue;
    if (found >= 0) return -1;
    found = static_cast<int>(c);
  }
  return found;
}

bool add_days(Table& table, std::size_t time_column) {
  const int column = date_column(table);
  if (column < 0 || !table.of_day[time_column]) return false;
  const std::vector<double> days = days_of(table, static_cast<std::size_t>(column));
  for (std::size_t r = 0; r < table.rows(); ++r) table.columns[time_column][r] += day_s * days[r];
  table.of_day[time_column] = false;
  return true;
}

bool counts_from_midnight(const std::string& name) {
  const std::string low = in_small(name);
  return low.find("today") != low.npos || low.find("of_day") != low.npos || low.find("midnight") != low.npos;
}

void pass_midnights(Log& log) {
  constexpr double near_s = 600;
  double before_s = 0;
  int midnights = 0;
  for (double& t : log.of(Role::time)) {
    midnights += (before_s - t > day_s / 2) - (midnights > 0 && t - before_s > day_s - near_s);
    before_s = t;
    t += day_s * midnights;
  }
  if (midnights > 0)
    log.notes.push_back(fmt::format("The clock passes midnight {} time{}; a day is added each time.", midnights,
                                    midnights == 1 ? "" : "s"));
}

Source give_clock(Table& table, const std::vector<Session>& sessions, double period_s) {
  std::vector<double> time_s(table.rows(), missing);
  for (const auto& [name, rows] : sessions) {
    for (std::size_t i = 0; i < rows.size(); ++i) time_s[rows[i]] = static_cast<double>(i) * period_s;
  }
  table.names.push_back("--period");
  table.columns.push_back(std::move(time_s));
  table.words.emplace_back();
  table.of_day.push_back(false);
  table.thousands.push_back(0);
  table.has_plain.push_back(true);
  return {table.names.back()};
}

}  // namespace identify

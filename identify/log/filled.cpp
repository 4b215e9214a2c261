// SPDX-License-Identifier: MIT
#include "identify/log/filled.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "identify/log/masks.hpp"
#include "identify/log/median.hpp"

namespace identify {
namespace {

// Half of what is chosen here at once changes nothing of two logs that were filled in, double no answer; but at twice
// the slack of is_multiple channels that were read in every row count as held (tests: Filled).
constexpr std::size_t least_readings = 20;  // of which the pattern must show
/// Of what is on lines. At a half, currents as they were commanded count as filled in, at 0.95 lines of rounded cells
/// do not (tests: Filled).
constexpr double most_share = 0.8;

/// Readings of a channel, and the rows that they stand in.
struct Readings {
  std::vector<std::size_t> row;
  std::vector<double> t_s, degC;
};

Readings readings_of(const Log& log, Role role) {
  Readings out;
  const auto& v = log.of(role);
  for (std::size_t i = 0; i < v.size(); ++i) {
    if (std::isnan(v[i])) continue;
    out.row.push_back(i);
    out.t_s.push_back(log.of(Role::time)[i]);
    out.degC.push_back(v[i]);
  }
  return out;
}

/// Is a number of rows `k`, or several times that, but for the row or the quarter that a clock of its own may be off?
bool is_multiple(double rows, double k) {
  const double slack = k < 4 ? 0 : std::max(1.0, k / 4);
  return std::abs(rows - k * std::round(rows / k)) <= slack;
}

/// Those that a channel holds until the next: its runs of one value are all as long, or twice and thrice where two
/// readings agree. Empty where it does not hold them.
std::vector<std::size_t> held(const Readings& r) {
  std::vector<std::size_t> from = {0};
  for (std::size_t i = 1; i < r.degC.size(); ++i) {
    if (r.degC[i] != r.degC[i - 1]) from.push_back(i);
  }
  if (from.size() < least_readings) return {};
  std::vector<double> length;
  for (std::size_t i = 0; i + 1 < from.size(); ++i) length.push_back(static_cast<double>(from[i + 1] - from[i]));
  std::vector<double> sorted = length;
  std::sort(sorted.begin(), sorted.end());
  const double shortest = sorted[sorted.size() / 10];
  std::erase_if(sorted, [&](double l) { return l > 1.5 * shortest; });  // half way to twice
  const double k = median(sorted);
  if (k < 2) return {};
  // Longer ones, of a motor that rests, say nothing of the pattern. Nine in ten must fit: at a half, channels that were
  // read in every row count as held, at 0.97 none of those that are held is missed (tests: Filled).
  std::erase_if(length, [&](double l) { return l > 6 * k; });
  const auto fit = std::count_if(length.begin(), length.end(), [&](double l) { return is_multiple(l, k); });
  if (length.size() < least_readings || 10 * static_cast<std::size_t>(fit) < 9 * length.size()) return {};
  std::vector<std::size_t> kept;
  from.push_back(r.degC.size());
  for (std::size_t i = 0; i + 1 < from.size(); ++i) {
    const auto agree =
        static_cast<std::size_t>(std::max(1.0, std::round(static_cast<double>(from[i + 1] - from[i]) / k)));
    for (std::size_t n = 0; n < agree; ++n) kept.push_back(from[i] + n * (from[i + 1] - from[i]) / agree);
  }
  return kept;
}

/// Rows from .. to of a line, or two rows that no line joins to others.
struct Line {
  std::size_t from, to;
  bool joins() const { return to - from > 1; }
};

/// The lines that a channel follows from row to row. Empty where it does not: noise bends from row to row, and what is
/// smooth bends little by little.
std::vector<Line> lines_of(const Readings& r, double step_K) {
  // A rounded cell is off by half a step, and so are the ends of its line; a cell of single precision by 1e-7.
  const double tolerance_K = step_K > 0 ? 1.01 * step_K : 1e-6 * largest_magnitude(r.degC);
  std::vector<Line> lines;
  std::vector<double> lengths;  // of those that join, but for level ones, which any channel may have
  double bends = 0;             // at the ends of these, seen in the next row
  double rows = 0;              // of these and of what lies on no line
  for (std::size_t from = 0; from + 1 < r.degC.size(); from = lines.back().to) {
    const auto run_s = [&](std::size_t i) { return r.t_s[i] - r.t_s[from]; };
    const auto slope = [&](std::size_t i) { return (r.degC[i] - r.degC[from]) / run_s(i); };
    double low = -1e300, high = 1e300;  // slopes of lines that pass by all rows so far
    std::size_t to = from + 1;
    for (; to + 1 < r.degC.size(); ++to) {
      low = std::max(low, slope(to) - tolerance_K / run_s(to));
      high = std::min(high, slope(to) + tolerance_K / run_s(to));
      if (slope(to + 1) < low || slope(to + 1) > high) break;
    }
    lines.push_back({from, to});
    if (lines.back().joins() && r.degC[to] == r.degC[from]) continue;
    rows += static_cast<double>(to - from);
    if (!lines.back().joins()) continue;
    lengths.push_back(static_cast<double>(to - from));
    if (to + 1 < r.degC.size())
      bends += std::abs(r.degC[from] + slope(to) * run_s(to + 1) - r.degC[to + 1]) > 3 * tolerance_K;
  }
  if (lengths.size() < least_readings) return {};
  const double k = median(lengths);
  double on_lines = 0, alike = 0;
  for (const double l : lengths) {
    on_lines += l;
    if (is_multiple(l, k) && l < 1.5 * k) alike += l;
  }
  const bool bend = bends > most_share * static_cast<double>(lengths.size());
  return on_lines > most_share * rows && (bend || alike > most_share * rows) ? lines : std::vector<Line>{};
}

/// The column with nothing but these of its readings; as it is where there are none.
std::vector<double> only(const std::vector<double>& column, const Readings& r, const std::vector<std::size_t>& kept) {
  if (kept.empty()) return column;
  std::vector<double> out(column.size(), missing);
  for (const std::size_t i : kept) out[r.row[i]] = r.degC[i];
  return out;
}

std::vector<double> without_repeats(const Log& log, Role role) {
  const Readings r = readings_of(log, role);
  return only(log.of(role), r, held(r));
}

}  // namespace

std::vector<double> without_lines(const Log& log, Role role) {
  const Readings r = readings_of(log, role);
  Readings read = r;
  const std::vector<Line> lines = lines_of(r, step_of(log.of(role)));
  std::vector<std::size_t> kept;
  if (!lines.empty()) kept.push_back(0);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const auto [from, to] = lines[i];
    const bool between =
        !lines[i].joins() && i > 0 && i + 1 < lines.size() && lines[i - 1].joins() && lines[i + 1].joins();
    if (!between) {
      kept.push_back(to);
      continue;
    }
    // What was read between two rows lies where the lines cross; it is put into the nearer one.
    const auto slope = [&](const Line& l) { return (r.degC[l.to] - r.degC[l.from]) / (r.t_s[l.to] - r.t_s[l.from]); };
    const double before = slope(lines[i - 1]), after = slope(lines[i + 1]), apart_s = r.t_s[to] - r.t_s[from];
    const double at_s = std::clamp((r.degC[to] - r.degC[from] - after * apart_s) / (before - after), 0.0, apart_s);
    const double degC = r.degC[from] + before * at_s;
    if (2 * at_s > apart_s) kept.back() = to;
    read.degC[kept.back()] = degC;
  }
  return only(log.of(role), read, kept);
}

void forget_filled(Log& log) {
  const struct {
    std::vector<double> (*read_of)(const Log&, Role);
    const char* how;
  } ways[] = {{without_repeats, "by repeating"}, {without_lines, "along straight lines"}};
  for (const Role role : {Role::housing, Role::core}) {
    // Between a coarse sensor's steps nothing is read either (masks.hpp).
    if (!log.has(role) || step_of(log.of(role)) >= coarse_K) continue;
    for (const auto& way : ways) {
      std::vector<double> read = way.read_of(log, role);
      if (count_told(read) == count_told(log.of(role))) continue;
      log.notes.push_back(fmt::format("{} was filled in {} between readings about {:.2g} s apart; only these are used.",
                                      own_name(role), way.how,
                                      log.of(Role::time).back() / static_cast<double>(count_told(read))));
      log.of(role) = std::move(read);
    }
  }
}

}  // namespace identify

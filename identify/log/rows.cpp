// SPDX-License-Identifier: MIT
#include "identify/log/rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "identify/log/median.hpp"
#include "wire/pc/names.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

using wire::pc::refuse;

/// What a cell says, as a person would write it; empty: nothing.
std::string said(const Table& table, std::size_t column, std::size_t row) {
  const double value = table.columns[column][row];
  return std::isnan(value) ? table.words[column].in_row(row) : fmt::format("{:g}", value);
}

/// Does a column's name say that it tells motors apart?
bool named_after_motors(const std::string& name) {
  const std::string low = in_small(name);
  constexpr const char* words[] = {"motor", "axis",  "joint",    "inst",   "esc",
                                   "servo", "drive", "actuator", "device", "node"};
  return low == "id" || std::any_of(std::begin(words), std::end(words),
                                    [&](const char* word) { return low.find(word) != std::string::npos; });
}

/// How far a temperature moves from row to row, and from each row to the next that says the same in `key`; medians.
std::pair<double, double> moves_K(const std::vector<double>& degC, const std::vector<std::string>& key) {
  std::vector<double> next, same;
  std::map<std::string, double> last;
  double before = missing;
  for (std::size_t r = 0; r < degC.size(); ++r) {
    if (std::isnan(degC[r])) continue;
    if (!std::isnan(before)) next.push_back(std::abs(degC[r] - before));
    if (const auto at = last.find(key[r]); at != last.end()) same.push_back(std::abs(degC[r] - at->second));
    before = last[key[r]] = degC[r];
  }
  return {median(next), median(same)};
}

}  // namespace

void keep_rows(Table& table, const std::string& choice) {
  if (choice.empty()) return;
  const std::size_t equals = choice.rfind('=');
  const std::string where = "--rows " + choice;
  if (equals == std::string::npos) refuse(where + ": write it as COLUMN=VALUE, such as motor=2.");
  const std::string column = choice.substr(0, equals), value = choice.substr(equals + 1);
  const int found = table.find(column);
  if (found < 0)
    refuse(fmt::format("{}: {} has no column '{}'{} (it has: {}).", where, table.file, column,
                       wire::pc::did_you_mean(column, table.names), table.has()));
  const auto c = static_cast<std::size_t>(found);
  std::vector<std::size_t> rows;
  std::vector<std::string> others;
  for (std::size_t r = 0; r < table.rows(); ++r) {
    const std::string cell = said(table, c, r);
    if (cell == value)
      rows.push_back(r);
    else if (others.size() < 20 && std::find(others.begin(), others.end(), cell) == others.end())
      others.push_back(cell);
  }
  if (rows.empty()) refuse(fmt::format("{}: no row says so; its column says: {}.", where, fmt::join(others, ", ")));
  const auto only = [&](auto& cells) {
    for (std::size_t i = 0; i < rows.size(); ++i) cells[i] = rows[i] < cells.size() ? cells[rows[i]] : 0;
    cells.resize(rows.size());
  };
  for (auto& cells : table.columns) only(cells);
  for (Words& words : table.words) {
    words.of_row.resize(table.rows());
    only(words.of_row);
  }
  only(table.line);
}

std::vector<Session> sessions_of(const Table& table, int column) {
  std::map<std::pair<double, std::string>, std::vector<std::size_t>> sessions;
  for (std::size_t r = 0; r < table.rows(); ++r) {
    const double number = column < 0 ? 0 : table.columns[static_cast<std::size_t>(column)][r];
    if (!std::isnan(number)) {
      sessions[{number, ""}].push_back(r);
    } else if (const std::string word = table.words[static_cast<std::size_t>(column)].in_row(r); !word.empty()) {
      sessions[{HUGE_VAL, word}].push_back(r);
    }
  }
  std::vector<Session> out;
  for (auto& [key, rows] : sessions)
    out.push_back({sessions.size() < 2  ? ""
                   : key.second.empty() ? fmt::format("{:g}", key.first)
                                        : key.second,
                   std::move(rows)});
  return out;
}

std::string several_motors(const Table& table, const std::vector<double>& time, std::size_t heat,
                           std::size_t temperature, const std::vector<std::size_t>& known) {
  constexpr double in_turn = 0.7, apart = 3;  // of the rows (of a sign by chance a half); times each motor's own steps
  for (std::size_t c = 0; c < table.names.size(); ++c) {
    if (std::find(known.begin(), known.end(), c) != known.end()) continue;
    const bool named = named_after_motors(table.names[c]);
    const std::size_t most = named ? 64 : 16;  // motors of a robot with its hands; of a leg, an arm or a hand
    std::vector<std::string> key, values;
    std::size_t changes = 0, begins = 0;
    for (std::size_t r = 0; r < table.rows() && values.size() <= most; ++r) {
      key.push_back(said(table, c, r));
      if (std::find(values.begin(), values.end(), key.back()) == values.end()) values.push_back(key.back());
      const bool changed = r > 0 && key[r] != key[r - 1];
      changes += changed;
      begins += changed && !time.empty() && time[r] < time[r - 1];
    }
    constexpr std::ptrdiff_t least_rows = 5;  // of each: what hardly comes again is a reading and no name
    // All of one, then all of the next.
    const bool in_blocks = named && changes + 1 == values.size() && begins == changes &&
                           std::all_of(values.begin(), values.end(), [&](const std::string& value) {
                             return std::count(key.begin(), key.end(), value) >= least_rows;
                           });
    if (values.size() < 2 || values.size() > most ||
        static_cast<std::ptrdiff_t>(table.rows()) < least_rows * static_cast<std::ptrdiff_t>(values.size()) ||
        std::find(values.begin(), values.end(), "") != values.end() ||
        (!in_blocks && static_cast<double>(changes) < in_turn * static_cast<double>(table.rows())))
      continue;
    // A column of message kinds changes in turn as well, and each kind fills cells of its own.
    const bool each_is_whole = std::all_of(values.begin(), values.end(), [&](const std::string& value) {
      bool heated = false, read = false;
      for (std::size_t r = 0; r < table.rows() && !(heated && read); ++r) {
        if (key[r] != value) continue;
        heated = heated || !std::isnan(table.columns[heat][r]);
        read = read || !std::isnan(table.columns[temperature][r]);
      }
      return heated && read;
    });
    if (!each_is_whole) continue;
    const auto [next_K, same_K] = moves_K(table.columns[temperature], key);
    if (!named && !(next_K > apart * same_K)) continue;
    std::sort(values.begin(), values.end());
    return fmt::format(
        "{}: its rows belong to several motors {}, as column '{}' tells ({}); choose one with --rows \"{}={}\".",
        table.file, in_blocks ? "one after the other" : "in turn", table.names[c], fmt::join(values, ", "),
        table.names[c], values.front());
  }
  return "";
}

}  // namespace identify

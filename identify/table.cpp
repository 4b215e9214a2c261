// SPDX-License-Identifier: MIT
#include "identify/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

using wire::pc::Exit;
using wire::pc::UserError;

// A logger's row is below a kilobyte; a line of this size is a file without line ends, or not a table at all.
constexpr std::size_t longest_line = 1 << 20;

std::string_view trimmed(std::string_view s) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!s.empty() && blank(s.front())) s.remove_prefix(1);
  while (!s.empty() && blank(s.back())) s.remove_suffix(1);
  return s;
}

std::string whole_file(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    throw UserError(Exit::usage, path + (std::filesystem::exists(path, error)
                                             ? ": this is a folder or a device and no log; name a CSV file."
                                             : ": there is no such file; check the path."));
  }
  std::ifstream in(path, std::ios::binary);
  std::string text(static_cast<std::size_t>(std::filesystem::file_size(path)), '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (!in) throw UserError(Exit::usage, path + ": cannot be read; check its permissions.");
  return text;
}

/// Cells of one line. Returns false when a quote is never closed.
bool split(std::string_view line, char separator, std::vector<std::string_view>& cells) {
  cells.clear();
  std::size_t at = 0;
  while (true) {
    std::size_t start = at;
    while (start < line.size() && line[start] == ' ') ++start;
    if (start < line.size() && line[start] == '"') {
      const std::size_t close = line.find('"', start + 1);
      if (close == std::string_view::npos) return false;
      cells.push_back(line.substr(start + 1, close - start - 1));
      at = std::min(line.find(separator, close), line.size());
    } else {
      const std::size_t end = std::min(line.find(separator, at), line.size());
      cells.push_back(trimmed(line.substr(at, end - at)));
      at = end;
    }
    if (at >= line.size()) return true;
    ++at;
  }
}

bool means_missing(std::string_view s) {
  if (s.empty()) return true;
  std::string low(s.substr(0, 5));
  std::transform(low.begin(), low.end(), low.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  return low == "nan" || low == "na" || low == "n/a" || low == "null" || low == "none" || low == "-" || low == "-nan";
}

/// A cell as a number; false when it is neither a number nor a word for "missing". An infinite value counts as missing.
bool number(std::string_view s, bool decimal_comma, double& value) {
  if (means_missing(s)) return value = missing, true;
  std::string changed;
  if (decimal_comma && s.find(',') != std::string_view::npos) {
    changed = s;
    std::replace(changed.begin(), changed.end(), ',', '.');
    s = changed;
  }
  if (s.front() == '+') s.remove_prefix(1);
  const auto [end, error] = std::from_chars(s.data(), s.data() + s.size(), value);
  if (error == std::errc::result_out_of_range) return value = missing, end == s.data() + s.size();
  if (error != std::errc() || end != s.data() + s.size()) return value = missing, false;
  if (!std::isfinite(value)) value = missing;
  return true;
}

std::string shown(std::string_view s) { return std::string(s.substr(0, 40)) + (s.size() > 40 ? "..." : ""); }

char separator_of(std::string_view header) {
  char best = ',';
  std::ptrdiff_t most = 0;
  for (const char c : {',', ';', '\t'}) {
    const auto n = std::count(header.begin(), header.end(), c);
    if (n > most) best = c, most = n;
  }
  return best;
}

}  // namespace

int Table::find(const std::string& name) const {
  const auto at = std::find(names.begin(), names.end(), name);
  return at == names.end() ? -1 : static_cast<int>(at - names.begin());
}

Table read_table(const std::string& path) {
  const std::string text = whole_file(path);
  Table table;
  table.file = path;
  const auto at_line = [&](int line, const std::string& what) {
    return fmt::format("{}, line {}: {}", path, line, what);
  };
  const auto refuse = [&](int line, const std::string& what) { throw UserError(Exit::unusable, at_line(line, what)); };

  std::string_view rest = text;
  if (rest.substr(0, 3) == "\xEF\xBB\xBF") rest.remove_prefix(3);
  if (rest.size() >= 2 && (rest.substr(0, 2) == "\xFF\xFE" || rest.substr(0, 2) == "\xFE\xFF")) {
    refuse(1, "the file is UTF-16; save it as UTF-8 text.");
  }
  char separator = ',';
  std::vector<std::string_view> cells;
  for (int line = 1; !rest.empty(); ++line) {
    const std::size_t end = rest.find('\n');
    const bool closed = end != std::string_view::npos;
    std::string_view row = rest.substr(0, end);
    rest.remove_prefix(closed ? end + 1 : rest.size());
    if (row.size() > longest_line) {
      refuse(line, fmt::format("{:.1f} MB without a line end; a table has one row a line: export the log again.",
                               static_cast<double>(row.size()) / 1e6));
    }
    row = trimmed(row);
    if (row.find('\0') != std::string_view::npos)
      refuse(line, "a zero byte; this is not a text file: export the log as CSV.");
    if (row.empty() || row.front() == '#') continue;
    if (table.names.empty()) {
      separator = separator_of(row);
      if (!split(row, separator, cells)) refuse(line, "a quote is opened and never closed; repair the header.");
      for (const auto cell : cells) table.names.emplace_back(trimmed(cell));
      double unused = 0;
      if (number(cells.front(), separator == ';', unused) && std::isfinite(unused)) {
        refuse(line,
               "numbers where the header should be; put a line with column names (such as "
               "time_s,current_A,housing_degC) first.");
      }
      table.columns.resize(table.names.size());
      table.complaints.resize(table.names.size());
      continue;
    }
    // A separator at the end of every row is some loggers' habit; one cell too many and empty is not a mistake.
    const bool whole = split(row, separator, cells);
    if (whole && cells.size() == table.names.size() + 1 && cells.back().empty()) cells.pop_back();
    if (!whole || cells.size() != table.names.size()) {
      refuse(line,
             fmt::format(
                 "the row has {} of {} cells{}", cells.size(), table.names.size(),
                 closed ? "; repair or delete this line."
                        : " and the file ends in it, so it was cut off; delete the last line or copy the file again."));
    }
    for (std::size_t c = 0; c < cells.size(); ++c) {
      double value = missing;
      if (!number(cells[c], separator == ';', value)) {
        std::string& complaint = table.complaints[c];
        if (complaint.empty())
          complaint =
              at_line(line, fmt::format("'{}' in column '{}' is not a number; repair it or leave the cell empty.",
                                        shown(cells[c]), shown(table.names[c])));
      }
      table.columns[c].push_back(value);
    }
    table.line.push_back(line);
  }
  if (table.names.empty()) {
    throw UserError(Exit::unusable, path + ": the file is empty; record a log with a header line and rows.");
  }
  if (table.rows() == 0)
    throw UserError(Exit::unusable, path + ": there is a header and no row; the recording failed: record it again.");
  return table;
}

}  // namespace identify

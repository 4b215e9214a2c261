// SPDX-License-Identifier: MIT
#include "identify/log/table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <string_view>

#include "identify/log/median.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

using wire::pc::refuse;
using wire::pc::refuse_data;

// A logger's row is below a kilobyte; a line of this size is a file without line ends, or not a table at all.
constexpr std::size_t longest_line = 1 << 20;
constexpr std::size_t least_columns = 3;  // a time, what heats, and a temperature

std::string whole_file(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    refuse(path + (std::filesystem::exists(path, error) ? ": this is a folder or a device and no log; name a CSV file."
                                                        : ": there is no such file; check the path."));
  }
  std::ifstream in(path, std::ios::binary);
  std::string text(static_cast<std::size_t>(std::filesystem::file_size(path)), '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (!in) refuse(path + ": cannot be read; check its permissions.");
  return text;
}

bool is_utf8(std::string_view text) {
  for (std::size_t at = 0; at < text.size();) {
    const auto first = static_cast<unsigned char>(text[at]);
    const std::size_t length = first < 0x80                    ? 1
                               : first >= 0xC2 && first < 0xE0 ? 2
                               : first >= 0xE0 && first < 0xF0 ? 3
                               : first >= 0xF0 && first < 0xF5 ? 4
                                                               : 0;
    const std::string_view more = text.substr(at + 1, length - 1);
    if (length == 0 || more.size() + 1 < length) return false;
    if (std::any_of(more.begin(), more.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }))
      return false;
    at += length;
  }
  return true;
}

/// Spreadsheets write the degree sign of a header so in much of Europe.
std::string from_latin_1(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (code < 0x80)
      out += c;
    else
      out += {static_cast<char>(0xC0 | code >> 6), static_cast<char>(0x80 | (code & 0x3F))};
  }
  return out;
}

/// What spreadsheets call Unicode text, and a Windows shell writes: pairs of bytes, in the order of the mark that they
/// begin with.
std::string from_utf_16(std::string_view text) {
  const bool low_first = text.starts_with("\xFF\xFE");
  const auto unit = [&](std::size_t at) {
    const auto first = static_cast<unsigned char>(text[at]), second = static_cast<unsigned char>(text[at + 1]);
    return static_cast<std::uint32_t>(low_first ? second << 8 | first : first << 8 | second);
  };
  std::string out;
  for (std::size_t at = 0; at + 1 < text.size(); at += 2) {
    std::uint32_t code = unit(at);
    if (code >= 0xD800 && code < 0xDC00 && at + 3 < text.size()) {  // of two pairs
      at += 2;
      code = 0x10000 + ((code & 0x3FF) << 10 | (unit(at) & 0x3FF));
    }
    const int more = code < 0x80 ? 0 : code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;  // bytes behind the first
    constexpr int marks[] = {0, 0xC0, 0xE0, 0xF0};
    out += static_cast<char>(marks[more] | code >> 6 * more);
    for (int k = more - 1; k >= 0; --k) out += static_cast<char>(0x80 | (code >> 6 * k & 0x3F));
  }
  return out;
}

/// Cells of one line. Returns false when a quote is never closed, or something follows it in its cell.
bool split(std::string_view line, char separator, std::vector<std::string_view>& cells) {
  cells.clear();
  if (separator == ' ') line = trimmed(line);
  std::size_t at = 0;
  while (true) {
    std::size_t start = at;
    while (start < line.size() && line[start] == ' ') ++start;
    if (start < line.size() && line[start] == '"') {
      std::size_t close = line.find('"', start + 1);
      while (close != std::string_view::npos && line.substr(close + 1, 1) == "\"")  // two of them stand for one
        close = line.find('"', close + 2);
      if (close == std::string_view::npos) return false;
      std::string_view cell = trimmed(line.substr(start + 1, close - start - 1));
      if (cell.size() > 4 && cell.starts_with("\"\"") && cell.ends_with("\"\"")) cell = cell.substr(2, cell.size() - 4);
      cells.push_back(cell);
      at = std::min(line.find(separator, close), line.size());
      if (!trimmed(line.substr(close + 1, at - close - 1)).empty()) return false;
    } else {
      const std::size_t end = std::min(line.find(separator, at), line.size());
      cells.push_back(trimmed(line.substr(at, end - at)));
      at = end;
    }
    if (at >= line.size()) return true;
    ++at;
    while (separator == ' ' && line[at] == ' ') ++at;
  }
}

/// Where a row ends: a line end in a quoted cell is none. The first one where the quote is not closed soon.
std::size_t end_of_row(std::string_view rest, char separator) {
  const std::size_t line_end = rest.find('\n');
  const std::string_view line = rest.substr(0, line_end);
  if (std::count(line.begin(), line.end(), '"') % 2 == 0 || trimmed(line).starts_with('#')) return line_end;
  bool quoted = false, begins = true;  // a quote within a cell's words opens nothing
  for (std::size_t i = 0; i < std::min(rest.size(), longest_line); ++i) {
    const char c = rest[i];
    if (c == '"' && (quoted || begins)) {
      quoted = !quoted;
    } else if (!quoted) {
      if (c == '\n') return i;
      begins = c == separator || (begins && c == ' ');
    }
  }
  return quoted ? line_end : std::string_view::npos;
}

/// No number in it and something else: the row of units that some loggers write below the header.
bool all_words(const std::vector<std::string_view>& cells, bool decimal_comma) {
  double value = 0;
  std::string unit;
  const auto told = [&](std::string_view cell) {
    return !means_missing(cell) &&
           (number_in(cell, decimal_comma, value) || number_and_unit_in(cell, decimal_comma, value, unit));
  };
  return std::none_of(cells.begin(), cells.end(), told) && !std::all_of(cells.begin(), cells.end(), means_missing);
}

bool all_differ(std::vector<std::string> names) {
  std::sort(names.begin(), names.end());
  return std::adjacent_find(names.begin(), names.end()) == names.end();
}

/// What a quoted cell says, in one line.
std::string one_line(std::string_view s) {
  std::string line(s);
  std::erase(line, '\r');
  std::replace(line.begin(), line.end(), '\n', ' ');
  return line;
}

std::string shown(std::string_view s) { return one_line(s.substr(0, 40)) + (s.size() > 40 ? "..." : ""); }

/// How many numbers a line has between blanks; 0 where anything else is there.
std::size_t numbers_between_blanks(std::string_view line) {
  std::vector<std::string_view> cells;
  double unused = 0;
  const bool whole = split(line, ' ', cells) && std::all_of(cells.begin(), cells.end(), [&](auto cell) {
                       return means_missing(cell) || number_in(cell, false, unused);
                     });
  return whole ? cells.size() : 0;
}

/// Of the header that `text` begins with, or of its first row. Blanks separate what nothing else does, where there are
/// as many numbers between them as words above.
char separator_of(std::string_view text) {
  const std::string_view line = text.substr(0, text.find('\n'));
  char best = ',';
  std::ptrdiff_t most = 0;
  for (const char c : {',', ';', '\t', '|'}) {
    const auto n = std::count(line.begin(), line.end(), c);
    if (n > most) best = c, most = n;
  }
  if (most > 0) return best;
  std::vector<std::string_view> words;
  text.remove_prefix(std::min(line.size() + 1, text.size()));
  const bool by_blanks =
      split(line, ' ', words) && words.size() >= least_columns &&
      (numbers_between_blanks(line) || numbers_between_blanks(text.substr(0, text.find('\n'))) == words.size());
  return by_blanks ? ' ' : best;
}

/// An object, or a list of what a list may hold; [Data] is a line that some loggers write.
bool is_json(std::string_view text) {
  constexpr std::string_view blank = " \t\r\n";
  const std::string_view begin = text.substr(std::min(text.find_first_not_of(blank), text.size()));
  if (!begin.starts_with('[')) return begin.starts_with('{');
  const std::size_t next = begin.find_first_not_of(blank, 1);
  return next != std::string_view::npos &&
         std::string_view("[{\"-0123456789").find(begin[next]) != std::string_view::npos;
}

/// Do rows follow that belong to this one? Of the next five half have as many cells, half of them numbers: below a
/// header units may be named first.
bool heads_a_table(std::vector<std::string_view> cells, char separator, std::string_view rest) {
  while (!cells.empty() && cells.back().empty()) cells.pop_back();
  const std::size_t columns = cells.size();
  if (columns < least_columns) return false;
  int rows = 0, fit = 0;
  while (rows < 5 && !rest.empty()) {
    const std::string_view row = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(row.size() + 1, rest.size()));
    if (trimmed(row).empty() || trimmed(row).front() == '#') continue;
    ++rows;
    if (!split(row, separator, cells)) continue;
    const auto is_number = [&](std::string_view cell) {
      double value = missing;
      std::string unit;
      return (number_in(cell, separator != ',', value) || number_and_unit_in(cell, separator != ',', value, unit)) &&
             !std::isnan(value);
    };
    const auto numbers = std::count_if(cells.begin(), cells.end(), is_number),
               told = std::count_if(cells.begin(), cells.end(), [](auto cell) { return !means_missing(cell); });
    while (cells.size() > columns && cells.back().empty()) cells.pop_back();
    fit += numbers > 0 && 2 * numbers >= told && cells.size() == columns;
  }
  return fit > 0 && 2 * fit >= rows;
}

/// Does a table begin below, after what some loggers write first?
bool begins_below(std::string_view rest) {
  std::vector<std::string_view> cells;
  for (int line = 0; line < 100 && !rest.empty(); ++line) {
    const char separator = separator_of(rest);
    const std::string_view row = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(row.size() + 1, rest.size()));
    if (split(row, separator, cells) && all_words(cells, separator != ',') && heads_a_table(cells, separator, rest))
      return true;
  }
  return false;
}

std::string at_line(const Table& table, int line, const std::string& what) {
  return fmt::format("{}, line {}: {}", table.file, line, what);
}

[[noreturn]] void refuse_line(const Table& table, int line, const std::string& what) {
  refuse_data(at_line(table, line, what));
}

/// LabVIEW's .lvm: what is said of the file and of its channels ends in this line each time. How many lines it took.
int skip_preamble(std::string_view& rest) {
  const std::size_t mark = rest.rfind("***End_of_Header***");
  const std::size_t end = mark == std::string_view::npos ? mark : rest.find('\n', mark);
  if (end == std::string_view::npos) return 0;
  const auto lines = std::count(rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(end) + 1, '\n');
  rest.remove_prefix(end + 1);
  return static_cast<int>(lines);
}

/// Names the columns: this row does, or, where it holds numbers, the '#' line before it. Was it the row?
bool name_columns(Table& table, const std::vector<std::string_view>& row, std::string_view remark, char separator,
                  int line) {
  double value = missing;
  const bool numbers = number_in(row.front(), separator != ',', value) && std::isfinite(value);
  std::vector<std::string_view> header = row;
  if (numbers &&
      (!split(remark, separator, header) || header.size() != row.size() || !all_words(header, separator != ','))) {
    refuse_line(table, line,
                "numbers where the header should be; put a line with column names (such as "
                "time_s,current_A,housing_degC) first.");
  }
  while (header.size() > 1 && header.back().empty()) header.pop_back();
  if (header.size() == 1 && header.front().find_first_of(",;\t") != std::string_view::npos)
    refuse_line(table, line, "the whole line is one cell, in quotes; export the log without quotes about its lines.");
  for (const auto name : header) table.names.push_back(one_line(trimmed(name)));
  for (std::size_t c = 0; c < header.size(); ++c) {
    if (table.names[c].empty()) table.names[c] = fmt::format("#{}", c + 1);  // pandas leaves that of its index empty
  }
  table.columns.resize(header.size());
  table.words.resize(header.size());
  table.complaints.resize(header.size());
  table.of_day.resize(header.size());
  table.thousands.resize(header.size());
  table.has_plain.resize(header.size());
  return !numbers;
}

/// Notes a cell's word; of the thousands that free text has, none beyond the first hundred.
void take(Words& words, std::string_view cell, std::size_t row) {
  constexpr std::size_t most = 100;
  auto at = std::find(words.seen.begin(), words.seen.end(), cell);
  if (at == words.seen.end() && words.seen.size() < most) at = words.seen.emplace(at, cell);
  words.of_row.resize(row);
  words.of_row.push_back(static_cast<std::size_t>(at - words.seen.begin()) + 1);
}

/// The same of a cell that may name its unit too. All cells of a column must have one unit.
bool number_of_column(Table& table, std::size_t column, std::string_view cell, bool decimal_comma, double& value) {
  if (number_in(cell, decimal_comma, value)) return true;
  std::string unit;
  if (!number_and_unit_in(cell, decimal_comma, value, unit)) return false;
  table.units.resize(table.names.size());
  const auto told = [](double x) { return !std::isnan(x); };
  const auto& above = table.columns[column];
  if (table.units[column].empty() && std::none_of(above.begin(), above.end(), told)) table.units[column] = unit;
  return table.units[column] == unit;
}

/// A comma where thousands are set apart: 1,234 and not 0,123.
bool like_thousands(std::string_view cell) {
  if (cell.front() == '-' || cell.front() == '+') cell.remove_prefix(1);
  const std::size_t comma = cell.find(',');
  return comma >= 1 && comma <= 3 && comma + 4 == cell.size() && cell.front() != '0' &&
         cell.find_first_not_of("0123456789,") == std::string_view::npos;
}

/// The same beside decimals, 1,234.5 or 1.234,5, and as Switzerland and France do it.
bool sets_thousands_apart(std::string_view cell) {
  std::string left(cell);
  for (const std::string_view apart : {"'", "\u2019", "\u00a0", "\u202f"}) {
    for (std::size_t at = 0; (at = left.find(apart, at)) != std::string::npos;) left.erase(at, apart.size());
  }
  const std::size_t first = left.find_first_of(".,"), last = left.find_last_of(".,");
  const bool both = first != std::string::npos && left[first] != left[last];
  return (both || left.size() < cell.size()) && left.find_first_of("0123456789") != std::string::npos &&
         left.find_first_not_of("+-0123456789.,") == std::string::npos;
}

/// The cells of a column that are dates between strokes, read in either way.
struct StrokedDates {
  std::vector<std::size_t> rows;
  std::vector<double> month_first_s, day_first_s;
};

/// A column of nothing but such dates in the order in which all are dates, and of two in which the log is shorter: its
/// days follow each other.
void read_dates(Table& table, std::size_t c, const StrokedDates& dates) {
  if (dates.rows.size() != table.words[c].count() || count_told(table.columns[c]) > 0) return;
  const auto lasts_s = [](const std::vector<double>& told_s) {
    const auto [low, high] = std::minmax_element(told_s.begin(), told_s.end());
    return std::any_of(told_s.begin(), told_s.end(), [](double t) { return std::isnan(t); }) ? missing : *high - *low;
  };
  const double month_first_s = lasts_s(dates.month_first_s), day_first_s = lasts_s(dates.day_first_s);
  if (std::isnan(month_first_s) && std::isnan(day_first_s)) return;
  const bool month_first = std::isnan(day_first_s) || month_first_s <= day_first_s;
  for (std::size_t i = 0; i < dates.rows.size(); ++i)
    table.columns[c][dates.rows[i]] = (month_first ? dates.month_first_s : dates.day_first_s)[i];
  table.words[c] = {};
  table.complaints[c].clear();
  constexpr double day_s = 86400;
  if (!std::isnan(month_first_s + day_first_s) && month_first_s != day_first_s)
    table.notes.push_back(
        fmt::format("Dates of column '{}' are read with the {} first, so that they span {:.3g} d and not {:.3g}.",
                    table.names[c], month_first ? "month" : "day", std::min(month_first_s, day_first_s) / day_s,
                    std::max(month_first_s, day_first_s) / day_s));
}

void add_row(Table& table, const std::vector<std::string_view>& cells, bool decimal_comma, int line,
             std::map<std::size_t, StrokedDates>& dates) {
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const bool comma = cells[c].find(',') != std::string_view::npos;
    if (int& thousands = table.thousands[c]; thousands >= 0 && comma)
      thousands = like_thousands(cells[c]) ? thousands + 1 : -1;
    double value = missing, unused = 0;
    if (!number_of_column(table, c, cells[c], decimal_comma, value)) {
      value = missing;
      Words& words = table.words[c];
      const bool like_number = cells[c].find_first_of("0123456789") != std::string_view::npos;
      take(words, cells[c], table.rows());
      if (double month_first_s = 0, day_first_s = 0; stroked_date(cells[c], month_first_s, day_first_s)) {
        dates[c].rows.push_back(table.rows());
        dates[c].month_first_s.push_back(month_first_s);
        dates[c].day_first_s.push_back(day_first_s);
      }
      if (!table.complaints[c].empty() && (words.like_numbers || !like_number)) {
        table.columns[c].push_back(missing);
        continue;
      }
      words.like_numbers = like_number;
      table.complaints[c] = at_line(
          table, line,
          fmt::format(
              "'{}' in column '{}' is not a number{}.", shown(cells[c]), shown(table.names[c]),
              sets_thousands_apart(cells[c]) ? ", for it sets thousands apart; export the column without that"
              : like_a_moment(cells[c])
                  ? ", nor a time as it is read (12.5, 08:15:30, 1:05.3, 2026-11-21 08:15:30, "
                    "2026-11-21T08:15:30.5+01:00, 21.11.2026 08:15:30, 21-Nov-2026 08:15:30, 11/21/2026 08:15:30 AM; "
                    "--period S does without); repair it or leave the cell empty"
              : comma && !decimal_comma && cells[c].find_first_not_of("+-0123456789,") == std::string_view::npos
                  ? ", for a comma in it is read only where none separates the cells, and as a decimal one; export the "
                    "log with semicolons or tabs between the cells, and thousands not set apart"
                  : "; repair it or leave the cell empty"));
    }
    table.columns[c].push_back(value);
    if (!comma && value == std::round(value)) table.has_plain[c] = true;
    if (time_of_day(cells[c], unused)) table.of_day[c] = true;
  }
  table.line.push_back(line);
}

}  // namespace

std::size_t count_told(const std::vector<double>& cells) {
  return static_cast<std::size_t>(std::count_if(cells.begin(), cells.end(), [](double x) { return !std::isnan(x); }));
}

double largest_magnitude(const std::vector<double>& cells) {
  double most = 0;
  for (const double x : cells) most = std::max(most, std::abs(x));
  return most;
}

bool stands(const std::vector<double>& cells) {
  double low = missing, high = missing;  // fmin and fmax pass over what is missing
  for (const double x : cells) low = std::fmin(low, x), high = std::fmax(high, x);
  return low == high;
}

std::vector<double> spacing(const std::vector<double>& cells) {
  std::vector<double> out;
  for (std::size_t i = 1; i < cells.size(); ++i) out.push_back(cells[i] - cells[i - 1]);
  return out;
}

double row_period_s(const std::vector<double>& time_s) {
  constexpr std::size_t most_rows = 24;                 // of two messages at 10 Hz and one at 1 Hz 21
  constexpr double alike = 0.25, repeats_itself = 0.9;  // to this share of a row; of the places where it may begin
  // Rows of a grid some of which are missing are no pattern, however regularly they are.
  const std::vector<double> spacing_s = spacing(time_s);
  const double usual_s = median(spacing_s);
  const auto on_grid = std::count_if(spacing_s.begin(), spacing_s.end(), [&](double s) {
    const double rows = std::round(s / usual_s);
    return rows >= 1 && rows <= 5 && std::abs(s - rows * usual_s) <= 0.1 * usual_s;
  });
  if (static_cast<double>(on_grid) >= repeats_itself * static_cast<double>(spacing_s.size())) return usual_s;
  double best = 0, period_s = missing;
  for (std::size_t rows = 1; rows <= most_rows && rows < time_s.size(); ++rows) {
    std::vector<double> length_s;
    for (std::size_t i = rows; i < time_s.size(); ++i) length_s.push_back(time_s[i] - time_s[i - rows]);
    const double middle_s = median(length_s);
    const auto near = std::count_if(length_s.begin(), length_s.end(), [&](double s) {
      return std::abs(s - middle_s) * static_cast<double>(rows) <= alike * middle_s;
    });
    const double share = static_cast<double>(near) / static_cast<double>(length_s.size());
    if (rows == 1 || (share > best && share > repeats_itself))
      best = share, period_s = middle_s / static_cast<double>(rows);
    if (best > repeats_itself) break;
  }
  return period_s;
}

std::size_t Words::count() const {
  return of_row.size() - static_cast<std::size_t>(std::count(of_row.begin(), of_row.end(), 0u));
}

std::string Words::in_row(std::size_t row) const {
  const std::size_t place = row < of_row.size() ? of_row[row] : 0;
  return place == 0 || place > seen.size() ? "" : seen[place - 1];
}

int Table::find(const std::string& name) const {
  const auto at = std::find(names.begin(), names.end(), name);
  return at == names.end() ? -1 : static_cast<int>(at - names.begin());
}

std::string Table::has() const {
  constexpr std::size_t most = 100;
  const auto end = names.begin() + static_cast<std::ptrdiff_t>(std::min(names.size(), most));
  return fmt::format("{}{}", fmt::join(names.begin(), end, ", "),
                     names.size() > most ? fmt::format(" and {} more", names.size() - most) : "");
}

Table read_table(const std::string& path) {
  std::string text = whole_file(path);
  Table table;
  table.file = path;
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF")) text = from_utf_16(text);
  if (!is_utf8(text)) text = from_latin_1(text);
  if (text.find('\n') == std::string::npos) std::replace(text.begin(), text.end(), '\r', '\n');  // old Macintosh's
  if (text.starts_with("version https://git-lfs"))
    refuse_data(path + ": this is Git LFS's pointer to the log and not the log; fetch it with git lfs pull.");
  std::string_view rest = text;
  if (rest.starts_with("\xEF\xBB\xBF")) rest.remove_prefix(3);
  if (is_json(rest)) {
    refuse_line(
        table, 1,
        "this is JSON; write it as CSV: a line of column names (such as time_s,current_A,housing_degC), then one "
        "line a row.");
  }
  char separator = ',';
  std::vector<std::string_view> cells;
  std::map<std::size_t, StrokedDates> dates;
  std::string_view remark;  // the last '#' line: some programs write the header there
  int lines = skip_preamble(rest), torn = 0, first_torn = 0, headers = 0;
  std::string what_is_torn;
  for (int line = 1 + lines; !rest.empty(); line += lines) {
    if (table.names.empty()) separator = separator_of(rest);
    const std::size_t end = end_of_row(rest, separator);
    const bool closed = end != std::string_view::npos;
    const std::string_view row = rest.substr(0, end);
    lines = 1 + static_cast<int>(std::count(row.begin(), row.end(), '\n'));
    rest.remove_prefix(closed ? end + 1 : rest.size());
    if (row.size() > longest_line) {
      refuse_line(table, line,
                  fmt::format("{:.1f} MB without a line end; a table has one row a line: export the log again.",
                              static_cast<double>(row.size()) / 1e6));
    }
    if (row.find('\0') != std::string_view::npos)
      refuse_line(table, line, "a zero byte; this is not a text file: export the log as CSV.");
    const std::string_view bare = trimmed(row);  // not the row itself: a tab may stand for an empty cell
    if (bare.empty()) continue;
    if (bare.front() == '#') {
      remark = trimmed(bare.substr(1));
      continue;
    }
    if (table.names.empty()) {
      if (bare.find_first_not_of(",;\t\" ") == std::string_view::npos) continue;
      if (!split(row, separator, cells))
        refuse_line(table, line, "a quote is opened and never closed; repair the header.");
      if (!heads_a_table(cells, separator, rest) && begins_below(rest)) continue;
      if (name_columns(table, cells, remark, separator, line)) continue;
    }
    // A separator at the end of every row is some loggers' habit; one cell too many and empty is not a mistake.
    const bool whole = split(row, separator, cells);
    if (whole && cells.size() == table.names.size() + 1 && cells.back().empty()) cells.pop_back();
    if (!whole || cells.size() != table.names.size()) {
      const std::string wrong = fmt::format(
          "the row has {} of {} cells{}{}", cells.size(), table.names.size(),
          lines > 1 ? fmt::format(", one of them in quotes until line {}", line + lines - 1) : "",
          whole && separator == ',' && cells.size() > table.names.size()
              ? "; if commas stand in its numbers as well, export it with semicolons or tabs between the cells, else "
                "repair or delete this line."
          : closed ? "; repair or delete this line."
                   : " and the file ends in it, so it was cut off; delete the last line or copy the file again.");
      if (!whole || !closed || lines > 1) refuse_line(table, line, wrong);
      if (torn++ == 0) first_torn = line, what_is_torn = wrong;
      continue;
    }
    if (std::equal(cells.begin(), cells.end(), table.names.begin())) {
      ++headers;
      continue;
    }
    if (table.line.empty() && table.units.empty() && all_words(cells, separator != ',')) {
      std::vector<std::string> below(cells.begin(), cells.end());
      if (all_differ(below) && !all_differ(table.names))
        table.names = std::move(below);  // of two header rows the upper one names groups of columns
      else
        table.units = std::move(below);
    } else
      add_row(table, cells, separator != ',', line, dates);
  }
  if (table.names.empty()) {
    refuse_data(path + ": the file is empty; record a log with a header line and rows.");
  }
  constexpr double most_torn = 0.01;  // of the rows: more are another table
  if (torn > 0 && torn > most_torn * static_cast<double>(table.rows())) refuse_line(table, first_torn, what_is_torn);
  if (torn > 0)
    table.notes.push_back(fmt::format(
        "Lines that have not as many cells as the header were left out: {}, the first line {}.", torn, first_torn));
  for (const auto& [column, told] : dates) read_dates(table, column, told);
  if (headers > 0) table.notes.push_back(fmt::format("Lines that repeat the header were left out: {}.", headers));
  if (table.rows() == 0) refuse_data(path + ": there is a header and no row; the recording failed: record it again.");
  return table;
}

}  // namespace identify

// SPDX-License-Identifier: MIT
// Reads a text table (CSV) as people and loggers write it, and refuses a broken one in one sentence.
//
//   in   a file: comma, semicolon, tab, blanks; quotes, and line ends in them; CRLF; byte-order mark; '#' lines,
//        rows of empty cells before the header, or '#' before it as well; a row of units below it; decimal comma where
//        no comma separates; times as ISO 8601, MATLAB, spreadsheets and German loggers write
//        them; UTF-8, UTF-16 and Latin-1
//   out  names and columns of numbers, NaN where a cell is empty or says nan; a column of words (a date, a state) is a
//        mistake only for who uses it
//
// Does not know what the columns mean (log.hpp does).
#pragma once

#include <string>
#include <vector>

#include "identify/log/cell.hpp"

namespace identify {

/// How many cells are not missing; and the largest of these without its sign, 0 of none.
std::size_t count_told(const std::vector<double>& cells);
double largest_magnitude(const std::vector<double>& cells);

/// Does each cell that is not missing say the same? Not of none.
bool stands(const std::vector<double>& cells);

/// From each cell to the next, one fewer.
std::vector<double> spacing(const std::vector<double>& cells);

/// From row to row, usually. Rows may come in bursts (one for each message, a millisecond apart, ten times a second):
/// of a pattern of up to 24 rows that repeats itself better than they do one by one, its mean. Missing of fewer
/// than two.
double row_period_s(const std::vector<double>& time_s);

/// The cells of a column that are neither numbers nor a word for "missing".
struct Words {
  std::vector<std::string> seen;    // each once
  std::vector<std::size_t> of_row;  // its place in `seen` and one; 0 and the rows after the last: none
  bool like_numbers = false;        // one of them has a digit
  std::size_t count() const;
  std::string in_row(std::size_t row) const;  // empty: none
};

struct Table {
  std::string file;
  std::vector<std::string> names;
  std::vector<std::string> units;            // as a row below the header gives them; empty without such a row
  std::vector<std::vector<double>> columns;  // columns[c][row]
  std::vector<Words> words;                  // for each column
  std::vector<std::string> complaints;       // for each column: what is wrong with its first cell that is no number
  std::vector<bool> of_day;                  // for each column: a cell of it is a time of day, without a date
  std::vector<int> thousands;                // for each column: cells such as 1,234; -1: others have a comma too
  std::vector<bool> has_plain;               // for each column: a whole number in it has no comma
  std::vector<int> line;                     // line number of each row, for sentences
  std::vector<std::string> notes;            // what was passed over, a sentence each

  std::size_t rows() const { return line.size(); }
  int find(const std::string& name) const;  // -1: no such column
  std::string has() const;                  // the columns' names in a row, the first hundred of more
};

/// Throws wire::pc::UserError (unusable) with file, line, column and what to do; (usage) when it is no readable file.
Table read_table(const std::string& path);

}  // namespace identify

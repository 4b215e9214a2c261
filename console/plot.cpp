// SPDX-License-Identifier: MIT
#include "console/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>
#include <sstream>

namespace console {
namespace {

constexpr int scale_width = 12;  // characters of the scale at the left: "-2000 rad/s"
constexpr std::array<int, 6> ansi_colours = {36, 33, 35, 32, 31, 34};  // told apart on dark and on light grounds

struct Cell {
  unsigned dots = 0;
  std::size_t line = 0;  // whose colour it has: the last one drawn
};

/// Bit of a dot in its Braille cell (Unicode block 2800), x 0..1, y 0..3 downwards.
unsigned dot(int x, int y) {
  constexpr unsigned bits[4][2] = {{0x01, 0x08}, {0x02, 0x10}, {0x04, 0x20}, {0x40, 0x80}};
  return bits[y][x];
}

std::string utf8(unsigned code) {
  return {static_cast<char>(0xE0 | code >> 12), static_cast<char>(0x80 | ((code >> 6) & 0x3F)),
          static_cast<char>(0x80 | (code & 0x3F))};
}

/// Until it holds all values, then outwards to round numbers: 1, 2 or 5 times a power of ten.
void grow(Scale& scale, const std::vector<PlotLine>& lines, std::size_t columns) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const PlotLine& line : lines) {
    const std::size_t first = line.values.size() - std::min(columns, line.values.size());
    for (std::size_t i = first; i < line.values.size(); ++i) {
      if (!std::isfinite(line.values[i])) continue;
      low = std::min(low, double{line.values[i]});
      high = std::max(high, double{line.values[i]});
    }
  }
  const bool begun = scale.low < scale.high;
  if (low > high || (begun && low >= scale.low && high <= scale.high)) return;
  if (begun) low = std::min(low, scale.low), high = std::max(high, scale.high);
  // Four digits are shown, so both ends shall differ in them.
  const double least = std::max(scale.least_span, 1e-3 * std::max(std::abs(low), std::abs(high)));
  const double lacking = std::max(0.0, least - (high - low)) / 2;
  low -= lacking, high += lacking;
  const double fifth = (high - low) / 5, power = std::pow(10, std::floor(std::log10(fifth)));
  const double step = power * (fifth <= power ? 1 : fifth <= 2 * power ? 2 : fifth <= 5 * power ? 5 : 10);
  scale.low = step * std::floor(low / step);
  scale.high = step * std::ceil(high / step);
}

}  // namespace

std::string plot(const std::vector<PlotLine>& lines, Scale& scale, int width, int height, bool colours) {
  const int cells = std::max(10, width - scale_width - 1), rows = std::max(2, height);
  const auto columns = static_cast<std::size_t>(2 * cells);
  grow(scale, lines, columns);
  const double low = scale.low, high = low < scale.high ? scale.high : low + scale.least_span;
  std::vector<Cell> grid(static_cast<std::size_t>(cells * rows));
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const auto& values = lines[l].values;
    const std::size_t shown = std::min(columns, values.size());
    int last_y = -1;
    for (std::size_t i = 0; i < shown; ++i) {
      const float value = values[values.size() - shown + i];
      if (!std::isfinite(value)) {
        last_y = -1;
        continue;
      }
      const double share = (high - double{value}) / (high - low);
      const int y = static_cast<int>(std::lround(std::clamp(share, 0.0, 1.0) * (4 * rows - 1)));
      const int x = static_cast<int>(columns - shown + i);
      // A steep curve stays connected: the dots between it and its last column are drawn as well.
      const int from = last_y < 0 ? y : std::min(y, last_y + 1);
      const int to = last_y < 0 ? y : std::max(y, last_y - 1);
      for (int d = from; d <= to; ++d) {
        Cell& cell = grid[static_cast<std::size_t>(d / 4 * cells + x / 2)];
        cell.dots |= dot(x % 2, d % 4);
        cell.line = l;
      }
      last_y = y;
    }
  }
  std::string text;
  for (int row = 0; row < rows; ++row) {
    std::string end;
    if (row == 0) end = fmt::format("{:.4g} {}", high, scale.unit);
    if (row == rows - 1) end = fmt::format("{:.4g} {}", low, scale.unit);
    text += fmt::format("{:>{}} ", end, scale_width);
    int colour = 0;
    for (int c = 0; c < cells; ++c) {
      const Cell& cell = grid[static_cast<std::size_t>(row * cells + c)];
      const int wanted = cell.dots == 0 || !colours ? 0 : ansi_colours[cell.line % ansi_colours.size()];
      if (wanted != colour) text += fmt::format("\033[{}m", wanted);
      colour = wanted;
      text += cell.dots == 0 ? " " : utf8(0x2800 + cell.dots);
    }
    if (colour != 0) text += "\033[0m";
    text += '\n';
  }
  text += std::string(scale_width + 1, ' ');
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const std::string label = (l == 0 ? "" : "   ") + lines[l].label;
    text += colours ? fmt::format("\033[{}m{}\033[0m", ansi_colours[l % ansi_colours.size()], label) : label;
  }
  return text + '\n';
}

Fitted fitted(const std::string& text, int columns, int rows) {
  Fitted fit{"", 0};
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    int seen = 0;
    bool escape = false;
    for (const unsigned char c : line) {
      if (c == '\033')
        escape = true;
      else if (escape)
        escape = std::isalpha(c) == 0;
      else if ((c & 0xC0) != 0x80)  // a character of UTF-8 begins
        ++seen;
    }
    const int takes = std::max(1, (seen + columns - 1) / columns);
    if (fit.rows + takes >= rows) break;
    fit.text += line + "\n";
    fit.rows += takes;
  }
  return fit;
}

}  // namespace console

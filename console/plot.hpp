// SPDX-License-Identifier: MIT
// Curves in a terminal: Braille characters, each two dots wide and four high, a scale at the left, colours by ANSI
// codes.
#pragma once

#include <string>
#include <vector>

namespace console {

struct PlotLine {
  std::string label;          // name, newest value, unit: "core 41.3 degC"
  std::vector<float> values;  // oldest first, one per column of dots; NaN leaves a gap
};

/// What the scale at the left shows. It only grows, so that a live curve does not jump, and ends at round numbers.
struct Scale {
  std::string unit;
  double least_span;
  double low = 0, high = 0;  // equal: nothing was drawn yet
};

/// `height` lines of text and one of labels, each `width` characters wide at most, each ended by a line feed. The
/// newest value stands at the right edge; older values than fit are left out.
std::string plot(const std::vector<PlotLine>& lines, Scale& scale, int width, int height, bool colours);

struct Fitted {
  std::string text;
  int rows;
};

/// The lines of `text` that a terminal shows without scrolling, and the rows they take: what is drawn again has to go
/// up so far. A line longer than a row goes on below.
Fitted fitted(const std::string& text, int columns, int rows);

}  // namespace console

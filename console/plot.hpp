// SPDX-License-Identifier: MIT
// Curves in a terminal: Braille characters, each two dots wide and four high, a scale at the left, colours by ANSI
// codes.
#pragma once

#include <string>
#include <vector>

namespace console {

struct PlotLine {
  std::string label;          // "core 41.3 degC"
  std::vector<float> values;  // oldest first, one per column of dots; NaN leaves a gap
};

/// `height` lines of text and one of labels, each `width` characters wide at most, each ended by a line feed. The
/// newest value stands at the right edge; older values than fit are left out. `least_span`: the scale never shows less.
std::string plot(const std::vector<PlotLine>& lines, int width, int height, float least_span, bool colours);

}  // namespace console

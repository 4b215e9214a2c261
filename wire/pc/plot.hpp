// SPDX-License-Identifier: MIT
// Pictures of curves as SVG, drawn by gnuplot (a program that must be installed; ./run installs it).
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace wire::pc {

struct Curve {
  std::string label;
  std::vector<double> x, y;  // same length; NaN breaks the line
  std::string colour = "";   // "#rrggbb"; empty: the next one of the palette
  bool dashed = false;
  bool dots = false;  // points instead of a line
};

/// A stretch of x with a tinted background: where the model is wrong, where a limit held.
struct Stretch {
  double from, to;
  std::string label;
  std::string colour = "#f4d9d0";
};

/// A horizontal line: a limit.
struct Level {
  double y;
  std::string label;
};

struct Panel {
  std::string y_label;  // with unit
  std::vector<Curve> curves;
  std::vector<Level> levels = {};
  std::vector<Stretch> stretches = {};
  bool log_y = false;
  double y_min = 0, y_max = 0;  // equal: chosen from the data
  std::string title = "";
};

/// Panels under each other over one x axis.
struct Picture {
  std::string title;
  std::string x_label;
  std::vector<Panel> panels;
  bool log_x = false;
  std::string note = "";  // small print under the title: what a person should see, what is simulated
  std::pair<double, double> x_range = {0, 0};  // equal: chosen from the data
};

/// The picture as SVG text. Throws UserError (usage) when gnuplot is missing or fails.
std::string svg(const Picture& picture);

/// The same, written to a file in one step (a reader never sees half a picture).
void write_svg(const std::string& path, const Picture& picture);

}  // namespace wire::pc

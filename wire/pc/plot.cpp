// SPDX-License-Identifier: MIT
#include "wire/pc/plot.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "wire/pc/files.hpp"

namespace wire::pc {
namespace {

constexpr int width = 960, panel_height = 230, head_height = 80, foot_height = 50;
constexpr std::size_t most_points = 2000;  // per curve: about two per pixel
// Okabe and Ito's palette, readable with any colour vision, and a brown.
constexpr const char* palette[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                   "#e69f00", "#56b4e9", "#404040", "#8c5a2b"};

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c == '\n' ? ' ' : c;
  }
  return out + "\"";
}

/// Data block of one curve. Long curves keep the smallest and largest value of each stretch, so that no spike is lost.
std::string data_block(const std::string& name, const Curve& curve) {
  std::string out = fmt::format("${} << EOD\n", name);
  const auto line = [&](std::size_t i) {
    if (std::isfinite(curve.x[i]) && std::isfinite(curve.y[i]))
      out += fmt::format("{:.9g} {:.6g}\n", curve.x[i], curve.y[i]);
    else
      out += "\n";
  };
  const std::size_t n = std::min(curve.x.size(), curve.y.size());
  if (n <= most_points) {
    for (std::size_t i = 0; i < n; ++i) line(i);
  } else {
    const std::size_t stretches = most_points / 2;
    for (std::size_t s = 0; s < stretches; ++s) {
      const std::size_t from = s * n / stretches, to = (s + 1) * n / stretches;
      std::size_t low = to, high = to;
      bool gap = false;
      for (std::size_t i = from; i < to; ++i) {
        if (!std::isfinite(curve.y[i])) {
          gap = true;
          continue;
        }
        if (low == to || curve.y[i] < curve.y[low]) low = i;
        if (high == to || curve.y[i] > curve.y[high]) high = i;
      }
      if (low < to) line(std::min(low, high));
      if (low != high) line(std::max(low, high));
      if (gap) out += "\n";
    }
  }
  return out + "EOD\n";
}

/// From the data and the levels, with air above and below; a level outside the range would be drawn into the neighbour.
std::pair<double, double> y_range(const Panel& panel) {
  if (panel.y_min != panel.y_max) return {panel.y_min, panel.y_max};
  double low = INFINITY, high = -INFINITY;
  const auto include = [&](double y) {
    if (std::isfinite(y) && (!panel.log_y || y > 0)) low = std::min(low, y), high = std::max(high, y);
  };
  for (const Curve& curve : panel.curves) std::for_each(curve.y.begin(), curve.y.end(), include);
  for (const Level& level : panel.levels) include(level.y);
  if (!(low <= high)) return {0, 1};
  if (panel.log_y) return {low / 1.15, high * 1.15};
  const double air = high > low ? 0.07 * (high - low) : 1;
  return {low - air, high + air};
}

/// Width of the key beside the plots, as share of the picture: about 7 pixels a character, a sample and a margin.
double key_share(const Picture& picture) {
  std::size_t longest = 0;
  for (const Panel& panel : picture.panels) {
    for (const Curve& curve : panel.curves) longest = std::max(longest, curve.label.size());
  }
  return std::clamp((7.0 * static_cast<double>(longest) + 55) / width, 0.03, 0.45);
}

std::string script(const Picture& picture, const std::string& output) {
  const int panels = static_cast<int>(picture.panels.size());
  const int height = head_height + panels * panel_height + foot_height;
  std::string s = fmt::format(
      "set terminal svg size {},{} dynamic background '#ffffff' font 'Helvetica,Arial,sans-serif,13'\n", width, height);
  s += fmt::format("set output {}\nset encoding utf8\n", quoted(output));
  s += fmt::format("set label 1 {} at screen 0.012,{} left font ',18' noenhanced\n", quoted(picture.title),
                   1.0 - 24.0 / height);
  s += fmt::format("set label 2 {} at screen 0.012,{} left font ',12' textcolor '#606060' noenhanced\n",
                   quoted(picture.note), 1.0 - 46.0 / height);
  s += "set border 3 lc '#808080'\nset tics nomirror textcolor '#404040'\nset grid lc '#e4e4e4' lt 1\n"
       "set key outside right top vertical noenhanced samplen 1.6 width 0 maxrows 12\nset lmargin at screen 0.085\n";
  s += fmt::format("set rmargin at screen {:.3f}\n", 1 - key_share(picture));
  if (picture.log_x) s += "set logscale x\n";
  if (picture.x_range.first != picture.x_range.second) {
    s += fmt::format("set xrange [{}:{}]\n", picture.x_range.first, picture.x_range.second);
  } else {
    double low = INFINITY, high = -INFINITY;
    for (const Panel& panel : picture.panels) {
      for (const Curve& curve : panel.curves) {
        for (const double x : curve.x) {
          if (std::isfinite(x)) low = std::min(low, x), high = std::max(high, x);
        }
      }
    }
    if (low < high) s += fmt::format("set xrange [{}:{}]\n", low, high);
  }
  s += "set multiplot\n";
  for (int p = 0; p < panels; ++p) {
    const Panel& panel = picture.panels[static_cast<std::size_t>(p)];
    for (std::size_t c = 0; c < panel.curves.size(); ++c) s += data_block(fmt::format("p{}c{}", p, c), panel.curves[c]);
    const double top = 1.0 - static_cast<double>(head_height + p * panel_height) / height;
    const double bottom = top - static_cast<double>(panel_height - 30) / height;
    s += fmt::format("set tmargin at screen {}\nset bmargin at screen {}\n", top, bottom);
    s += fmt::format("set ylabel {} noenhanced textcolor '#404040'\n", quoted(panel.y_label));
    s += p + 1 == panels
             ? fmt::format("set xlabel {} noenhanced textcolor '#404040'\nset format x '%g'\n", quoted(picture.x_label))
             : std::string("unset xlabel\nset format x ''\n");
    s += panel.title.empty() ? "unset title\n"
                             : fmt::format("set title {} noenhanced font ',13' offset 0,-0.7\n", quoted(panel.title));
    s += panel.log_y ? "set logscale y\n" : "unset logscale y\n";
    const auto [low, high] = y_range(panel);
    s += fmt::format("set yrange [{}:{}]\n", low, high);
    s += "unset object\nunset arrow\n";
    for (int label = 10; label < 40; ++label) s += fmt::format("unset label {}\n", label);
    int tag = 10;
    for (const Stretch& stretch : panel.stretches) {
      s += fmt::format(
          "set object rectangle from first {},graph 0 to first {},graph 1 fc rgb '{}' fs solid noborder behind\n",
          stretch.from, stretch.to, stretch.colour);
      if (!stretch.label.empty() && tag < 40) {
        s += fmt::format("set label {} {} at first {},graph 0.93 left font ',11' textcolor '#905040' noenhanced\n",
                         tag++, quoted(stretch.label), stretch.from);
      }
    }
    for (const Level& level : panel.levels) {
      s += fmt::format("set arrow from graph 0,first {0} to graph 1,first {0} nohead lc '#b00000' dt 2 lw 1.2\n",
                       level.y);
      if (tag < 40) {
        s += fmt::format(
            "set label {} {} at graph 0.01,first {} left offset 0,0.5 font ',11' textcolor '#b00000' noenhanced\n",
            tag++, quoted(level.label), level.y);
      }
    }
    std::string plots;
    for (std::size_t c = 0; c < panel.curves.size(); ++c) {
      const Curve& curve = panel.curves[c];
      const std::string colour = curve.colour.empty() ? palette[c % std::size(palette)] : curve.colour;
      const std::string style = curve.dots     ? "points pt 7 ps 0.35"
                                : curve.dashed ? "lines lw 1.8 dt 2"
                                               : "lines lw 1.8";
      plots += fmt::format("{}$p{}c{} using 1:2 with {} lc rgb '{}' {}", plots.empty() ? "" : ", ", p, c, style, colour,
                           curve.label.empty() ? "notitle" : "title " + quoted(curve.label));
    }
    if (plots.empty()) plots = "NaN notitle";
    s += "plot " + plots + "\n";
    s += "unset label 1\nunset label 2\n";
  }
  return s + "unset multiplot\n";
}

}  // namespace

std::string svg(const Picture& picture) {
  namespace fs = std::filesystem;
  std::string folder = (fs::temp_directory_path() / "hotcore-plot-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) refuse("No temporary folder can be made; set TMPDIR to a folder with room.");
  const std::string source = folder + "/plot.gp", output = folder + "/plot.svg";
  std::ofstream(source) << script(picture, output);
  const int status = std::system(fmt::format("gnuplot '{}' > '{}/messages' 2>&1", source, folder).c_str());
  std::ostringstream text;
  text << std::ifstream(output).rdbuf();
  std::string complaint;
  std::getline(std::ifstream(folder + "/messages"), complaint);
  std::error_code none;
  fs::remove_all(folder, none);
  if (status != 0 || text.str().empty()) {
    refuse("The picture could not be drawn" + (complaint.empty() ? std::string() : " (" + complaint + ")") +
           "; ./run installs gnuplot, which draws it.");
  }
  return text.str();
}

void write_svg(const std::string& path, const Picture& picture) { write_whole(path, svg(picture)); }

}  // namespace wire::pc

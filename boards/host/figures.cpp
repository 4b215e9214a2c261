// SPDX-License-Identifier: MIT
#include "boards/host/figures.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "thermal/board_heat.hpp"
#include "thermal/indices.hpp"
#include "wire/pc/files.hpp"
#include "wire/pc/motor_file.hpp"
#include "wire/pc/plot.hpp"

namespace boards::host {
namespace {

constexpr double ambient_degC = 25;
// Housing to water: the value with which the 200 W motor carries five times its uncooled rating for ever.
constexpr double water_R2_K_per_W = 0.0954;
constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

/// Thermal rows of motor sheets, K/W and s. Public transcriptions of catalogue pages unless the status says otherwise.
constexpr IndexRow sheet_rows[] = {
    {"maxon EC-powermax 30, 200 W", "two sources agree", 0.209, 7.4, 2.11, 1180, 0, 0},
    {"maxon EC 16, 40 W", "surrogate: recalled, +-20 %", 1.08, 16.3, 1.22, 294, 0, 0},
    {"maxon EC-max 16, 8 W", "one source", 1.41, 17.7, 0.90, 427, 0, 0},
    {"maxon EC-max 16, 5 W (283828)", "one source", 2.57, 23.5, 0.943, 390, 0, 0},
    {"maxon RE 40, 150 W", "brushed", 1.93, 4.65, 41.6, 1120, 0, 0},
    {"maxon RE 50, 200 W (370354)", "brushed", 2.27, 3.81, 137, 406, 0, 0},
    {"maxon EC 45 flat, 70 W (397172)", "one source", 4.3, 3.1, 28.8, 157, 0, 0},
    {"Dephy ActPack (U8 class)", "measured, University of Michigan", 1.07, 1.94, 17.4, 994, 0, 0},
};

template <class Law>
PaperCurve curve(const std::string& label, Law law) {
  PaperCurve out{label, {}};
  for (const double t_s : paper_times_s) out.values.push_back(law(t_s));
  return out;
}

std::string table_of(const std::vector<PaperCurve>& curves, const char* format) {
  std::string out = fmt::format("  {:<42}", "t, s");
  for (const double t_s : paper_times_s) out += fmt::format("{:>8g}", t_s);
  for (const PaperCurve& c : curves) {
    out += fmt::format("\n  {:<42}", c.label);
    for (const double value : c.values) out += fmt::format("{:>8}", fmt::format(fmt::runtime(format), value));
  }
  return out + "\n";
}

std::string known(double value, const char* unit) {
  return std::isnan(value) ? "not found" : fmt::format("{:g} {}", value, unit);
}

wire::pc::Panel panel_of(const std::vector<PaperCurve>& curves, const std::string& y_label, bool log_y) {
  wire::pc::Panel panel{y_label, {}};
  panel.log_y = log_y;
  for (const PaperCurve& c : curves) panel.curves.push_back({c.label, paper_times_s, c.values});
  return panel;
}

}  // namespace

const std::vector<double> paper_times_s = {0.1, 0.3, 1, 3, 10, 30, 100, 300, 1000, 3000};

PaperFigures paper_figures(const std::string& motor_folder) {
  using thermal::housing_at_limit_degC, thermal::overload_ratio;
  const wire::Motor large = wire::pc::read_motor("ec-powermax-30-24v", motor_folder).motor;
  const wire::Motor small = wire::pc::read_motor("ec-16-40w", motor_folder).motor;
  wire::Motor cooled = large;
  cooled.R2_K_per_W = water_R2_K_per_W;
  const double uncooled_A = thermal::rated_current_A(large, ambient_degC);

  PaperFigures f;
  const auto overload = [](const wire::Motor& m) {
    return [&m](double t_s) { return overload_ratio(m, t_s, ambient_degC); };
  };
  const auto housing = [](const wire::Motor& m) {
    return [&m](double t_s) { return housing_at_limit_degC(m, t_s, ambient_degC); };
  };
  f.overload = {curve("200 W", overload(large)), curve("EC 16, 40 W (surrogate)", overload(small)),
                curve("200 W, water cooled (of its air rating)",
                      [&](double t_s) { return thermal::current_to_limit_A(cooled, t_s, ambient_degC) / uncooled_A; })};
  f.housing = {curve("200 W", housing(large)), curve("EC 16, 40 W (surrogate)", housing(small)),
               curve("200 W, water cooled", housing(cooled))};

  const thermal::BoardRating stage;
  f.amperes = {
      curve("EC 16, 40 W (surrogate)",
            [&](double t_s) { return thermal::direct_A(thermal::current_to_limit_A(small, t_s, ambient_degC)); }),
      curve("driver, one pole through 6 A and 20 A for 15 s", [&](double t_s) {
        return static_cast<double>(stage.continuous_A) /
               std::sqrt(-std::expm1(-t_s / static_cast<double>(stage.tau_s)));
      })};
  f.boards = {{"H8-15D", 2, 48, static_cast<double>(stage.continuous_A), 20, 15, static_cast<double>(stage.tau_s)},
              {"H8-17.5D", 2, unknown, unknown, 80, unknown, unknown}};

  for (IndexRow row : sheet_rows) {
    wire::Motor m{};
    m.R1_K_per_W = row.R1_K_per_W;
    m.R2_K_per_W = row.R2_K_per_W;
    m.C1_J_per_K = row.tau_winding_s / row.R1_K_per_W;
    row.short_term = thermal::short_term_index(m);
    row.forced_cooling = thermal::forced_cooling_index(m);
    f.indices.push_back(row);
  }
  return f;
}

std::string figures_text(const PaperFigures& f) {
  std::string out = fmt::format(
      "From cold at {:g} degC to the winding's limit, constant current, copper coefficient in load and rating.\n\n",
      ambient_degC);
  out += "Fig 1  current over rated current\n" + table_of(f.overload, "{:.2f}");
  out += "Fig 2  housing when the winding is at its limit, degC\n" + table_of(f.housing, "{:.1f}");
  out += "Fig 6  direct current, A\n" + table_of(f.amperes, "{:.1f}");
  out += "Tables I and II  the boards, as far as their figures are known\n";
  for (const BoardRow& b : f.boards) {
    out += fmt::format("  {:<10}{} axes, supply {}, continuous {}, peak {} for {}; one pole of {}\n", b.board, b.axes,
                       known(b.supply_V, "V"), known(b.continuous_A, "A"), known(b.peak_A, "A"), known(b.peak_s, "s"),
                       known(b.pole_s, "s"));
  }
  out += fmt::format("Index table\n  {:<34}{:>9}{:>9}{:>9}{:>9}{:>14}{:>8}  {}\n", "motor", "R1 K/W", "R2 K/W",
                     "tau_w s", "tau_m s", "(6) sqrt(s)", "(7)", "status");
  for (const IndexRow& r : f.indices) {
    out += fmt::format("  {:<34}{:>9g}{:>9g}{:>9g}{:>9g}{:>14.2f}{:>8.2f}  {}\n", r.motor, r.R1_K_per_W, r.R2_K_per_W,
                       r.tau_winding_s, r.tau_motor_s, r.short_term, r.forced_cooling, r.status);
  }
  return out;
}

std::string figures_json(const PaperFigures& f) {
  nlohmann::ordered_json out;
  out["times_s"] = paper_times_s;
  const auto put = [&](const char* name, const std::vector<PaperCurve>& curves) {
    for (const PaperCurve& c : curves) out[name][c.label] = c.values;
  };
  put("fig1_current_ratio", f.overload);
  put("fig2_housing_degC", f.housing);
  put("fig6_direct_A", f.amperes);
  for (const BoardRow& b : f.boards) {  // NaN becomes null: not known
    out["boards"].push_back({{"board", b.board},
                             {"axes", b.axes},
                             {"supply_V", b.supply_V},
                             {"continuous_A", b.continuous_A},
                             {"peak_A", b.peak_A},
                             {"peak_s", b.peak_s},
                             {"pole_s", b.pole_s}});
  }
  for (const IndexRow& r : f.indices) {
    out["indices"].push_back({{"motor", r.motor},
                              {"status", r.status},
                              {"short_term_sqrt_s", r.short_term},
                              {"forced_cooling", r.forced_cooling}});
  }
  return out.dump(2) + "\n";
}

std::vector<std::string> draw_figures(const PaperFigures& f, const std::string& folder) {
  const std::string time = "time to the limit, s";
  const auto path = [&](const char* name) { return folder + "/" + name; };
  wire::pc::write_svg(path("fig1.svg"),
                      {.title = "Fig 1: how many times its rated current a motor stands",
                       .x_label = time,
                       .panels = {panel_of(f.overload, "current / rated current", true)},
                       .log_x = true,
                       .note = "Computed from sheet values, corrected equations; EC 16 values are a surrogate."});
  wire::pc::write_svg(path("fig2.svg"),
                      {.title = "Fig 2: how warm the housing is when the winding burns",
                       .x_label = time,
                       .panels = {panel_of(f.housing, "housing, °C", false)},
                       .log_x = true,
                       .note = "Within seconds the housing has noticed nothing; water cooled, it never does."});
  wire::pc::write_svg(
      path("fig6.svg"),
      {.title = "Fig 6: what the motor stands and what the driver stands",
       .x_label = "duration, s",
       .panels = {panel_of(f.amperes, "direct current, A", true)},
       .log_x = true,
       .note = "Driver: its thermal reading; if 20 A is a hard peak, the motor stands more below 0.33 s."});
  wire::pc::Curve dots{"", {}, {}, "", false, true};
  wire::pc::Picture index{.title = "Index table: short pushes (6) and forced cooling (7)",
                          .x_label = "(6) short-term index, sqrt(s)",
                          .panels = {},
                          .note = "To the right: stands longer pushes. Above: gains more from a cooled housing."};
  wire::pc::Panel panel{"(7) forced-cooling index", {}};
  for (const IndexRow& r : f.indices) {
    dots.label = fmt::format("{} ({:.1f}, {:.1f})", r.motor, r.short_term, r.forced_cooling);
    dots.x = {r.short_term};
    dots.y = {r.forced_cooling};
    panel.curves.push_back(dots);
  }
  index.panels = {panel};
  index.x_range = {0, 21};
  wire::pc::write_svg(path("index.svg"), index);
  wire::pc::write_whole(path("figures.txt"), figures_text(f));
  return {path("fig1.svg"), path("fig2.svg"), path("fig6.svg"), path("index.svg"), path("figures.txt")};
}

}  // namespace boards::host

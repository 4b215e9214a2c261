// SPDX-License-Identifier: MIT
#include "boards/host/trace.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "wire/pc/files.hpp"
#include "wire/pc/plot.hpp"

namespace boards::host {
namespace {

struct Column {
  const char* name;
  double Row::*value;
};

constexpr Column columns[] = {
    {"time_s", &Row::time_s},
    {"demand_A", &Row::demand_A},
    {"allowance_A", &Row::allowance_A},
    {"id_now_A", &Row::id_now_A},
    {"iq_now_A", &Row::iq_now_A},
    {"iq_A", &Row::iq_A},
    {"current_A", &Row::current_A},
    {"speed_rad_per_s", &Row::speed_rad_per_s},
    {"torque_Nm", &Row::torque_Nm},
    {"shaft_W", &Row::shaft_W},
    {"bus_V", &Row::bus_V},
    {"bus_A", &Row::bus_A},
    {"depth_ratio", &Row::depth_ratio},
    {"estimated_core_degC", &Row::estimated_core_degC},
    {"core_sigma_K", &Row::core_sigma_K},
    {"true_core_degC", &Row::true_core_degC},
    {"true_winding_degC", &Row::true_winding_degC},
    {"housing_degC", &Row::housing_degC},
    {"true_housing_degC", &Row::true_housing_degC},
    {"ambient_degC", &Row::ambient_degC},
};

std::string label(const Result& result, const Trace& trace) {
  const bool two_axes =
      std::any_of(result.traces.begin(), result.traces.end(), [](const Trace& t) { return t.axis == 1; });
  switch (trace.limiter) {
    case Limiter::governor:
      return two_axes ? fmt::format("hotcore, axis {}", trace.axis) : "hotcore";
    case Limiter::rated:
      return "rated-current limit";
    case Limiter::housing:
      return fmt::format("housing limit {:g} °C", result.scene.housing_limit_degC);
    case Limiter::hard_cut:
      return "paper's hard cut";
    case Limiter::oracle:
      return "oracle (true temperature)";
  }
  return "";
}

double share_of_optimum(const Result& result, const Trace& trace) {
  return trace.axis == 0 && result.optimal_impulse_As > 0 ? trace.impulse_As / result.optimal_impulse_As : 0;
}

double smallest_allowance_A(const Trace& trace) {
  const bool idle = std::all_of(trace.rows.begin(), trace.rows.end(), [](const Row& row) { return row.demand_A == 0; });
  double smallest = std::numeric_limits<double>::infinity();
  for (const Row& row : trace.rows) {
    if (row.demand_A != 0 || idle) smallest = std::min(smallest, row.allowance_A);
  }
  return smallest;
}

/// The picture of the scene.
void draw(const Result& result, const std::string& path) {
  using wire::pc::Curve;
  using wire::pc::Panel;
  constexpr const char* colours[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7"};

  const auto curve = [&](std::size_t i, double Row::*value, const std::string& text) {
    const Trace& trace = result.traces[i];
    Curve c{text, {}, {}, colours[i % std::size(colours)]};
    for (const Row& row : trace.rows) {
      c.x.push_back(row.time_s);
      c.y.push_back(row.*value);
    }
    return c;
  };
  const auto all = [&](double Row::*value, bool labelled) {
    std::vector<Curve> curves;
    for (std::size_t i = result.traces.size(); i-- > 0;) {  // the first limiter, hotcore, is drawn on top
      curves.push_back(curve(i, value, labelled ? label(result, result.traces[i]) : ""));
    }
    return curves;
  };

  Panel current{"current, A", all(&Row::iq_now_A, true)};
  Curve asked = curve(0, &Row::demand_A, "asked for");
  asked.colour = "#909090";
  asked.dashed = true;
  current.curves.push_back(asked);

  Panel core{
      "hottest winding, °C", all(&Row::true_core_degC, false), {{result.winding_max_degC, "limit of the winding"}}};
  Curve believed = curve(0, &Row::estimated_core_degC, "hotcore's estimate");
  believed.dashed = true;
  believed.colour = "#000000";
  core.curves.push_back(believed);

  Panel housing{"housing sensor, °C", all(&Row::housing_degC, false)};
  std::vector<Panel> panels = {current, core, housing};
  if (std::any_of(result.traces.begin(), result.traces.end(), [](const Trace& t) { return t.peak_shaft_W > 20; })) {
    panels.push_back({"shaft power, W", all(&Row::shaft_W, false)});
  }
  wire::pc::write_svg(path, {.title = result.scene.title,
                             .x_label = "time, s",
                             .panels = panels,
                             .note = result.scene.note + (result.surrogate ? " Motor data: surrogate." : ""),
                             .x_range = {0, result.scene.seconds}});
}

}  // namespace

double modulation_depth(const hal::Duty& duty) {
  if (!duty.on) return 0;
  const double a = static_cast<double>(duty.ratio.a), b = static_cast<double>(duty.ratio.b),
               c = static_cast<double>(duty.ratio.c);
  return std::hypot((2 * a - b - c) / std::numbers::sqrt3, b - c);
}

std::string csv(const Result& result, const Trace& trace) {
  std::string out = fmt::format("# hotcore scene {} (simulated), motor {}{}, limiter {}, axis {}, seed {}\n",
                                result.scene.id, result.motor_name, result.surrogate ? " (surrogate)" : "",
                                name_of(trace.limiter), trace.axis, result.scene.seed);
  for (const Column& column : columns) out += fmt::format("{},", column.name);
  out += "limit,fault\n";
  for (const Row& row : trace.rows) {
    for (const Column& column : columns) out += fmt::format("{:.7g},", row.*column.value);
    out += fmt::format("{},{}\n", wire::text_of(row.limit).name, wire::text_of(row.fault).name);
  }
  return out;
}

std::string summary_text(const Result& result) {
  std::string out =
      fmt::format("{}\n  motor {}{}; winding limit {:g} degC; seed {}\n", result.scene.title, result.motor_name,
                  result.surrogate ? " (surrogate)" : "", result.winding_max_degC, result.scene.seed);
  out += fmt::format("  {:<24}{:>16}{:>12}{:>14}{:>16}{:>18}\n", "limiter", "hottest winding", "over limit",
                     "peak shaft", "impulse", "least allowance");
  for (const Trace& trace : result.traces) {
    out += fmt::format("  {:<24}{:>11.1f} degC{:>10.1f} K{:>12.0f} W{:>13.3f} As{:>16.2f} A", label(result, trace),
                       trace.hottest_true_degC, std::max(0.0, trace.hottest_true_degC - result.winding_max_degC),
                       trace.peak_shaft_W, trace.impulse_As, smallest_allowance_A(trace));
    if (share_of_optimum(result, trace) > 0)
      out += fmt::format("  ({:.1f} % of the optimum)", 100 * share_of_optimum(result, trace));
    out += '\n';
  }
  return out + fmt::format(
                   "  {:.3g} simulated seconds in {:.2f} s of processor time ({:.0f} per second, two axes at 20 kHz)\n",
                   result.simulated_s, result.cpu_s, result.simulated_s / std::max(result.cpu_s, 1e-9));
}

std::string summary_json(const Result& result) {
  nlohmann::ordered_json out;
  out["scene"] = result.scene.id;
  out["motor"] = result.motor_name;
  out["surrogate"] = result.surrogate;
  out["seed"] = result.scene.seed;
  out["winding_max_degC"] = result.winding_max_degC;
  out["optimal_impulse_As"] = result.optimal_impulse_As;
  out["simulated_s_per_cpu_s"] = result.simulated_s / std::max(result.cpu_s, 1e-9);
  for (const Trace& trace : result.traces) {
    out["traces"].push_back({{"limiter", name_of(trace.limiter)},
                             {"axis", trace.axis},
                             {"hottest_core_degC", trace.hottest_true_degC},
                             {"overshoot_K", std::max(0.0, trace.hottest_true_degC - result.winding_max_degC)},
                             {"peak_shaft_W", trace.peak_shaft_W},
                             {"impulse_As", trace.impulse_As},
                             {"share_of_optimum", share_of_optimum(result, trace)},
                             {"smallest_allowance_A", smallest_allowance_A(trace)},
                             {"fault", trace.rows.empty() ? "none" : wire::text_of(trace.rows.back().fault).name}});
  }
  return out.dump(2) + "\n";
}

void write_files(const Result& result, const std::string& folder) {
  for (const Trace& trace : result.traces) {
    const std::string axis = trace.axis == 0 ? "" : "-axis1";
    wire::pc::write_whole(fmt::format("{}/{}{}.csv", folder, name_of(trace.limiter), axis), csv(result, trace));
  }
  draw(result, fmt::format("{}/{}.svg", folder, result.scene.id));
}

}  // namespace boards::host

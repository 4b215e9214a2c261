// SPDX-License-Identifier: MIT
#include "console/live.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

namespace console {
namespace {

constexpr std::size_t most_points = 1000;  // two a character, and terminals are narrower

void push(std::vector<float>& trail, float value) {
  if (trail.size() == most_points) trail.erase(trail.begin());
  trail.push_back(value);
}

std::string label(const char* name, float value, const char* unit) {
  return fmt::format("{} {:.1f} {}", name, value, unit);
}

}  // namespace

std::string mode_text(std::uint8_t mode) {
  constexpr const char* texts[] = {"off", "ready", "running",
                                   "tripped"};  // firmware/mode.hpp, as wire/protocol.hpp tells
  return mode < std::size(texts) ? texts[mode] : fmt::format("mode {}", mode);
}

Json json_of(const wire::State& state, double time_s) {
  Json axes = Json::array();
  for (const wire::AxisReport& axis : state.axis) {
    axes.push_back({{"mode", mode_text(axis.mode)},
                    {"control", wire::text_of(axis.control)},
                    {"limit", wire::text_of(axis.limit).name},
                    {"fault", wire::text_of(axis.fault).name},
                    {"id_A", number(axis.id_A)},
                    {"iq_A", number(axis.iq_A)},
                    {"speed_rad_per_s", number(axis.speed_rad_per_s)},
                    {"rotor_rad", number(axis.rotor_rad)},
                    {"core_degC", number(axis.core_degC)},
                    {"core_sigma_K", number(axis.core_sigma_K)},
                    {"housing_degC", number(axis.housing_degC)},
                    {"allowance_A", number(axis.allowance_A)},
                    {"time_left_s", number(axis.time_left_s)},
                    {"allowance_1s_A", number(axis.allowance_1s_A)}});
  }
  return {{"time_s", number(time_s)}, {"bus_V", number(state.bus_V)}, {"axes", axes}};
}

Live::Live(std::uint8_t mask) : mask_(mask), terminal_(on_terminal()), trails_(wire::axis_count) {}

std::string Live::table(const wire::State& state, double time_s) const {
  std::string text;
  if (terminal_ || lines_ == 0) {
    text = fmt::format("{:>8} {:>7}  {:<5}{:<8}{:<8}{:>8}{:>8}{:>9}{:>14}{:>9}{:>11}   {}\n", "time s", "bus V", "axis",
                       "mode", "control", "id A", "iq A", "rad/s", "core degC", "housing", "allowed A", "limit");
  }
  for (int a = 0; a < wire::axis_count; ++a) {
    if ((mask_ >> a & 1) == 0) continue;
    const wire::AxisReport& axis = state.axis[a];
    const std::string core = fmt::format("{:.1f} +-{:.1f}", axis.core_degC, axis.core_sigma_K);
    const std::string holding = axis.fault != 0                   ? wire::text_of(axis.fault).name
                                : axis.limit != 0                 ? wire::text_of(axis.limit).name
                                : std::isfinite(axis.time_left_s) ? fmt::format("{:.1f} s left", axis.time_left_s)
                                                                  : "";
    text += fmt::format("{:8.2f} {:7.1f}  {:<5}{:<8}{:<8}{:>8.2f}{:>8.2f}{:>9.1f}{:>14}{:>9.1f}{:>11.2f}   {}\n",
                        time_s, state.bus_V, a, mode_text(axis.mode), wire::text_of(axis.control), axis.id_A, axis.iq_A,
                        axis.speed_rad_per_s, core, axis.housing_degC, axis.allowance_A, holding);
  }
  return text;
}

std::string Live::screen(const wire::State& state, double time_s, TerminalSize size, bool colours) {
  std::string text = table(state, time_s);
  const int axes = std::max(1, std::popcount(mask_));
  // Two curves an axis, each with a line of labels, in what the table leaves of the screen.
  const int left = (size.rows - fitted(text, size.columns, size.rows).rows - 1) / axes - 2;
  const int heat_rows = std::clamp(left * 3 / 5, 2, 6), current_rows = std::clamp(left - heat_rows, 2, 4);
  for (int a = 0; a < wire::axis_count; ++a) {
    const wire::AxisReport& axis = state.axis[a];
    Trail& trail = trails_[static_cast<std::size_t>(a)];
    push(trail.core_degC, axis.core_degC);
    push(trail.housing_degC, axis.housing_degC);
    push(trail.iq_A, axis.iq_A);
    push(trail.allowance_A, axis.allowance_A);
    if ((mask_ >> a & 1) == 0) continue;
    const std::string head = fmt::format("axis {} ", a);
    text += plot({{head + label("core", axis.core_degC, "degC"), trail.core_degC},
                  {label("housing", axis.housing_degC, "degC"), trail.housing_degC}},
                 trail.heat, size.columns, heat_rows, colours);
    text += plot({{head + label("iq", axis.iq_A, "A"), trail.iq_A},
                  {label("allowance", axis.allowance_A, "A"), trail.allowance_A}},
                 trail.current, size.columns, current_rows, colours);
  }
  return text;
}

void Live::show(const wire::State& state, double time_s) {
  if (time_s - drawn_s_ < (terminal_ ? 0.05 : 0.5)) return;
  drawn_s_ = time_s;
  std::string text;
  if (terminal_) {
    const TerminalSize size = terminal_size();
    // Up over what was drawn last, then each line over the old one; \033[K clears what the old one had more.
    if (lines_ > 0) text = fmt::format("\033[{}A", lines_);
    const Fitted shown = fitted(screen(state, time_s, size, in_colours()), size.columns, size.rows);
    for (const char c : shown.text) text += c == '\n' ? std::string("\033[K\n") : std::string(1, c);
    lines_ = shown.rows;
  } else {
    text = table(state, time_s);
    lines_ = 1;  // the header stands
  }
  put(text);
}

}  // namespace console

// SPDX-License-Identifier: MIT
#include "identify/log/impossible.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

using wire::pc::refuse_data;

void check_range(const Log& log, Role role, double low, double high, const std::string& unit) {
  for (const double v : log.of(role)) {
    if (v < low || v > high)
      refuse_data(fmt::format("{}: {} reaches {:g}; {} to {} {} is possible: check the unit or mask the value.",
                              log.name, own_name(role), v, low, high, unit));
  }
}

/// Deviations from a mean, or shares of a range, as data sets for machine learning have them, in all columns.
void check_normalised(const Log& log) {
  constexpr double most = 6;  // standard deviations, or what they would be in A, rad/s and degC: no use
  const auto told_small = [&](const auto& roles) {
    double largest = 0;
    for (const Role role : roles) largest = std::max(largest, largest_magnitude(log.of(role)));
    return largest > 0 && largest <= most;
  };
  const auto moves = [&](Role role) { return count_told(log.of(role)) > 0 && !stands(log.of(role)); };
  if (told_small(temperatures) && told_small(load_roles) &&
      std::any_of(std::begin(temperatures), std::end(temperatures), moves))
    refuse_data(
        fmt::format("{}: no column, temperatures and load, exceeds {:g}, as if they were normalised; give them as "
                    "they were measured, in degC, A and rad/s.",
                    log.name, most));
}

/// Is a column called like one phase, ia or I_U?
bool called_like_a_phase(const std::string& column) {
  std::string name = in_small(column.substr(0, column.find_first_of(" [(")));
  std::erase(name, '_');
  if (name.starts_with("phase")) name.replace(0, 5, "i");
  return name.size() == 2 && name[0] == 'i' && std::string_view("abcuvw").find(name[1]) != std::string_view::npos;
}

/// What loggers write for want of a reading, and a DS18B20 as it wakes (85) or its library when it is silent (-127).
/// Where a temperature leaps to it and back as none does, and too often to be glitches (masks.cpp).
void forget_placeholders(Log& log, Role role) {
  constexpr double leap_K = 10, few = 0.05;
  std::vector<double>& v = log.of(role);
  for (const double placeholder : {-1.0, 0.0, 85.0, -127.0}) {
    std::size_t leaps = 0, rows = 0;
    double last = missing, shortest_K = leap_K;
    for (const double x : v) {
      if (std::isnan(x)) continue;
      rows += x == placeholder;
      if (!std::isnan(last) && (x == placeholder) != (last == placeholder)) {
        ++leaps;
        shortest_K = std::min(shortest_K, std::abs(x - last));
      }
      last = x;
    }
    const bool often = static_cast<double>(rows) > few * static_cast<double>(count_told(v));
    if (!often || leaps < 2 || shortest_K < leap_K) continue;
    log.notes.push_back(
        fmt::format("{} leaps to {:g} and back; that stands for no reading, and is left out in {} rows.",
                    own_name(role), placeholder, rows));
    std::replace(v.begin(), v.end(), placeholder, missing);
  }
}

}  // namespace

double lowest(const std::vector<double>& v) {
  double low = missing;
  for (const double x : v) low = std::fmin(low, x);  // which passes over what is missing
  return low;
}

double highest(const std::vector<double>& v) {
  double high = missing;
  for (const double x : v) high = std::fmax(high, x);
  return high;
}

double most_current_A(const std::optional<wire::Motor>& motor) { return motor ? 40 * motor->rated_current_A : 1000; }

void forget_impossible(Log& log) {
  constexpr double zero_K_degC = -273.15, few = 0.05;  // of the readings: more are another unit
  for (const Role role : temperatures) {
    forget_placeholders(log, role);
    const auto impossible =
        std::count_if(log.of(role).begin(), log.of(role).end(), [](double x) { return x < zero_K_degC; });
    if (impossible == 0 || static_cast<double>(impossible) > few * static_cast<double>(count_told(log.of(role))))
      continue;
    log.notes.push_back(
        fmt::format("{} is below 0 K in {} rows, which count as not read.", own_name(role), impossible));
    std::replace_if(
        log.of(role).begin(), log.of(role).end(), [](double x) { return x < zero_K_degC; }, missing);
  }
}

void check_values(const Log& log, const std::optional<wire::Motor>& motor) {
  check_normalised(log);
  for (const Role role : temperatures) {
    if (!log.has(role)) continue;
    const double low = lowest(log.of(role));
    // Nothing that a person works beside is always hotter than 200 degC; 200 K is -73 degC.
    if (low > 450)
      refuse_data(
          fmt::format("{}: {} never falls below {:.0f}, which looks like parts of a degree; say {} (or "
                      "what one is worth).",
                      log.name, own_name(role), low, column_in(log, role, "0.01degC")));
    // A motor that is measured begins above -23 degC and stays below 200; a room is 10..45 degC, which reads 50..113 in
    // Fahrenheit.
    const bool kelvin = low > 250 && largest_magnitude(log.of(role)) < 473;
    if (low > 200 || (role == Role::ambient && low > 113))
      refuse_data(fmt::format(
          "{}: {} never falls below {:.0f}, which looks like {}.", log.name, own_name(role), low,
          kelvin ? fmt::format("kelvin; say {} (or :0.1degC of tenths of a degree)", column_in(log, role, "K"))
                 : fmt::format("tenths of a degree; say {}", column_in(log, role, "0.1degC"))));
    // Coolant and motors may truly be that warm, a room may not.
    if (role == Role::ambient && low > 55)
      refuse_data(
          fmt::format("{}: ambient_degC never falls below {:.0f}, which looks like Fahrenheit; say {} (and the same "
                      "for the other temperatures).",
                      log.name, low, column_in(log, role, "degF")));
    check_range(log, role, -80, 600, "degC");
  }
  // Without anything that says how warm it is around the motor, a motor that is never cooler than a room can be is no
  // use, whatever its unit.
  const Role motor_at = log.has(Role::housing) ? Role::housing : Role::core;
  if (!log.has(sink_of(log)) && lowest(log.of(motor_at)) > 55)
    refuse_data(
        fmt::format("{0}: {1} never falls below {2:.0f} and there is no ambient_degC: say how warm the room was, "
                    "--ambient DEGC, or record it; if this is Fahrenheit say {3}.",
                    log.name, own_name(motor_at), lowest(log.of(motor_at)), column_in(log, motor_at, "degF")));
  // Beside a meter's offset and noise.
  constexpr double clearly = 0.05, often = 0.01;
  const std::vector<double>& power = log.of(Role::power);
  const double below_W = -clearly * largest_magnitude(power);
  const auto negative = std::count_if(power.begin(), power.end(), [&](double W) { return W < below_W; });
  if (static_cast<double>(negative) > often * static_cast<double>(count_told(power)))
    refuse_data(fmt::format(
        "{}: power_W is negative in {} rows, as what heats a winding never is: this is what the shaft or the supply "
        "gives and takes; map the current instead, or the loss alone.",
        log.name, negative));
  const double most_A = most_current_A(motor);
  for (const Role role : {Role::current, Role::id, Role::iq}) {
    const double peak = largest_magnitude(log.of(role));
    if (peak > most_A)
      refuse_data(
          fmt::format("{0}: {1} reaches {2:.0f} A, where more than {3:.0f} A cannot be; if it is in mA say "
                      "{4} (or what one is worth), if it is another quantity map the right column.",
                      log.name, own_name(role), peak, most_A, column_in(log, role, "mA")));
  }
  if (log.has(Role::speed)) check_range(log, Role::speed, -2e4, 2e4, "rad/s");
}

void check_alone(const Log& log, const std::map<Role, Source>& found) {
  for (const Role role : {Role::current, Role::iq}) {
    const auto source = found.find(role);
    const auto alternates = [&] { return lowest(log.of(role)) < -0.5 * largest_magnitude(log.of(role)); };
    if (source != found.end() && called_like_a_phase(source->second.column) && alternates())
      refuse_data(
          fmt::format("{}: column '{}' is called like one phase, whose current alternates; map all of them "
                      "(--column phase_a_A={} and phase_b_A, phase_c_A).",
                      log.name, source->second.column, source->second.column));
  }
}

void check_order(const Log& log) {
  if (!log.has(Role::housing) || !log.has(Role::core) || !log.has(Role::current)) return;
  constexpr double apart_s = 20;  // far enough for a winding to have moved, and noise not to count
  const auto &t = log.of(Role::time), &housing = log.of(Role::housing), &core = log.of(Role::core),
             &current = log.of(Role::current);
  double housing2 = 0, core2 = 0, over2 = 0, heat2 = 0, together = 0;
  int pairs = 0;
  double sum_A2 = 0, rows = 0, mean_A2 = 0, last_mean_A2 = 0;
  std::size_t last = t.size();
  for (std::size_t i = 0; i < t.size(); ++i) {
    if (!std::isnan(current[i])) sum_A2 += current[i] * current[i], ++rows;
    if (std::isnan(housing[i]) || std::isnan(core[i])) continue;
    if (last < t.size() && t[i] - t[last] < apart_s) continue;
    last_mean_A2 = mean_A2;
    mean_A2 = sum_A2 / std::max(rows, 1.0);
    sum_A2 = rows = 0;
    if (last < t.size()) {
      const double housing_K = housing[i] - housing[last], core_K = core[i] - core[last];
      const double over_K = core_K - housing_K, heat_A2 = mean_A2 - last_mean_A2;
      housing2 += housing_K * housing_K;
      core2 += core_K * core_K;
      over2 += over_K * over_K;
      heat2 += heat_A2 * heat_A2;
      together += over_K * heat_A2;
      ++pairs;
    }
    last = i;
  }
  // A correlation of -0.35 in ten pairs is chance in one of six, and the other condition another. A sensor that sits on
  // the winding moves as much as it does, by chance a little more; a housing that a warm frame moves, 1.31 times (score
  // designed-sparse, frame_conduction 75001255).
  constexpr double clearly = 2;
  if (pairs < 10 || !(housing2 > clearly * core2) || !(together < -0.35 * std::sqrt(over2 * heat2))) return;
  refuse_data(
      fmt::format("{}: core_degC falls against housing_degC when the current rises, and moves less: the two "
                  "columns are swapped; map them with --column.",
                  log.name));
}

}  // namespace identify

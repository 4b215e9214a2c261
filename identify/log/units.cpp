// SPDX-License-Identifier: MIT
#include "identify/log/units.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <map>
#include <numbers>

namespace identify {
namespace {

using std::numbers::pi;
using wire::pc::Exit;
using wire::pc::UserError;

const std::map<std::string, Unit>& units() {
  static const std::map<std::string, Unit> table = {
      {"s", {"time", 1, 0}},
      {"ms", {"time", 1e-3, 0}},
      {"us", {"time", 1e-6, 0}},
      {"ns", {"time", 1e-9, 0}},
      {"min", {"time", 60, 0}},
      {"h", {"time", 3600, 0}},
      {"d", {"time", 86400, 0}},
      {"A", {"current", 1, 0}},
      {"mA", {"current", 1e-3, 0}},
      {"kA", {"current", 1e3, 0}},
      {"W", {"power", 1, 0}},
      {"mW", {"power", 1e-3, 0}},
      {"kW", {"power", 1e3, 0}},
      {"Nm", {"torque", 1, 0}},
      {"mNm", {"torque", 1e-3, 0}},
      {"V", {"voltage", 1, 0}},
      {"mV", {"voltage", 1e-3, 0}},
      {"degC", {"temperature", 1, 0}},
      {"C", {"temperature", 1, 0}},
      {"°C", {"temperature", 1, 0}},
      {"K", {"temperature", 1, -273.15}},
      {"degF", {"temperature", 5.0 / 9.0, -32}},
      {"F", {"temperature", 5.0 / 9.0, -32}},
      {"°F", {"temperature", 5.0 / 9.0, -32}},
      {"rad_per_s", {"speed", 1, 0}},
      {"rad/s", {"speed", 1, 0}},
      {"rpm", {"speed", pi / 30, 0}},
      {"rev/s", {"speed", 2 * pi, 0}},
      {"deg/s", {"speed", pi / 180, 0}},
      {"deg_per_s", {"speed", pi / 180, 0}},
      {"Hz", {"speed", 2 * pi, 0}},
      {"ohm", {"resistance", 1, 0}},
      {"mohm", {"resistance", 1e-3, 0}},
      {"1", {"number", 1, 0}},
  };
  return table;
}

/// How loggers spell these too, in small letters and without blanks.
const std::map<std::string, std::string>& spellings() {
  static const std::map<std::string, std::string> table = {
      {"rpm", "rpm"},         {"1/min", "rpm"},       {"min-1", "rpm"}, {"min^-1", "rpm"},      {"u/min", "rpm"},
      {"r/min", "rpm"},       {"rev/min", "rpm"},     {"rps", "rev/s"}, {"rad/sec", "rad/s"},   {"rads-1", "rad/s"},
      {"rad*s^-1", "rad/s"},  {"deg/sec", "deg/s"},   {"amp", "A"},     {"amps", "A"},          {"ampere", "A"},
      {"amperes", "A"},       {"mamp", "mA"},         {"mamps", "mA"},  {"milliamps", "mA"},    {"watt", "W"},
      {"watts", "W"},         {"sec", "s"},           {"secs", "s"},    {"second", "s"},        {"seconds", "s"},
      {"ms", "ms"},           {"us", "us"},           {"ns", "ns"},     {"msec", "ms"},         {"usec", "us"},
      {"nsec", "ns"},         {"minutes", "min"},     {"hours", "h"},   {"days", "d"},          {"kelvin", "K"},
      {"degc", "degC"},       {"celsius", "degC"},    {"degf", "degF"}, {"fahrenheit", "degF"}, {"nm", "Nm"},
      {"n·m", "Nm"},          {"n*m", "Nm"},          {"n.m", "Nm"},    {"ohms", "ohm"},        {"°c", "degC"},
      {"ºc", "degC"},         {"°f", "degF"},         {"ºf", "degF"},  // º: the sign of an ordinal
      {"rad_s", "rad/s"},     {"deg_s", "deg/s"},     {"dps", "deg/s"}, {"deg_c", "degC"},      {"deg_f", "degF"},
      {"turn/s", "rev/s"},    {"turns/s", "rev/s"},   {"hz", "Hz"},                    // as programs write
      {"℃", "degC"},          {"℉", "degF"},          {"µs", "us"},     {"μs", "us"},  // the sign micro, the letter mu
      {"Ω", "ohm"},           {"mΩ", "mohm"},         {"Ω", "ohm"},     {"mΩ", "mohm"},  // the letter, the sign ohm
      {"nmm", "mNm"},         {"n.mm", "mNm"},        {"n·mm", "mNm"},  {"rad.s-1", "rad/s"},   {"radpersec", "rad/s"},
      {"degpersec", "deg/s"}, {"rotpersec", "rev/s"},
  };
  return table;
}

std::string quantity_of_role(const std::string& role) {
  std::string quantity;
  for (std::size_t cut = role.find('_'); cut != std::string::npos && quantity.empty(); cut = role.find('_', cut + 1))
    quantity = quantity_of(role.substr(cut + 1));
  return quantity;
}

std::optional<Unit> multiple_of_unit(const std::string& text) {
  double many = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), many);
  if (error != std::errc() || !(many > 0) || !std::isfinite(many)) return std::nullopt;
  auto unit = unit_named(end);
  if (unit) unit->factor *= many, unit->offset /= many;
  return unit;
}

}  // namespace

std::optional<Unit> unit_named(const std::string& unit) {
  // Names in small letters alone, as programs like them, have milliamperes so; MA is another unit.
  auto at = units().find(unit == "ma" ? "mA" : unit == "mv" ? "mV" : unit);
  if (at == units().end()) {
    std::string plain;
    for (const char c : unit) {
      if (c != ' ') plain += c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
    }
    const auto spelling = spellings().find(plain);
    if (spelling == spellings().end()) return multiple_of_unit(unit);
    at = units().find(spelling->second);
  }
  return at->second;
}

std::vector<std::string> unit_names() {
  std::vector<std::string> names;
  for (const auto& [name, unused] : units()) names.push_back(name);
  return names;
}

std::string quantity_of(const std::string& suffix) {
  const auto unit = unit_named(suffix);
  return unit ? unit->quantity : std::string();
}

std::string bracketed(const std::string& column) {
  const std::size_t open = column.find_last_of("([");
  if (open == std::string::npos || !(column.ends_with(')') || column.ends_with(']'))) return "";
  return column.substr(open + 1, column.size() - open - 2);
}

std::string unit_in_name(const std::string& column, const std::string& role) {
  const std::string wanted = quantity_of_role(role);
  const auto fits = [&](const std::string& unit) { return !wanted.empty() && quantity_of(unit) == wanted; };
  if (const std::string unit = bracketed(column); !unit.empty()) return fits(unit) ? unit : "";
  // A name may be one (RPM), or end in one: speed_rpm, MotorRPM, n/rpm. One letter is one behind a slash alone, T/K.
  const auto small = [&](std::size_t at) { return column[at] >= 'a' && column[at] <= 'z'; };
  const auto capital = [&](std::size_t at) { return column[at] >= 'A' && column[at] <= 'Z'; };
  for (std::size_t at = 0; at < column.size(); ++at) {
    const char before = at == 0 ? '_' : column[at - 1];
    const bool begins =
        std::string_view("_ ./").find(before) != std::string_view::npos || (at > 0 && small(at - 1) && capital(at));
    const std::string unit = column.substr(at);
    if (begins && (unit.size() > 1 || before == '/') && fits(unit)) return unit;
  }
  return "";
}

void apply_unit(const std::string& unit, const std::string& role, const std::string& where, Exit blame, double& factor,
                double& offset) {
  const auto known = unit_named(unit);
  if (!known)
    throw UserError(blame,
                    fmt::format("{}: unknown unit '{}'; units: {}.", where, unit, fmt::join(unit_names(), ", ")));
  const std::string wanted = quantity_of_role(role);
  if (!wanted.empty() && wanted != known->quantity) {
    throw UserError(blame, fmt::format("{}: {} is a {}, but {} is a {}; map another column.", where, unit,
                                       known->quantity, role, wanted));
  }
  factor = known->factor;
  offset = known->offset;
}

}  // namespace identify

// SPDX-License-Identifier: MIT
#include "identify/log/cell.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <iterator>

#include "identify/log/units.hpp"

namespace identify {
namespace {

/// Digits and nothing else as a whole number.
bool digits(std::string_view s, int& value) {
  const auto [end, error] = std::from_chars(s.data(), s.data() + s.size(), value);
  return error == std::errc() && end == s.data() + s.size() && s.front() != '-';
}

/// 08:15:30.5 as seconds, or what a stopwatch shows, 1:05.3 or 2:01:05 (with a fraction where there are no hours: 12:30
/// may be a time of day).
bool on_a_clock(std::string_view s, double& value) {
  int first = 0, minute = 0;
  const std::size_t colon = s.find(':'), last = s.rfind(':');
  if (colon == std::string_view::npos || colon > 2 || !digits(s.substr(0, colon), first)) return false;
  const std::string_view seconds = s.substr(last + 1);
  if (seconds.size() < 2 || (colon == last && seconds.size() < 4)) return false;
  if (colon != last && (last != colon + 3 || !digits(s.substr(colon + 1, 2), minute))) return false;
  double second = 0;
  const auto [end, error] = std::from_chars(seconds.data(), seconds.data() + seconds.size(), second);
  if (error != std::errc() || end != seconds.data() + seconds.size() || !(second >= 0 && second < 61)) return false;
  value = (colon == last ? 60 * first : 3600 * first + 60 * minute) + second;
  return true;
}

/// Takes " AM" or " PM" off: 'a', 'p', or 0 where neither stands there.
char take_half_of_day(std::string_view& s) {
  const std::string half = s.size() < 3 ? "" : in_small(s.substr(s.size() - 3));
  if (half != " am" && half != " pm") return 0;
  s.remove_suffix(3);
  return half[1];
}

/// Of a clock of twelve hours, where a half of the day is said.
double since_midnight_s(double on_a_clock_s, char half) {
  if (half == 0) return on_a_clock_s;
  return on_a_clock_s + 3600 * ((half == 'p' ? 12 : 0) - (on_a_clock_s >= 12 * 3600 ? 12 : 0));
}

/// A date by itself: 2026-11-21 as in ISO 8601 or 2026/11/21, 21.11.2026 as in Germany, 21-Nov-2026 as in MATLAB, and
/// 11/21/2026 beside a clock of twelve hours, as in America; else 11/21 and 21/11 cannot be told apart.
bool date_of(std::string_view s, bool american, std::chrono::year_month_day& date) {
  constexpr std::string_view months = "jan feb mar apr may jun jul aug sep oct nov dec";
  const std::size_t first = s.find_first_of("-/.");
  const std::size_t second = first == std::string_view::npos ? first : s.find(s[first], first + 1);
  if (second == std::string_view::npos) return false;
  std::string_view year = s.substr(0, first), month = s.substr(first + 1, second - first - 1),
                   day = s.substr(second + 1);
  const char separator = s[first];
  const bool year_last = year.size() != 4;
  if (year_last) {
    std::swap(year, day);
    if (separator == '/') std::swap(month, day);
    if (year.size() != 4 || (separator == '/' && !american)) return false;
  } else if (separator == '.') {
    return false;
  }
  int y = 0, m = 0, d = 0;
  if (const std::size_t name = month.size() == 3 ? months.find(in_small(month)) : std::string_view::npos;
      name != std::string_view::npos)
    m = static_cast<int>(name / 4) + 1;
  else if (separator == '-' && year_last)
    return false;
  else if (month.size() > 2 || month.empty() || !digits(month, m))
    return false;
  if (day.size() > 2 || day.empty() || !digits(day, d) || !digits(year, y)) return false;
  date = {std::chrono::year(y), std::chrono::month(static_cast<unsigned>(m)),
          std::chrono::day(static_cast<unsigned>(d))};
  return date.ok();
}

/// A date and time (2026-11-21T08:15:30.5+01:00), s since 1970; a time of day; or what MATLAB and pandas write of a
/// duration (12.5 sec, 0 days 00:00:12.5).
bool moment(std::string_view s, double& value) {
  int hours = 0, minutes = 0, days = 0;
  if (time_of_day(s, value)) return true;
  if (s.ends_with(" sec")) return number_in(s.substr(0, s.size() - 4), false, value);
  const std::size_t begin = s.find_first_of(" T");
  if (begin == std::string_view::npos || begin == 0) return false;
  std::string_view clock = s.substr(begin + 1);
  if (clock.starts_with("days ") && digits(s.substr(0, begin), days)) {
    if (!time_of_day(clock.substr(5), value)) return false;
    value += 86400.0 * days;
    return true;
  }
  double ahead_s = 0;
  const char half = take_half_of_day(clock);
  if (clock.ends_with(" UTC") || clock.ends_with(" GMT")) clock.remove_suffix(4);
  std::chrono::year_month_day date;
  if (clock.empty() || !date_of(s.substr(0, begin), half != 0, date)) return false;
  if (clock.back() == 'Z') {
    clock.remove_suffix(1);
  } else if (const std::size_t sign = clock.find_first_of("+-"); sign != std::string_view::npos) {
    std::string_view zone = clock.substr(sign + 1);
    if (zone.size() < 2 || !digits(zone.substr(0, 2), hours)) return false;
    zone.remove_prefix(zone.size() > 2 && zone[2] == ':' ? 3 : 2);
    if (!zone.empty() && !digits(zone, minutes)) return false;
    ahead_s = (clock[sign] == '-' ? -60 : 60) * (60 * hours + minutes);
    clock = clock.substr(0, sign);
  }
  std::string told(trimmed(clock));
  if (std::count(told.begin(), told.end(), ':') == 1) told += ":00";  // beside a date it is no stopwatch
  if (!on_a_clock(told, value)) return false;
  value = since_midnight_s(value, half);
  value += 86400.0 * static_cast<double>(std::chrono::sys_days(date).time_since_epoch().count()) - ahead_s;
  return true;
}

}  // namespace

std::string_view trimmed(std::string_view s) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!s.empty() && blank(s.front())) s.remove_prefix(1);
  while (!s.empty() && blank(s.back())) s.remove_suffix(1);
  return s;
}

std::string in_small(std::string_view s) {
  std::string low(s);
  std::transform(low.begin(), low.end(), low.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  return low;
}

bool means_missing(std::string_view s) {
  if (s.empty()) return true;
  // #NV: a German spreadsheet's #N/A; \N: a database's; 1.#: an old C library's.
  constexpr std::string_view words[] = {"nan",     "-nan",    "-nan(ind)", "na",      "n/a",    "n.a.",
                                        "#n/a",    "#nv",     "<na>",      "nat",     "null",   "none",
                                        "\\n",     "1.#qnan", "1.#ind",    "-1.#ind", "1.#inf", "-1.#inf",
                                        "#div/0!", "#value!", "-",         "--",      "---",    "?"};
  return s.size() < 10 && std::find(std::begin(words), std::end(words), in_small(s)) != std::end(words);
}

bool time_of_day(std::string_view s, double& value) {
  const char half = take_half_of_day(s);
  if (!on_a_clock(s, value)) return false;
  value = since_midnight_s(value, half);
  return true;
}

bool day_in(std::string_view s, double& days) {
  std::chrono::year_month_day date;
  if (!date_of(s, false, date)) return false;
  days = static_cast<double>(std::chrono::sys_days(date).time_since_epoch().count());
  return true;
}

bool stroked_date(std::string_view s, double& month_first_s, double& day_first_s) {
  const std::size_t begin = s.find(' ');
  std::string clock(begin == std::string_view::npos ? "" : trimmed(s.substr(begin))), date(s.substr(0, begin));
  const auto colons = std::count(clock.begin(), clock.end(), ':');
  if (colons == 1) clock += ":00";
  if (colons == 3) clock[clock.rfind(':')] = '.';  // 17:30:00:250, as Keysight's recorders write
  double clock_s = 0;
  const std::size_t stroke = date.find_first_of("/-");
  if (stroke > 2 || (!clock.empty() && !on_a_clock(clock, clock_s))) return false;
  std::replace(date.begin(), date.end(), '-', '/');
  const auto since_1970_s = [&](bool month_first) {
    std::chrono::year_month_day day;
    if (!date_of(date, month_first, day)) return missing;
    return 86400.0 * static_cast<double>(std::chrono::sys_days(day).time_since_epoch().count()) + clock_s;
  };
  month_first_s = since_1970_s(true);
  std::replace(date.begin(), date.end(), '/', '.');
  day_first_s = since_1970_s(false);
  return !std::isnan(month_first_s) || !std::isnan(day_first_s);
}

bool like_a_moment(std::string_view s) {
  const auto many = [&](char c) { return std::count(s.begin(), s.end(), c); };
  return s.find_first_of("0123456789") != std::string_view::npos &&
         (many(':') > 0 || many('/') > 0 || many('.') > 1 || many('-') > 1);
}

bool number_in(std::string_view s, bool decimal_comma, double& value) {
  if (means_missing(s)) return value = missing, true;
  std::string changed;
  if (decimal_comma && s.find(',') != std::string_view::npos) {
    changed = s;
    std::replace(changed.begin(), changed.end(), ',', '.');
    s = changed;
  }
  std::string joined;  // some loggers set the sign apart: "-   3.2"
  if (s.front() == '+') {
    s = trimmed(s.substr(1));
  } else if (s.starts_with("- ")) {
    joined.append("-").append(trimmed(s.substr(1)));
    s = joined;
  }
  const auto [end, error] = std::from_chars(s.data(), s.data() + s.size(), value);
  if (error == std::errc::result_out_of_range) return value = missing, end == s.data() + s.size();
  if (error != std::errc() || end != s.data() + s.size()) return moment(s, value) || (value = missing, false);
  if (!std::isfinite(value)) value = missing;
  return true;
}

bool number_and_unit_in(std::string_view cell, bool decimal_comma, double& value, std::string& unit) {
  const std::size_t blank = cell.rfind(' '), degree = cell.rfind("\u00b0");  // 21.9°C; 1F may be no temperature
  const std::size_t begin = blank != std::string_view::npos ? blank + 1 : degree;
  if (begin == std::string_view::npos || begin == 0) return false;
  unit = cell.substr(begin);
  return unit_named(unit) && number_in(trimmed(cell.substr(0, begin)), decimal_comma, value);
}

}  // namespace identify

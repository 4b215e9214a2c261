// SPDX-License-Identifier: MIT
// What one cell of a table says: a number, a moment, nothing.
#pragma once

#include <limits>
#include <string>
#include <string_view>

namespace identify {

inline constexpr double missing = std::numeric_limits<double>::quiet_NaN();

/// Without blanks, tabs and carriage returns at its ends.
std::string_view trimmed(std::string_view s);
std::string in_small(std::string_view s);  // of the letters A to Z

bool means_missing(std::string_view s);

/// A cell as a number; false when it is neither a number nor a word for "missing". An infinite value counts as missing,
/// a date and time as s since 1970, a time of day or a duration as s.
bool number_in(std::string_view s, bool decimal_comma, double& value);
/// A number with a unit behind it, as dashboards export them: 22.9 °C.
bool number_and_unit_in(std::string_view cell, bool decimal_comma, double& value, std::string& unit);

/// A time without a date, as s since midnight; or what a stopwatch shows.
bool time_of_day(std::string_view s, double& value);
/// A date without a time, as days since 1970.
bool day_in(std::string_view s, double& days);
/// A date between strokes, its day or its month first (1/8/2023, 01-08-2023), alone or with a time of 24 hours behind
/// it: s since 1970 of either, missing where there is no such month.
bool stroked_date(std::string_view s, double& month_first_s, double& day_first_s);
/// Perhaps a date or a time, in no form that is read.
bool like_a_moment(std::string_view s);

}  // namespace identify

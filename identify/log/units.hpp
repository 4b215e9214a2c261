// SPDX-License-Identifier: MIT
// Units that loggers write, and how each becomes SI (temperatures: degrees Celsius). The one door for conversions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "wire/pc/user_error.hpp"

namespace identify {

struct Unit {
  std::string quantity;   // "time", "current", "temperature", ...
  double factor, offset;  // SI = factor * (value + offset)
};

/// Also of so many of a unit, 0.01degC.
std::optional<Unit> unit_named(const std::string& unit);
std::vector<std::string> unit_names();

/// Quantity of one of our own unit suffixes ("A", "degC", "rad_per_s"); empty when it is none.
std::string quantity_of(const std::string& suffix);

/// What stands in brackets at the end of a column's name; else empty.
std::string bracketed(const std::string& column);

/// The unit that a column's name ends in, where it is one of what `role` (an own name, unit included) measures: "Time
/// (ms)", "I [mA]", "current_mA"; else empty. A bare letter is none: T_K and motor_C may be anything.
std::string unit_in_name(const std::string& column, const std::string& role);

/// Sets factor and offset for a column in `unit` that plays `role` (an own name, unit included). Throws UserError
/// (`blame`: the command line or the log), saying `where`, when the unit is unknown or measures something else.
void apply_unit(const std::string& unit, const std::string& role, const std::string& where, wire::pc::Exit blame,
                double& factor, double& offset);

}  // namespace identify

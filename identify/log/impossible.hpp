// SPDX-License-Identifier: MIT
// What no motor shows: a wrong unit, columns swapped or normalised, a sensor that is not there. Refuses it, or takes it
// for not read and says so.
#pragma once

#include <map>
#include <optional>

#include "identify/log/log.hpp"

namespace identify {

/// 40 times rated current would heat any winding of the sheet by hundreds of kelvin a second; without a sheet 1000 A is
/// beyond any board this project drives or any traction log it was shown.
double most_current_A(const std::optional<wire::Motor>& motor);

/// The least of what is told; missing when nothing is.
double lowest(const std::vector<double>& column);
double highest(const std::vector<double>& column);

/// What a logger writes for a sensor that does not answer, -999 or -32768, is no temperature.
void forget_impossible(Log& log);

/// Units that a header did not tell: values that no motor shows.
void check_values(const Log& log, const std::optional<wire::Motor>& motor);

/// A column that is called like one phase, whose current alternates, tells less than it is taken for.
void check_alone(const Log& log, const std::map<Role, Source>& found);

/// More current makes a winding hotter than its housing within seconds. Where it makes it cooler, and the housing moves
/// more than the winding, the two columns are swapped. One sign alone may be a sensor's gain or noise; not both.
void check_order(const Log& log);

}  // namespace identify

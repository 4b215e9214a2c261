// SPDX-License-Identifier: MIT
// A measured log: what the columns of a table mean, in SI units and degrees Celsius.
//
//   in   a table; a map (file or --column) for foreign names and units
//   out  one Log per session, time rising, every column either empty or as long as the time, NaN where missing
//
// Refuses what cannot be: a wrong unit, time that runs backwards, values no motor has. Knows nothing of models.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "identify/log/column_map.hpp"
#include "identify/log/table.hpp"
#include "wire/motor.hpp"

namespace identify {

/// Where copper's straight line, 0.393 %/K of 20 degC, has no resistance left: from there a winding's temperature goes
/// in proportion to it.
inline constexpr double no_ohm_degC = 20 - 1 / 0.00393;

/// Of a motor as warm as its surroundings: two sensors beside each other differ by as much.
inline constexpr double soaked_K = 1;

/// What a winding that its resistance tells goes by.
struct Reference {
  double degC = missing;     // the motor at rest
  std::size_t readings = 0;  // of the resistance there; 0: the winding was read as a temperature
};

struct Log {
  std::string name;
  std::array<std::vector<double>, role_count> columns;
  std::array<std::string, role_count> called;  // what the file calls them; empty for what was derived
  std::vector<std::string> notes;              // what was repaired, masked or assumed, one sentence each
  double missing_share = 0;  // of housing (else core) readings, of input cells or of whole rows: the worst of these
  double gap_share = 0;      // of the duration, what lies in gaps
  std::vector<double> resumes_s;  // where it goes on after a pause in which nothing tells the heat (pauses.hpp)
  double sink_degC = missing;     // of a part of a log that tells no sink: what the whole began at
  bool sink_typed = false;        // it was said once for the whole log (--ambient)
  double housing_step_K = 0;      // of a sensor so coarse that only its steps are readings; else 0
  double core_step_K = 0;         // of one as coarse, however it is read
  Reference core_reference = {};  // of readings of the winding
  bool torque_for_A = false;      // a torque stands in iq_A as it is, for want of the motor's constant
  bool speed_guessed = false;     // in which unit it is, to be rad/s
  bool loaded_before = false;     // a row's load flowed since the row before, not until the next one
  bool averaged = false;          // and is all of that, a current's rms or a power's mean: no draw of it

  const std::vector<double>& of(Role r) const { return columns[static_cast<std::size_t>(r)]; }
  std::vector<double>& of(Role r) { return columns[static_cast<std::size_t>(r)]; }
  bool has(Role r) const { return !of(r).empty(); }
};

/// Of the most of a log, what counts as nothing: of its heat a sensor's offset; of its speed less than a thousandth of
/// what goes by the square.
inline constexpr double idle_heat_share = 1e-3, idle_speed_share = 0.02;

/// Does it go on, after a pause, between these times?
bool resumes(const Log& log, double after_s, double until_s);

/// How a column is read in another unit, as a command line takes it: --column housing_degC=T_case:degF.
std::string column_in(const Log& log, Role role, const std::string& unit);

/// What tells the heat: a power, else a current; iq of currents along two axes.
Role heat_of(const Log& log);
const char* heat_word(const Log& log);  // "current", "power" or "torque"

/// What takes the heat away: the coolant, else the ambient.
Role sink_of(const Log& log);

/// What the housing, or else the winding, shows before anything flows or turns, on average; its first reading where
/// something does at once; NaN: none.
double first_degC(const Log& log);

/// The rows before the last `fraction` of the log's time, one at least.
Log without_last(Log log, double fraction);

/// Each row with what the next one has, the last with its own.
std::vector<double> a_row_sooner(std::vector<double> column);

/// The same, each row's load taken for what flowed since the row before it; a note says so, and why.
Log loaded_before(Log log, const char* why);

/// The logs in a table: one, or one a session. Throws UserError (unusable; usage of a map that does not fit) in one
/// sentence.
std::vector<Log> logs_of(Table table, const ColumnMap& map, const std::optional<wire::Motor>& motor);

}  // namespace identify

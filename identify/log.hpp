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

#include "identify/table.hpp"
#include "wire/motor.hpp"

namespace identify {

/// What a column may be. Bus and board are read and checked, and nothing is made of them yet; winding_ohm becomes core
/// where the start of a log tells its temperature, phases become current, torque becomes iq where nothing else tells
/// the heat.
enum class Role {
  time,
  current,
  id,
  iq,
  phase_a,
  phase_b,
  phase_c,
  power,
  torque,
  speed,
  bus_V,
  bus_A,
  core,
  housing,
  ambient,
  coolant,
  frame,
  neighbour,
  board,
  winding_ohm,
  session,
  count
};
inline constexpr std::size_t role_count = static_cast<std::size_t>(Role::count);
/// What flows and turns.
inline constexpr Role load_roles[] = {Role::current, Role::id, Role::iq, Role::power, Role::speed};

/// What is read in degC, the motor's own first.
inline constexpr Role temperatures[] = {Role::core,  Role::housing,   Role::ambient, Role::coolant,
                                        Role::frame, Role::neighbour, Role::board};

/// Every role and every unit that a column may be given, one line each, for --help.
std::string roles_and_units();

/// The name under which a role is recognised without a map, unit included ("housing_degC").
const std::string& own_name(Role role);

struct Source {
  std::string column;
  double factor = 1, offset = 0;  // SI = factor * (cell + offset)
  bool unit_said = false;         // else a row of units in the table may say it, or the column's name
  std::string said = "";          // column and unit as they were written
};

/// Which column plays which role, and how its unit becomes ours.
struct ColumnMap {
  std::map<Role, Source> columns;
  double period_s = missing;      // from row to row of logs without a clock
  double ambient_degC = missing;  // of logs without a sink
  std::string rows;               // "motor=left": only these (rows.hpp)
  std::string note;               // what a person should know of these logs, printed in the report
};

/// Reads a map file: [columns] with role = "column" or role = { column = "...", unit = "rpm" }, and, where wanted, a
/// note and period_s.
ColumnMap read_map(const std::string& path);

/// Adds "role=column" or "role=column:unit" to a map; `from`: where it was said, for complaints.
void add_column(ColumnMap& map, const std::string& text, const std::string& from = "--column ");

/// Where copper's straight line, 0.393 %/K of 20 degC, has no resistance left: from there a winding's temperature goes
/// in proportion to it.
inline constexpr double no_ohm_degC = 20 - 1 / 0.00393;

/// What a winding that its resistance tells goes by.
struct Reference {
  double degC = missing;     // the motor at rest
  std::size_t readings = 0;  // of the resistance there; 0: the winding was read as a temperature
};

struct Log {
  std::string name;
  std::array<std::vector<double>, role_count> columns;
  std::vector<std::string> notes;  // what was repaired, masked or assumed, one sentence each
  double missing_share = 0;  // of housing (else core) readings, of input cells or of whole rows: the worst of these
  double gap_share = 0;      // of the duration, what lies in gaps
  std::vector<double> resumes_s;  // where it goes on after a pause in which nothing tells the heat (pauses.hpp)
  double sink_degC = missing;     // of a part of a log that tells no sink: what the whole began at
  bool sink_typed = false;        // it was said once for the whole log (--ambient)
  double housing_step_K = 0;      // of a sensor so coarse that only its steps are readings; else 0
  Reference core_reference = {};  // of readings of the winding
  bool torque_for_A = false;      // a torque stands in iq_A as it is, for want of the motor's constant
  bool loaded_before = false;     // a row's load flowed since the row before, not until the next one

  const std::vector<double>& of(Role r) const { return columns[static_cast<std::size_t>(r)]; }
  std::vector<double>& of(Role r) { return columns[static_cast<std::size_t>(r)]; }
  bool has(Role r) const { return !of(r).empty(); }
};

/// Does it go on, after a pause, between these times?
bool resumes(const Log& log, double after_s, double until_s);

/// What tells the heat: a power, else a current; iq of currents along two axes.
Role heat_of(const Log& log);

/// What takes the heat away: the coolant, else the ambient.
Role sink_of(const Log& log);

/// What the housing, or else the winding, shows before anything flows or turns, on average; its first reading where
/// something does at once; NaN: none.
double first_degC(const Log& log);

/// The rows before the last `fraction` of the log's time.
Log without_last(Log log, double fraction);

/// Each row with what the next one has, the last with its own.
std::vector<double> a_row_sooner(std::vector<double> column);

/// The same, each row's load taken for what flowed since the row before it; a note says so.
Log loaded_before(Log log);

/// The logs in a table: one, or one a session. Throws UserError (unusable; usage of a map that does not fit) in one
/// sentence.
std::vector<Log> logs_of(Table table, const ColumnMap& map, const std::optional<wire::Motor>& motor);

}  // namespace identify

// SPDX-License-Identifier: MIT
// What the columns of a table are: the roles they may have, and who says so, a person, a map file, or a column's name.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "identify/log/table.hpp"

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

/// Every role that a column may be given on a line, and every unit on another, for --help.
std::string roles_and_units();

/// The name under which a role is recognised without a map, unit included ("housing_degC").
const std::string& own_name(Role role);

/// In quotation marks where a shell would take it apart.
std::string for_a_shell(const std::string& word);

struct Source {
  std::string column;
  double factor = 1, offset = 0;  // SI = factor * (cell + offset)
  bool unit_said = false;         // else a row of units in the table may say it, or the column's name
  std::string said = "";          // column and unit as they were written
  bool unit_guessed = false;      // nobody told it, and it is one of several that are usual
};

/// Which column plays which role, and how its unit becomes ours.
struct ColumnMap {
  std::map<Role, Source> columns;
  double period_s = missing;      // from row to row of logs without a clock
  double ambient_degC = missing;  // of logs without a sink
  bool averaged = false;          // Log::averaged
  std::string rows;               // "motor=left": only these (rows.hpp)
  std::string note;               // what a person should know of these logs, printed in the report
  std::string folder;             // of maps that came along: a refusal names the one that fits
};

/// Reads a map file: [columns] with role = "column" or role = { column = "...", unit = "rpm" }, and, where wanted, a
/// note, period_s and averaged.
ColumnMap read_map(const std::string& path);

/// Adds "role=column" or "role=column:unit" to a map; `from`: where it was said, for complaints.
void add_column(ColumnMap& map, const std::string& text, const std::string& from = "--column ");

/// Where each role of the table comes from, and in which unit; `notes`: what nobody said. Throws UserError (usage) of a
/// map that does not fit, (unusable) of columns that cannot be what they are called, or where none is a time, a heat or
/// a temperature.
std::map<Role, Source> resolve(const Table& table, const ColumnMap& map, std::vector<std::string>& notes);

std::size_t index_of(const Table& table, const Source& source);

}  // namespace identify

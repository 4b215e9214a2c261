// SPDX-License-Identifier: MIT
#include "identify/log/column_map.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "identify/log/clock.hpp"
#include "identify/log/guesses.hpp"
#include "identify/log/units.hpp"
#include "wire/pc/names.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

using wire::pc::Exit;
using wire::pc::refuse;
using wire::pc::refuse_data;

const std::array<std::string, role_count>& own_names() {
  static const std::array<std::string, role_count> names = {"time_s",       "current_A",
                                                            "id_A",         "iq_A",
                                                            "phase_a_A",    "phase_b_A",
                                                            "phase_c_A",    "power_W",
                                                            "torque_Nm",    "speed_rad_per_s",
                                                            "bus_V",        "bus_A",
                                                            "core_degC",    "housing_degC",
                                                            "ambient_degC", "coolant_degC",
                                                            "frame_degC",   "neighbour_housing_degC",
                                                            "board_degC",   "winding_ohm",
                                                            "session"};
  return names;
}

Role role_named(const std::string& name, const std::string& where) {
  for (std::size_t r = 0; r < role_count; ++r) {
    if (own_names()[r] == name) return static_cast<Role>(r);
  }
  refuse(fmt::format("{}: there is no role '{}'{} (roles: {}).", where, name,
                     wire::pc::did_you_mean(name, {own_names().begin(), own_names().end()}),
                     fmt::join(own_names(), ", ")));
}

/// The map, as far as the table bears it out.
std::map<Role, Source> from_map(const Table& table, const ColumnMap& map) {
  std::map<Role, Source> found;
  for (auto [role, source] : map.columns) {
    // "T:K" may be a name as a whole, and says the unit all the same.
    if (table.find(source.column) < 0 && table.find(source.said) >= 0) source.column = source.said;
    if (table.find(source.column) < 0) {
      const std::size_t colon = source.column.rfind(':');
      const std::string no_unit =
          source.unit_said || colon == std::string::npos
              ? ""
              : fmt::format(", and '{}' is no unit for a column '{}' (units: {})", source.column.substr(colon + 1),
                            source.column.substr(0, colon), fmt::join(unit_names(), ", "));
      refuse(fmt::format("{}: column '{}' for {} is missing{}{} (the file has: {}).", table.file, source.column,
                         own_name(role), wire::pc::did_you_mean(source.column, table.names), no_unit, table.has()));
    }
    found[role] = source;
  }
  return found;
}

/// "current_A" of "current_A [A]".
std::string bare(const std::string& name) {
  const std::string out = name.substr(0, name.find_first_of("[("));
  return out.substr(0, out.find_last_not_of(' ') + 1);
}

/// Adds own names of columns that the map does not give to another role, in other units too (current_mA). Of housing_K,
/// whose unit is a letter that may mean anything, and of two such names a sentence asks.
void add_own_names(const Table& table, const ColumnMap& map, std::map<Role, Source>& found) {
  const auto mapped = [&](const std::string& header) {
    return std::any_of(map.columns.begin(), map.columns.end(),
                       [&](const auto& m) { return m.second.column == header; });
  };
  for (std::size_t r = 0; r < role_count; ++r) {
    const Role role = static_cast<Role>(r);
    const std::string& name = own_name(role);
    if (found.contains(role)) continue;
    if (table.find(name) >= 0 && !mapped(name)) {
      found[role] = {name};
      continue;
    }
    const std::size_t cut = role == Role::neighbour ? name.rfind('_') : name.find('_');
    if (cut == std::string::npos) continue;
    std::string taken;
    for (const std::string& header : table.names) {
      if (mapped(header) || !header.starts_with(name.substr(0, cut + 1))) continue;
      const std::string unit = bare(header.substr(cut + 1));
      if (const auto known = unit_named(unit); !known || known->quantity != quantity_of(name.substr(cut + 1))) continue;
      if (unit.size() == 1 && name.substr(cut + 1) != unit)
        refuse_data(fmt::format("{}: column '{}' is in {}, but {} is expected; say --column {}={}:{} to convert it.",
                                table.file, header, unit, name, name, header, unit));
      if (!taken.empty())
        refuse_data(fmt::format("{}: columns '{}' and '{}' may both be {}; say which with --column {}=NAME.",
                                table.file, taken, header, name, name));
      taken = header;
    }
    if (!taken.empty()) found[role] = {taken};
  }
}

/// Some few words among a column's numbers say that nothing was read, as OL and Error do; else the first is refused.
void take_words(const Table& table, std::size_t column, Role role, std::vector<std::string>& notes) {
  constexpr double few = 0.05;  // of the numbers
  const Words& words = table.words[column];
  const std::size_t count = words.count();
  if (count == 0 || role == Role::session) return;
  if (words.like_numbers || static_cast<double>(count) > few * static_cast<double>(count_told(table.columns[column])))
    refuse_data(table.complaints[column]);
  notes.push_back(fmt::format("Cells of column '{}' with a word in them ('{}') count as not read: {}.",
                              table.names[column], words.seen.front(), count));
}

/// Where each comma of a column stands before three digits, and numbers below a thousand have none, it is no decimal
/// comma: of decimals one in ten would end sooner, or, where three of them are always written, 24,000 has one as well.
void refuse_thousands(const Table& table, std::size_t column) {
  constexpr int least = 10;
  const std::vector<double>& cells = table.columns[column];
  const int commas = table.thousands[column];
  if (commas >= least && table.has_plain[column] && largest_magnitude(cells) < 1000)
    refuse_data(fmt::format("{}: the commas of column '{}' set thousands apart; export it without them.", table.file,
                            table.names[column]));
}

/// Is a column called nothing but time, with or without its unit behind it?
bool named_time(const std::string& name) {
  constexpr std::string_view words[] = {"time", "timestamp", "elapsedtime", "date", "datetime", "date/time", "zeit"};
  std::string word = bare(name);
  if (const std::size_t cut = word.rfind('_');
      cut != word.npos && cut > 0 && quantity_of(word.substr(cut + 1)) == "time")
    word.resize(cut);
  std::erase_if(word, [](char c) { return c == '_' || c == ' ' || c == '%' || c == ':'; });
  return word == "t" ||  // T is a temperature
         std::find(std::begin(words), std::end(words), in_small(word)) != std::end(words);
}

/// And by what few loggers call it: Castle's Seconds, LabVIEW's X_Value, ArduPilot's TimeUS.
bool seldom_named_time(const std::string& name) {
  constexpr std::string_view words[] = {"seconds", "sec", "secs", "ts", "x_value"};
  const std::string word = bare(name);
  return word == "TimeUS" || word == "TimeMS" ||
         std::find(std::begin(words), std::end(words), in_small(word)) != std::end(words);
}

/// The only column without a role that is called so, and is no date without a time; empty: none, or several.
std::string called_time(const Table& table, const std::map<Role, Source>& found) {
  const auto taken = [&](const std::string& name) {
    return std::any_of(found.begin(), found.end(), [&](const auto& f) { return f.second.column == name; });
  };
  for (const auto& called : {named_time, seldom_named_time}) {
    std::vector<std::string> names;
    for (const std::string& name : table.names) {
      if (called(name) && !taken(name)) names.push_back(name);
    }
    const int date = date_column(table);
    if (date >= 0) std::erase(names, table.names[static_cast<std::size_t>(date)]);
    if (!names.empty()) return names.size() == 1 ? names.front() : "";
  }
  return "";
}

/// What a row of units says of a column; empty: nothing.
std::string unit_in_row(const Table& table, const std::string& column) {
  std::string unit = table.units.empty() ? "" : table.units[index_of(table, {column})];
  if (unit.size() > 2 && (unit.front() == '[' || unit.front() == '(')) unit = unit.substr(1, unit.size() - 2);
  // How a date is written, "dd.MM.yyyy HH:mm:ss", or that it is one (TS, as Campbell's loggers say) is no unit.
  const std::string low = in_small(unit);
  return low == "ts" || low.find("yy") != low.npos || low.find("hh") != low.npos ? "" : unit;
}

/// Beside others in Fahrenheit a temperature without a unit is hardly in Celsius.
void ask_for_the_unit(const Table& table, const std::string& column, Role role) {
  for (const std::string& other : table.names) {
    std::string unit = unit_in_row(table, other);
    if (unit.empty()) unit = unit_in_name(other, own_name(role));
    const auto known = unit_named(unit);
    if (known && known->quantity == "temperature" && known->factor != 1)
      refuse_data(fmt::format("{}: column '{}' tells no unit, and '{}' is in {}; say --column {}={}, or :degC.",
                              table.file, column, other, unit, own_name(role), for_a_shell(column + ":degF")));
  }
}

/// Of the maps in a folder the one with the most columns, all of which the table has; empty: none.
std::string map_that_fits(const Table& table, const std::string& folder) {
  std::string best;
  std::size_t most = 0;
  std::error_code none;
  for (const auto& file : std::filesystem::directory_iterator(folder, none)) {
    const ColumnMap map = read_map(file.path().string());
    const bool fits = std::all_of(map.columns.begin(), map.columns.end(),
                                  [&](const auto& column) { return table.find(column.second.column) >= 0; });
    if (fits && map.columns.size() > most) most = map.columns.size(), best = file.path().string();
  }
  return best;
}

}  // namespace

std::size_t index_of(const Table& table, const Source& source) {
  return static_cast<std::size_t>(table.find(source.column));
}

std::string roles_and_units() {
  return fmt::format("roles: {}\nunits: {}", fmt::join(own_names(), ", "), fmt::join(unit_names(), ", "));
}

std::string for_a_shell(const std::string& word) {
  return word.find_first_of(" ()[]'&;$*?|<>") == std::string::npos ? word : "\"" + word + "\"";
}

const std::string& own_name(Role role) { return own_names()[static_cast<std::size_t>(role)]; }

void add_column(ColumnMap& map, const std::string& text, const std::string& from) {
  const std::string where = from + text;
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) {
    refuse(where + ": write it as role=column or role=column:unit.");
  }
  const Role role = role_named(std::string(trimmed(std::string_view(text).substr(0, equals))), where);
  const std::string rest(trimmed(std::string_view(text).substr(equals + 1)));
  const std::size_t colon = rest.rfind(':');
  if (rest.empty() || rest == ":") {
    refuse(where + ": the column's name is missing behind '='.");
  }
  Source source{rest};
  source.said = rest;
  // What is no unit belongs to the column's name.
  if (colon != std::string::npos && unit_named(rest.substr(colon + 1))) {
    source.column = trimmed(std::string_view(rest).substr(0, colon));
    apply_unit(rest.substr(colon + 1), own_name(role), where, Exit::usage, source.factor, source.offset);
    source.unit_said = true;
  }
  if (!map.columns.emplace(role, source).second)
    refuse(where + ": " + own_name(role) + " was given a column before; give each role one.");
}

ColumnMap read_map(const std::string& path) {
  if (!std::filesystem::is_regular_file(path)) {
    refuse(path + ": there is no such map file; the ones that come along are in identify/maps.");
  }
  toml::table file;
  try {
    file = toml::parse_file(path);
  } catch (const toml::parse_error& error) {
    refuse(fmt::format("{}, line {}: {}; repair the map.", path, error.source().begin.line, error.description()));
  }
  for (const auto& [key, unused] : file) {
    const std::vector<std::string> keys = {"columns", "note", "period_s", "averaged"};
    if (std::find(keys.begin(), keys.end(), key.str()) == keys.end()) {
      refuse(fmt::format("{}: unknown key '{}'{} (a map holds [columns], note, period_s and averaged).", path,
                         key.str(), wire::pc::did_you_mean(key.str(), keys)));
    }
  }
  ColumnMap map;
  map.note = file["note"].value_or(std::string());
  if (file.contains("period_s")) {
    map.period_s = file["period_s"].value_or(missing);
    if (!(map.period_s > 0) || std::isinf(map.period_s))
      refuse(path + ": period_s: write the seconds from row to row, such as 0.5.");
  }
  if (const auto averaged = file["averaged"]) {
    if (!averaged.is_boolean()) refuse(path + ": averaged: write true or false.");
    map.averaged = averaged.value_or(false);
  }
  const toml::table* columns = file["columns"].as_table();
  if (columns == nullptr) refuse(path + ": [columns] is missing; write lines such as housing_degC = \"T_body\".");
  for (const auto& [role, value] : *columns) {
    const std::string name(role.str());
    std::string text;
    if (const auto* plain = value.as_string()) text = plain->get();
    if (const auto* table = value.as_table()) {
      for (const auto& [key, unused] : *table) {
        if (key.str() != "column" && key.str() != "unit") {
          refuse(fmt::format("{}: {}: unknown key '{}'; known are column and unit.", path, name, key.str()));
        }
      }
      text = (*table)["column"].value_or(std::string());
      if (const auto unit = (*table)["unit"].value<std::string>()) text += ":" + *unit;
    }
    if (text.empty())
      refuse(fmt::format("{}: {}: write \"column\" or {{ column = \"...\", unit = \"rpm\" }}.", path, name));
    add_column(map, name + "=" + text, path + ": ");
  }
  return map;
}

std::map<Role, Source> resolve(const Table& table, const ColumnMap& map, std::vector<std::string>& notes) {
  std::map<Role, Source> found = from_map(table, map);
  add_own_names(table, map, found);
  const std::string time = called_time(table, found);
  if (!found.contains(Role::time) && std::isnan(map.period_s) && !time.empty()) {
    found[Role::time] = {time};
    notes.push_back(fmt::format("Column '{}' is taken for the time{}.", time,
                                table.of_day[index_of(table, {time})] ? "" : ", in seconds where no unit is said"));
  }
  const bool nobody_mapped = map.columns.empty() && std::isnan(map.period_s);
  refuse_without_columns(table, found, !std::isnan(map.period_s),
                         nobody_mapped ? map_that_fits(table, map.folder) : "");
  note_unused_columns(table, found, notes);
  note_doubtful_columns(table, found, notes);
  for (const Role role : {Role::current, Role::iq, Role::id}) {
    const auto at = found.find(role);
    if (at != found.end() && named_rms(at->second.column) && !at->second.unit_said)
      notes.push_back(fmt::format("{}: if '{}' is one of a phase, say --column {}={}.",
                                  role == Role::current
                                      ? "The rms of a sinusoidal current heats as 1.2247 times as much direct current"
                                      : "The amplitude of a sinusoidal current is 1.4142 times its rms",
                                  at->second.column, own_name(role), for_a_shell(at->second.column + rms_unit(role))));
  }
  std::vector<std::string> by_row, by_name;
  for (auto& [role, source] : found) {
    for (const auto& [other, same] : found) {
      if (other < role && same.column == source.column)
        refuse_data(fmt::format("{}: column '{}' cannot be both {} and {}; map another one.", table.file, source.column,
                                own_name(other), own_name(role)));
    }
    if (std::count(table.names.begin(), table.names.end(), source.column) > 1)
      refuse_data(
          fmt::format("{}: column '{}' stands there twice; rename or delete one of them.", table.file, source.column));
    take_words(table, index_of(table, source), role, notes);
    refuse_thousands(table, index_of(table, source));
    if (source.unit_said) continue;
    std::string unit = unit_in_row(table, source.column);
    std::vector<std::string>& by = unit.empty() ? by_name : by_row;
    if (unit.empty()) unit = unit_in_name(source.column, own_name(role));
    // "T [case]" tells no unit; "[Umdr./min]" tells one.
    if (const std::string told = bracketed(source.column);
        unit.empty() && (told.find_first_of("/^%.") != told.npos || told.find("‰") != told.npos))
      notes.push_back(fmt::format(
          "The unit '{}' of column '{}' is not known and not used; say --column {}={}:UNIT if it "
          "is not the one in {} (units: {}).",
          told, source.column, own_name(role), source.column, own_name(role), fmt::join(unit_names(), ", ")));
    else if (role == Role::speed && named_electrical(source.column))
      refuse_data(fmt::format(
          "{}: column '{}' counts turns of the field; say --column {}={} of a motor of seven pole pairs, or its unit "
          "alone if they are the shaft's.",
          table.file, source.column, own_name(role), for_a_shell(source.column + ":0.1429rpm")));
    else if (unit.empty() && role == Role::speed && source.column != own_name(role)) {
      source.unit_guessed = true;
      notes.push_back(
          fmt::format("No unit of column '{}' is known; it is read in rad/s. Say --column {}={} if it is "
                      "in revolutions a minute, :rev/s if in turns a second.",
                      source.column, own_name(role), for_a_shell(source.column + ":rpm")));
    }
    if (unit.empty() && std::count(std::begin(temperatures), std::end(temperatures), role) > 0)
      ask_for_the_unit(table, source.column, role);
    if (!unit.empty())
      apply_unit(unit, own_name(role),
                 fmt::format("{}: the units in the table, column '{}' (--column {}={}:UNIT overrules it)", table.file,
                             source.column, own_name(role), source.column),
                 Exit::unusable, source.factor, source.offset);
    if (source.factor != 1 || source.offset != 0) by.push_back(fmt::format("{} in {}", own_name(role), unit));
  }
  if (!by_row.empty()) notes.push_back(fmt::format("Units are taken from the table: {}.", fmt::join(by_row, ", ")));
  if (!by_name.empty())
    notes.push_back(fmt::format("Units are taken from the columns' names: {}.", fmt::join(by_name, ", ")));
  return found;
}

}  // namespace identify

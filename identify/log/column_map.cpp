// SPDX-License-Identifier: MIT
#include "identify/log/column_map.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <optional>

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
                         own_name(role), wire::pc::did_you_mean(source.column, table.names), no_unit,
                         fmt::join(table.names, ", ")));
    }
    found[role] = source;
  }
  return found;
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
      const std::string unit = header.substr(cut + 1);
      if (const auto known = unit_named(unit); !known || known->quantity != quantity_of(name.substr(cut + 1))) continue;
      if (unit.size() == 1)
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
/// comma: of decimals one in ten would end sooner.
void refuse_thousands(const Table& table, std::size_t column) {
  constexpr int least = 10;
  const std::vector<double>& cells = table.columns[column];
  const int commas = table.thousands[column];
  const auto whole = std::count_if(cells.begin(), cells.end(), [](double x) { return x == std::round(x); });
  if (commas >= least && static_cast<std::size_t>(whole) > 0 && largest_magnitude(cells) < 1000)
    refuse_data(fmt::format("{}: the commas of column '{}' set thousands apart; export it without them.", table.file,
                            table.names[column]));
}

/// The only column without a role that is called nothing but time; empty: none, or several.
std::string called_time(const Table& table, const std::map<Role, Source>& found) {
  constexpr std::string_view words[] = {"time", "timestamp", "elapsedtime", "date", "datetime", "date/time", "zeit"};
  const auto is_time = [&](const std::string& name) {
    const bool taken = std::any_of(found.begin(), found.end(), [&](const auto& f) { return f.second.column == name; });
    std::string bare = name.substr(0, name.find_first_of("[("));
    if (const std::size_t cut = bare.rfind('_');
        cut != bare.npos && cut > 0 && quantity_of(bare.substr(cut + 1)) == "time")
      bare.resize(cut);
    std::erase_if(bare, [](char c) { return c == '_' || c == ' ' || c == '%'; });
    const bool says_so =
        bare == "t" || std::find(std::begin(words), std::end(words), in_small(bare)) != std::end(words);
    return says_so && !taken;  // T is a temperature
  };
  const auto first = std::find_if(table.names.begin(), table.names.end(), is_time);
  return std::count_if(table.names.begin(), table.names.end(), is_time) == 1 ? *first : "";
}

/// Does a word of a name begin so? "T_case" and "motorTemp" do with "t_" and "temp", "input_speed" not with "t_".
bool has_word(const std::string& name, std::string_view beginning) {
  const auto letter = [&](std::size_t at) { return std::isalpha(static_cast<unsigned char>(name[at])) != 0; };
  const auto capital = [&](std::size_t at) { return std::isupper(static_cast<unsigned char>(name[at])) != 0; };
  const std::string low = in_small(name);
  for (std::size_t at = low.find(beginning); at != std::string::npos; at = low.find(beginning, at + 1)) {
    if (at == 0 || !letter(at - 1) || !letter(at) || (capital(at) && !capital(at - 1))) return true;
  }
  return false;
}

/// A role, and what words of its columns begin with, in small letters.
struct Likely {
  Role role;
  std::vector<const char*> words;
};

/// Effective values, by a column's name: "motor_rms_current", "I [Arms]".
bool named_rms(const std::string& name) { return has_word(name, "rms") || in_small(bracketed(name)).ends_with("rms"); }

/// Sinusoidal currents heat by 3/2 of their rms squared what current_A heats; their amplitude is the root of two of it.
const char* rms_unit(Role role) {
  return role == Role::current ? ":1.2247A" : role == Role::iq || role == Role::id ? ":1.4142A" : "";
}

/// A column, and what it may be.
struct Guess {
  Role role;
  std::string column, unit;  // "", or as ":ms"
  /// As a command line takes it.
  std::string option() const { return "--column " + own_name(role) + "=" + for_a_shell(column + unit); }
};

std::vector<std::string> columns_of(const std::map<Role, Source>& found) {
  std::vector<std::string> out;
  for (const auto& [unused, source] : found) out.push_back(source.column);
  return out;
}

/// Metres a second, or the like: of what the motor drives.
bool of_a_vehicle(const std::string& name) {
  return has_word(name, "mps") || has_word(name, "kmh") || has_word(name, "km/h") || has_word(name, "meters") ||
         has_word(name, "m/s");
}

/// Of the first words that a column has which moves and is not `taken`.
std::optional<Guess> likely_column(const Table& table, const std::vector<std::string>& taken,
                                   const std::vector<Likely>& likely) {
  for (const bool moves : {true, false}) {
    for (const auto& [role, words] : likely) {
      for (std::size_t c = 0; c < table.names.size(); ++c) {
        const std::string& name = table.names[c];
        if (std::find(taken.begin(), taken.end(), name) != taken.end()) continue;
        if (role == Role::speed && of_a_vehicle(name)) continue;
        const std::vector<double>& cells = table.columns[c];
        const bool has = std::any_of(words.begin(), words.end(), [&](const char* w) { return has_word(name, w); });
        const bool stands = count_told(cells) > 0 && largest_magnitude(spacing(cells)) == 0;
        if (!has || stands == moves) continue;
        const std::string unit = named_rms(name)                              ? rms_unit(role)
                                 : role == Role::time && has_word(name, "ms") ? ":ms"
                                                                              : "";
        return Guess{role, name, unit};
      }
    }
  }
  return std::nullopt;
}

/// Turns of the field, not of the shaft.
bool named_electrical(const std::string& name) { return has_word(name, "erpm") || has_word(name, "electric"); }

/// What has to be said with a speed's column whose name tells no unit of the shaft's.
std::string speed_words(const std::string& name) {
  if (named_electrical(name)) return " (electrical: with its unit, as :0.1429rpm of seven pole pairs)";
  return unit_in_name(name, own_name(Role::speed)).empty() ? " (and its unit, as :rpm)" : "";
}

/// The current in d beside that in q: its name with a d for a q.
std::optional<Guess> twin_of(const Table& table, std::string q) {
  for (char& c : q) {
    const char as_it_was = c;
    c = c == 'q' ? 'd' : c == 'Q' ? 'D' : c;
    if (c != as_it_was && table.find(q) >= 0) return Guess{Role::id, q, ""};
    c = as_it_was;
  }
  return std::nullopt;
}

const std::vector<Likely> windings = {{Role::core, {"winding", "coil", "wicklung"}}},
                          housings = {{Role::housing, {"housing", "casing", "case", "yoke", "geh\u00e4use"}},
                                      {Role::housing, {"stator"}}},
                          rooms = {{Role::ambient, {"ambient", "room", "umgebung"}}},
                          coolants = {{Role::coolant, {"coolant"}}};

/// Columns that nothing needs, and that would tell more; `what` each is.
std::vector<std::pair<Guess, const char*>> useful_columns(const Table& table, std::map<Role, Source> found) {
  const std::pair<std::vector<Likely>, const char*> useful[] = {
      {{{Role::speed, {"velocity", "speed", "rpm", "erpm", "omega", "drehzahl"}}}, "the motor's speed"},
      {windings, "the winding's temperature"},
      {housings, "the housing's temperature"},
      {rooms, "the room's temperature"},
      {coolants, "the coolant's temperature"},
      {{{Role::session, {"session", "profile_id", "run_id", "test_id", "episode"}}}, "what tells sessions apart"}};
  std::vector<std::pair<Guess, const char*>> out;
  for (const auto& [likely, what] : useful) {
    const auto guess =
        found.contains(likely.front().role) ? std::nullopt : likely_column(table, columns_of(found), likely);
    if (!guess) continue;
    found[guess->role] = {guess->column};
    out.emplace_back(*guess, what);
  }
  if (found.contains(Role::iq) && !found.contains(Role::id)) {
    if (const auto twin = twin_of(table, found.at(Role::iq).column)) out.emplace_back(*twin, "the current in d");
  }
  return out;
}

void note_unused_columns(const Table& table, const std::map<Role, Source>& found, std::vector<std::string>& notes) {
  for (const auto& [guess, what] : useful_columns(table, found))
    notes.push_back(fmt::format("A column may be {} and is not used: if it is, say {}{}.", what, guess.option(),
                                guess.role == Role::speed ? speed_words(guess.column) : ""));
}

/// Databases and dashboards export one value a row, beside what it is of.
void refuse_one_value_a_row(const Table& table) {
  const auto any = [&](std::initializer_list<std::string_view> of) {
    const auto at = std::find_if(table.names.begin(), table.names.end(), [&](const std::string& name) {
      return std::find(of.begin(), of.end(), in_small(name)) != of.end();
    });
    return at == table.names.end() ? std::string() : *at;
  };
  const std::string value = any({"_value", "value", "state"});
  const std::string of =
      any({"_field", "field", "entity_id", "metric", "signal", "signal_name", "channel", "variable"});
  if (!value.empty() && !of.empty())
    refuse_data(
        fmt::format("{}: each row has one value ('{}') and what it is of ('{}'); pivot the table, so that each "
                    "quantity has a column, and export it again.",
                    table.file, value, of));
}

/// A temperature of the motor, where no column has such a role: the housing's rather than the winding's.
std::optional<Guess> likely_temperature(const Table& table, const std::map<Role, Source>& found) {
  std::vector<std::string> taken = columns_of(found);
  const auto winding = likely_column(table, taken, windings);
  for (const auto& other : {windings, rooms, coolants}) {
    while (const auto of_it = likely_column(table, taken, other)) taken.push_back(of_it->column);
  }
  std::vector<Likely> likely = housings;
  likely.insert(likely.begin(), {Role::housing, {"motor temp", "motor_temp", "temp_motor", "motortemp"}});
  if (!winding) likely.push_back({Role::housing, {"temp", "degc", "\u00b0c", "t_"}});
  const auto housing = likely_column(table, taken, likely);
  return housing ? housing : winding;
}

/// All that is missing at once, each with the column that its name speaks for, and with what else is of use.
void refuse_without_columns(const Table& table, const std::map<Role, Source>& found, bool by_row) {
  const auto none_of = [&](std::initializer_list<Role> roles) {
    return std::none_of(roles.begin(), roles.end(), [&](Role r) { return found.contains(r); });
  };
  std::map<Role, Source> taken = found;
  std::vector<std::string> missing_ones, hints;
  const auto ask_for = [&](const char* what, const std::optional<Guess>& guess, const char* hint, Role otherwise) {
    missing_ones.emplace_back(what);
    if (guess) taken[guess->role] = {guess->column};
    hints.push_back(
        fmt::format(fmt::runtime(hint), guess ? guess->option() : "--column " + own_name(otherwise) + "=NAME"));
  };
  if (!by_row && none_of({Role::time}))
    ask_for("a time column",
            likely_column(table, columns_of(taken),
                          {{Role::time, {"time", "zeit", "stamp", "ms"}}, {Role::time, {"date", "datum"}}}),
            "call it time_s, say {}, or --period S where the rows are S seconds apart", Role::time);
  if (none_of({Role::current, Role::iq, Role::phase_a, Role::power, Role::torque})) {
    const auto guess = likely_column(table, columns_of(taken),
                                     {{Role::current, {"motor current", "motor_current", "motorcurrent"}},
                                      {Role::iq, {"current_motor"}},  // an amplitude: the name is VESC's
                                      {Role::iq, {"iq", "i_q", "q-axis", "q_axis", "q_current", "current_q"}},
                                      {Role::current, {"current", "curr", "strom", "amp"}},
                                      {Role::phase_a, {"ia", "i_a", "iu", "i_u", "phase_a"}},
                                      {Role::torque, {"torque", "effort", "drehmoment"}},
                                      {Role::power, {"loss", "p_loss", "verlust"}},
                                      {Role::power, {"power", "watt", "leistung"}}});
    ask_for("the heat input (current_A, iq_A, power_W or torque_Nm)", guess, "map it with {}", Role::current);
    if (!guess) hints.back() += ", or join it to this table by time if it was recorded in another";
    if (guess && guess->role == Role::power) hints.back() += " if that is what heats the winding";
  }
  if (none_of({Role::housing, Role::core}))
    ask_for("a measured temperature (housing_degC or core_degC)", likely_temperature(table, taken), "map it with {}",
            Role::housing);
  if (missing_ones.empty()) return;
  refuse_one_value_a_row(table);
  std::vector<std::string> useful;
  for (const auto& [guess, unused] : useful_columns(table, taken))
    useful.push_back(guess.option() + (guess.role == Role::speed ? speed_words(guess.column) : ""));
  if (!useful.empty()) hints.push_back(fmt::format("of use as well: {}", fmt::join(useful, ", ")));
  refuse_data(fmt::format("{}: {} {} missing; {}. The file has: {}.", table.file, fmt::join(missing_ones, " and "),
                          missing_ones.size() == 1 ? "is" : "are", fmt::join(hints, "; "),
                          fmt::join(table.names, ", ")));
}

/// What a row of units says of a column; empty: nothing.
std::string unit_in_row(const Table& table, const std::string& column) {
  std::string unit = table.units.empty() ? "" : table.units[index_of(table, {column})];
  if (unit.size() > 2 && (unit.front() == '[' || unit.front() == '(')) unit = unit.substr(1, unit.size() - 2);
  return unit;
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

}  // namespace

std::size_t index_of(const Table& table, const Source& source) {
  return static_cast<std::size_t>(table.find(source.column));
}

std::string roles_and_units() {
  return fmt::format("roles: {}\nunits: {}", fmt::join(own_names(), ", "), fmt::join(unit_names(), ", "));
}

std::string for_a_shell(const std::string& word) {
  return word.find_first_of(" ()[]'&;$*?") == std::string::npos ? word : "\"" + word + "\"";
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
  if (rest.empty() || colon == 0) {
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
    if (key.str() != "columns" && key.str() != "note" && key.str() != "period_s") {
      refuse(fmt::format("{}: unknown key '{}'{} (a map holds [columns], note and period_s).", path, key.str(),
                         wire::pc::did_you_mean(key.str(), {"columns", "note", "period_s"})));
    }
  }
  ColumnMap map;
  map.note = file["note"].value_or(std::string());
  if (file.contains("period_s")) {
    map.period_s = file["period_s"].value_or(missing);
    if (!(map.period_s > 0) || std::isinf(map.period_s))
      refuse(path + ": period_s: write the seconds from row to row, such as 0.5.");
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
  refuse_without_columns(table, found, !std::isnan(map.period_s));
  note_unused_columns(table, found, notes);
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
      notes.push_back(
          fmt::format("Column '{}' counts turns of the field; say --column {}={} of a motor of seven pole pairs.",
                      source.column, own_name(role), for_a_shell(source.column + ":0.1429rpm")));
    else if (unit.empty() && role == Role::speed && source.column != own_name(role))
      notes.push_back(
          fmt::format("No unit of column '{}' is known; it is read in rad/s. Say --column {}={} if it is "
                      "in revolutions a minute.",
                      source.column, own_name(role), for_a_shell(source.column + ":rpm")));
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

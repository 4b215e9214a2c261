// SPDX-License-Identifier: MIT
#include "identify/log/guesses.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>

#include "identify/log/impossible.hpp"
#include "identify/log/units.hpp"
#include "wire/pc/names.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {

using wire::pc::refuse_data;

namespace {
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
}  // namespace

bool named_rms(const std::string& name) { return has_word(name, "rms") || in_small(bracketed(name)).ends_with("rms"); }

const char* rms_unit(Role role) {
  return role == Role::current ? ":1.2247A" : role == Role::iq || role == Role::id ? ":1.4142A" : "";
}

bool named_electrical(const std::string& name) { return has_word(name, "erpm") || has_word(name, "elec"); }

namespace {

/// A role, and what words of its columns begin with, in small letters.
struct Likely {
  Role role;
  std::vector<const char*> words;
};

/// A column, and what it may be.
struct Guess {
  Role role;
  std::string column, unit;  // "", or as ":ms"
  /// As a command line takes it.
  std::string option() const { return "--column " + own_name(role) + "=" + for_a_shell(column + unit); }
};

/// Columns that have a role, and one that tells whose motor's they are.
struct Taken {
  std::vector<std::string> columns;
  std::string of_motor = "";
};

Taken taken_of(const std::map<Role, Source>& found) {
  Taken out;
  for (const auto& [unused, source] : found) out.columns.push_back(source.column);
  for (const Role role :
       {Role::current, Role::iq, Role::phase_a, Role::torque, Role::power, Role::housing, Role::core}) {
    if (out.of_motor.empty() && found.contains(role)) out.of_motor = found.at(role).column;
  }
  return out;
}

bool has_any(const std::string& name, std::initializer_list<const char*> words) {
  return std::any_of(words.begin(), words.end(), [&](const char* word) { return has_word(name, word); });
}

bool of_the_supply(const std::string& name) {
  return has_any(name, {"supply", "batt", "bus", "ibus", "input", "current_in"});
}

/// What a column's name shows not to be what such a role asks: of what a motor drives, of what feeds it, or another
/// quantity (current_temperature is no current, and StatorCurrent no stator's temperature).
bool is_none(const std::string& name, Role role) {
  const bool temperature = has_any(name, {"temp", "degc", "\u00b0c"});
  if (role == Role::speed) return has_any(name, {"mps", "kmh", "km/h", "meters", "m/s", "fan", "gps"});
  if (role == Role::current)
    return temperature || of_the_supply(name) ||
           has_any(name, {"charge", "hour", "state", "mode", "pos", "angle", "speed", "vel", "rpm", "time", "volt",
                          "torque"});
  return std::find(std::begin(temperatures), std::end(temperatures), role) != std::end(temperatures) && !temperature &&
         has_any(name, {"current", "volt", "speed", "veloc", "torque", "resist", "ohm", "flux"});
}

/// Of what switches the motor's current, as VESC (temp_mos_max) and PX4 (esc_temperature) have it beside the motor's.
bool of_a_controller(const std::string& name) {
  return has_any(name, {"mos", "fet", "esc", "controller", "driver", "inverter", "igbt", "bridge", "stage", "board",
                        "pcb", "mcu", "cpu", "batt"});
}

/// Does a current's name say that the motor's own flows there?
bool of_the_motor(const std::string& name) {
  return has_any(name, {"motor", "mot", "phase", "winding", "stator", "coil", "iq", "i_q", "q-axis", "q_axis", "q_curr",
                        "current_q"});
}

/// What was asked for, beside what is, or counts beside what they are worth: Iq_setpoint and current_raw, Iq_measured.
bool is_commanded(const std::string& name) {
  return has_any(name, {"set", "target", "goal", "command", "cmd", "desired", "demand", "ref", "limit", "lim", "max",
                        "error", "raw", "adc"});
}

/// esc[0].motor_temp: esc, 0, motor, temp.
std::vector<std::string> words_of(const std::string& name) {
  const auto kind = [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return std::isdigit(byte) != 0 ? 1 : std::isalpha(byte) != 0 ? 2 : 0;
  };
  std::vector<std::string> words;
  int before = 0;
  for (const char c : in_small(name)) {
    if (kind(c) != 0 && kind(c) != before) words.emplace_back();
    if (kind(c) != 0) words.back() += c;
    before = kind(c);
  }
  return words;
}

/// Is a column of another motor than the column `of`? So it is where one that is called alike shares the word with
/// `of` that it does not: right.temp beside left.current, where there is a left.temp.
bool of_another(const std::vector<std::vector<std::string>>& names, const std::vector<std::string>& name,
                const std::vector<std::string>& of) {
  const auto said = [&](const std::string& word) { return std::find(of.begin(), of.end(), word) != of.end(); };
  return std::any_of(names.begin(), names.end(), [&](const std::vector<std::string>& other) {
    if (other.size() != name.size() || other == of) return false;
    const auto [mine, its] = std::mismatch(name.begin(), name.end(), other.begin());
    return mine != name.end() && std::equal(mine + 1, name.end(), its + 1) && said(*its) && !said(*mine) &&
           *its != "motor";  // temp_case is of the same as temp_motor
  });
}

/// Of the same motor rather than of another, which moves rather than which stands, and measured rather than commanded:
/// of the first words that such a column has.
std::optional<Guess> likely_column(const Table& table, const Taken& taken, const std::vector<Likely>& likely) {
  std::vector<std::vector<std::string>> names;
  for (const std::string& name : table.names) names.push_back(words_of(name));
  const std::vector<std::string> motor = words_of(taken.of_motor);
  std::optional<Guess> best;
  int best_doubts = 0;
  for (const auto& [role, words] : likely) {
    for (std::size_t c = 0; c < table.names.size(); ++c) {
      const std::string& name = table.names[c];
      const std::vector<std::string>& other = taken.columns;
      if (std::find(other.begin(), other.end(), name) != other.end() || is_none(name, role)) continue;
      if (std::none_of(words.begin(), words.end(), [&](const char* w) { return has_word(name, w); })) continue;
      const int doubts = 4 * of_another(names, names[c], motor) + 2 * stands(table.columns[c]) + is_commanded(name);
      if (best && doubts >= best_doubts) continue;
      const std::string unit = named_rms(name)                                         ? rms_unit(role)
                               : role == Role::time && has_any(name, {"ms", "millis"}) ? ":ms"
                               : role == Role::time && has_word(name, "micros")        ? ":us"
                                                                                       : "";
      best = Guess{role, name, unit};
      if (role == Role::phase_a && named_rms(name)) best = Guess{Role::current, name, rms_unit(Role::current)};
      best_doubts = doubts;
    }
  }
  return best;
}

/// The first column that nothing but its unit tells to be of such a role: "1-1 [A]", as recorders call their channels.
std::optional<Guess> column_by_unit(const Table& table, const Taken& taken, Role role) {
  for (const std::string& name : table.names) {
    const bool other = std::find(taken.columns.begin(), taken.columns.end(), name) != taken.columns.end();
    if (!other && !is_none(name, role) && !unit_in_name(name, own_name(role)).empty()) return Guess{role, name, ""};
  }
  return std::nullopt;
}

/// What has to be said with a speed's column whose name tells no unit of the shaft's.
std::string speed_words(const std::string& name) {
  if (named_electrical(name)) return " (electrical: with its unit, as :0.1429rpm of seven pole pairs)";
  return unit_in_name(name, own_name(Role::speed)).empty() ? " (and its unit, as :rpm or :rev/s)" : "";
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
                          housings = {{Role::housing,
                                       {"housing", "casing", "case", "yoke", "geh\u00e4use", "gehaeuse"}},
                                      {Role::housing, {"stator"}}},
                          rooms = {{Role::ambient, {"amb", "tamb", "room", "umgebung"}}},
                          coolants = {{Role::coolant, {"coolant"}}};

/// Columns that nothing needs, and that would tell more; `what` each is.
std::vector<std::pair<Guess, const char*>> useful_columns(const Table& table, std::map<Role, Source> found) {
  const std::pair<std::vector<Likely>, const char*> useful[] = {
      {{{Role::speed, {"velocity", "vel", "speed", "rpm", "erpm", "omega", "drehzahl", "motordrehzahl"}},
        {Role::speed, {"dq", "qd"}}},
       "the motor's speed"},
      {windings, "the winding's temperature"},
      {housings, "the housing's temperature"},
      {rooms, "the room's temperature"},
      {coolants, "the coolant's temperature"},
      {{{Role::session, {"session", "profile_id", "run_id", "test_id", "episode"}}}, "what tells sessions apart"}};
  std::vector<std::pair<Guess, const char*>> out;
  for (const auto& [likely, what] : useful) {
    const auto guess =
        found.contains(likely.front().role) ? std::nullopt : likely_column(table, taken_of(found), likely);
    if (!guess) continue;
    found[guess->role] = {guess->column};
    out.emplace_back(*guess, what);
  }
  if (found.contains(Role::iq) && !found.contains(Role::id)) {
    if (const auto twin = twin_of(table, found.at(Role::iq).column)) out.emplace_back(*twin, "the current in d");
  }
  return out;
}

/// Databases and dashboards export one value a row, beside what it is of.
void refuse_one_value_a_row(const Table& table) {
  const auto any = [&](std::initializer_list<std::string_view> of) {
    const auto at = std::find_if(table.names.begin(), table.names.end(), [&](const std::string& name) {
      return std::find(of.begin(), of.end(), in_small(name)) != of.end();
    });
    return at == table.names.end() ? std::string() : *at;
  };
  const std::string value =
      any({"_value", "value", "state", "physvalue", "phys_value", "wert", "messwert", "varvalue"});
  const std::string of = any({"_field", "field", "entity_id", "entry", "key", "metric", "name", "signal", "signal_name",
                              "channel", "topic", "variable", "signalname", "kanal", "varname"});
  if (!value.empty() && !of.empty())
    refuse_data(
        fmt::format("{}: each row has one value ('{}') and what it is of ('{}'); pivot the table, so that each "
                    "quantity has a column, and export it again.",
                    table.file, value, of));
}

/// A temperature of the motor, where no column has such a role: the housing's rather than the winding's, and one that
/// stands, as of a sensor that is not connected, rather than what may be the controller's.
std::optional<Guess> likely_temperature(const Table& table, const std::map<Role, Source>& found) {
  const Likely motors = {Role::housing,
                         {"motor temp", "motor_temp", "temp_motor", "motortemp", "mottemp", "mot_temp",
                          "temperature motor", "temperature_motor", "tmot", "t_mot", "tmpm"}};
  Taken taken = taken_of(found);
  const auto winding = likely_column(table, taken, windings);
  for (const auto& other : {windings, rooms, coolants}) {
    while (const auto of_it = likely_column(table, taken, other)) taken.columns.push_back(of_it->column);
  }
  const auto motor = likely_column(table, taken, {motors});
  for (const std::string& name : table.names) {
    if (of_a_controller(name) && (!motor || motor->column != name)) taken.columns.push_back(name);
  }
  std::vector<Likely> likely = housings;
  likely.insert(likely.begin(), motors);
  if (!winding && !motor) likely.push_back({Role::housing, {"temp", "degc", "\u00b0c", "t_"}});
  const auto housing = likely_column(table, taken, likely);
  return housing ? housing : winding ? winding : column_by_unit(table, taken, Role::housing);
}

/// A temperature, and of what nobody knows: temperature of moteus, Present Temperature of Dynamixel are the drive's
/// own.
bool says_nothing_of_itself(const std::string& name) {
  constexpr std::string_view nothing[] = {"temp",   "temperature", "temperatures", "present",
                                          "system", "c",           "degc",         "deg"};
  const std::vector<std::string> words = words_of(name);
  return std::all_of(words.begin(), words.end(), [&](const std::string& word) {
    return std::find(std::begin(nothing), std::end(nothing), word) != std::end(nothing);
  });
}

}  // namespace

void note_doubtful_columns(const Table& table, const std::map<Role, Source>& found, std::vector<std::string>& notes) {
  const auto foreign = [&](Role role) { return found.contains(role) && found.at(role).column != own_name(role); };
  const auto volts = std::find_if(table.names.begin(), table.names.end(), [](const std::string& name) {
    return has_any(name, {"volt", "vbat", "vbus", "vdc", "v_bat", "v_bus", "v_dc"}) && !of_the_motor(name);
  });
  for (const Role role : {Role::current, Role::iq}) {
    if (!foreign(role) || of_the_motor(found.at(role).column)) continue;
    const std::string& name = found.at(role).column;
    if (volts != table.names.end() || of_the_supply(name))
      notes.push_back(fmt::format(
          "Column '{}'{} may be what the supply gives; the winding is heated by the motor's own current, which is "
          "larger wherever the motor turns slower than the supply could drive it. Map that one, if there is one.",
          name, volts == table.names.end() ? "" : fmt::format(" beside '{}'", *volts)));
  }
  const std::string heat = taken_of(found).of_motor;
  std::vector<std::vector<std::string>> names;
  for (const std::string& name : table.names) names.push_back(words_of(name));
  for (const Role role : {Role::housing, Role::core}) {
    if (foreign(role) && of_another(names, words_of(found.at(role).column), words_of(heat)))
      notes.push_back(
          fmt::format("Column '{}' is called as if it were of another motor than '{}'; if it is, nothing "
                      "here holds.",
                      found.at(role).column, heat));
    if (foreign(role) && says_nothing_of_itself(found.at(role).column))
      notes.push_back(
          fmt::format("Column '{}' does not tell what it is the temperature of; many drives call their own so. If this "
                      "is not the motor's, nothing here holds for the motor.",
                      found.at(role).column));
    if (foreign(role) && of_a_controller(found.at(role).column) && !of_the_motor(found.at(role).column))
      notes.push_back(
          fmt::format("Column '{}' is called like the temperature of what drives the motor; if it is that, nothing "
                      "here holds for the motor: map the sensor in or on it as {}.",
                      found.at(role).column, own_name(role)));
  }
}

void note_unused_columns(const Table& table, const std::map<Role, Source>& found, std::vector<std::string>& notes) {
  for (const auto& [guess, what] : useful_columns(table, found))
    notes.push_back(fmt::format("A column may be {} and is not used: if it is, say {}{}.", what, guess.option(),
                                guess.role == Role::speed ? speed_words(guess.column) : ""));
}

void refuse_without_columns(const Table& table, const std::map<Role, Source>& found, bool by_row,
                            const std::string& map) {
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
            likely_column(
                table, taken_of(taken),
                {{Role::time, {"time", "zeit", "stamp", "ms", "millis", "micros"}}, {Role::time, {"date", "datum"}}}),
            "call it time_s, say {}, or --period S where the rows are S seconds apart", Role::time);
  if (none_of({Role::current, Role::iq, Role::phase_a, Role::power, Role::torque})) {
    auto guess = likely_column(
        table, taken_of(taken),
        {{Role::current, {"motor current", "motor_current", "motorcurrent", "motorstrom"}},
         {Role::current, {"phase current", "phase_current", "phasecurrent", "i_phase", "iphase", "i_mot"}},
         {Role::iq, {"current_motor"}},  // an amplitude: the name is VESC's
         {Role::iq, {"iq", "i_q", "q-axis", "q_axis", "q_current", "current_q"}},
         {Role::current, {"current", "curr", "strom", "amp"}},
         {Role::phase_a, {"ia", "i_a", "iu", "i_u", "phase_a"}},
         {Role::torque, {"torque", "tau", "effort", "drehmoment"}},
         {Role::power, {"loss", "p_loss", "verlust"}},
         {Role::power, {"power", "watt", "leistung"}}});
    if (!guess) guess = column_by_unit(table, taken_of(taken), Role::current);
    ask_for("the heat input (current_A, iq_A, power_W or torque_Nm)", guess, "map it with {}", Role::current);
    if (!guess) hints.back() += ", or join it to this table by time if it was recorded in another";
    if (guess && guess->role == Role::current && !of_the_motor(guess->column))
      hints.back() += " if it is the motor's own current and not the supply's";
    if (guess && guess->role == Role::power) hints.back() += " if that is what heats the winding";
  }
  if (none_of({Role::housing, Role::core})) {
    const auto guess = likely_temperature(table, taken);
    ask_for("a measured temperature (housing_degC or core_degC)", guess, "map it with {}", Role::housing);
    const auto at = guess ? static_cast<std::size_t>(table.find(guess->column)) : 0;
    if (guess && table.rows() > 1 && stands(table.columns[at]))
      hints.back() +=
          fmt::format(", which says {:g} in all rows: see whether its sensor is connected", lowest(table.columns[at]));
  }
  if (missing_ones.empty()) return;
  refuse_one_value_a_row(table);
  if (!map.empty())
    refuse_data(fmt::format("{}: {} {} missing under {} own names; say --map {}, which was made for such a table.",
                            table.file, fmt::join(missing_ones, " and "), missing_ones.size() == 1 ? "is" : "are",
                            missing_ones.size() == 1 ? "its" : "their", for_a_shell(map)));
  std::vector<std::string> useful;
  for (const auto& [guess, unused] : useful_columns(table, taken))
    useful.push_back(guess.option() + (guess.role == Role::speed ? speed_words(guess.column) : ""));
  if (!useful.empty()) hints.push_back(fmt::format("of use as well: {}", fmt::join(useful, ", ")));
  refuse_data(fmt::format("{}: {} {} missing; {}. The file has: {}.", table.file, fmt::join(missing_ones, " and "),
                          missing_ones.size() == 1 ? "is" : "are", fmt::join(hints, "; "), table.has()));
}

}  // namespace identify

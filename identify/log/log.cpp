// SPDX-License-Identifier: MIT
#include "identify/log/log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "identify/log/clock.hpp"
#include "identify/log/derived.hpp"
#include "identify/log/filled.hpp"
#include "identify/log/impossible.hpp"
#include "identify/log/masks.hpp"
#include "identify/log/pauses.hpp"
#include "identify/log/rows.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

using wire::pc::refuse;
using wire::pc::refuse_data;

constexpr Role signed_roles[] = {Role::current, Role::id,     Role::iq,    Role::phase_a, Role::phase_b,
                                 Role::phase_c, Role::torque, Role::power, Role::speed};

/// Columns that are read and checked, and that nothing comes of.
void note_unused(Log& log) {
  const auto names = [&](std::initializer_list<Role> roles) {
    std::vector<std::string> there;
    for (const Role role : roles) {
      if (log.has(role)) there.push_back(own_name(role));
    }
    return there;
  };
  std::vector<std::string> unused =
      names({Role::phase_a, Role::phase_b, Role::phase_c, Role::torque, Role::bus_V, Role::bus_A, Role::board});
  if (log.has(Role::winding_ohm) && log.has(Role::core)) unused.push_back(own_name(Role::winding_ohm));
  if (log.has(Role::power)) {
    const auto currents = names({Role::current, Role::id, Role::iq});
    if (!currents.empty()) {
      log.notes.push_back(fmt::format(
          "power_W is taken for the heat, and not {}; to fit by the current instead, delete the power's column.",
          fmt::join(currents, ", ")));
    }
  } else if (log.has(Role::id) && !log.has(Role::iq)) {
    unused.push_back(own_name(Role::id));
  }
  if (!unused.empty())
    log.notes.push_back(fmt::format("{} {} not used.", fmt::join(unused, ", "), unused.size() == 1 ? "is" : "are"));
}

/// What is 0 in all rows beside another column that tells the heat, as loggers write what nothing measured.
void forget_idle_heat(Log& log) {
  constexpr Role heats[] = {Role::power,   Role::current, Role::iq,    Role::phase_a,
                            Role::phase_b, Role::phase_c, Role::torque};
  const auto flows = [&](Role role) { return largest_magnitude(log.of(role)) > 0; };
  const auto other = std::find_if(std::begin(heats), std::end(heats), flows);
  if (other == std::end(heats)) return;
  for (const Role role : {Role::power, Role::current, Role::iq}) {
    if (!log.has(role) || flows(role)) continue;
    log.of(role).clear();
    log.notes.push_back(
        fmt::format("{} is 0 in all rows, beside {}, and was left out.", own_name(role), own_name(*other)));
  }
}

/// The least number of 16 bits, which PX4 writes where no sensor is.
void forget_unread(std::vector<double>& cells, const std::string& column, std::vector<std::string>& notes) {
  constexpr double no_reading = -32768;
  const auto unread = std::count(cells.begin(), cells.end(), no_reading);
  if (unread == 0) return;
  std::replace(cells.begin(), cells.end(), no_reading, missing);
  notes.push_back(fmt::format("Column '{}' is {:g} in {} rows, which count as not read.", column, no_reading, unread));
}

/// What a column of a sensor that is not connected says; empty: it may be one that is. 0 degC or -1 all along, and not
/// by a hundredth otherwise, is no weather, nor is what noise makes of an open thermistor, about -75 (VESC).
std::string not_connected(const std::vector<double>& degC) {
  constexpr double no_weather_degC = -45;
  if (count_told(degC) < 2) return "";
  if (stands(degC) && (lowest(degC) == 0 || lowest(degC) == -1)) return fmt::format("is {:g}", lowest(degC));
  return highest(degC) < no_weather_degC ? fmt::format("is below {:g}", no_weather_degC) : "";
}

Log one_log(const Table& table, const std::map<Role, Source>& found, const std::vector<std::size_t>& chosen,
            const std::string& name, const std::optional<wire::Motor>& motor) {
  Log log;
  log.name = name;
  const std::size_t time_column = index_of(table, found.at(Role::time));
  const auto& time = table.columns[time_column];
  std::vector<std::size_t> rows;
  for (const std::size_t r : chosen) {
    if (!std::isnan(time[r])) rows.push_back(r);
  }
  if (rows.size() * 3 < chosen.size() * 2 || rows.empty())
    refuse_data(fmt::format("{}: {} of {} rows have no time; record the log again.", name, chosen.size() - rows.size(),
                            chosen.size()));
  if (rows.size() < chosen.size())
    log.notes.push_back(fmt::format("{} rows without a time were left out.", chosen.size() - rows.size()));
  if (const std::size_t moved = put_in_order(rows, time); moved > 0)
    log.notes.push_back(fmt::format("Rows that were out of order by a few were sorted by time: {}.", moved));
  if (const std::size_t repeated = drop_repeated(rows, table, time); repeated > 0)
    log.notes.push_back(fmt::format("Rows that are the same as the row before were left out: {}.", repeated));
  for (const auto& [role, source] : found) {
    if (role == Role::session) continue;
    log.called[static_cast<std::size_t>(role)] = source.column;
    if (role == Role::speed) log.speed_guessed = source.unit_guessed;
    const auto& from = table.columns[index_of(table, source)];
    auto& to = log.of(role);
    to.reserve(rows.size());
    for (const std::size_t r : rows) to.push_back(from[r]);
    const bool is_temperature = std::count(std::begin(temperatures), std::end(temperatures), role) > 0;
    if (is_temperature) forget_unread(to, source.column, log.notes);
    const bool flows_or_turns = std::count(std::begin(signed_roles), std::end(signed_roles), role) > 0;
    if (const int bits = flows_or_turns ? give_sign(to) : 0; bits > 0)
      log.notes.push_back(fmt::format("Column '{}' shows negative numbers without their sign, {:.0f} for -1; read so.",
                                      source.column, std::exp2(bits) - 1));
    for (double& x : to) x = source.factor * (x + source.offset);
    if (const std::string idle = is_temperature ? not_connected(to) : ""; !idle.empty()) {
      const std::string why = fmt::format("{} in all rows, as of a sensor that is not connected", idle);
      // Without a temperature of the motor nobody would see the note.
      const bool other = std::any_of(found.begin(), found.end(), [&](const auto& f) {
        return f.first != role && (f.first == Role::housing || f.first == Role::core || f.first == Role::winding_ohm);
      });
      if ((role == Role::housing || role == Role::core) && !other)
        refuse_data(fmt::format("{}: column '{}' {}; connect it and record the log again, or map another as {}.", name,
                                source.column, why, own_name(role)));
      log.notes.push_back(fmt::format("{} {}, and was left out.", own_name(role), why));
      to.clear();
    } else if (count_told(to) == 0) {
      to.clear();
      log.notes.push_back(
          fmt::format("Column '{}' ({}) has no value at all and was left out.", source.column, own_name(role)));
    }
  }
  forget_idle_heat(log);
  read_phases(log);
  if (!log.has(Role::current) && !log.has(Role::iq) && !log.has(Role::power) && !log.has(Role::torque))
    refuse_data(name +
                ": the heat input (current_A, iq_A, power_W or torque_Nm) has no value at all; record the log again.");
  check_alone(log, found);
  check_epoch(log, time[rows.front()]);
  if (table.of_day[time_column] || counts_from_midnight(table.names[time_column])) pass_midnights(log);
  check_time(table, log, rows);
  spread_shared_times(log);
  const double start_s = log.of(Role::time).front();
  for (double& t : log.of(Role::time)) t -= start_s;
  read_torque(log, motor);
  read_resistance(log);
  note_unused(log);
  return log;
}

}  // namespace

std::string column_in(const Log& log, Role role, const std::string& unit) {
  const std::string& called = log.called[static_cast<std::size_t>(role)];
  return fmt::format("--column {}={}", own_name(role),
                     for_a_shell((called.empty() ? own_name(role) : called) + ":" + unit));
}

bool resumes(const Log& log, double after_s, double until_s) {
  return std::any_of(log.resumes_s.begin(), log.resumes_s.end(), [&](double s) { return s > after_s && s <= until_s; });
}

Role heat_of(const Log& log) {
  for (const Role role : {Role::power, Role::current}) {
    if (log.has(role)) return role;
  }
  return Role::iq;
}

const char* heat_word(const Log& log) {
  return log.has(Role::power) ? "power" : log.torque_for_A ? "torque" : "current";
}

Role sink_of(const Log& log) { return log.has(Role::coolant) ? Role::coolant : Role::ambient; }

double first_degC(const Log& log) {
  const Role sensor = count_told(log.of(Role::housing)) > 0 ? Role::housing : Role::core;
  constexpr double hardly = 0.05;  // of the most: a 400th of its heat
  std::size_t rest = log.of(Role::time).size();
  for (const Role role : {heat_of(log), Role::speed}) {
    const double most = hardly * largest_magnitude(log.of(role));
    for (std::size_t i = 0; i < log.of(role).size(); ++i) {
      if (std::abs(log.of(role)[i]) > most) rest = std::min(rest, i);
    }
  }
  double sum = 0, n = 0;
  for (std::size_t i = 0; i < log.of(sensor).size() && (i < rest || n == 0); ++i) {
    if (!std::isnan(log.of(sensor)[i])) sum += log.of(sensor)[i], n += 1;
  }
  return n > 0 ? sum / n : missing;
}

Log without_last(Log log, double fraction) {
  const auto& t = log.of(Role::time);
  const auto end = std::lower_bound(t.begin(), t.end(), (1 - fraction) * t.back());
  const auto rows = static_cast<std::size_t>(std::max(end - t.begin(), std::ptrdiff_t{1}));
  for (std::vector<double>& column : log.columns) column.resize(std::min(column.size(), rows));
  return log;
}

std::vector<double> a_row_sooner(std::vector<double> column) {
  column.erase(column.begin());
  column.push_back(column.back());
  return column;
}

Log loaded_before(Log log, const char* why) {
  for (const Role role : load_roles) {
    if (log.has(role)) log.of(role) = a_row_sooner(std::move(log.of(role)));
  }
  log.loaded_before = true;
  log.notes.push_back(fmt::format("Current and speed of a row are taken for those since the row before it: {}.", why));
  return log;
}

std::vector<Log> logs_of(Table table, const ColumnMap& map, const std::optional<wire::Motor>& motor) {
  std::vector<std::string> unit_notes = table.notes;
  keep_rows(table, map.rows);
  auto found = resolve(table, map, unit_notes);
  const auto has = [&](Role r) { return found.contains(r); };
  if (has(Role::time) && add_days(table, index_of(table, found.at(Role::time))))
    unit_notes.push_back(fmt::format("Column '{}' tells the day of '{}'.",
                                     table.names[static_cast<std::size_t>(date_column(table))],
                                     found.at(Role::time).column));
  const bool by_row = !std::isnan(map.period_s);
  if (by_row && has(Role::time))
    refuse(fmt::format("{}: its column '{}' tells the time; leave the period of its rows away.", table.file,
                       found.at(Role::time).column));
  std::vector<std::size_t> known;
  for (const auto& [role, source] : found) {
    if (role != Role::session) known.push_back(index_of(table, source));
  }
  const auto first_of = [&](std::initializer_list<Role> roles) {
    return index_of(table, found.at(*std::find_if(roles.begin(), roles.end(), has)));
  };
  const bool one_clock = has(Role::time) && !has(Role::session);
  const std::string several =
      several_motors(table, one_clock ? table.columns[first_of({Role::time})] : std::vector<double>(),
                     first_of({Role::current, Role::iq, Role::phase_a, Role::phase_b, Role::power, Role::torque}),
                     first_of({Role::housing, Role::core}), known);
  if (!several.empty()) refuse_data(several);
  const int session = has(Role::session) ? table.find(found.at(Role::session).column) : -1;
  const std::vector<Session> sessions = sessions_of(table, session);
  if (sessions.empty())
    refuse_data(fmt::format("{}: column '{}' has no value, so no row belongs to a session; fill it or rename it.",
                            table.file, found.at(Role::session).column));
  if (by_row) found[Role::time] = give_clock(table, sessions, map.period_s);
  std::vector<Log> logs;
  for (const auto& [name, rows] : sessions) {
    Log whole = one_log(table, found, rows,
                        name.empty() ? table.file : fmt::format("{} (session {})", table.file, name), motor);
    if (!std::isnan(map.ambient_degC)) {
      if (whole.has(sink_of(whole)))
        whole.notes.push_back(fmt::format(
            "The log's own {} tells how warm the surroundings are; --ambient is not used.", own_name(sink_of(whole))));
      else
        whole.of(Role::ambient).assign(whole.of(Role::time).size(), map.ambient_degC), whole.sink_typed = true;
    }
    forget_impossible(whole);
    forget_filled(whole);
    const std::size_t read = count_told(whole.of(Role::housing)) + count_told(whole.of(Role::core));
    forget_glitches(whole);
    if (by_row) check_rows_follow(whole, read);
    check_values(whole, motor);
    for (Log& log : parts_between_pauses(std::move(whole))) {
      mask(log);
      check_order(log);
      if (map.averaged) log = loaded_before(std::move(log), "it was said that they are averaged");
      log.averaged = map.averaged;
      logs.push_back(std::move(log));
    }
  }
  logs.front().notes.insert(logs.front().notes.begin(), unit_notes.begin(), unit_notes.end());
  std::size_t in_a_session = 0;
  for (const Session& s : sessions) in_a_session += s.rows.size();
  if (in_a_session < table.rows())
    logs.front().notes.push_back(fmt::format("{} rows without a session were left out.", table.rows() - in_a_session));
  return logs;
}

}  // namespace identify

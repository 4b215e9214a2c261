// SPDX-License-Identifier: MIT
#include "identify/log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>

#include "identify/clock.hpp"
#include "identify/filled.hpp"
#include "identify/masks.hpp"
#include "identify/pauses.hpp"
#include "identify/rows.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

using wire::pc::refuse;
using wire::pc::refuse_data;

void check_range(const Log& log, Role role, double low, double high, const std::string& unit) {
  for (const double v : log.of(role)) {
    if (v < low || v > high)
      refuse_data(fmt::format("{}: {} reaches {:g}; {} to {} {} is possible: check the unit or mask the value.",
                              log.name, own_name(role), v, low, high, unit));
  }
}

double lowest(const std::vector<double>& v) {
  double low = missing;
  for (const double x : v) low = std::fmin(low, x);  // which passes over what is missing
  return low;
}

/// 40 times rated current would heat any winding of the sheet by hundreds of kelvin a second; without a sheet 1000 A is
/// beyond any board this project drives or any traction log it was shown.
double most_current_A(const std::optional<wire::Motor>& motor) { return motor ? 40 * motor->rated_current_A : 1000; }

/// What a logger writes for a sensor that does not answer, -999 or -32768, is no temperature.
void forget_impossible(Log& log) {
  constexpr double zero_K_degC = -273.15, few = 0.05;  // of the readings: more are another unit
  for (const Role role : temperatures) {
    const auto impossible =
        std::count_if(log.of(role).begin(), log.of(role).end(), [](double x) { return x < zero_K_degC; });
    if (impossible == 0 || static_cast<double>(impossible) > few * static_cast<double>(count_told(log.of(role))))
      continue;
    log.notes.push_back(
        fmt::format("{} is below 0 K in {} rows, which count as not read.", own_name(role), impossible));
    std::replace_if(
        log.of(role).begin(), log.of(role).end(), [](double x) { return x < zero_K_degC; }, missing);
  }
}

/// Deviations from a mean, or shares of a range, as data sets for machine learning have them, in all columns.
void check_normalised(const Log& log) {
  constexpr double most = 6;  // standard deviations, or what they would be in A, rad/s and degC: no use
  const auto told_small = [&](const auto& roles) {
    double largest = 0;
    for (const Role role : roles) largest = std::max(largest, largest_magnitude(log.of(role)));
    return largest > 0 && largest <= most;
  };
  const auto moves = [&](Role role) { return largest_magnitude(spacing(log.of(role))) > 0; };
  if (told_small(temperatures) && told_small(load_roles) &&
      std::any_of(std::begin(temperatures), std::end(temperatures), moves))
    refuse_data(
        fmt::format("{}: no column, temperatures and load, exceeds {:g}, as if they were normalised; give them as "
                    "they were measured, in degC, A and rad/s.",
                    log.name, most));
}

/// Units that a header did not tell: values that no motor shows.
void check_values(const Log& log, const std::optional<wire::Motor>& motor) {
  check_normalised(log);
  for (const Role role : temperatures) {
    if (!log.has(role)) continue;
    const double low = lowest(log.of(role));
    // Nothing that a person works beside is always hotter than 200 degC; 200 K is -73 degC.
    if (low > 450)
      refuse_data(
          fmt::format("{}: {} never falls below {:.0f}, which looks like parts of a degree; say --column "
                      "{}=COLUMN:0.01degC (or what one is worth).",
                      log.name, own_name(role), low, own_name(role)));
    if (low > 200)
      refuse_data(fmt::format("{}: {} never falls below {:.0f}, which looks like kelvin; say --column {}=COLUMN:K.",
                              log.name, own_name(role), low, own_name(role)));
    // A room is 10..45 degC, which reads 50..113 in Fahrenheit. Coolant and motors may truly be that warm, a room may
    // not.
    if (role == Role::ambient && low > 55)
      refuse_data(
          fmt::format("{}: ambient_degC never falls below {:.0f}, which looks like Fahrenheit; say --column "
                      "ambient_degC=COLUMN:degF (and the same for the other temperatures).",
                      log.name, low));
    check_range(log, role, -80, 600, "degC");
  }
  // Without anything that says how warm it is around the motor, a motor that is never cooler than a room can be is no
  // use, whatever its unit.
  const Role motor_at = log.has(Role::housing) ? Role::housing : Role::core;
  if (!log.has(sink_of(log)) && lowest(log.of(motor_at)) > 55)
    refuse_data(
        fmt::format("{0}: {1} never falls below {2:.0f} and there is no ambient_degC: if this is Fahrenheit "
                    "say --column {1}=COLUMN:degF, otherwise record the ambient too.",
                    log.name, own_name(motor_at), lowest(log.of(motor_at))));
  const double most_A = most_current_A(motor);
  for (const Role role : {Role::current, Role::id, Role::iq}) {
    const double peak = largest_magnitude(log.of(role));
    if (peak > most_A)
      refuse_data(
          fmt::format("{0}: {1} reaches {2:.0f} A, where more than {3:.0f} A cannot be; if it is in mA say --column "
                      "{1}=COLUMN:mA, if it is another quantity map the right column.",
                      log.name, own_name(role), peak, most_A));
  }
  if (log.has(Role::speed)) check_range(log, Role::speed, -2e4, 2e4, "rad/s");
}

/// The direct current that heats alike, of the currents of the phases at each moment: 2 R i^2 = R (a^2 + b^2 + c^2).
/// Two of them tell the third, for a motor's star has no fourth wire.
void read_phases(Log& log) {
  std::vector<Role> told;
  for (const Role role : {Role::phase_a, Role::phase_b, Role::phase_c}) {
    if (log.has(role)) told.push_back(role);
  }
  if (told.empty() || log.has(Role::current) || log.has(Role::power)) return;
  const bool alternate = std::all_of(told.begin(), told.end(), [&](Role role) {
    return std::any_of(log.of(role).begin(), log.of(role).end(), [](double A) { return A < 0; });
  });
  if (told.size() == 1 || (told.size() == 2 && !alternate))
    refuse_data(fmt::format(
        "{}: {} {} how much flows; map all three phases (phase_a_A, phase_b_A, phase_c_A).", log.name,
        own_name(told.front()),
        alternate ? "alternates and does not tell" : "is an effective value and with one other does not tell"));
  std::vector<double>& current = log.of(Role::current);
  for (std::size_t i = 0; i < log.of(Role::time).size(); ++i) {
    double sum_A = 0, sum_A2 = 0;
    for (const Role role : told) sum_A += log.of(role)[i], sum_A2 += log.of(role)[i] * log.of(role)[i];
    if (told.size() == 2) sum_A2 += sum_A * sum_A;
    current.push_back(std::sqrt(sum_A2 / 2));
  }
  for (const Role role : told) log.of(role).clear();
  log.notes.push_back("current_A is taken from the phases: the root of half the sum of their squares.");
}

/// Is a column called like one phase, ia or I_U?
bool called_like_a_phase(const std::string& column) {
  std::string name = in_small(column.substr(0, column.find_first_of(" [(")));
  std::erase(name, '_');
  if (name.starts_with("phase")) name.replace(0, 5, "i");
  return name.size() == 2 && name[0] == 'i' && std::string_view("abcuvw").find(name[1]) != std::string_view::npos;
}

/// Robots' logs often have a joint's torque and no current.
void read_torque(Log& log, const std::optional<wire::Motor>& motor) {
  if (!log.has(Role::torque) || log.has(Role::current) || log.has(Role::iq) || log.has(Role::power)) return;
  const double Nm_per_A = motor ? 1.5 * motor->pole_pairs * motor->flux_linkage_Wb : 1;
  for (const double Nm : log.of(Role::torque)) log.of(Role::iq).push_back(Nm / Nm_per_A);
  log.of(Role::torque).clear();
  log.torque_for_A = !motor;
  const double peak_A = largest_magnitude(log.of(Role::iq)), most_A = most_current_A(motor);
  if (peak_A > most_A)
    refuse_data(
        fmt::format("{}: torque_Nm takes {:.0f} A, where more than {:.0f} A cannot be; give the motor's own torque, "
                    "before any gear, in newton metres.",
                    log.name, peak_A, most_A));
  log.notes.push_back(fmt::format("iq_A is torque_Nm at {:.4g} N m/A{}.", Nm_per_A,
                                  motor ? ", by the motor file; it must be the motor's own torque, before any gear"
                                        : ", for want of a motor file: R1 and R2 come out multiplied by the square of "
                                          "the true A/N m, C1 and C2 divided by it"));
}

/// More current makes a winding hotter than its housing within seconds. Where it makes it cooler, and the housing moves
/// more than the winding, the two columns are swapped. One sign alone may be a sensor's gain or noise; not both.
void check_order(const Log& log) {
  if (!log.has(Role::housing) || !log.has(Role::core) || !log.has(Role::current)) return;
  constexpr double apart_s = 20;  // far enough for a winding to have moved, and noise not to count
  const auto &t = log.of(Role::time), &housing = log.of(Role::housing), &core = log.of(Role::core),
             &current = log.of(Role::current);
  double housing2 = 0, core2 = 0, over2 = 0, heat2 = 0, together = 0;
  int pairs = 0;
  double sum_A2 = 0, rows = 0, mean_A2 = 0, last_mean_A2 = 0;
  std::size_t last = t.size();
  for (std::size_t i = 0; i < t.size(); ++i) {
    if (!std::isnan(current[i])) sum_A2 += current[i] * current[i], ++rows;
    if (std::isnan(housing[i]) || std::isnan(core[i])) continue;
    if (last < t.size() && t[i] - t[last] < apart_s) continue;
    last_mean_A2 = mean_A2;
    mean_A2 = sum_A2 / std::max(rows, 1.0);
    sum_A2 = rows = 0;
    if (last < t.size()) {
      const double housing_K = housing[i] - housing[last], core_K = core[i] - core[last];
      const double over_K = core_K - housing_K, heat_A2 = mean_A2 - last_mean_A2;
      housing2 += housing_K * housing_K;
      core2 += core_K * core_K;
      over2 += over_K * over_K;
      heat2 += heat_A2 * heat_A2;
      together += over_K * heat_A2;
      ++pairs;
    }
    last = i;
  }
  // A correlation of -0.35 in ten pairs is chance in one of six, and the other condition another. A sensor that sits on
  // the winding moves as much as it does, by chance a little more; a housing that a warm frame moves, 1.31 times (score
  // designed-sparse, frame_conduction 75001255).
  constexpr double clearly = 2;
  if (pairs < 10 || !(housing2 > clearly * core2) || !(together < -0.35 * std::sqrt(over2 * heat2))) return;
  refuse_data(
      fmt::format("{}: core_degC falls against housing_degC when the current rises, and moves less: the two "
                  "columns are swapped; map them with --column.",
                  log.name));
}

/// The mean of the middle half: of two both count, and one reading of three that went wrong does not. Missing when
/// there is none.
double middle(std::vector<double> v) {
  if (v.empty()) return missing;
  std::sort(v.begin(), v.end());
  const auto cut = static_cast<std::ptrdiff_t>((v.size() + 1) / 4);
  return std::accumulate(v.begin() + cut, v.end() - cut, 0.0) / static_cast<double>(std::ssize(v) - 2 * cut);
}

/// How many rows come before anything heats or turns. One part in a thousand of the most heat is a sensor's offset, or
/// its noise where it is not so three times running; a hundredth is neither. A row that tells nothing, as of a bus
/// that writes one message a row, is rest between two that do.
std::size_t rows_at_rest(const Log& log) {
  const auto heat = [&](std::size_t i) {
    if (log.has(Role::power)) return std::abs(log.of(Role::power)[i]);
    double A2 = 0;
    for (const Role role : {Role::current, Role::id, Role::iq}) {
      if (log.has(role)) A2 += log.of(role)[i] * log.of(role)[i];
    }
    return A2;
  };
  const std::size_t rows = log.of(Role::time).size();
  double most = 0;
  for (std::size_t i = 0; i < rows; ++i) most = std::max(most, heat(i));
  const double least_rad_per_s = 0.02 * largest_magnitude(log.of(Role::speed));  // as bins.cpp takes it for idle
  const auto turns = [&](std::size_t i) {
    return log.has(Role::speed) && std::abs(log.of(Role::speed)[i]) > least_rad_per_s;
  };
  constexpr double untold_s = 5;  // longer is a pause (pauses.cpp), in which anything may flow
  const std::vector<double>& t = log.of(Role::time);
  double told_s = t.front();
  std::size_t rest = 0;
  for (std::size_t i = 0, running = 0; i < rows && !turns(i) && !(heat(i) > 1e-2 * most); ++i) {
    const bool told = !std::isnan(heat(i));
    if (!told && t[i] - told_s > untold_s) break;
    if (!told) continue;
    told_s = t[i];
    running = heat(i) > 1e-3 * most ? running + 1 : 0;
    if (running == 3) break;
    if (running == 0) rest = i + 1;
  }
  return rest;
}

/// The winding's resistance tells its temperature once both are known of one moment: at the start, where a motor that
/// rested is as warm as the room everywhere. All readings of that rest count: what they are off by, all that follow
/// are.
void read_resistance(Log& log) {
  constexpr double soaked_K = 1;  // two sensors beside each other differ by as much
  if (!log.has(Role::winding_ohm) || log.has(Role::core)) return;
  std::vector<double>& ohm = log.of(Role::winding_ohm);
  int nothing = 0;
  for (double& x : ohm) {
    if (x <= 0) x = missing, ++nothing;
  }
  if (nothing > 0)
    log.notes.push_back(fmt::format("Cells of winding_ohm that say 0 or less are taken for no reading: {}.", nothing));
  const std::size_t rest = rows_at_rest(log);
  const auto at_rest = [&](Role role) {
    std::vector<double> readings;
    for (std::size_t i = 0; log.has(role) && i < rest; ++i) {
      if (!std::isnan(log.of(role)[i])) readings.push_back(log.of(role)[i]);
    }
    return readings;
  };
  const std::vector<double> readings_ohm = at_rest(Role::winding_ohm);
  const double start_ohm = middle(readings_ohm), start_degC = middle(at_rest(Role::housing));
  bool soaked = !readings_ohm.empty() && !std::isnan(start_degC);
  for (const Role role : {Role::ambient, Role::coolant})
    soaked = soaked && (!log.has(role) || std::abs(middle(at_rest(role)) - start_degC) <= soaked_K);
  if (!soaked) {
    log.notes.push_back(
        "winding_ohm is not used, since its temperature is known at no moment: begin the log at rest, all at room "
        "temperature, with readings of it, the housing and the room, or convert it to core_degC yourself.");
    return;
  }
  log.of(Role::core) = std::move(ohm);
  ohm.clear();
  log.core_reference = {start_degC, readings_ohm.size()};
  for (double& x : log.of(Role::core)) x = no_ohm_degC + x / start_ohm * (start_degC - no_ohm_degC);
  log.notes.push_back(fmt::format(
      "winding_ohm is read as core_degC by copper's 0.393 %/K, from {:.4g} ohm at {:.1f} degC at the "
      "start ({} reading{}), where all of the motor is taken to be as warm as its housing; leads in it that "
      "stay cool look like a gain of the housing's sensor.",
      start_ohm, start_degC, readings_ohm.size(), readings_ohm.size() == 1 ? "" : "s"));
}

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
    const auto& from = table.columns[index_of(table, source)];
    auto& to = log.of(role);
    to.reserve(rows.size());
    for (const std::size_t r : rows) to.push_back(source.factor * (from[r] + source.offset));
    // A sensor that is not connected; 0 degC all along, and not by a hundredth otherwise, is no weather.
    const bool unplugged = std::count(std::begin(temperatures), std::end(temperatures), role) > 0 &&
                           count_told(to) > 1 && largest_magnitude(to) == 0;
    if (unplugged) {
      to.clear();
      log.notes.push_back(
          fmt::format("{} is 0 in all rows, as of a sensor that is not connected, and was left out.", own_name(role)));
    } else if (count_told(to) == 0) {
      to.clear();
      log.notes.push_back(
          fmt::format("Column '{}' ({}) has no value at all and was left out.", source.column, own_name(role)));
    }
  }
  read_phases(log);
  if (!log.has(Role::current) && !log.has(Role::iq) && !log.has(Role::power) && !log.has(Role::torque))
    refuse_data(name +
                ": the heat input (current_A, iq_A, power_W or torque_Nm) has no value at all; record the log again.");
  for (const Role role : {Role::current, Role::iq}) {
    const auto source = found.find(role);
    const auto alternates = [&] { return lowest(log.of(role)) < -0.5 * largest_magnitude(log.of(role)); };
    if (source != found.end() && called_like_a_phase(source->second.column) && alternates())
      refuse_data(
          fmt::format("{}: column '{}' is called like one phase, whose current alternates; map all of them "
                      "(--column phase_a_A={} and phase_b_A, phase_c_A).",
                      name, source->second.column, source->second.column));
  }
  check_epoch(log, time[rows.front()]);
  if (table.of_day[time_column]) pass_midnights(log);
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
  const auto rows = static_cast<std::size_t>(end - t.begin());
  for (std::vector<double>& column : log.columns) column.resize(std::min(column.size(), rows));
  return log;
}

std::vector<double> a_row_sooner(std::vector<double> column) {
  column.erase(column.begin());
  column.push_back(column.back());
  return column;
}

Log loaded_before(Log log) {
  for (const Role role : load_roles) {
    if (log.has(role)) log.of(role) = a_row_sooner(std::move(log.of(role)));
  }
  log.loaded_before = true;
  log.notes.push_back(
      "Current and speed of a row are taken for those since the row before it: the temperatures ask it.");
  return log;
}

std::vector<Log> logs_of(Table table, const ColumnMap& map, const std::optional<wire::Motor>& motor) {
  std::vector<std::string> unit_notes = table.notes;
  keep_rows(table, map.rows);
  auto found = resolve(table, map, unit_notes);
  const auto has = [&](Role r) { return found.contains(r); };
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
  const std::string several = several_motors(
      table, first_of({Role::current, Role::iq, Role::phase_a, Role::phase_b, Role::power, Role::torque}),
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
    forget_glitches(whole);
    check_values(whole, motor);
    for (Log& log : parts_between_pauses(std::move(whole))) {
      mask(log);
      check_order(log);
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

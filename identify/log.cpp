// SPDX-License-Identifier: MIT
#include "identify/log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>

#include "identify/filled.hpp"
#include "identify/masks.hpp"
#include "identify/median.hpp"
#include "identify/pauses.hpp"
#include "identify/rows.hpp"
#include "identify/units.hpp"
#include "wire/pc/names.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

using wire::pc::Exit;
using wire::pc::UserError;

[[noreturn]] void refuse(const std::string& sentence) { throw UserError(Exit::unusable, sentence); }

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
  throw UserError(Exit::usage, fmt::format("{}: there is no role '{}'{} (roles: {}).", where, name,
                                           wire::pc::did_you_mean(name, {own_names().begin(), own_names().end()}),
                                           fmt::join(own_names(), ", ")));
}

std::size_t index_of(const Table& table, const Source& source) {
  return static_cast<std::size_t>(table.find(source.column));
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
      throw UserError(Exit::usage,
                      fmt::format("{}: column '{}' for {} is missing{}{} (the file has: {}).", table.file,
                                  source.column, own_name(role), wire::pc::did_you_mean(source.column, table.names),
                                  no_unit, fmt::join(table.names, ", ")));
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
        refuse(fmt::format("{}: column '{}' is in {}, but {} is expected; say --column {}={}:{} to convert it.",
                           table.file, header, unit, name, name, header, unit));
      if (!taken.empty())
        refuse(fmt::format("{}: columns '{}' and '{}' may both be {}; say which with --column {}=NAME.", table.file,
                           taken, header, name, name));
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
    refuse(table.complaints[column]);
  notes.push_back(fmt::format("Cells of column '{}' with a word in them ('{}') count as not read: {}.",
                              table.names[column], words.seen.front(), count));
}

/// Where each role comes from, and in which unit; a note says which units nobody typed.
std::map<Role, Source> resolve(const Table& table, const ColumnMap& map, std::vector<std::string>& notes) {
  std::map<Role, Source> found = from_map(table, map);
  add_own_names(table, map, found);
  std::vector<std::string> by_row, by_name;
  for (auto& [role, source] : found) {
    for (const auto& [other, same] : found) {
      if (other < role && same.column == source.column)
        refuse(fmt::format("{}: column '{}' cannot be both {} and {}; map another one.", table.file, source.column,
                           own_name(other), own_name(role)));
    }
    if (std::count(table.names.begin(), table.names.end(), source.column) > 1)
      refuse(
          fmt::format("{}: column '{}' stands there twice; rename or delete one of them.", table.file, source.column));
    take_words(table, index_of(table, source), role, notes);
    if (source.unit_said) continue;
    std::string unit = table.units.empty() ? "" : table.units[index_of(table, source)];
    if (unit.size() > 2 && (unit.front() == '[' || unit.front() == '(')) unit = unit.substr(1, unit.size() - 2);
    std::vector<std::string>& by = unit.empty() ? by_name : by_row;
    if (unit.empty()) unit = unit_in_name(source.column, own_name(role));
    // "T [case]" tells no unit; "[Umdr./min]" tells one.
    if (const std::string told = bracketed(source.column); unit.empty() && told.find_first_of("/^%") != told.npos)
      notes.push_back(fmt::format(
          "The unit '{}' of column '{}' is not known and not used; say --column {}={}:UNIT if it "
          "is not the one in {} (units: {}).",
          told, source.column, own_name(role), source.column, own_name(role), fmt::join(unit_names(), ", ")));
    if (!unit.empty())
      apply_unit(unit, own_name(role),
                 fmt::format("{}: the row of units below the header, column '{}' (--column {}={}:UNIT overrules it)",
                             table.file, source.column, own_name(role), source.column),
                 Exit::unusable, source.factor, source.offset);
    if (source.factor != 1 || source.offset != 0) by.push_back(fmt::format("{} in {}", own_name(role), unit));
  }
  if (!by_row.empty())
    notes.push_back(fmt::format("Units are taken from the row below the header: {}.", fmt::join(by_row, ", ")));
  if (!by_name.empty())
    notes.push_back(fmt::format("Units are taken from the columns' names: {}.", fmt::join(by_name, ", ")));
  return found;
}

void check_range(const Log& log, Role role, double low, double high, const std::string& unit) {
  for (const double v : log.of(role)) {
    if (v < low || v > high)
      refuse(fmt::format("{}: {} reaches {:g}; {} to {} {} is possible: check the unit or mask the value.", log.name,
                         own_name(role), v, low, high, unit));
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
  if (told_small(temperatures) && told_small(load_roles))
    refuse(
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
      refuse(
          fmt::format("{}: {} never falls below {:.0f}, which looks like parts of a degree; say --column "
                      "{}=COLUMN:0.01degC (or what one is worth).",
                      log.name, own_name(role), low, own_name(role)));
    if (low > 200)
      refuse(fmt::format("{}: {} never falls below {:.0f}, which looks like kelvin; say --column {}=COLUMN:K.",
                         log.name, own_name(role), low, own_name(role)));
    // A room is 10..45 degC, which reads 50..113 in Fahrenheit. Coolant and motors may truly be that warm, a room may
    // not.
    if (role == Role::ambient && low > 55)
      refuse(
          fmt::format("{}: ambient_degC never falls below {:.0f}, which looks like Fahrenheit; say --column "
                      "ambient_degC=COLUMN:degF (and the same for the other temperatures).",
                      log.name, low));
    check_range(log, role, -80, 600, "degC");
  }
  // Without anything that says how warm it is around the motor, a motor that is never cooler than a room can be is no
  // use, whatever its unit.
  const Role motor_at = log.has(Role::housing) ? Role::housing : Role::core;
  if (!log.has(sink_of(log)) && lowest(log.of(motor_at)) > 55)
    refuse(
        fmt::format("{0}: {1} never falls below {2:.0f} and there is no ambient_degC: if this is Fahrenheit "
                    "say --column {1}=COLUMN:degF, otherwise record the ambient too.",
                    log.name, own_name(motor_at), lowest(log.of(motor_at))));
  const double most_A = most_current_A(motor);
  for (const Role role : {Role::current, Role::id, Role::iq}) {
    const double peak = largest_magnitude(log.of(role));
    if (peak > most_A)
      refuse(
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
    refuse(fmt::format(
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
    refuse(
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
  refuse(
      fmt::format("{}: core_degC falls against housing_degC when the current rises, and moves less: the two "
                  "columns are swapped; map them with --column.",
                  log.name));
}

/// A clock that counts from 1970 and in no seconds. 1e11 s is in the year 5138.
void check_epoch(const Log& log, double first_cell) {
  if (log.of(Role::time).front() < 1e11) return;
  const std::string unit = first_cell > 1e17 ? "ns" : first_cell > 1e14 ? "us" : first_cell > 1e11 ? "ms" : "s";
  refuse(fmt::format("{}: the first time is {:.0f}, which looks like {} since 1970; say --column time_s=COLUMN:{}.",
                     log.name, first_cell, unit, unit));
}

void check_time(const Table& table, const Log& log, const std::vector<std::size_t>& rows) {
  const auto& t = log.of(Role::time);
  const std::vector<double> spacing_s = spacing(t);
  std::vector<std::size_t> falls;
  for (std::size_t i = 1; i < t.size(); ++i) {
    if (t[i] < t[i - 1]) falls.push_back(i);
  }
  if (falls.empty()) return;
  constexpr double correction_s = 5;  // a clock that is set right by another jumps by less
  const std::size_t first = falls.front();
  const std::string what_to_do =
      *std::min_element(spacing_s.begin(), spacing_s.end()) < -correction_s
          ? "(two recordings joined, or two clocks); split the file there or give it a session column"
      : falls.size() > 2
          ? fmt::format("and in {} places (rows out of order); sort the rows by time", falls.size())
          : fmt::format(
                "(a clock that was set while it recorded); add {:.3g} s to the times from there on, or split "
                "the file there",
                t[first - 1] - t[first] + median(spacing_s));
  refuse(fmt::format("{}, line {}: time runs backwards from {:.12g} to {:.12g} s {}.", table.file,
                     table.line[rows[first]], t[first - 1], t[first], what_to_do));
}

/// Sorts rows of which some few, each for itself, stand up to five too late, as of messages that overtook each other;
/// how many did. A clock that was set back stays so for more than a row.
std::size_t put_in_order(std::vector<std::size_t>& rows, const std::vector<double>& time) {
  constexpr std::size_t most_late = 5;
  constexpr double most_share = 0.05;
  std::size_t moved = 0, latest = 0;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    if (time[rows[i]] >= time[rows[latest]]) {
      latest = i;
      continue;
    }
    const bool alone = latest + 1 == i;
    if (!alone || (i > most_late && time[rows[i]] < time[rows[i - most_late - 1]])) return 0;
    ++moved;
  }
  if (static_cast<double>(moved) > most_share * static_cast<double>(rows.size())) return 0;
  std::stable_sort(rows.begin(), rows.end(), [&](std::size_t a, std::size_t b) { return time[a] < time[b]; });
  return moved;
}

/// Times told too coarsely for the rows, in whole seconds most often: rows that share one are spread until the next.
void spread_shared_times(Log& log) {
  std::vector<double>& t = log.of(Role::time);
  std::vector<std::size_t> first = {0};
  for (std::size_t i = 1; i < t.size(); ++i) {
    if (t[i] != t[i - 1]) first.push_back(i);
  }
  if (first.size() < 3 || t.size() < 2 * first.size()) return;
  const std::vector<double> told_s = t;
  std::vector<double> steps_s;
  for (std::size_t k = 1; k < first.size(); ++k) steps_s.push_back(told_s[first[k]] - told_s[first[k - 1]]);
  const double step_s = median(steps_s);
  std::vector<double> rows;
  for (std::size_t k = 1; k < first.size(); ++k) rows.push_back(static_cast<double>(first[k] - first[k - 1]));
  const double usual = median(rows);
  first.push_back(t.size());
  for (std::size_t k = 0; k + 1 < first.size(); ++k) {
    // The log may begin and end within a step; what is missing of the first is missing before it.
    const double count = std::max(usual, static_cast<double>(first[k + 1] - first[k]));
    const double skipped = k == 0 ? count - static_cast<double>(first[1]) : 0;
    for (std::size_t i = first[k]; i < first[k + 1]; ++i)
      t[i] = told_s[i] + step_s * (static_cast<double>(i - first[k]) + skipped) / count;
  }
  log.notes.push_back(
      fmt::format("About {:g} rows share each time; they are spread over the {:g} s to the next.", usual, step_s));
}

/// Takes rows away that say again, time and all, what the row before them says; how many.
std::size_t drop_repeated(std::vector<std::size_t>& rows, const Table& table, const std::vector<double>& time) {
  const auto same = [&](std::size_t a, std::size_t b) {
    return time[a] == time[b] && std::all_of(table.columns.begin(), table.columns.end(), [&](const auto& column) {
             return column[a] == column[b] || (std::isnan(column[a]) && std::isnan(column[b]));
           });
  };
  const auto end = std::unique(rows.begin(), rows.end(), same);
  const auto repeated = static_cast<std::size_t>(rows.end() - end);
  rows.erase(end, rows.end());
  return repeated;
}

/// A time of day that falls by half a day or more has passed midnight; one that rises by nearly a day is a row from
/// before it, out of order.
void pass_midnights(Log& log) {
  constexpr double day_s = 86400, near_s = 600;
  double before_s = 0;
  int midnights = 0;
  for (double& t : log.of(Role::time)) {
    midnights += (before_s - t > day_s / 2) - (midnights > 0 && t - before_s > day_s - near_s);
    before_s = t;
    t += day_s * midnights;
  }
  if (midnights > 0)
    log.notes.push_back(fmt::format("The clock passes midnight {} time{}; a day is added each time.", midnights,
                                    midnights == 1 ? "" : "s"));
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

/// The first column whose name has one of these in it, as a command line takes it; NAME where none has.
std::string likely_column(const Table& table, const std::vector<const char*>& parts) {
  for (const std::string& name : table.names) {
    const std::string low = in_small(name);
    if (std::any_of(parts.begin(), parts.end(), [&](const char* p) { return low.find(p) != std::string::npos; }))
      return name.find_first_of(" ()[]'&;$*?") == std::string::npos ? name : "\"" + name + "\"";
  }
  return "NAME";
}

/// All that is missing at once, each with the column that its name speaks for.
void refuse_without_columns(const Table& table, const std::map<Role, Source>& found, bool by_row) {
  struct Need {
    std::vector<Role> any_of;
    const char *what, *hint;
    std::vector<const char*> names;  // parts of likely ones, in small letters
  };
  const Need needs[] = {{{Role::time},
                         "a time column",
                         "call it time_s, say --column time_s={}, or --period S where the rows are S seconds apart",
                         {"time", "zeit", "stamp"}},
                        {{Role::current, Role::iq, Role::phase_a, Role::phase_b, Role::power, Role::torque},
                         "the heat input (current_A, iq_A, power_W or torque_Nm)",
                         "map it with --column current_A={}",
                         {"current", "curr", "strom", "amp"}},
                        {{Role::housing, Role::core},
                         "a measured temperature (housing_degC or core_degC)",
                         "map it with --column housing_degC={}",
                         {"temp", "degc", "\u00b0c", "t_"}}};
  std::vector<std::string> missing_ones, hints;
  for (const Need& need : needs) {
    if ((by_row && need.any_of.front() == Role::time) ||
        std::any_of(need.any_of.begin(), need.any_of.end(), [&](Role r) { return found.contains(r); }))
      continue;
    missing_ones.emplace_back(need.what);
    hints.push_back(fmt::format(fmt::runtime(need.hint), likely_column(table, need.names)));
  }
  if (!missing_ones.empty())
    refuse(fmt::format("{}: {} {} missing; {}. The file has: {}.", table.file, fmt::join(missing_ones, " and "),
                       missing_ones.size() == 1 ? "is" : "are", fmt::join(hints, "; "), fmt::join(table.names, ", ")));
}

/// A column of the time since the first row of a session, of rows that are a period apart.
Source give_clock(Table& table, const std::vector<Session>& sessions, double period_s) {
  std::vector<double> time_s(table.rows(), missing);
  for (const auto& [name, rows] : sessions) {
    for (std::size_t i = 0; i < rows.size(); ++i) time_s[rows[i]] = static_cast<double>(i) * period_s;
  }
  table.names.push_back("--period");
  table.columns.push_back(std::move(time_s));
  table.words.emplace_back();
  table.of_day.push_back(false);
  return {table.names.back()};
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
    refuse(fmt::format("{}: {} of {} rows have no time; record the log again.", name, chosen.size() - rows.size(),
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
    refuse(name +
           ": the heat input (current_A, iq_A, power_W or torque_Nm) has no value at all; record the log again.");
  for (const Role role : {Role::current, Role::iq}) {
    const auto source = found.find(role);
    const auto alternates = [&] { return lowest(log.of(role)) < -0.5 * largest_magnitude(log.of(role)); };
    if (source != found.end() && called_like_a_phase(source->second.column) && alternates())
      refuse(
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

std::string roles_and_units() {
  return fmt::format("roles: {}\nunits: {}", fmt::join(own_names(), ", "), fmt::join(unit_names(), ", "));
}

const std::string& own_name(Role role) { return own_names()[static_cast<std::size_t>(role)]; }

void add_column(ColumnMap& map, const std::string& text, const std::string& from) {
  const std::string where = from + text;
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) {
    throw UserError(Exit::usage, where + ": write it as role=column or role=column:unit.");
  }
  const Role role = role_named(std::string(trimmed(std::string_view(text).substr(0, equals))), where);
  const std::string rest(trimmed(std::string_view(text).substr(equals + 1)));
  const std::size_t colon = rest.rfind(':');
  if (rest.empty() || colon == 0) {
    throw UserError(Exit::usage, where + ": the column's name is missing behind '='.");
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
    throw UserError(Exit::usage, where + ": " + own_name(role) + " was given a column before; give each role one.");
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
    throw UserError(Exit::usage, fmt::format("{}: its column '{}' tells the time; leave the period of its rows away.",
                                             table.file, found.at(Role::time).column));
  refuse_without_columns(table, found, by_row);
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
  if (!several.empty()) refuse(several);
  const int session = has(Role::session) ? table.find(found.at(Role::session).column) : -1;
  const std::vector<Session> sessions = sessions_of(table, session);
  if (sessions.empty())
    refuse(fmt::format("{}: column '{}' has no value, so no row belongs to a session; fill it or rename it.",
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

// SPDX-License-Identifier: MIT
#include "identify/log/derived.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "identify/log/impossible.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

using wire::pc::refuse_data;

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
  const double least_rad_per_s = idle_speed_share * largest_magnitude(log.of(Role::speed));
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
    running = heat(i) > idle_heat_share * most ? running + 1 : 0;
    if (running == 3) break;
    if (running == 0) rest = i + 1;
  }
  return rest;
}

}  // namespace

int give_sign(std::vector<double>& cells) {
  const double most = largest_magnitude(cells);
  if (lowest(cells) < 0 ||
      std::any_of(cells.begin(), cells.end(), [](double x) { return x != std::round(x) && !std::isnan(x); }))
    return 0;
  for (const int bits : {16, 32}) {
    const double all = std::exp2(bits);
    if (most >= all || most < all - all / 256) continue;  // what has a sign passes zero; 52000 rpm may be what it says
    const auto count = [&](double from, double to) {
      return std::count_if(cells.begin(), cells.end(), [&](double x) { return x >= from * all && x < to * all; });
    };
    // 65535 by itself stands for no reading.
    const auto negative = count(0.75, 1), ones = std::count(cells.begin(), cells.end(), all - 1);
    if (negative == ones || count(0.25, 0.75) > 0) continue;
    for (double& x : cells) x -= x >= 0.75 * all ? all : 0;
    return bits;
  }
  return 0;
}

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

void read_resistance(Log& log) {
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

}  // namespace identify

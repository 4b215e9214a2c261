// SPDX-License-Identifier: MIT
#include "identify/fit/problem.hpp"

#include <algorithm>
#include <cmath>

namespace identify {

using thermal::Drive;

bool Problem::any_core() const {
  return std::any_of(logs.begin(), logs.end(), [](const Bins& b) { return b.has_core; });
}

void Problem::warm_unevenly(double per_A2) {
  for (Bins& log : logs) {
    for (Bin& bin : log.bins) bin.input[Drive::current_A2] += (per_A2 - uneven_per_A2) * bin.uneven_A4;
    log.uneven_per_A2 = per_A2;
  }
  uneven_per_A2 = per_A2;
}

double Problem::scale(Scale s, Drive d) const {
  switch (s) {
    case Scale::one:
      return 1;
    case Scale::heat_per_drive:
      return drive_mean[static_cast<int>(d)] > 0 ? heat_W / drive_mean[static_cast<int>(d)] : 0;
    case Scale::heat:
      return heat_W;
    case Scale::sink_conductance:
      return 1 / belief.R2_K_per_W;
    case Scale::core_capacity:
      return belief.C1_J_per_K;
    case Scale::housing_capacity:
      return belief.C2_J_per_K;
    case Scale::core_resistance:
      return belief.R1_K_per_W;
    case Scale::sink_resistance:
      return belief.R2_K_per_W;
    case Scale::rms_current:
      return rms_A;
    case Scale::duration:
      return duration_s;
    case Scale::speed08:
      return speed08_mean > 0 ? 1 / speed08_mean : 0;
  }
  return 1;
}

bool Problem::possible(const Cause& cause) const {
  const auto any = [&](auto what) { return std::any_of(logs.begin(), logs.end(), what); };
  const bool amps = rms_A > 0 && !heated_by_power();
  switch (cause.needs) {
    case Needs::nothing:
      return true;
    case Needs::current:
      return amps;
    case Needs::copper:
      return amps && belief.copper_per_K > 0;
    case Needs::speed: {
      const bool loaded = cause.drive == Drive::current_speed || cause.drive == Drive::current2_speed2 ||
                          cause.edit == Edit::stall_share;
      return speed08_mean > 0 && (!loaded || amps);
    }
    case Needs::several_currents: {
      // Of one current alone an offset is a change of gain, and cannot be seen.
      double n = 0, sum = 0, square = 0;
      for (const Bins& log : logs) {
        for (const Bin& bin : log.bins) n += 1, sum += bin.signed_A, square += bin.signed_A * bin.signed_A;
      }
      constexpr double varied = 1.1;  // a mean square over the square of the mean
      return amps && n * square > varied * sum * sum;
    }
    case Needs::winding:  // a resistance is not late
      return any([](const Bins& b) { return b.has_core && b.core_reference.readings == 0; });
    case Needs::neighbour:
      return any([](const Bins& b) { return b.has_neighbour; });
    case Needs::frame:
      return any([](const Bins& b) { return b.has_frame; });
    case Needs::several_logs:
      return logs.size() > 1;
    case Needs::several_housings:
      return std::count_if(logs.begin(), logs.end(), [](const Bins& b) { return b.has_housing; }) > 1;
    case Needs::logs_of_power:
      return logs.size() > 1 && heated_by_power();
    case Needs::logs_of_current:
      return logs.size() > 1 && amps;
  }
  return true;
}

std::string column_lacking(const std::vector<Chosen>& chosen, const Bins& log) {
  for (const Chosen& c : chosen) {
    const Needs needs = cause_of(c).needs;
    if (needs == Needs::speed && !log.has_speed) return own_name(Role::speed);
    if (needs == Needs::neighbour && !log.has_neighbour) return own_name(Role::neighbour);
    if (needs == Needs::frame && !log.has_frame) return own_name(Role::frame);
  }
  return "";
}

void warm_phases_unequally(Problem& problem) {
  const Belief& b = problem.belief;
  const double R_u_K_per_W = 1.5 * b.R1_K_per_W, tau_s = R_u_K_per_W * b.C1_J_per_K / 3;
  for (Bins& log : problem.logs) {
    const double keep = std::exp(-log.width_s / tau_s), mean_keep = (1 - keep) * tau_s / log.width_s;
    double warmed_A2 = 0;
    for (Bin& bin : log.bins) {
      const double ahead_A2 = warmed_A2 - bin.stalled_A2;
      bin.uneven_A4 = bin.stalled_A2 * (bin.stalled_A2 + mean_keep * ahead_A2);
      warmed_A2 = bin.stalled_A2 + keep * ahead_A2;
    }
  }
  problem.warm_unevenly(b.copper_per_K * R_u_K_per_W * b.ohm / 6);
}

Problem first_part(const Problem& problem, double fraction) {
  Problem out = problem;
  for (Bins& log : out.logs) {
    const auto cut = static_cast<std::size_t>((1 - fraction) * static_cast<double>(log.bins.size()));
    log.bins.resize(std::max<std::size_t>(cut, 2));
  }
  return out;
}

Problem last_part(const Problem& problem, double fraction) {
  Problem out = problem;
  for (Bins& log : out.logs) {
    const auto cut = static_cast<std::size_t>((1 - fraction) * static_cast<double>(log.bins.size()));
    forget_readings(log, 0, cut);
  }
  return out;
}

Problem heard(Problem problem, double early_s) {
  for (Bins& log : problem.logs) {
    const std::size_t all = log.bins.size();
    const auto bins = static_cast<std::size_t>(std::ceil(early_s / log.width_s));
    forget_readings(log, all - std::min(bins, all), all);
  }
  return problem;
}

Problem unseen_by(const Problem& fitted, const std::vector<Log>& logs) {
  Problem out = fitted;
  out.logs.clear();
  out.leeway.clear();
  out.uneven_per_A2 = 0;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const std::size_t like = std::min(l, fitted.logs.size() - 1);
    out.logs.push_back(bins_of(logs[l], fitted.logs[like].width_s));
  }
  if (!out.heated_by_power()) warm_phases_unequally(out);
  return out;
}

}  // namespace identify

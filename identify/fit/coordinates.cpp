// SPDX-License-Identifier: MIT
#include "identify/fit/coordinates.hpp"

#include <algorithm>
#include <cmath>

namespace identify {
namespace {

constexpr double initial_sd_K = 3;  // the first readings tell the initial state this well
// Far beyond what a first reading is wrong by, and what a winding of class F can be above its housing.
constexpr double initial_room_K = 60, most_excess_K = 150;
// Over a housing that is warm when the log begins, a winding may be this share of its rise warmer again; R1 over R2 of
// catalogues is 0.03 to 1.4.
constexpr double warm_excess_share = 0.5;
// Before a log that begins warm its housing moved by this share of its rise within its time constant: all of it or
// none, evenly likely, the root of whose mean square this is; three times it under a burst. And an ambient may have
// drifted for as long again.
const double before_sd = 1 / std::sqrt(3.0);
constexpr double least_before[] = {-3, -3, 0}, most_before[] = {3, 3, 1};

}  // namespace

Eigen::Index own_count(const Bins& log) {
  return per_start_count * static_cast<Eigen::Index>(log.starts.size()) + (log.begins_warm ? before_count : 0);
}

std::vector<Before> before_of(const std::vector<Chosen>& chosen) {
  std::vector<Before> out;
  for (const Chosen& c : chosen) {
    if (cause_of(c).edit == Edit::mass) out.push_back(mass_before);
    if (cause_of(c).edit == Edit::sensor_lag) out.push_back(sensor_before);
    if (cause_of(c).edit == Edit::drift) out.push_back(drift_before);
  }
  return out;
}

int coordinates_of(const std::vector<Chosen>& chosen) {
  int n = 0;
  for (const Chosen& c : chosen) n += static_cast<int>(cause_of(c).parameters.size());
  return n;
}

std::vector<Coordinate> layout(const Problem& problem, const std::vector<Chosen>& chosen) {
  const Belief& b = problem.belief;
  std::vector<Coordinate> out;
  for (const double v : {b.R1_K_per_W, b.R2_K_per_W, b.C1_J_per_K, b.C2_J_per_K}) {
    const double x = std::log(v);
    out.push_back({x, x, b.log_sd, x - b.log_room, x + b.log_room});
  }
  for (const Chosen& c : chosen) {
    for (const Parameter& p : cause_of(c).parameters) {
      if (p.logarithmic) {
        const double centre = std::log(p.none);
        out.push_back({centre, centre, p.typical, std::log(p.low), std::log(p.high), true});
      } else {
        out.push_back({p.none, p.none, p.typical, p.low, p.high, true});
      }
    }
  }
  for (const Bins& log : problem.logs) {
    for (const Start& start : log.starts) {
      const double core = start.core_degC, housing = start.housing_degC;
      const double at = std::isnan(housing) ? core : housing;
      const double sink = log.bins[std::min(start.bin, log.bins.size() - 1)].input.boundary_degC[0];
      const double known = std::isnan(at) ? sink : at;
      out.push_back({known, known, initial_sd_K, known - initial_room_K, known + initial_room_K});
      const double excess = std::isnan(core) || std::isnan(housing) ? 0 : core - housing;
      const double excess_sd_K =
          std::isnan(core) ? warm_excess_share * std::max(0.0, known - sink) : problem.noise.core_white_K;
      out.push_back({excess, excess, initial_sd_K + excess_sd_K, -initial_room_K, most_excess_K});
    }
    const std::vector<Before> before = before_of(chosen);
    for (int i = 0; log.begins_warm && i < before_count; ++i) {
      const bool counts = std::find(before.begin(), before.end(), i) != before.end();
      out.push_back({0, 0, before_sd, counts ? least_before[i] : 0, counts ? most_before[i] : 0});
    }
  }
  return out;
}

Eigen::Index own_at(const Problem& problem, const Eigen::VectorXd& x, std::size_t log) {
  Eigen::Index at = x.size();
  for (std::size_t l = problem.logs.size(); l-- > log;) at -= own_count(problem.logs[l]);
  return at;
}

Eigen::Index before_at(const Problem& problem, const Eigen::VectorXd& x, std::size_t log) {
  const Bins& bins = problem.logs[log];
  return own_at(problem, x, log) + own_count(bins) - (bins.begins_warm ? before_count : 0);
}

Physical physical(const Eigen::VectorXd& x) { return {std::exp(x[0]), std::exp(x[1]), std::exp(x[2]), std::exp(x[3])}; }

double parameter_value(const Problem& problem, const Cause& cause, int p, double coordinate) {
  const Parameter& parameter = cause.parameters[static_cast<std::size_t>(p)];
  return (parameter.logarithmic ? std::exp(coordinate) : coordinate) * problem.scale(parameter.scale, cause.drive);
}

}  // namespace identify

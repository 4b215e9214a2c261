// SPDX-License-Identifier: MIT
// Where a fit looks: ln R1, ln R2, ln C1, ln C2; the causes' parameters in units of their scale (or logarithm); for
// each log, and again after each pause, the housing's initial temperature and the winding's excess over it; for each
// log that begins warm then what it has behind it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "identify/fit/problem.hpp"

namespace identify {

inline constexpr int base_count = 4, per_start_count = 2;
/// What went on before a log that begins warm: as how far the housing moved a further mass and a late sensor show it,
/// in shares of its rise within its time constant; and for how much of Problem::duration_s an ambient drifted.
enum Before { mass_before, sensor_before, drift_before, before_count };

struct Coordinate {
  double start, prior, sd, low, high;
  bool of_cause = false;
};
std::vector<Coordinate> layout(const Problem& problem, const std::vector<Chosen>& chosen);

/// How many the causes have, and a log of its own.
int coordinates_of(const std::vector<Chosen>& chosen);
Eigen::Index own_count(const Bins& log);

/// Where in x a log's own stand, and of them what is said of what was before it; nothing where it does not begin warm.
Eigen::Index own_at(const Problem& problem, const Eigen::VectorXd& x, std::size_t log);
Eigen::Index before_at(const Problem& problem, const Eigen::VectorXd& x, std::size_t log);
/// What of the causes depends on what was before a log.
std::vector<Before> before_of(const std::vector<Chosen>& chosen);

/// The base parameters in physical units.
struct Physical {
  double R1_K_per_W, R2_K_per_W, C1_J_per_K, C2_J_per_K;
};
Physical physical(const Eigen::VectorXd& x);

/// A coordinate in physical units, for parameter p of a chosen cause.
double parameter_value(const Problem& problem, const Cause& cause, int p, double coordinate);

}  // namespace identify

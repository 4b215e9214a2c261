// SPDX-License-Identifier: MIT
// Fits the two-resistor model, with any causes added, to all logs of a problem at once.
//
// Levenberg-Marquardt on whitened residuals with exact sensitivities (dual.hpp), box bounds and weak priors.
// Coordinates: ln R1, ln R2, ln C1, ln C2; the causes' parameters in units of their scale (or logarithm); for each log,
// and again after each pause, the housing's initial temperature and the winding's excess over it; for each log that
// begins warm then what it has behind it.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "identify/problem.hpp"

namespace identify {

inline constexpr int base_count = 4, per_start_count = 2;
/// What went on before a log that begins warm: as how far the housing moved a further mass and a late sensor show it,
/// in shares of its rise within its time constant; and for how much of Problem::duration_s an ambient drifted.
enum Before { mass_before, sensor_before, drift_before, before_count };

struct Fit {
  std::vector<Chosen> chosen;
  Eigen::VectorXd x;            // coordinates
  Eigen::MatrixXd information;  // of data and prior (Gauss-Newton Hessian)
  Eigen::MatrixXd from_data;    // of the data alone
  Eigen::VectorXd gradient;     // of the cost: none but where a bound holds it back
  double cost = 1e300;          // half the sum of squared whitened residuals, plus prior
  double misfit = 1e300;        // the same without prior
  double uneven_per_A2 = 0;     // what its residuals show of Leeway::uneven_per_A2; a replay has it
  double narrowing = 0;         // twice the logarithm of the prior's volume over the posterior's (Laplace)
  int readings = 0;             // whitened residuals that entered
  int iterations = 0;
  bool settled = false;  // a full step would lower the cost by less than 0.005: no decision changes
  double promise = 0;    // what a full step would still take from the cost, were the model linear
  std::vector<bool> at_bound;

  bool valid() const { return x.size() > 0; }  // false: nothing could be simulated, and the rest says nothing
  int cause_coordinates() const;
  /// Of coordinates, from the data and the prior; those at a bound count as known where `bounds_hold`.
  Eigen::MatrixXd covariance(bool bounds_hold = true) const;
  Eigen::VectorXd std_errors() const { return covariance().diagonal().cwiseMax(0).cwiseSqrt(); }
  double ratio() const;     // of what is left to the noise, root mean square
  double surprise() const;  // -2 ln of the model's evidence, up to what all models of the problem share
};

/// Fits with the causes `chosen`, two at most. The first of `warm` gives base and initial coordinates; each cause
/// starts from its parameters in the first of them that has it. A last cause that none has starts near nothing, and,
/// where it is nonlinear in its parameters, from several places; without warm and motor file from a usual motor, too.
/// `most`: Newton steps; few are a look at what the causes promise. Not valid() where no start can be simulated.
Fit fit(const Problem& problem, const std::vector<Chosen>& chosen, std::initializer_list<const Fit*> warm = {},
        int most = 60);

/// The same fit, as unsure as it is in `problem` (which may average over more), and of R1 as unsure as a factor of two
/// away from it, either way: seen from the housing alone R1, C1 and C2 lie along a ridge that bends, and the curvature
/// at its top may say far more than there is to know.
Fit as_wide_as_its_ridge(const Problem& problem, Fit fit);

/// First coordinate of a chosen cause that edits this; -1: none does.
int coordinate_of(const Fit& fit, Edit edit);

/// The same motor with a further cause of these coordinates: nothing is fitted.
Fit with_cause(Fit motor, const char* id, std::initializer_list<double> coordinates);

/// The motor that a fit found, without its causes.
Fit bare(const Problem& problem, const Fit& fit);

/// What the noise model itself costs, half the logarithm of the readings' covariance: to compare fits that assume
/// different noise.
double cost_of_noise(const Problem& problem);

/// The same model on other logs of the motor: base and causes held as in `from`, initial temperatures from the
/// first readings.
Fit transferred(const Problem& other, const Fit& from);

/// The same fit on the same logs, longer than it saw them: what begins after a pause there begins as its first readings
/// say.
Fit carried_on(const Problem& whole, const Problem& fitted, const Fit& f);

/// What a fit simulates for one log: readings at every bin (also where nothing was measured) and the raw residuals.
struct Replayed {
  std::vector<double> housing_degC, core_degC;              // as the sensors would read
  std::vector<double> housing_residual_K, core_residual_K;  // measured - simulated, NaN where nothing was measured
  std::vector<double> whitened;  // residual of the housing (of a winding read alone), whitened, NaN likewise
};
Replayed replayed(const Problem& problem, const Fit& fit, std::size_t log);

/// The most that any part of the winding becomes, degC.
double hottest_degC(const Problem& problem, const Fit& fit, std::size_t log);

/// Root mean square and worst of the residuals; NaN when there is no reading.
struct Error {
  double rms_K, worst_K;
  int readings;
};
Error error_of(const std::vector<double>& residual_K);

struct Rmse {
  double housing_K = 0, core_K = 0;  // NaN: not measured
  double housing_worst_K = 0, core_worst_K = 0;

  double judged_K() const;  // the winding's where it is read
};
/// Errors over all logs, K; `each`: of every log as well.
Rmse rmse_of(const Problem& problem, const Fit& fit, std::vector<Rmse>* each = nullptr);

/// The base parameters in physical units.
struct Physical {
  double R1_K_per_W, R2_K_per_W, C1_J_per_K, C2_J_per_K;
};
Physical physical(const Eigen::VectorXd& x);

/// Coordinates into physical units, for parameter p of a chosen cause.
double parameter_value(const Problem& problem, const Cause& cause, int p, double coordinate);

Model<double> model_of(const Problem& problem, const Fit& fit, std::size_t log);

/// Misfit at given coordinates, and its gradient (tests compare it with differences of the former).
double misfit_at(const Problem& problem, const std::vector<Chosen>& chosen, const Eigen::VectorXd& x,
                 Eigen::VectorXd* gradient = nullptr);

}  // namespace identify

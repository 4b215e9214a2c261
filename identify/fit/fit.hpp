// SPDX-License-Identifier: MIT
// Fits the two-resistor model, with any causes added, to all logs of a problem at once.
//
// Levenberg-Marquardt on whitened residuals with exact sensitivities, box bounds and weak priors.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "identify/fit/coordinates.hpp"

namespace identify {

struct Fit {
  std::vector<Chosen> chosen;
  Eigen::VectorXd x;            // coordinates.hpp
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

}  // namespace identify

// SPDX-License-Identifier: MIT
// How far a model is from what was measured, in whitened residuals, with its exact derivatives by all coordinates.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "identify/fit/whitening.hpp"

namespace identify {

struct Misfit {
  double sum = 0;  // half of the squares of whitened residuals
  int readings = 0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd information;
  Eigen::VectorXd leeway;  // what the residuals show of each effect averaged over, a column of Averaged each
};

/// At coordinates x of two causes at most; false: nothing can be simulated there.
bool evaluate(const Problem& problem, const Averaged& averaged, const std::vector<Chosen>& chosen,
              const Eigen::VectorXd& x, Misfit& out);

}  // namespace identify

// SPDX-License-Identifier: MIT
// What a fit simulates, and how far that is from what was measured, in kelvins.
#pragma once

#include "identify/fit/fit.hpp"
#include "identify/model/model.hpp"

namespace identify {

Model<double> model_of(const Problem& problem, const Fit& fit, std::size_t log);

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

/// The model of a fit as near to the readings as least squares in kelvins comes, winding and housing counted alike: a
/// fit that averages over slow noise and leeway misses by more than it needs to, and two models are to be compared each
/// at its nearest.
Fit closest(const Problem& problem, const Fit& motor);

}  // namespace identify

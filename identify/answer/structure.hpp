// SPDX-License-Identifier: MIT
// What is left in a residual: is it white, what does it go with, where in time does it sit, and what the data does not
// fix.
#pragma once

#include <string>
#include <vector>

#include "identify/fit/fit.hpp"

namespace identify {

struct Whiteness {
  double ratio = 0;  // rms of the whitened housing residual (the winding's where there is no housing); 1 = noise alone
  double white_p = 1;      // cumulated periodogram: chance of such a residual from a right model
  double ljung_box_p = 1;  // the same from autocorrelations
};

struct Relation {
  std::string signal;  // "current squared", ...
  double correlation;  // of the residual with the signal, plain or smoothed by smoothed_s
  double smoothed_s;
};

/// A stretch of one log where the simulation is off in one direction. mean_K > 0: measured is hotter than simulated.
struct Wrong {
  std::size_t log;
  std::string channel;  // "housing" or "winding"
  double from_s, to_s, mean_K;
  std::string goes_with;
};

/// A direction of ln(R1, R2, C1, C2) in which the data says little.
struct Loose {
  double sd;  // of the logarithm along the direction: 0.1 = 10 %
  double share[base_count];
};

struct Structure {
  Whiteness residual;
  std::vector<Relation> relations;  // strongest first
  std::vector<Wrong> wrong;         // largest first
};

Whiteness whiteness(const std::vector<double>& whitened);
Structure structure(const Problem& problem, const Fit& fit);

/// Eigen-directions of the data's information on the four base parameters, initial states and causes free; loosest
/// first.
std::vector<Loose> directions(const Fit& fit);

/// Standard deviation of ln R1 (0), ln R2, ln C1, ln C2 from the data alone; huge when it says nothing.
double sd_from_data(const Fit& fit, int coordinate);

}  // namespace identify

// SPDX-License-Identifier: MIT
// Every cause fitted alone, and every pair that may come near the best: what search.hpp decides between.
//
// Sets hold two causes at most: three at once imitate nearly anything (of seven forms that the table does not know,
// five were "explained" by some three of it); two do not.
#pragma once

#include <string>
#include <vector>

#include "identify/fit/fit.hpp"

namespace identify {

struct Candidate {
  Fit fit;
  double evidence = 0;  // twice its logarithm, over the baseline's
  double ratio = 0;     // rms of whitened residuals, both channels
  bool chosen = false;
  bool tied = false;    // as good as the best
  bool likely = false;  // a board must not take it for excluded: nearly as good; likelier than adequate two resistors
};

/// Every cause alone and the pairs worth fitting, each best first, under the noise of the problem.
struct Field {
  Candidate baseline;
  std::vector<Candidate> singles, pairs;
};

std::vector<std::string> ids_of(const std::vector<Chosen>& chosen);
/// The same for a person: of two entries of one id also which each is.
std::vector<std::string> names_of(const std::vector<Chosen>& chosen);

/// All causes that the logs hold the columns for, those of one log in each; `without`: ids left out.
std::vector<Chosen> available(const Problem& problem, const std::vector<std::string>& without);

/// Fits two resistors and each of `all`, from where the field's last fits ended.
void fit_alone(const Problem& problem, const std::vector<Chosen>& all, Field& field);

/// Fits the pairs of the field's singles; a single that a pair helped out of a poor valley is fitted again.
void fit_pairs(const Problem& problem, Field& field);

/// The best pair with either of its causes replaced by each other one: what a short look passed over may be as good.
void add_neighbours(const Problem& problem, const Field& field, std::vector<Candidate>& sets);

/// Of two resistors and every cause alone the one that follows the logs best.
Fit best_alone(const Problem& problem);

}  // namespace identify

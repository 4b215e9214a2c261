// SPDX-License-Identifier: MIT
// Which causes does the data ask for? Fits every cause alone, then with a second and a third, and decides, or abstains.
//
// A wrong name is worse than no name. The decision therefore knows five ends: nothing is missing; one set of causes
// stands clear; several sets are as good (a tie); something is missing and no known cause explains it; too poor to say.
#pragma once

#include "identify/fit.hpp"

namespace identify {

/// What the decision asks for, in units of BIC; where each comes from stands in search.cpp.
struct Margins {
  double detect = 10, second = 10, tie = 6;
  double adequate_ratio = 1.13;  // residual over noise above which a model is not called adequate
  double explained_share = 0.8;  // of the misfit's excess over noise, for a name in spite of that
  double dominance = 3;          // or: evidence of the best single cause over that of the next
  double noticeable_K = 0.25;    // what a cause must move, rms, in the winding or at the sensor, to be worth a name
};

struct Candidate {
  Fit fit;
  double gain = 0;       // BIC of the baseline minus its own
  double ratio = 0;      // rms of whitened residuals, both channels
  double explained = 0;  // share of the baseline's excess misfit that it takes away
  bool chosen = false, tied = false;
};

enum class Verdict { adequate, explained, partly_explained, ambiguous, unknown_cause, insufficient };
const char* word(Verdict verdict);

struct Search {
  Candidate base;
  std::vector<Candidate> singles;              // best first, one per cause (per log for causes that pick one)
  std::vector<Candidate> sets;                 // sets of the size that was chosen, best first
  Candidate chosen;                            // what is believed best, whatever the verdict
  std::vector<std::vector<std::string>> tied;  // ids of the sets that are as good as the best, itself first
  Verdict verdict = Verdict::insufficient;
  std::vector<std::string> steps;  // the reasoning in plain words
};

std::vector<std::string> ids_of(const std::vector<Chosen>& chosen);

/// `without`: ids left out of the table (tests take the truth away and expect "unknown").
Search search(const Problem& problem, const Margins& margins = {}, const std::vector<std::string>& without = {});

}  // namespace identify

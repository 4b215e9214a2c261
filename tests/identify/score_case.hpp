// SPDX-License-Identifier: MIT
// One hidden effect, one log, one answer, and how good the answer is. Truth comes from the generator alone.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "identify/search/search.hpp"
#include "tests/identify/hidden_log.hpp"

namespace tests {

enum class Outcome { right, wrong, tied_right, tied_wrong, silent, unknown };

struct CaseOptions {
  HiddenLogOptions log;
  std::vector<std::string> removed;  // ids taken out of identify's table
  identify::Margins margins;
  bool blind = false;  // no motor sheet is given; parameters, in another gauge then, are not compared
  // What costs more logs or fits is measured on demand.
  bool gain = false;          // the winding on another log
  bool separability = false;  // D of the truth
  bool follow = false;        // play the advised experiment and ask again
};

struct CaseResult {
  std::vector<std::string> truth;                // sorted
  std::vector<std::vector<std::string>> answer;  // the sets that were named (one) or tied
  identify::Verdict verdict;
  /// rms error of the true winding, without noise, on another log of the same motor: both models fitted to the first.
  std::optional<double> core_before_K, core_after_K;
  int parameters = 0, parameters_right = 0;  // of rightly named causes; within two standard errors of the truth
  /// Smallest misfit that the table leaves of a log without noise: of any other single cause where the truth is one, of
  /// any other set of two at most elsewhere.
  std::optional<double> D;
  std::optional<bool> resolved;  // a tie: did the advised experiment, played once, lead to the right name?
  double search_s = 0;
  std::string remarks;             // one line for a person who looks for reasons
  std::vector<std::string> steps;  // identify's own reasoning

  bool named() const;
  Outcome outcome() const { return outcome_for(truth); }
  Outcome outcome_for(const std::vector<std::string>& truth) const;
  std::string answer_text() const;
};

CaseResult play(const CaseOptions& options, const std::string& scratch_path);

std::string joined(const std::vector<std::string>& ids);

}  // namespace tests

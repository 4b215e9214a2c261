// SPDX-License-Identifier: MIT
// Three parts of the data, so that none judges itself: fitted; not fitted, to refuse a cause that spoils it (veto); and
// never looked at before the answer stands, to say what the answer is worth (final), with an interval.
#pragma once

#include "identify/answer/baseline.hpp"

namespace identify {

/// Part of a problem that the fit may not see.
struct HoldOut {
  std::vector<Log> logs;  // whole logs, or none
  double fraction = 0;    // last part of each log, 0: none
  int draws = 1000;       // of the bootstrap
};

/// What `fitted` has not seen of `logs`, or the logs held out.
Problem unseen_of(const Problem& fitted, const std::vector<Log>& logs, const HoldOut& held);

/// Errors of both models on that, with a bootstrap interval over blocks of a minute. What was held out is added to
/// the report's plots.
HeldOutScore score_held_out(const Problem& unseen, const Problem& fitted, const HoldOut& held, const Fit& baseline,
                            const Fit& extended, Report& report);

/// Why the extended model must not be believed: fitted to the first three quarters of each log it misses the last by
/// more than the two-resistor model does, and by more than chance explains. Empty: it may.
std::string veto(const Problem& problem, const Fit& baseline, const Fit& extended);

}  // namespace identify

// SPDX-License-Identifier: MIT
#include "identify/discover.hpp"

#include <fmt/format.h>

#include <cmath>

namespace identify {
namespace {

void score_held_out(const Problem& whole, const std::optional<wire::pc::MotorFile>& motor, const HoldOut& held,
                    const Fit& f, Report& report) {
  if (held.fraction > 0) {
    HeldOut out;
    out.how = fmt::format("the last {:.0f} % of each log", 100 * held.fraction);
    Fit onward = f;
    out.before = rmse_of(last_part(whole, held.fraction), onward);
    report.held_out = out;
  } else if (!held.logs.empty()) {
    HeldOut out;
    out.how = fmt::format("{}; only its initial temperatures fitted", held.logs.front().name);
    Problem other = problem_of(held.logs, motor, whole.belief.copper_per_K);
    other.belief = whole.belief;
    const Fit moved = transferred(other, f);
    out.before = rmse_of(other, moved, &out.each_before);
    for (const Log& log : held.logs) out.names.push_back(log.name);
    add_plots(other, moved, " (not seen by the fit)", report);
    report.held_out = out;
  }
}

}  // namespace

Report discover(const std::vector<Log>& logs, const std::optional<wire::pc::MotorFile>& motor, const HoldOut& held) {
  Report report;
  const Problem whole = problem_of(logs, motor);
  const Problem problem = held.fraction > 0 ? first_part(whole, held.fraction) : whole;
  const Fit base = judge_baseline(problem, logs, motor, report);
  score_held_out(whole, motor, held, base, report);
  const bool adequate = report.structure.housing.ratio < 1.3;
  report.verdict = adequate ? "adequate" : "unknown_cause";
  const Rmse& e = report.baseline_rmse;
  const bool core = !std::isnan(e.core_K);
  report.sentence =
      adequate
          ? fmt::format("The two-resistor model is adequate: it misses the {} by {:.2f} K rms, no more than the noise.",
                        core ? "winding" : "housing", core ? e.core_K : e.housing_K)
          : fmt::format(
                "The two-resistor model is wrong: it misses the {} by {:.1f} K rms ({:.1f} K at worst), {:.1f} times "
                "what noise explains.",
                core ? "winding" : "housing", core ? e.core_K : e.housing_K, core ? e.core_worst_K : e.housing_worst_K,
                report.structure.housing.ratio);
  return report;
}

}  // namespace identify

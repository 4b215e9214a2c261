// SPDX-License-Identifier: MIT
#include "identify/answer/held_out.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "identify/fit/replayed.hpp"
#include "identify/search/search.hpp"

namespace identify {
namespace {

constexpr double block_s = 60;  // longer than a housing sensor's slow error (20 s), so that blocks are strangers
constexpr std::size_t least_blocks = 4;  // drawn from fewer, chance looks smaller than it is
constexpr int least_draws = 100;         // for the 2.5th of a hundred to be one of them
constexpr int veto_draws = 400;

/// Sums of one block's residuals, and of their squares under both models.
struct Block {
  double before2 = 0, after2 = 0, after = 0;
  int readings = 0;
};

/// Of the winding where it is read, else of the housing.
std::vector<Block> blocks_of(const Problem& problem, const Fit& baseline, const Fit& extended, bool winding) {
  std::vector<Block> out;
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    const Replayed a = replayed(problem, baseline, l), b = replayed(problem, extended, l);
    const auto& before = winding ? a.core_residual_K : a.housing_residual_K;
    const auto& after = winding ? b.core_residual_K : b.housing_residual_K;
    const auto length = static_cast<std::size_t>(std::max(1.0, std::ceil(block_s / problem.logs[l].width_s)));
    for (std::size_t from = 0; from < before.size(); from += length) {
      Block block;
      for (std::size_t k = from; k < std::min(from + length, before.size()); ++k) {
        if (std::isnan(before[k])) continue;
        block.before2 += before[k] * before[k];
        block.after2 += after[k] * after[k];
        block.after += after[k];
        ++block.readings;
      }
      if (block.readings > 0) out.push_back(block);
    }
  }
  return out;
}

struct Resampled {
  std::vector<double> before_K, after_K, growth_K;  // of each draw, sorted
};

Resampled resampled(const std::vector<Block>& blocks, int draws) {
  std::mt19937 random(1);  // fixed: the same data gives the same interval
  Resampled out;
  for (int d = 0; d < draws; ++d) {
    Block sum;
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      const Block& b = blocks[random() % blocks.size()];
      sum.before2 += b.before2;
      sum.after2 += b.after2;
      sum.readings += b.readings;
    }
    out.before_K.push_back(std::sqrt(sum.before2 / sum.readings));
    out.after_K.push_back(std::sqrt(sum.after2 / sum.readings));
    out.growth_K.push_back(out.after_K.back() - out.before_K.back());
  }
  for (auto* v : {&out.before_K, &out.after_K, &out.growth_K}) std::sort(v->begin(), v->end());
  return out;
}

/// From the 2.5th to the 97.5th of a hundred.
Interval middle_95(const std::vector<double>& sorted) {
  const auto n = static_cast<double>(sorted.size() - 1);
  return {sorted[static_cast<std::size_t>(0.025 * n)], sorted[static_cast<std::size_t>(0.975 * n)]};
}

/// What a log that was held out does not tell, and may be missed for; empty: it tells all.
std::string untold_there(const Problem& unseen, const Fit& extended, const HoldOut& held) {
  for (const Bins& log : unseen.logs) {
    const std::string column = column_lacking(extended.chosen, log);
    if (!column.empty()) return fmt::format("{}, which what was found goes by, is missing in {}", column, log.name);
  }
  for (const Bins& log : unseen.logs) {
    if (log.sink_assumed && held.fraction == 0)
      return fmt::format("no ambient was recorded in {}, whose room may not be as warm as what it begins at", log.name);
  }
  return "";
}

/// What was held out may speak against the answer: what was found does worse there, or all that was fitted misses far
/// more than where it was fitted. `untold`: what may be why instead.
std::string speaks_against(const std::vector<Block>& blocks, const HeldOutScore& out, const Rmse& fitted,
                           const Report& report, const std::string& untold) {
  const auto so = [&](const char* then) { return untold.empty() ? fmt::format(": {}.", then) : "; " + untold + "."; };
  const auto of = [&](const Rmse& e) { return out.winding ? e.core_K : e.housing_K; };
  const double before_K = of(out.before), after_K = of(out.after);
  const char* what = out.winding ? "winding" : "housing";
  if (!report.causes.empty() && blocks.size() >= least_blocks) {
    const std::vector<double> growth_K = resampled(blocks, veto_draws).growth_K;
    if (middle_95(growth_K).low > 0)
      return fmt::format(
          "On what was held out, though, it misses the {} by {:.2f} K, where two resistors miss it by "
          "{:.2f} K{}",
          what, after_K, before_K, so("do not rely on it"));
  }
  // Of blocks' means: readings may be noisier there than in the fit.
  double sum2 = 0, readings = 0;
  for (const Block& b : blocks) sum2 += b.after * b.after / b.readings, readings += b.readings;
  const double lasting_K = std::sqrt(sum2 / std::max(readings, 1.0));
  constexpr double far = 3, worth_K = 1;
  const double fitted_K = of(fitted);
  const bool answered = report.verdict != Verdict::unknown_cause && report.verdict != Verdict::insufficient;
  if (answered && !std::isnan(fitted_K) && lasting_K > std::max(worth_K, far * fitted_K))
    return fmt::format(
        "On what was held out, though, the {} is missed by {:.2f} K, where {:.2f} K were missed in the "
        "fit{}",
        what, after_K, fitted_K, so("something in it is not in what was fitted"));
  return "";
}

void judge(const Problem& problem, const Fit& baseline, const Fit& extended, const HoldOut& held, const Rmse& fitted,
           const Report& report, HeldOutScore& out) {
  out.winding = problem.any_core();
  const auto blocks = blocks_of(problem, baseline, extended, out.winding);
  out.blocks = static_cast<int>(blocks.size());
  out.against = speaks_against(blocks, out, fitted, report, untold_there(problem, extended, held));
  if (blocks.size() < least_blocks || held.draws < least_draws) return;
  const Resampled r = resampled(blocks, held.draws);
  out.before_95 = middle_95(r.before_K);
  out.after_95 = middle_95(r.after_K);
}

constexpr Rmse no_error{missing, missing, missing, missing};

/// Logs of little load may leave open how well a motor is cooled; under more, copper then heats without end.
bool glows(const Problem& unseen, const Fit& f) {
  constexpr double molten_K = 1000;
  return !f.valid() || rmse_of(unseen, f).judged_K() > molten_K;
}

}  // namespace

Problem unseen_of(const Problem& fitted, const std::vector<Log>& logs, const HoldOut& held) {
  Problem out = unseen_by(fitted, held.fraction > 0 ? logs : held.logs);
  for (std::size_t l = 0; held.fraction > 0 && l < out.logs.size(); ++l)
    forget_readings(out.logs[l], 0,
                    static_cast<std::size_t>(std::ceil(fitted.logs[l].duration_s() / out.logs[l].width_s - 1e-6)));
  return out;
}

HeldOutScore score_held_out(const Problem& unseen, const Problem& fitted, const HoldOut& held, const Fit& baseline,
                            const Fit& extended, Report& report) {
  HeldOutScore out;
  Fit before, after;
  const char* remark = " (not seen by the fit)";
  if (held.fraction > 0) {
    out.how = fmt::format("the last {:.0f} % of each log", 100 * held.fraction);
    remark = " (the last part, not seen by the fit)";
    before = carried_on(unseen, fitted, baseline);
    after = carried_on(unseen, fitted, extended);
  } else {
    const bool several = held.logs.size() > 1;
    out.how = fmt::format("{}{}; initial temperatures from {} first readings", held.logs.front().name,
                          several ? fmt::format(" and {} more", held.logs.size() - 1) : "", several ? "their" : "its");
    for (const Log& log : held.logs) out.names.push_back(log.name);
    // What is of one of the fitted logs (a fan) is not of these.
    Fit elsewhere = extended;
    for (Chosen& c : elsewhere.chosen) c.log = -1;
    before = transferred(unseen, baseline);
    after = transferred(unseen, elsewhere);
  }
  if (const bool model = glows(unseen, after), two = glows(unseen, before); model || two) {
    out.before = two ? no_error : rmse_of(unseen, before);
    out.after = model ? no_error : rmse_of(unseen, after);
    out.against = fmt::format("What was held out cannot be foretold, though: under its load {} would glow.",
                              model ? "the model as fitted" : "two resistors as fitted");
    return out;
  }
  out.before = rmse_of(unseen, before, held.logs.size() > 1 ? &out.each_before : nullptr);
  out.after = rmse_of(unseen, after);
  judge(unseen, before, after, held, rmse_of(fitted, extended), report, out);
  add_plots(unseen, before, remark, report);
  add_extended(unseen, after, report, report.plots.size() - unseen.logs.size());
  return out;
}

std::string veto(const Problem& problem, const Fit& baseline, const Fit& extended) {
  const Problem first = first_part(problem, veto_share), last = last_part(problem, veto_share);
  const Fit before = fit(first, {}, {&baseline}), after = fit(first, extended.chosen, {&extended});
  if (!before.valid() || !after.valid()) return "";
  auto blocks = blocks_of(last, before, after, problem.any_core());
  if (blocks.size() < least_blocks) blocks = blocks_of(last, before, after, false);
  if (blocks.size() < least_blocks) return "";
  const Resampled r = resampled(blocks, veto_draws);
  // A sixth of the draws lie more than a standard deviation below the middle.
  if (!(r.growth_K[r.growth_K.size() / 6] > 0)) return "";
  const auto middle = [](const std::vector<double>& v) { return v[v.size() / 2]; };
  return fmt::format(
      "Fitted to the first three quarters, the extended model misses the last by {:.2f} K where the two-resistor model "
      "misses it by {:.2f} K: refused.",
      middle(r.after_K), middle(r.before_K));
}

}  // namespace identify

// SPDX-License-Identifier: MIT
#include "identify/search/problem_of.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "identify/fit/noise.hpp"
#include "identify/fit/parallel.hpp"
#include "identify/search/candidates.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

/// Ten hours in bins of a second, which a search is to do within 10 s on two cores (fit_speed): of more, coarser ones.
constexpr double most_fine_bins = 36000;
/// Of a slow winding fewer do: bins are then longer than longest_bin_s, up to a sixteenth of its time constant.
constexpr double enough_bins = 5000;

using thermal::Drive;

void set_scales(Problem& problem) {
  double n = 0, heat = 0, amps2 = 0, speed08 = 0;
  problem.duration_s = 0;
  for (double& m : problem.drive_mean) m = 0;
  for (const Bins& log : problem.logs) {
    for (const Bin& bin : log.bins) {
      for (int d = 0; d < thermal::drive_count; ++d) problem.drive_mean[d] += bin.input.drive[d];
      heat += problem.heated_by_power() ? std::abs(bin.input[Drive::power_W])
                                        : problem.belief.ohm * bin.input[Drive::current_A2];
      amps2 += bin.input[Drive::current_A2];
      speed08 += bin.input[Drive::speed_to_0_8];
      n += 1;
    }
    problem.duration_s = std::max(problem.duration_s, log.duration_s());
  }
  for (double& m : problem.drive_mean) m /= n;
  problem.heat_W = heat / n;
  problem.rms_A = std::sqrt(amps2 / n);
  problem.speed08_mean = speed08 / n;
}

/// Where a search begins is seen in no more, of ten hours in bins of 4.5 s: chosen for speed.
constexpr std::size_t most_rough_bins = 8000;

/// Time constants that housings of motors have, each with R1 over R2 small and large; a winding's is this share of its
/// housing's. Believed to a factor of ten either way, e^9 at most.
constexpr double guessed_housing_s[] = {120, 600, 2400}, guessed_R1_of_R2[] = {0.1, 0.6}, guessed_winding_share = 0.02;
constexpr double guessed_log_sd = 2.3, guessed_log_room = 9;

/// With the rise that this log shows, at `share` of the resistance that its mean heat would need for it.
std::vector<Belief> guesses_of(const Problem& problem, double share) {
  double rise_K = 1;
  for (const Bin& bin : problem.logs.front().bins) {
    const double T = bin.housing_n > 0 ? bin.housing_degC : bin.core_degC;
    if (!std::isnan(T)) rise_K = std::max(rise_K, T - bin.input.boundary_degC[0]);
  }
  std::vector<Belief> out;
  for (const double housing_s : guessed_housing_s) {
    for (const double ratio : guessed_R1_of_R2) {
      Belief b = problem.belief;
      b.log_sd = guessed_log_sd;
      b.log_room = guessed_log_room;
      b.R2_K_per_W = share * rise_K / std::max(1e-9, problem.heat_W);
      b.R1_K_per_W = ratio * b.R2_K_per_W;
      b.C2_J_per_K = housing_s / b.R2_K_per_W;
      b.C1_J_per_K = guessed_winding_share * housing_s / b.R1_K_per_W;
      out.push_back(b);
    }
  }
  return out;
}

/// Without a sheet: several guesses of the time constants, each fitted to the longest log, the best one kept. One log
/// only, because several may differ in just what is to be found out.
void rough_search(Problem& whole) {
  const auto longest = std::max_element(whole.logs.begin(), whole.logs.end(),
                                        [](const Bins& a, const Bins& b) { return a.duration_s() < b.duration_s(); });
  Problem problem = whole;
  problem.logs = {merged(*longest, 1 + longest->bins.size() / most_rough_bins)};
  // A housing that answers at once is fitted best by both masses as one, and no motor is so.
  const auto centred_at = [](Belief belief, const Fit& f) {
    const auto believed = [](double value, const InCatalogues& share, double of) {
      return std::clamp(value, share.least / beyond_catalogues * of, share.most * beyond_catalogues * of);
    };
    const Physical p = physical(f.x);
    const Eigen::VectorXd unsure = f.covariance(false).diagonal();
    // Of R1 and R2 the one less known is moved: cooling that another heat hides has no R2, and R1 with it would glow.
    belief.R2_K_per_W = unsure[1] < unsure[0]
                            ? p.R2_K_per_W
                            : std::clamp(p.R2_K_per_W, p.R1_K_per_W / (R1_of_R2.most * beyond_catalogues),
                                         p.R1_K_per_W / (R1_of_R2.least / beyond_catalogues));
    belief.C2_J_per_K = std::max(p.C2_J_per_K, p.C1_J_per_K / (C1_of_C2.most * beyond_catalogues));
    belief.R1_K_per_W = believed(p.R1_K_per_W, R1_of_R2, belief.R2_K_per_W);
    belief.C1_J_per_K = believed(p.C1_J_per_K, C1_of_C2, belief.C2_J_per_K);
    return belief;
  };
  std::vector<Belief> guesses;
  std::vector<Fit> fits;
  const auto valid = [](const Fit& f) { return f.valid(); };
  // The mean heat is little beside that of long holds, under which all guesses may glow: then of less resistance.
  for (double share = 1; share > 0.01 && std::none_of(fits.begin(), fits.end(), valid); share /= 2) {
    guesses = guesses_of(problem, share);
    fits.assign(guesses.size(), {});
    in_parallel(guesses.size(), [&](std::size_t i) {
      Problem guessed = problem;
      guessed.belief = guesses[i];
      fits[i] = fit(guessed, {});
    });
  }
  const auto least =
      std::min_element(fits.begin(), fits.end(), [](const Fit& a, const Fit& b) { return a.cost < b.cost; });
  if (!least->valid()) return;
  const Belief &guess = guesses[static_cast<std::size_t>(least - fits.begin())], best = centred_at(guess, *least);
  problem.belief = best;
  Fit alone = best_alone(problem);
  const auto bounds = least->at_bound.begin();
  if (std::find(bounds, bounds + base_count, true) != bounds + base_count) {
    problem.belief = guess;  // from where what is missing has bent two resistors to, no cause may find back
    Fit straight = best_alone(problem);
    if (straight.cost < alone.cost) alone = std::move(straight);
  }
  // By half: beyond recognition, by what is missing. Where any gain was enough, a log that hid nothing got a name
  // (score's motors, designed, dense, seed 17).
  const bool bent = alone.cost < least->cost / 2;
  whole.belief = bent ? centred_at(best, alone) : best;
}

/// A sensor that feels the winding shows how its temperature bends within a bin: an eighth of the winding's time
/// constant where that, by a fit with such a sensor, is evidence that a further cause could be named on; else infinite.
double felt_winding_bin_s(const Problem& problem) {
  const Fit felt = fit(problem, {{cause_named("sensor_placement"), -1}});
  if (!felt.valid()) return std::numeric_limits<double>::infinity();
  const Physical p = physical(felt.x);
  const double ohm = problem.heated_by_power() ? 1 : problem.belief.ohm, share = felt.x[base_count];
  // Where it took more than the readings' noise, 5 of 36 logs of a misplaced sensor were given a hot spot or a clock's
  // delay beside it, and 4 of 30 at a quarter; none now (score duty-none duty-sparse designed-sparse --quick --only
  // sensor_placement, --seeds 12 --first 3100, --seeds 10 --first 38004).
  constexpr double worth = 10;
  double evidence = 0;
  for (const Bins& log : problem.logs) {
    for (const Bin& bin : log.bins) {
      if (bin.housing_n == 0) continue;
      const double bent_K = share * ohm / p.C1_J_per_K * bin.housing_ahead;
      evidence += 0.5 * static_cast<double>(bin.housing_n) * std::pow(bent_K / problem.noise.housing_white_K, 2);
    }
  }
  return evidence > worth ? p.R1_K_per_W * p.C1_J_per_K / 8 : std::numeric_limits<double>::infinity();
}

}  // namespace

Problem problem_of(const std::vector<Log>& logs, const std::optional<wire::pc::MotorFile>& motor,
                   std::optional<double> copper_per_K) {
  Problem problem;
  if (motor) {
    const wire::Motor& m = motor->motor;
    Belief& b = problem.belief;
    b.known = true;
    b.motor = motor->name;
    b.ohm = 1.5 * m.phase_resistance_ohm;
    b.copper_per_K = m.copper_coefficient_per_K;
    b.R1_K_per_W = m.R1_K_per_W;
    b.R2_K_per_W = m.R2_K_per_W;
    b.C1_J_per_K = m.C1_J_per_K;
    b.C2_J_per_K = m.C2_J_per_K;
    b.winding_max_degC = m.winding_max_degC;
  }
  if (copper_per_K) problem.belief.copper_per_K = *copper_per_K;
  // A winding read all the time shows how its temperature bends within a bin.
  const bool dense = std::any_of(logs.begin(), logs.end(), [](const Log& log) {
    const auto& core = log.of(Role::core);
    return std::count_if(core.begin(), core.end(), [](double x) { return !std::isnan(x); }) >
           static_cast<std::ptrdiff_t>(core.size() / 2);
  });
  double longest_s = 0, all_s = 0;
  for (const Log& log : logs) {
    longest_s = std::max(longest_s, log.of(Role::time).back());
    all_s += log.of(Role::time).back();
  }
  // From logs of 20 min without structure bins of half a time constant made C1 5 and 8 percent too small, of a
  // quarter 1 and 2 (designed 5004, duty 5102). Of a long day half must do, for speed.
  const auto fine_enough_s = [&](double winding_s) {
    const double bin_s = std::min(longest_bin_s, std::clamp(longest_s / most_fine_bins, winding_s / 4, winding_s / 2));
    return std::max(dense ? bin_s / 2 : bin_s, std::min(all_s / enough_bins, winding_s / 16));
  };
  const double usual_winding_s = 4;  // until the log has shown its own
  const auto winding_s = [&] { return problem.belief.R1_K_per_W * problem.belief.C1_J_per_K; };
  double finest_s = fine_enough_s(motor ? winding_s() : usual_winding_s);
  const auto take_in = [&](double bin_s) {
    problem.logs.clear();
    for (const Log& log : logs) problem.logs.push_back(bins_of(log, bin_s));
    noise_from_rest(problem);
    set_scales(problem);
  };
  take_in(finest_s);
  if (problem.heated_by_power()) problem.belief.copper_per_K = 0;
  if (!(problem.heat_W > 0)) {
    wire::pc::refuse_data(fmt::format(
        "{}: no current and no power flows at all, so nothing can be learned of the motor; record a log with load.",
        problem.logs.front().name));
  }
  if (!motor) {
    rough_search(problem);
    const double bin_s = fine_enough_s(winding_s());
    if (bin_s < finest_s || bin_s >= 2 * finest_s) take_in(finest_s = bin_s);
  }
  if (const double bin_s = felt_winding_bin_s(problem); bin_s < finest_s) take_in(bin_s);
  if (!problem.heated_by_power()) {
    warm_phases_unequally(problem);
    allow_for_noisy_current(problem);
  }
  return problem;
}

}  // namespace identify

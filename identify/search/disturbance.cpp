// SPDX-License-Identifier: MIT
#include "identify/search/disturbance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "identify/fit/parallel.hpp"
#include "identify/fit/replayed.hpp"

namespace identify {
namespace {

constexpr double least_step_noise_share = 0.03;  // of a coarse sensor's step: the moment between two rows
/// A winding's own noise is taken from so many of its residuals at least, and within these.
constexpr double least_core_white_K = 0.5, most_core_white_K = 3;
constexpr int enough_core_readings = 10;
/// Windings of small motors have moved within this (noise.cpp), and of a typed table the last digit is this at best.
constexpr double moves_within_s = 20, least_white_K = 0.02;

/// What no model of a few nodes follows, as a share of the housing's rise, slow. A housing believed to the hundredths
/// of a kelvin that its sensor wanders by outvotes a winding read twice a minute: of a motor recorded in host-sim
/// (gain, seed 503) C1 came out 13 percent too large with a standard error of 3; from a winding read all the time it
/// is 1.
constexpr struct Unmodelled { double share, over_s; } of_a_housing{0.001, slow_disturbance_s};
/// A winding has no single temperature: a sensor that feels it sees phases, teeth and end turns go their own ways
/// within seconds. Believed as a housing, such sensors of host-sim came out on the very winding (602, 10003, 10045;
/// true is 0.9 of the way), and as a winding within two of their standard errors.
constexpr Unmodelled of_a_winding{0.01, 5};

double housing_range_K(const Problem& problem) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Bins& log : problem.logs) {
    for (const Bin& bin : log.bins) {
      if (bin.housing_n > 0) low = std::min(low, bin.housing_degC), high = std::max(high, bin.housing_degC);
    }
  }
  return std::max(0.0, high - low);
}

/// The share of a winding's resistance by which all its readings are off: no noise of each.
double off_by_reference(const Replayed& r) {
  double product = 0, square = 0;
  for (std::size_t k = 0; k < r.core_degC.size(); ++k) {
    if (std::isnan(r.core_residual_K[k])) continue;
    const double above_K = r.core_degC[k] - no_ohm_degC;
    product += r.core_residual_K[k] * above_K;
    square += above_K * above_K;
  }
  return square > 0 ? product / square : 0;
}

/// Of a fit to the problem's noise; to compare fits that assume different noise.
double evidence(const Problem& problem, const Fit& f) { return -f.surprise() - 2 * cost_of_noise(problem); }

/// Takes less of a noise, down to `least_K`, while what the fit leaves is likelier so.
void lessen(Problem& problem, const Fit& best, double Noise::*which, double least_K) {
  double most = -1e300;
  for (Problem less = problem; less.noise.*which > least_K; less.noise.*which *= 0.8) {
    const double reached = evidence(less, fit(less, best.chosen, {&best}));
    if (reached < most) return;
    most = reached;
    problem.noise.*which = less.noise.*which;
  }
}

}  // namespace

Disturbance disturbance_of(const Problem& problem, const Fit& undisturbed) {
  const double own = evidence(problem, undisturbed);
  // Half as large again each time: coarser than that loses a gain of three.
  constexpr double slow_s[] = {fast_disturbance_s, slow_disturbance_s}, past_top = 20;
  std::vector<Disturbance> tried[std::size(slow_s)];
  in_parallel(std::size(slow_s), [&](std::size_t i) {
    Problem disturbed = problem;
    disturbed.noise.disturbance_s = slow_s[i];
    Fit warm = undisturbed;
    double most = own;
    const double least_K = std::max(0.6 * problem.noise.housing_slow_K, problem.noise.disturbance_K);
    for (double factor = 1; factor < 1667; factor *= 1.6) {
      disturbed.noise.disturbance_K = factor * least_K;
      Fit f = fit(disturbed, undisturbed.chosen, {&warm}, 10);
      if (!f.valid()) break;
      const double reached = evidence(disturbed, f);
      tried[i].push_back({disturbed.noise, reached - own, reached});
      most = std::max(most, reached);
      if (reached < most - past_top) break;
      warm = std::move(f);
    }
  });
  Disturbance out{problem.noise, 0, own};
  for (const std::vector<Disturbance>& larger : tried) {
    for (const Disturbance& d : larger) {
      if (d.joint_evidence > out.joint_evidence) out = d;
      // A slower one counts where its smallest is near: taken at any size three tests failed
      // (SlowSearch.WhereNoRest..., SlowSearch.WhereQuietSensors..., SlowTraction.WhereNothingExplains...).
      if (d.joint_evidence < out.joint_evidence - past_top) break;
    }
  }
  return out;
}

double coarsest_step_K(const Problem& problem) {
  double step_K = 0;
  for (const Bins& log : problem.logs) step_K = std::max(step_K, log.housing_step_K);
  return step_K;
}

void refine_core_noise(Problem& problem, const Fit& best) {
  double sum = 0;
  int n = 0;
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    const Replayed r = replayed(problem, best, l);
    const double shared = problem.logs[l].core_reference.readings > 0 ? off_by_reference(r) : 0;
    for (std::size_t k = 0; k < r.core_degC.size(); ++k) {
      const double own_K = r.core_residual_K[k] - shared * (r.core_degC[k] - no_ohm_degC);
      if (!std::isnan(own_K)) sum += own_K * own_K, ++n;
    }
  }
  if (n >= enough_core_readings)
    problem.noise.core_white_K = std::clamp(std::sqrt(sum / n), least_core_white_K, most_core_white_K);
}

void refine_housing_noise(Problem& problem, const Fit& best) {
  if (const double step_K = coarsest_step_K(problem); step_K > 0)
    lessen(problem, best, &Noise::housing_white_K, least_step_noise_share * step_K);
  lessen(problem, best, &Noise::housing_slow_K, least_slow_K);
}

bool refine_noise_of_slow_rows(Problem& problem, const Fit& best) {
  const Noise told = problem.noise;
  const auto slow = [](const Bins& log) { return log.interval_s > moves_within_s; };
  if (!std::all_of(problem.logs.begin(), problem.logs.end(), slow)) return false;
  lessen(problem, best, &Noise::core_white_K, least_white_K);
  lessen(problem, best, &Noise::housing_white_K, least_white_K);
  return problem.noise.core_white_K < told.core_white_K || problem.noise.housing_white_K < told.housing_white_K;
}

bool take_sticking_for_noise(Problem& problem, const Fit& best, double worth) {
  const double own = evidence(problem, fit(problem, best.chosen, {&best}));
  Problem sticking = problem;
  double most = own;
  Noise likeliest = problem.noise;
  for (const double slow_s : {5.0, 10.0}) {
    sticking.noise.slow_s = slow_s;
    double before = own;
    for (double factor = 1.25; factor < 100; factor *= 1.25) {
      sticking.noise.housing_slow_K = factor * problem.noise.housing_slow_K;
      const double reached = evidence(sticking, fit(sticking, best.chosen, {&best}));
      if (reached > most) most = reached, likeliest = sticking.noise;
      if (reached < before) break;
      before = reached;
    }
  }
  if (!(most > own + worth) || !(most > disturbance_of(problem, best).joint_evidence + worth)) return false;
  problem.noise = likeliest;
  return true;
}

Problem believed_less(Problem problem, const Fit& f, double times) {
  const int at = coordinate_of(f, Edit::sensor_share);
  // A sensor that feels a tenth of the winding sees a tenth of how uneven that is.
  const Unmodelled felt{at < 0 ? 0 : of_a_winding.share * f.x[at], of_a_winding.over_s};
  const Unmodelled& unmodelled = felt.share > of_a_housing.share ? felt : of_a_housing;
  const double unmodelled_K = times * unmodelled.share * housing_range_K(problem);
  Noise& noise = problem.noise;
  if (noise.disturbance_K < unmodelled_K) {
    noise.disturbance_K = unmodelled_K;
    noise.disturbance_s = unmodelled.over_s;
  }
  return problem;
}

}  // namespace identify

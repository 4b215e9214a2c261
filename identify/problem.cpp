// SPDX-License-Identifier: MIT
#include "identify/problem.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "identify/candidates.hpp"
#include "identify/fit.hpp"
#include "identify/parallel.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

/// Ten hours in bins of a second, which a search is to do within 10 s on two cores (fit_speed): of more, coarser ones.
constexpr double most_fine_bins = 36000;
/// Of a slow winding fewer do: bins are then longer than longest_bin_s, up to a sixteenth of its time constant.
constexpr double enough_bins = 5000;

using thermal::Drive;

/// Of rest: second differences over eight seconds share the curvature of a cooling curve, and hardly any noise. They
/// are counted a fifth higher than they are: at their own height a model's error was taken for a cause's, and of 624
/// hidden logs five that were named or tied became "unknown" (score, four rows of --seeds 6 --first 72000).
constexpr double block_s = 90, spare = 1.2;
/// The winding still empties into the housing: of a small motor it has a time constant of 1 to 20 s (pauses.cpp).
constexpr double after_load_s = 20;

/// Second differences, over a lag, of means over a second at rest: they cancel the slope of a cooling curve.
struct AtRest {
  double sum = 0;    // of their squares
  double white = 0;  // of these, what readings that are noisy each for itself account for
  double s = 0;      // of rest
  int n = 0;

  /// Share of its variance that a first-order process keeps in them.
  static double kept(double lag_s, double slow_s) {
    const double rho = std::exp(-lag_s / slow_s);
    return 6 - 8 * rho + 2 * rho * rho;
  }
};

AtRest at_rest(const Bins& fine, double lag_s) {
  AtRest out;
  const Bins log = merged(fine, static_cast<std::size_t>(std::max(1.0, std::round(1 / fine.width_s))));
  const auto j = static_cast<std::size_t>(std::max(1.0, std::round(lag_s / log.width_s)));
  const auto block = static_cast<std::size_t>(block_s / log.width_s) + 1;
  const auto after_load = static_cast<std::size_t>(after_load_s / log.width_s);
  std::size_t resting = 0;
  std::vector<double> differences;
  const auto close = [&] {  // what a block's differences share is the cooling curve's curvature
    double mean = 0;
    for (const double d : differences) mean += d / static_cast<double>(differences.size());
    for (const double d : differences) out.sum += (d - mean) * (d - mean) * spare;
    out.n += static_cast<int>(differences.size());
    differences.clear();
  };
  for (std::size_t k = 0, begun = 1; k < log.bins.size(); ++k) {
    resting = log.bins[k].idle ? resting + 1 : 0;
    if (begun < log.starts.size() && k == log.starts[begun].bin) ++begun, resting = 0;
    if (resting == 0 || differences.size() >= block) close();
    if (resting <= 2 * j + after_load) continue;
    const Bin &a = log.bins[k - 2 * j], &b = log.bins[k - j], &c = log.bins[k];
    if (std::isnan(a.housing_degC) || std::isnan(b.housing_degC) || std::isnan(c.housing_degC)) continue;
    out.s += log.width_s;
    differences.push_back(a.housing_degC - 2 * b.housing_degC + c.housing_degC);
    out.white += log.housing_noise_K * log.housing_noise_K *
                 (1 / static_cast<double>(a.housing_n) + 4 / static_cast<double>(b.housing_n) +
                  1 / static_cast<double>(c.housing_n));
  }
  close();
  return out;
}

/// White and slow part of the housing noise: of one reading from its differences, the rest from rest. What is assumed
/// here matters where the noise decides: half of usual_slow_K, of after_load_s, of the least white, of the five minutes
/// and of a winding's 2 K at once named one effect of 1.3 K more, of 20 logs, and lost one of 3.6 K to "unknown" (those
/// of candidates.cpp).
void noise_from_rest(Problem& problem) {
  // Over eight seconds what is white is little beside what is slow; over two it is much.
  constexpr double lag_s = 8, short_s = 2;
  constexpr double last_digit_K = 0.01;  // of a channel that repeats itself perfectly: of steps of 0.035 K, rms
  constexpr double most_slow_K = 1;      // what wanders more at rest is no sensor's noise
  AtRest all, close_by;
  double reading2 = 0;
  int logs = 0;
  const auto add = [](AtRest& to, const AtRest& more) {
    to.sum += more.sum, to.white += more.white, to.s += more.s, to.n += more.n;
  };
  for (const Bins& log : problem.logs) {
    if (!log.has_housing) continue;
    reading2 += log.housing_noise_K * log.housing_noise_K;
    ++logs;
    add(all, at_rest(log, lag_s));
    add(close_by, at_rest(log, short_s));
  }
  Noise& noise = problem.noise;
  noise.housing_white_K = std::max(last_digit_K, std::sqrt(reading2 / std::max(logs, 1)));
  const double kept = AtRest::kept(lag_s, noise.slow_s);
  constexpr double assumed2 = usual_slow_K * usual_slow_K;
  // A filtered sensor differs little from reading to reading, and yet wanders within a second or two.
  if (close_by.n > 0 && close_by.white > 0) {
    const double more = (close_by.sum - AtRest::kept(short_s, noise.slow_s) * assumed2 * close_by.n) / close_by.white;
    const double independent = close_by.s / (2 * short_s);
    if (more > 1 + 3 * std::sqrt(2 / independent)) {  // three standard deviations of a variance
      noise.housing_white_K *= std::sqrt(more);
      all.white *= more;
    }
  }
  const double seen2 = all.n > 0 ? std::max(0.0, (all.sum - all.white) / (all.n * kept)) : assumed2;
  const double trust = all.s / (all.s + 300);  // five minutes of rest count as much as what is assumed
  noise.housing_slow_K = std::clamp(std::sqrt(trust * seen2 + (1 - trust) * assumed2), least_slow_K, most_slow_K);
  noise.idle_s = all.s;

  // Winding: a dense channel shows its noise; readings further apart than the winding's own motion do not.
  double core2 = 0;
  int dense = 0, any = 0;
  for (const Bins& log : problem.logs) {
    if (!log.has_core) continue;
    const auto readings = std::count_if(log.bins.begin(), log.bins.end(), [](const Bin& b) { return b.core_n > 0; });
    ++any;
    if (static_cast<std::size_t>(readings) * 2 < log.bins.size()) continue;
    core2 += log.core_noise_K * log.core_noise_K;
    ++dense;
  }
  if (any > 0 && dense == any) {
    noise.core_white_K = std::max(0.02, std::sqrt(core2 / dense));
    noise.core_slow_K = 2 * noise.housing_slow_K;  // a winding has no single temperature: a sensor on it wanders more
  } else {
    // What resistance at standstill gives, as host-sim has it; then its residuals tell (disturbance.cpp).
    noise.core_white_K = 2;
    noise.core_slow_K = 0;
  }
}

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

/// With the rise that this log shows.
std::vector<Belief> guesses_of(const Problem& problem) {
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
      b.R2_K_per_W = rise_K / std::max(1e-9, problem.heat_W);
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
  const std::vector<Belief> guesses = guesses_of(problem);
  std::vector<Fit> fits(guesses.size());
  in_parallel(guesses.size(), [&](std::size_t i) {
    Problem guessed = problem;
    guessed.belief = guesses[i];
    fits[i] = fit(guessed, {});
  });
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

/// A standing rotor's phases take unequal heat P_k and warm unequally, and the warmer ones then take more still:
/// wherever it stands, alpha R_u sum (P_k - P/3)^2 = alpha R_u P^2 / 6 above P, the heat of equal phases, with one P as
/// long ago as phases of C1/3 need to warm. Between one phase and the others lies R_u: 0 where they share their heat at
/// once, 3 R1 where they share none. The middle is assumed.
void warm_phases_unequally(Problem& problem) {
  const Belief& b = problem.belief;
  const double R_u_K_per_W = 1.5 * b.R1_K_per_W, tau_s = R_u_K_per_W * b.C1_J_per_K / 3;
  for (Bins& log : problem.logs) {
    const double keep = std::exp(-log.width_s / tau_s), mean_keep = (1 - keep) * tau_s / log.width_s;
    double warmed_A2 = 0;
    for (Bin& bin : log.bins) {
      const double ahead_A2 = warmed_A2 - bin.stalled_A2;
      bin.uneven_A4 = bin.stalled_A2 * (bin.stalled_A2 + mean_keep * ahead_A2);
      warmed_A2 = bin.stalled_A2 + keep * ahead_A2;
    }
  }
  problem.warm_unevenly(b.copper_per_K * R_u_K_per_W * b.ohm / 6);
}

/// A current that is noisy from row to row tells a heat that is: white, of 2 i ohm times the current's. A housing
/// gathers it as slowly as it cools, a winding on top as slowly as it follows.
void allow_for_noisy_current(Problem& problem) {
  const Belief& b = problem.belief;
  double told2_s = 0, left2_s = 0, s = 0;
  for (const Bins& log : problem.logs) {
    const double noise2_s = log.current_noise_A * log.current_noise_A * log.interval_s * log.duration_s();
    told2_s += noise2_s;
    left2_s += log.noisy_share * noise2_s;
    s += log.duration_s();
  }
  const auto gathered_K2 = [&](double noise2_s, double R_K_per_W, double C_J_per_K) {
    return 4 * b.ohm * problem.heat_W * noise2_s / s * R_K_per_W / (2 * C_J_per_K);
  };
  Noise& noise = problem.noise;
  noise.disturbance_K = std::sqrt(gathered_K2(left2_s, b.R2_K_per_W, b.C2_J_per_K));
  noise.disturbance_s = std::clamp(b.R2_K_per_W * b.C2_J_per_K, fast_disturbance_s, slow_disturbance_s);
  noise.of_current_K =
      std::sqrt(gathered_K2(told2_s, b.R2_K_per_W, b.C2_J_per_K) + gathered_K2(told2_s, b.R1_K_per_W, b.C1_J_per_K));
}

}  // namespace

bool Problem::any_core() const {
  return std::any_of(logs.begin(), logs.end(), [](const Bins& b) { return b.has_core; });
}

void Problem::warm_unevenly(double per_A2) {
  for (Bins& log : logs) {
    for (Bin& bin : log.bins) bin.input[Drive::current_A2] += (per_A2 - uneven_per_A2) * bin.uneven_A4;
    log.uneven_per_A2 = per_A2;
  }
  uneven_per_A2 = per_A2;
}

double Problem::scale(Scale s, Drive d) const {
  switch (s) {
    case Scale::one:
      return 1;
    case Scale::heat_per_drive:
      return drive_mean[static_cast<int>(d)] > 0 ? heat_W / drive_mean[static_cast<int>(d)] : 0;
    case Scale::heat:
      return heat_W;
    case Scale::sink_conductance:
      return 1 / belief.R2_K_per_W;
    case Scale::core_capacity:
      return belief.C1_J_per_K;
    case Scale::housing_capacity:
      return belief.C2_J_per_K;
    case Scale::core_resistance:
      return belief.R1_K_per_W;
    case Scale::sink_resistance:
      return belief.R2_K_per_W;
    case Scale::rms_current:
      return rms_A;
    case Scale::duration:
      return duration_s;
    case Scale::speed08:
      return speed08_mean > 0 ? 1 / speed08_mean : 0;
  }
  return 1;
}

bool Problem::possible(const Cause& cause) const {
  const auto any = [&](auto what) { return std::any_of(logs.begin(), logs.end(), what); };
  const bool amps = rms_A > 0 && !heated_by_power();
  switch (cause.needs) {
    case Needs::nothing:
      return true;
    case Needs::current:
      return amps;
    case Needs::copper:
      return amps && belief.copper_per_K > 0;
    case Needs::speed: {
      const bool loaded = cause.drive == Drive::current_speed || cause.drive == Drive::current2_speed2 ||
                          cause.edit == Edit::stall_share;
      return speed08_mean > 0 && (!loaded || amps);
    }
    case Needs::several_currents: {
      // Of one current alone an offset is a change of gain, and cannot be seen.
      double n = 0, sum = 0, square = 0;
      for (const Bins& log : logs) {
        for (const Bin& bin : log.bins) n += 1, sum += bin.signed_A, square += bin.signed_A * bin.signed_A;
      }
      constexpr double varied = 1.1;  // a mean square over the square of the mean
      return amps && n * square > varied * sum * sum;
    }
    case Needs::winding:  // a resistance is not late
      return any([](const Bins& b) { return b.has_core && b.core_reference.readings == 0; });
    case Needs::neighbour:
      return any([](const Bins& b) { return b.has_neighbour; });
    case Needs::frame:
      return any([](const Bins& b) { return b.has_frame; });
    case Needs::several_logs:
      return logs.size() > 1;
    case Needs::logs_of_power:
      return logs.size() > 1 && heated_by_power();
    case Needs::logs_of_current:
      return logs.size() > 1 && amps;
  }
  return true;
}

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

Problem first_part(const Problem& problem, double fraction) {
  Problem out = problem;
  for (Bins& log : out.logs) {
    const auto cut = static_cast<std::size_t>((1 - fraction) * static_cast<double>(log.bins.size()));
    log.bins.resize(std::max<std::size_t>(cut, 2));
  }
  return out;
}

Problem last_part(const Problem& problem, double fraction) {
  Problem out = problem;
  for (Bins& log : out.logs) {
    const auto cut = static_cast<std::size_t>((1 - fraction) * static_cast<double>(log.bins.size()));
    forget_readings(log, cut);
  }
  return out;
}

Problem unseen_by(const Problem& fitted, const std::vector<Log>& logs) {
  Problem out = fitted;
  out.logs.clear();
  out.leeway.clear();
  out.uneven_per_A2 = 0;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const std::size_t like = std::min(l, fitted.logs.size() - 1);
    out.logs.push_back(bins_of(logs[l], fitted.logs[like].width_s));
  }
  if (!out.heated_by_power()) warm_phases_unequally(out);
  return out;
}

}  // namespace identify

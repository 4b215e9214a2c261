// SPDX-License-Identifier: MIT
// What is left of a residual when the noise that can be foretold, and what a fit averages over, is taken out: white.
#pragma once

#include <Eigen/Dense>
#include <cassert>
#include <cmath>
#include <vector>

#include "identify/fit/problem.hpp"

namespace identify {

/// The whitening filter of one channel: residual = white/sqrt(n) + wander + disturbance, the latter two first-order
/// processes. A Kalman filter predicts these; what is left over, divided by its standard deviation, is white.
struct Whitener {
  double keep, keep_disturbed, wander2, disturbance2, white2;
  double P, P_both, P_disturbed;
  static constexpr double least_K2 = 1e-8;  // no reading is better than 0.1 mK: what divides stays above nothing
  double gain = 0, gain_disturbed = 0, weight = 0;  // of the present reading; weight = 1 / standard deviation

  static Whitener housing(const Noise& n, double step_s) {
    return {n, n.housing_white_K, n.housing_slow_K, n.disturbance_K, step_s};
  }
  static Whitener core(const Noise& n, double step_s) {
    return {n, n.core_white_K, n.core_slow_K, n.disturbance_K * n.core_slow_K / n.housing_slow_K, step_s};
  }

  bool disturbed() const { return disturbance2 > 0; }
  void reading(double n) {
    const double a = P + P_both, b = P_both + P_disturbed, S = a + b + white2 / n + least_K2;
    gain = a / S;
    gain_disturbed = b / S;
    weight = 1 / std::sqrt(S);
    P -= gain * a;
    P_both -= gain * b;
    P_disturbed -= gain_disturbed * b;
  }
  void step() {
    P = keep * keep * P + (1 - keep * keep) * wander2;
    P_both *= keep * keep_disturbed;
    P_disturbed = keep_disturbed * keep_disturbed * P_disturbed + (1 - keep_disturbed * keep_disturbed) * disturbance2;
  }

 private:
  Whitener(const Noise& n, double white_K, double slow_K, double disturbance_K, double step_s)
      : keep(std::exp(-step_s / n.slow_s)),
        keep_disturbed(std::exp(-step_s / n.disturbance_s)),
        wander2(slow_K * slow_K),
        disturbance2(disturbance_K * disturbance_K),
        white2(white_K * white_K),
        P(wander2),
        P_both(0),
        P_disturbed(disturbance2) {}
};

/// What a channel's filter foretells of a residual, or of what goes along with it: its sensitivities, ordinary effects.
template <class T>
struct Foretold {
  T wander, disturbance;

  /// Makes the residual of the present reading white, and learns from it.
  void whiten(const Whitener& w, T& residual) {
    residual -= wander;
    if (w.disturbed()) residual -= disturbance;
    residual *= w.weight;
    wander += residual * (w.gain / w.weight);
    if (w.disturbed()) disturbance += residual * (w.gain_disturbed / w.weight);
  }
  void step(const Whitener& w) {
    wander *= w.keep;
    if (w.disturbed()) disturbance *= w.keep_disturbed;
  }
};

/// What whitened readings see of the ordinary effects S that a fit averages over, a column each, or one for each log
/// where each has its own. So averaged, residuals have the covariance 1 + S S^T, whose inverse is 1 - S (1 + S^T S)^-1
/// S^T.
struct Averaged {
  static constexpr std::size_t most = 14;
  std::vector<Leeway> effects;  // whitened
  Eigen::MatrixXd inverse;      // (1 + S^T S)^-1
  double log_determinant = 0;

  explicit Averaged(const Problem& problem) : effects(problem.leeway) {
    assert(effects.size() <= most);
    Eigen::Index n = 0;
    for (const Leeway& effect : effects) {
      first.push_back(n);
      n += effect.of_each_log ? static_cast<Eigen::Index>(problem.logs.size()) : 1;
    }
    Eigen::MatrixXd sum = Eigen::MatrixXd::Identity(n, n);
    for (std::size_t l = 0; l < problem.logs.size() && n > 0; ++l) {
      const Bins& log = problem.logs[l];
      whiten(Whitener::housing(problem.noise, log.width_s), log, &Bin::housing_n, &Leeway::housing_K, l, sum);
      whiten(Whitener::core(problem.noise, log.width_s), log, &Bin::core_n, &Leeway::core_K, l, sum);
    }
    inverse = sum.inverse();
    log_determinant = std::log(sum.determinant());
  }

  Eigen::Index columns() const { return inverse.cols(); }
  Eigen::Index column(std::size_t effect, std::size_t log) const {
    return first[effect] + (effects[effect].of_each_log ? static_cast<Eigen::Index>(log) : 0);
  }

 private:
  std::vector<Eigen::Index> first;  // column of each effect, of the first log

  void whiten(Whitener w, const Bins& log, float Bin::*readings, std::vector<std::vector<double>> Leeway::*channel,
              std::size_t l, Eigen::MatrixXd& sum) {
    const auto n = static_cast<Eigen::Index>(effects.size());
    std::vector<Eigen::Index> at;
    for (std::size_t i = 0; i < effects.size(); ++i) at.push_back(column(i, l));
    Eigen::VectorXd s = Eigen::VectorXd::Zero(n);
    Foretold<Eigen::VectorXd> foretold{s, s};
    Eigen::MatrixXd of_log = Eigen::MatrixXd::Zero(n, n);
    for (std::size_t k = 0; k < log.bins.size(); ++k) {
      if (log.bins[k].*readings > 0) {
        w.reading(static_cast<double>(log.bins[k].*readings));
        for (Eigen::Index i = 0; i < n; ++i) s[i] = (effects[static_cast<std::size_t>(i)].*channel)[l][k];
        foretold.whiten(w, s);
        for (Eigen::Index i = 0; i < n; ++i) (effects[static_cast<std::size_t>(i)].*channel)[l][k] = s[i];
        of_log += s * s.transpose();
      }
      w.step();
      foretold.step(w);
    }
    sum(at, at) += of_log;
  }
};

}  // namespace identify

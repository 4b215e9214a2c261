// SPDX-License-Identifier: MIT
#include "thermal/uncertainty.hpp"

#include <cmath>

#include "thermal/housing_watch.hpp"

namespace thermal {

namespace {

constexpr double dt_s = estimator_dt_s;
constexpr float dt_f = static_cast<float>(estimator_dt_s);

// Drift of the ambient: 10 K in 20 min, at most 10 K off while it is observed; it also takes up cooling that differs
// from the sheet's. Of any node: 0.1 K in a second's square root, what no parameter explains.
constexpr float ambient_walk_K2_per_s = 100.0f / 1200.0f, ambient_worst_K = 10.0f, node_walk_K2_per_s = 1e-2f;

constexpr float measured_ambient_sigma_K = 1.0f;  // a sensor beside the motor is as good as that
constexpr float unheard_sigma_K = 3.0f;  // that housing and ambient are less known by, once nothing tells them; chosen

// One sigma of what a housing sensor may lag beside what was told, where only the sheet is known; in proportion less
// where the trust says that more is. Glued or potted ones lag 10..60 s, and the rms of anything up to 60 s is 35 s.
constexpr double untold_lag_s = 35.0, told_lag_share = 0.5;  // the latter, of what was told: chosen

float squared(float x) { return x * x; }

}  // namespace

Uncertainty::Uncertainty(const HeatSet<double>& set, const Trust& trust, float ambient_sigma_K)
    : n_(set.node_count), housing_(set.housing), trust_(trust), ambient_sigma_K_(ambient_sigma_K) {
  for (int i = 0; i < n_; ++i) has_limit_[i] = std::isfinite(set.nodes[i].max_degC);
  const double doubt = static_cast<double>(trust.inner_resistance / sheet_trust.inner_resistance);
  const double late_s = doubt * (housing_.lag_s > 0.0 ? told_lag_share * housing_.lag_s : untold_lag_s);
  late_share_ = dt_s / (dt_s + housing_.lag_s + late_s);
  widen_all();
}

void Uncertainty::widen_all() {
  p_.setZero(size(), size());
  late_shared_K_.setZero(size());
  for (int i = 0; i < n_; ++i) p_(i, i) = squared(start_sigma_K);
  p_(ambient(), ambient()) = squared(ambient_sigma_K_);
  p_(sensor(), sensor()) = squared(start_sigma_K);
  p_(power(), power()) = squared(trust_.power);
  p_(inner(), inner()) = squared(trust_.inner_resistance);
  p_(cooling(), cooling()) = squared(trust_.cooling);
  // The states are power over capacity and conductance: both signs turned.
  p_(power(), inner()) = p_(inner(), power()) = trust_.correlation * trust_.power * trust_.inner_resistance;
}

void Uncertainty::soak(float sigma_K) {
  p_.topLeftCorner(n_, n_).setConstant(squared(sigma_K));
  p_.row(sensor()) = p_.row(housing_.node);
  p_.col(sensor()) = p_.col(housing_.node);
  p_(sensor(), sensor()) = squared(sigma_K);
}

/// What the windings were off by is taken for an error of how fast they warm (the worst case: the next burst adds to
/// it), and for one that the housing does not show.
void Uncertainty::begin_anew(const float (&sigma_K)[max_nodes]) {
  late_K_ = static_cast<double>(most_sigma_K);  // of a sensor of which nothing is known
  widen_all();
  const int h = housing_.node;
  for (int i = 0; i < n_; ++i) {
    if (i == h) continue;
    for (int j = 0; j < n_; ++j) {
      if (j != h) p_(i, j) = sigma_K[i] * sigma_K[j];
    }
    p_(i, power()) = p_(power(), i) = sigma_K[i] * trust_.power;
    p_(i, inner()) = p_(inner(), i) = trust_.correlation * sigma_K[i] * trust_.inner_resistance;
  }
  know_housing(start_sigma_K);  // its sensor is as warm as what it sits on
}

/// What is known of a state from now on says nothing of others.
void Uncertainty::separate(int state, float sigma_K) {
  p_.row(state).setZero();
  p_.col(state).setZero();
  late_shared_K_[state] = 0.0f;
  p_(state, state) = squared(sigma_K);
}

void Uncertainty::know_ambient() { separate(ambient(), measured_ambient_sigma_K); }

void Uncertainty::know_sensor(float sigma_K) {
  separate(sensor(), sigma_K);
  late_K_ = 0.0;
}

void Uncertainty::know_housing(float sigma_K) {
  const int h = housing_.node;
  p_(h, h) = p_(h, sensor()) = p_(sensor(), h) = p_(sensor(), sensor()) = squared(sigma_K);
}

void Uncertainty::lose_surroundings() {
  p_(housing_.node, housing_.node) += squared(unheard_sigma_K);
  p_(ambient(), ambient()) += squared(unheard_sigma_K);
}

/// F = [phi0, phi1 d(rate)/d(ambient, parameters); 0, 1], and the sensor's lag as a row of its own.
Uncertainty::Matrix Uncertainty::step_matrix(const HeatNetwork<double>& network, const Transition<double>& transition,
                                             const HeatNetwork<double>::Rates& rates) const {
  using Mat = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, 0, max_nodes, max_nodes>;
  using Vec = Eigen::Matrix<float, Eigen::Dynamic, 1, 0, max_nodes, 1>;
  const Mat phi1 = transition.phi1.cast<float>();
  Matrix f = Matrix::Identity(size(), size());
  Mat nodes = transition.phi0.cast<float>();
  const Vec slope = rates.source_slope_per_s.cast<float>();
  for (int i = 0; i < n_; ++i) nodes.col(i) += phi1.col(i) * slope[i];  // hot copper heats more
  f.topLeftCorner(n_, n_) = nodes;
  const auto column = [&](int index, const Vec& rate) { f.col(index).head(n_) = phi1.lazyProduct(rate); };
  column(ambient(), network.boundary_gain_per_s(Boundary::ambient).cast<float>());
  // A winding whose capacity is off warms and cools at another rate, and the housing gets no more for it.
  Vec warming_K_per_s = (rates.sources_K_per_s + rates.inner_K_per_s + rates.outer_K_per_s).cast<float>();
  for (int i = 0; i < n_; ++i) {
    if (!has_limit_[i]) warming_K_per_s[i] = 0.0f;
  }
  column(power(), warming_K_per_s);
  column(inner(), rates.inner_K_per_s.cast<float>());
  column(cooling(), rates.outer_K_per_s.cast<float>());
  const float take = 1.0f / (1.0f + static_cast<float>(housing_.lag_s) / dt_f);
  f.row(sensor()) = f.row(housing_.node) * (take * (1.0f + static_cast<float>(housing_.gain_error)));
  f(sensor(), sensor()) = 1.0f - take;
  return f;
}

/// P = F P F' + Q. What the untold lag shares with the states moves with them.
void Uncertainty::step(const Matrix& f, bool ambient_drifts) {
  const Matrix fp = f.lazyProduct(p_);
  p_ = fp.lazyProduct(f.transpose());
  late_shared_K_ = f.lazyProduct(late_shared_K_).eval();
  for (int i = 0; i < n_; ++i) p_(i, i) += node_walk_K2_per_s * dt_f;
  if (ambient_drifts && p_(ambient(), ambient()) < squared(ambient_worst_K))
    p_(ambient(), ambient()) += ambient_walk_K2_per_s * dt_f;
}

void Uncertainty::step_lag(double behind_K, double moved_K) { late_K_ += moved_K - late_share_ * (behind_K + late_K_); }

/// What one sigma of the untold lag adds to the difference. A lag only makes a warming housing read colder: the hotter
/// the reading, the less it is doubted for one. While the model cools a lag would make it read hotter, but so does a
/// model that cools too fast, and that would be cold.
float Uncertainty::lag_K(const Sight& seen) const {
  const float doubt = !raises(seen) ? 1.0f : seen.late_K < 0.0f ? 0.0f : 1.0f - seen.above_K / least_gate_K;
  return doubt > 0.0f ? doubt * (seen.of.dot(late_shared_K_) - seen.late_K) : 0.0f;
}

/// The covariance of each state with what is seen, the lag apart.
Uncertainty::Row Uncertainty::shared_K2(const Sight& seen) const { return p_.lazyProduct(seen.of); }

bool Uncertainty::gain(const Sight& seen, Row& gain) const {
  const Row shared = shared_K2(seen);
  const float late_K = lag_K(seen);
  const float expected_K2 = seen.of.dot(shared) + seen.variance_K2 + squared(late_K);
  if (!(expected_K2 > 0.0f) || !std::isfinite(seen.above_K)) return false;
  gain = (shared + late_shared_K_ * late_K) / expected_K2;
  gain.tail(3).setZero();
  return true;
}

/// The untold lag is an error that stays, and that no reading teaches: hearing it twice a second makes nothing surer.
/// Raised, a state is no colder than it was: what a lag may hide grows only when a reading lowers.
void Uncertainty::follow(const Sight& seen, const Row& gain) {
  const Matrix keep = Matrix::Identity(size(), size()) - gain.lazyProduct(seen.of.transpose());
  const Matrix half = keep.lazyProduct(p_);
  p_ = half.lazyProduct(keep.transpose());
  p_ += (gain * seen.variance_K2).lazyProduct(gain.transpose());
  if (!raises(seen)) late_shared_K_ = (keep.lazyProduct(late_shared_K_) + gain * seen.late_K).eval();
  p_ = ((p_ + p_.transpose()) * 0.5f).eval();
}

float Uncertainty::variance_K2(int state) const { return p_(state, state) + squared(late_shared_K_[state]); }

float Uncertainty::sigma_K(int state) const { return std::sqrt(variance_K2(state)); }

float Uncertainty::sigma_K(const Sight& seen) const {
  const float late_K = seen.of.dot(late_shared_K_) - seen.late_K;
  return std::sqrt(seen.of.dot(shared_K2(seen)) + squared(late_K) + seen.variance_K2);
}

bool Uncertainty::sound() const {
  for (int i = 0; i < size(); ++i) {
    if (!(p_(i, i) >= 0.0f && p_(i, i) < 1e6f && std::abs(late_shared_K_[i]) < 1e3f)) return false;
  }
  return true;
}

}  // namespace thermal

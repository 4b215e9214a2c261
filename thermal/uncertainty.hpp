// SPDX-License-Identifier: MIT
// How sure the core-temperature estimate is: the covariance of a Schmidt-Kalman filter.
//
//   in    what one step does to the states, and what is seen of them
//   out   standard deviations, K, and by how much each state follows what is seen
//
// The states: the nodes, the ambient, the housing sensor, and three errors of the sheet, which make sigma grow with
// load and are never learned: from the housing alone they cannot be told apart. Float: it is a margin, not a memory.
// Knows no temperature and decides nothing. No heap; same cost every call. Not for an ISR.
#pragma once

#include "thermal/network.hpp"

namespace thermal {

/// Relative standard deviations of what the heat set claims.
struct Trust {
  float power;             // heat per A^2 against heat capacity of a winding: what a burst depends on
  float inner_resistance;  // links between nodes (R1): what a steady winding depends on
  float cooling;           // links to the world (R2)
  /// Of the errors of capacity and inner resistance, -1..1. Their product is known best: too much of one goes with too
  /// little of the other. A load that lasts as long as a winding takes to warm is then more uncertain than if the two
  /// erred independently, and what it cools by afterwards less.
  float correlation = -0.5f;
};
/// Catalogue values are good to 10..30 %. Identified: typical standard errors of a fit with core readings.
inline constexpr Trust sheet_trust{0.20f, 0.20f, 0.20f};
inline constexpr Trust identified_trust{0.02f, 0.04f, 0.05f};
inline constexpr Trust exact_trust{0.0f, 0.0f, 0.0f};

inline constexpr float start_sigma_K = 15.0f;  // of a temperature of which nothing is known
inline constexpr float most_sigma_K = 100.0f;  // as it is kept: more says no more

class Uncertainty {
 public:
  static constexpr int max_states = max_nodes + 5;
  using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, 0, max_states, max_states>;
  using Row = Eigen::Matrix<float, Eigen::Dynamic, 1, 0, max_states, 1>;

  /// One thing seen: a mean of states, with an error of its own.
  struct Sight {
    Row of;             // weights
    float above_K;      // by how much it is more than thought
    float variance_K2;  // of its noise
    float late_K;       // how much too low it may be for each sigma of the untold lag
  };

  /// As widen_all().
  Uncertainty(const HeatSet<double>& set, const Trust& trust, float ambient_sigma_K);

  int size() const { return n_ + 5; }
  int ambient() const { return n_; }
  int sensor() const { return n_ + 1; }

  /// Nothing is known about the temperatures but the states themselves; of the sheet, what the trust says.
  void widen_all();
  /// Whatever the housing turns out to be, the winding is too.
  void soak(float sigma_K = start_sigma_K);
  /// Nothing but temperatures and their sigmas has survived.
  void begin_anew(const float (&sigma_K)[max_nodes]);
  /// The ambient is measured.
  void know_ambient();
  /// Sensor and housing are known as well as after long hearing.
  void know_housing(float sigma_K);
  /// The sensor has just told where it is, and nothing of where anything else is.
  void know_sensor(float sigma_K);
  /// Nothing tells any more what housing and ambient are.
  void lose_surroundings();

  /// What one step makes of a small difference of the states.
  Matrix step_matrix(const HeatNetwork<double>& network, const Transition<double>& transition,
                     const HeatNetwork<double>::Rates& rates) const;
  /// `ambient_drifts`: a housing is heard that shows where it went.
  void step(const Matrix& step_matrix, bool ambient_drifts);
  /// The sensor, `behind_K` behind its housing, went `moved_K` of that in this step.
  void step_lag(double behind_K, double moved_K);

  /// By how much the states follow each kelvin of above_K, parameters not; false if that cannot be said.
  bool gain(const Sight& seen, Row& gain) const;
  /// The states did so (Joseph form: any gain will do).
  void follow(const Sight& seen, const Row& gain);

  float variance_K2(int state) const;
  float sigma_K(int state) const;
  /// Of what is seen against what is thought.
  float sigma_K(const Sight& seen) const;
  /// Numbers that can be true.
  bool sound() const;

  /// How much less a sensor reads that lags by one sigma more than was told.
  double late_K() const { return late_K_; }
  void set_late_K(double late_K) { late_K_ = late_K; }

  void add_built_to(FlipSum& sum) const {
    sum.add(n_, housing_.node, housing_.lag_s, housing_.offset_K, housing_.gain_error, trust_, ambient_sigma_K_,
            late_share_);
    sum.add_first(max_nodes, has_limit_);
  }
  void add_state_to(FlipSum& sum) const { sum.add(p_, late_shared_K_, late_K_); }

 private:
  int power() const { return n_ + 2; }
  int inner() const { return n_ + 3; }
  int cooling() const { return n_ + 4; }
  bool raises(const Sight& seen) const { return seen.late_K != 0.0f && seen.above_K > 0.0f; }
  float lag_K(const Sight& seen) const;
  Row shared_K2(const Sight& seen) const;
  void separate(int state, float sigma_K);

  int n_;
  HousingSensor<double> housing_;
  Trust trust_;
  float ambient_sigma_K_;
  bool has_limit_[max_nodes] = {};  // windings, and what else may not become too hot

  Matrix p_;  // covariance of the states
  // The lag that nobody told is one more error that is never learned. What it shares with the states is kept apart from
  // p_: sigma^2 is p_(i, i) + late_shared_K_[i]^2.
  Row late_shared_K_;  // how much colder the states were made, per sigma of it
  double late_K_ = 0.0;
  double late_share_;  // of its way that a sensor which lags by one sigma more goes in a step
};

}  // namespace thermal

// SPDX-License-Identifier: MIT
// Turns temperatures into the largest |i| that keeps every winding at or below its limit: continuous, no trip, no
// chatter.
//
//   holding current  ih^2 = (heat that leaves a node held at its limit) / (R(T_limit) share)
//   braking law      i = ih + sqrt(2 slope E / S),  S = R share (i_max + ih),  E = C (T_limit - T)        (eq. 8)
//   softness         neither ih nor i - ih grows by more than i_max within soft_K, of the neighbours or of the node
//                    (where neighbours are hotter, of the node as it will be when the current has run out)
//
// E is what the node can still store. With eq. 8 a full push runs down to ih no faster than `slope`: dE/dt = -R share
// (i^2 - ih^2) gives di/dt = -slope (i + ih)/(i_max + ih). Near ih a straight line replaces the root, whose endless
// gain would turn sensor noise into chatter. A node that current reaches mostly through others (a magnet beside a
// winding) would switch it on and off with tenths of a kelvin; softness is for these, a winding hardly feels it. A
// ceiling from the discrete step bounds what may happen before the next look, whatever the slope: it binds when a rotor
// stalls near the limit. Closed form: square roots only, so that host and target agree to the digit. No heap; same cost
// every call. The kernels may be called from an ISR, tick not (double).
#pragma once

#include "thermal/core_estimator.hpp"
#include "wire/codes.hpp"

namespace thermal {

struct GovernorSettings {
  float max_A = 20.0f;          // hardware limit of |i|
  float slope_per_s = 1.8f;     // of max_A; the promise is 2 % of peak per 10 ms = 2/s, a tenth is kept for drift of ih
  float approach_s = 0.05f;     // time constant of the last stretch: 0.1 K of noise moves a small motor by 0.07 A
  float horizon_s = 0.025f;     // until a changed allowance is certainly in the motor: two steps and a half
  float soft_K = 10.0f;         // from nothing to everything at least; half a housing's usual margin to its limit
  float margin_K = 5.0f;        // above the limit by this: nothing is allowed
  float coldest_degC = -60.0f;  // below it the estimate is broken: nothing is allowed
};

/// One node that has a limit, reduced to what the law needs.
struct NodeBudget {
  float limit_degC;
  float capacity_J_per_K;
  float hold_W;               // current heat that keeps it at its limit; negative if its neighbours alone overheat it
  float gain_W_per_A2;        // of |i|^2, at the limit; 0 for a node that current heats only through others
  float conductance_W_per_K;  // to all its neighbours together; 0: nothing holds it
};

/// Largest |i| by the braking law, A. For every one of the 2^32 floats: finite, within [0, max_A], 0 for NaN, for at
/// least limit + margin and below coldest_degC; from there up it never rises with temperature.
float allowed_current_A(float core_degC, const NodeBudget& node, const GovernorSettings& settings);

/// Largest |i| with which the node cannot pass its limit within horizon_s, A. Same promises.
float ceiling_current_A(float core_degC, const NodeBudget& node, const GovernorSettings& settings);

/// Next allowance: the braking law, approached with no more than the promised slope, under the ceiling.
float sloped_allowance_A(float last_A, float allowed_A, float ceiling_A, float dt_s, const GovernorSettings& settings);

/// Share of |i|^2 in each phase during a step: mean(i_k^2) / |i|^2. With (almost) no current 1 each, the hottest
/// possible.
struct PhaseShares {
  float k[3];
};
PhaseShares phase_shares(const HeatInput<>& input);

struct Allowance {
  float current_A;    // largest |i| from now on
  wire::Limit limit;  // hardware, core_hot, or blind when the estimate is broken
};

class Governor {
 public:
  explicit Governor(const GovernorSettings& settings) : settings_(settings) {}

  /// One step of 10 ms, after the estimator's.
  Allowance tick(const CoreEstimator& core);

  const GovernorSettings& settings() const { return settings_; }

 private:
  GovernorSettings settings_;
  float last_A_ = -1.0f;  // negative: not started, the first allowance is taken as it is
};

/// Budget of one node as the estimator sees it. Its margin (k sigma) lowers the limit at which heat flows are taken.
NodeBudget node_budget(const CoreEstimator& core, int node, const PhaseShares& shares);

}  // namespace thermal

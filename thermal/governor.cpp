// SPDX-License-Identifier: MIT
#include "thermal/governor.hpp"

#include <cmath>

namespace thermal {

namespace {

float largest(float a, float b) { return a > b ? a : b; }
float smallest(float a, float b) { return a < b ? a : b; }

/// Into [0, most]; NaN becomes 0.
float clamped(float x, float most) { return x > 0.0f ? smallest(x, most) : 0.0f; }

/// False for every temperature and every node that allows nothing; NaN falls out of each comparison.
bool usable(float core_degC, const NodeBudget& node, const GovernorSettings& s) {
  return core_degC >= s.coldest_degC && core_degC < node.limit_degC + s.margin_K && node.capacity_J_per_K > 0.0f &&
         node.gain_W_per_A2 >= 0.0f && s.max_A > 0.0f;
}

float holding_A(const NodeBudget& node, const GovernorSettings& s) {
  if (!(node.hold_W > 0.0f && node.conductance_W_per_K > 0.0f)) return 0.0f;
  const float soft_A = s.max_A * (node.hold_W / (node.conductance_W_per_K * s.soft_K));
  const float direct_A = node.gain_W_per_A2 > 0.0f ? std::sqrt(node.hold_W / node.gain_W_per_A2) : s.max_A;
  return smallest(s.max_A, smallest(direct_A, soft_A));
}

/// Above the limit the holding current runs out linearly within the margin.
float over_limit_A(float hold_A, float over_K, const GovernorSettings& s) {
  return hold_A * (1.0f - over_K / s.margin_K);
}

/// Room to the limit when a running current has run out, K: no more than now, less where the neighbours are hotter yet.
float soon_room_K(const NodeBudget& node, float room_K, const GovernorSettings& s) {
  if (!(node.conductance_W_per_K > 0.0f)) return room_K;
  const float left_K = node.hold_W / node.conductance_W_per_K;  // that the neighbours' mean is below the limit
  const float share = node.conductance_W_per_K / (node.capacity_J_per_K * s.slope_per_s);
  return smallest(room_K, (room_K + share * left_K) / (1.0f + share));
}

}  // namespace

float allowed_current_A(float core_degC, const NodeBudget& node, const GovernorSettings& s) {
  if (!usable(core_degC, node, s)) return 0.0f;
  const float room_K = node.limit_degC - core_degC, room_J = node.capacity_J_per_K * room_K;
  const float hold_A = holding_A(node, s);
  const float soft_A = hold_A + s.max_A * (soon_room_K(node, room_K, s) / s.soft_K);
  if (!(node.gain_W_per_A2 > 0.0f))
    return clamped(room_K < 0.0f ? smallest(soft_A, over_limit_A(hold_A, -room_K, s)) : soft_A, s.max_A);
  const float slope_A_per_s = s.slope_per_s * s.max_A;
  const float S_W_per_A = node.gain_W_per_A2 * (s.max_A + hold_A);
  const float line_J = slope_A_per_s * S_W_per_A * s.approach_s * s.approach_s;  // the straight stretch ends here
  const float line_A_per_J = 1.0f / (S_W_per_A * s.approach_s);
  const float line_A = hold_A + room_J * line_A_per_J;
  if (room_J < 0.0f) return clamped(smallest(largest(line_A, soft_A), over_limit_A(hold_A, -room_K, s)), s.max_A);
  if (room_J < line_J) return clamped(smallest(line_A, soft_A), s.max_A);
  const float root_A = std::sqrt(2.0f * slope_A_per_s / S_W_per_A * (room_J - 0.5f * line_J));
  const float steep_A = hold_A + largest(root_A, line_J * line_A_per_J);  // largest: rounding must not step down
  return clamped(smallest(steep_A, soft_A), s.max_A);
}

float ceiling_current_A(float core_degC, const NodeBudget& node, const GovernorSettings& s) {
  if (!usable(core_degC, node, s)) return 0.0f;
  const float room_K = node.limit_degC - core_degC;
  if (room_K < 0.0f) return clamped(over_limit_A(holding_A(node, s), -room_K, s), s.max_A);
  if (!(node.gain_W_per_A2 > 0.0f)) return s.max_A;
  const float power_W = node.hold_W + node.capacity_J_per_K * room_K / s.horizon_s;
  return power_W > 0.0f ? clamped(std::sqrt(power_W / node.gain_W_per_A2), s.max_A) : 0.0f;
}

float sloped_allowance_A(float last_A, float allowed_A, float ceiling_A, float dt_s, const GovernorSettings& s) {
  const float most_step_A = s.slope_per_s * s.max_A * dt_s * (1.0f / 0.9f);  // the full promise
  if (!(allowed_A >= 0.0f)) return 0.0f;
  float next_A = allowed_A;
  if (last_A >= 0.0f) next_A = smallest(largest(allowed_A, last_A - most_step_A), last_A + most_step_A);
  return clamped(smallest(next_A, ceiling_A), s.max_A);
}

PhaseShares phase_shares(const HeatInput<>& input) {
  const double a = input[Drive::phase_a_A2], b = input[Drive::phase_b_A2], c = input[Drive::phase_c_A2];
  const double vector_A2 = (a + b + c) / 1.5;
  if (!(vector_A2 > 1e-2)) return {{1.0f, 1.0f, 1.0f}};  // below 0.1 A the direction is noise
  return {{static_cast<float>(a / vector_A2), static_cast<float>(b / vector_A2), static_cast<float>(c / vector_A2)}};
}

NodeBudget node_budget(const CoreEstimator& core, int node, const PhaseShares& shares) {
  const Estimate& now = core.estimate();
  const double margin_K = static_cast<double>(now.margin_degC[node]) - now.degC[node];
  const double at_degC = static_cast<double>(now.max_degC[node]) - margin_K;
  HeatNetwork<double>::Vector held(now.node_count);
  for (int i = 0; i < now.node_count; ++i) held[i] = i == node ? at_degC : now.degC[i];
  // What heats without |i|^2 goes on as in the last step; what follows |i|^2 is taken out and counted per A^2.
  HeatInput<> rest = core.input(), unit{};
  for (int k = 0; k < 3; ++k) {
    rest[phase_drive(k)] = 0.0;
    unit[phase_drive(k)] = static_cast<double>(shares.k[k]);
  }
  rest[Drive::current_A2] = rest[Drive::current2_speed2] = 0.0;
  rest[Drive::enabled] = 1.0;  // a bridge at rest is asked what it will do
  unit[Drive::current_A2] = 1.0;
  unit[Drive::current2_speed2] = core.input()[Drive::speed2_rad2_per_s2];
  const double capacity_J_per_K = core.network().capacity_J_per_K(node);
  const double hold_W = -core.network().rate_K_per_s(node, held, rest) * capacity_J_per_K;
  held[node] -= 1.0;
  const double colder_W = -core.network().rate_K_per_s(node, held, rest) * capacity_J_per_K;
  // In a burst k sigma grows with the rise: what is limited moves like a winding that stores less.
  const double burst_J_per_K = capacity_J_per_K / static_cast<double>(core.burst_margin());
  return {now.max_degC[node], static_cast<float>(burst_J_per_K), static_cast<float>(hold_W),
          static_cast<float>(core.network().source_W(node, at_degC, unit)), static_cast<float>(hold_W - colder_W)};
}

Allowance Governor::tick(const CoreEstimator& core) {
  const Estimate& now = core.estimate();
  const PhaseShares shares = phase_shares(core.input());
  Allowance allowance{settings_.max_A, wire::Limit::hardware};
  float allowed_A = settings_.max_A, ceiling_A = settings_.max_A;
  for (int i = 0; i < now.node_count; ++i) {
    const float core_degC = now.margin_degC[i];
    if (now.max_degC[i] >= 1e30f) continue;  // no limit; a NaN limit is not skipped and allows nothing
    const NodeBudget budget = core_degC < 1e30f ? node_budget(core, i, shares) : NodeBudget{};
    const float node_A = allowed_current_A(core_degC, budget, settings_);
    if (!(node_A >= allowed_A)) {
      allowed_A = node_A;
      allowance.limit = core_degC < 1e30f ? wire::Limit::core_hot : wire::Limit::blind;
    }
    ceiling_A = smallest(ceiling_current_A(core_degC, budget, settings_), ceiling_A);
  }
  last_A_ = sloped_allowance_A(last_A_, allowed_A, ceiling_A, static_cast<float>(estimator_dt_s), settings_);
  allowance.current_A = last_A_;
  if (allowance.limit == wire::Limit::hardware && last_A_ < settings_.max_A) allowance.limit = wire::Limit::core_hot;
  return allowance;
}

}  // namespace thermal

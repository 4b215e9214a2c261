// SPDX-License-Identifier: MIT
// The power stage as a thermal model of its own: one pole in A^2, shared by both axes.
//
//   tau dx/dt = i0^2 + i1^2 - x,   x <= continuous_A^2
//
// The paper's board stands 6 A for ever and 20 A for 15 s; one pole through both points has tau = 159 s, for
// (20/6)^2 (1 - exp(-15/tau)) = 1. Whether that was one axis or both is not said, so the hot reading is taken: the sum
// of both axes has what one axis was promised (6 A on one, 4.2 A on each of two). The allowance is per axis: what the
// other leaves over, and half of it in any case, so that neither can starve the other. The sensor may only raise the
// model, and by a mean of its readings: each peak of its noise would be a step down. No heap; same cost every call;
// tick is for the 100 Hz lane, once for both axes.
#pragma once

#include "thermal/governor.hpp"

namespace thermal {

struct BoardRating {
  float continuous_A = 6.0f;
  float tau_s = 159.0f;
  // Of the power stage's own sensor: at rest in the hottest air allowed, and at continuous load there. Ours, not the
  // paper's.
  float idle_degC = 50.0f, limit_degC = 100.0f;
  float sensor_mean_s = 0.3f;  // what heats a stage faster than that, the model counts
};

class BoardHeat {
 public:
  explicit BoardHeat(const BoardRating& rating)
      : rating_(rating),
        limit_A2_(rating.continuous_A * rating.continuous_A),
        share_(static_cast<double>(1.0f / (1.0f + rating.tau_s / static_cast<float>(estimator_dt_s)))) {}

  /// `steps` of 10 ms with both axes' mean |i|^2 (not finite or negative: what would heat to the limit at once; and so
  /// does time without end).
  void tick(double axis0_A2, double axis1_A2, Reading power_stage = {0.0f, false}, int steps = 1) {
    const double load_A2 = axis0_A2 + axis1_A2;
    const bool good = axis0_A2 >= 0.0 && axis1_A2 >= 0.0 && load_A2 < 1e12 && steps <= 200;
    if (!good) used_A2_ += static_cast<double>(limit_A2_);
    for (int i = 0; good && i < steps; ++i) used_A2_ += (load_A2 - used_A2_) * share_;
    hear(power_stage, steps);
  }

  /// Largest |i| of one axis, A, while the other goes on with other_A2 (not a number: with all it may have).
  /// The braking law of the governor, in A^2 for kelvin.
  float allowed_A(double other_A2, const GovernorSettings& settings) const {
    const float left_A2 = other_A2 >= 0.0 ? limit_A2_ - static_cast<float>(other_A2) : 0.0f;
    const float hold_A2 = left_A2 < 0.5f * limit_A2_ ? 0.5f * limit_A2_ : left_A2;
    const NodeBudget pole{limit_A2_, rating_.tau_s, hold_A2, 1.0f, 1.0f};
    GovernorSettings s = settings;
    s.margin_K = 0.1f * limit_A2_;
    s.coldest_degC = 0.0f;
    s.soft_K = 0.08f * limit_A2_;  // steeper, a sensor ahead of the model would switch it on and off
    const float used_A2 = static_cast<float>(used_A2_);
    const float soft_A = allowed_current_A(used_A2, pole, s), hard_A = ceiling_current_A(used_A2, pole, s);
    return soft_A < hard_A ? soft_A : hard_A;
  }

  /// 0 cold .. 1 at the limit.
  float used_ratio() const { return static_cast<float>(used_A2_) / limit_A2_; }

  /// After a reset with unknown time off: the share of the limit that was stored, which may be more than all of it;
  /// anything unusable counts as full.
  void restore(float ratio) {
    constexpr float most = 25.0f;  // both axes at 20 A for ever would settle at 22
    used_A2_ = static_cast<double>(limit_A2_) * (ratio >= 0.0f && ratio < most ? static_cast<double>(ratio) : 1.0);
  }

  void add_to(FlipSum& sum) const { sum.add(rating_, limit_A2_, share_, used_A2_, ahead_A2_, heard_); }

 private:
  /// The first reading counts at once: nobody knows how warm the stage was when the model began.
  void hear(Reading power_stage, int steps) {
    if (!power_stage.valid || !(power_stage.value > -300.0f)) return;  // nor is what is not a number a reading
    const float degC = power_stage.value < 500.0f ? power_stage.value : 500.0f;
    const float seen = (degC - rating_.idle_degC) / (rating_.limit_degC - rating_.idle_degC) * limit_A2_;
    const float passed_s = static_cast<float>(steps) * static_cast<float>(estimator_dt_s);
    const double share = heard_ ? static_cast<double>(passed_s / (passed_s + rating_.sensor_mean_s)) : 1.0;
    ahead_A2_ += (static_cast<double>(seen) - used_A2_ - ahead_A2_) * share;
    heard_ = true;
    if (!(ahead_A2_ > 0.0)) return;
    used_A2_ += ahead_A2_;
    ahead_A2_ = 0.0;
  }

  BoardRating rating_;
  float limit_A2_;
  double share_;
  double used_A2_ = 0.0;
  double ahead_A2_ = 0.0;  // of the sensor, mean; what of it was positive is in the model already
  bool heard_ = false;
};

}  // namespace thermal

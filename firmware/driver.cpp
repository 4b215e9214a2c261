// SPDX-License-Identifier: MIT
#include "firmware/driver.hpp"

#include <algorithm>
#include <cmath>

namespace firmware {

namespace {
thermal::BoardRating heat_of(const DriverSetup& setup) {
  thermal::BoardRating heat = setup.board_heat;
  heat.continuous_A = setup.rating.continuous_A;
  return heat;
}

/// The hotter of what is read and what is estimated: a sensor may be missing or lag, and so may a model.
float housing_degC(const Axis& axis, const hal::AxisSlowSample& sample) {
  const float estimated_degC = static_cast<float>(axis.core().estimate().housing_degC);
  return sample.housing.valid ? std::fmax(estimated_degC, sample.housing.value_degC) : estimated_degC;
}
}  // namespace

Driver::Driver(const DriverSetup& setup)
    : governor_(governor_settings(setup.rating)),
      board_heat_(heat_of(setup)),
      axes_{{0, setup.axes[0], setup.rating}, {1, setup.axes[1], setup.rating}} {
  left_ = sum();
}

std::uint32_t Driver::sum() const {
  thermal::FlipSum sum;
  board_heat_.add_to(sum);
  return sum.add(governor_, board_A_).word();
}

void Driver::restore(const DriverMemory& memory) {
  for (int i = 0; i < axis_count; ++i) axes_[i].restore(memory.axes[i]);
  board_heat_.restore(memory.board_used_ratio);
  left_ = sum();
}

void Driver::start_hot() {
  for (Axis& axis : axes_) axis.start_hot();
  board_heat_.restore(1.0f);
  left_ = sum();
}

void Driver::slow_tick(const hal::BoardSlowSample& board, const hal::AxisSlowSample (&axes)[axis_count]) {
  const bool whole = sum() == left_;
  const double used_A2[axis_count] = {axes_[0].current2_A2(), axes_[1].current2_A2()};  // of the last slow tick
  board_heat_.tick(used_A2[0], used_A2[1], {board.power_stage.value_degC, board.power_stage.valid},
                   std::max(axes_[0].elapsed_steps(), axes_[1].elapsed_steps()));
  const float housings_degC[axis_count] = {housing_degC(axes_[0], axes[0]), housing_degC(axes_[1], axes[1])};
  for (int i = 0; i < axis_count; ++i) {
    // No step where the other axis takes more at once. Coming down from all to nothing heats a stage by a fortieth of
    // its limit at most, so nothing has to come down faster.
    board_A_[i] = thermal::sloped_allowance_A(board_A_[i], board_heat_.allowed_A(used_A2[1 - i], governor_),
                                              governor_.max_A, static_cast<float>(thermal::estimator_dt_s), governor_);
    axes_[i].slow_tick(axes[i], {whole ? board_A_[i] : 0.0f, wire::Limit::board_hot}, housings_degC[1 - i]);
  }
  if (whole) left_ = sum();  // else nothing is allowed until a restart
}

}  // namespace firmware

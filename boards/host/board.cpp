// SPDX-License-Identifier: MIT
#include "boards/host/board.hpp"

#include <cmath>
#include <numbers>

namespace boards::host {

hal::AxisSample AxisDoor::sample() noexcept {
  const host_sim::AxisRaw& raw = bench_->raw(axis_);
  bool valid = true;
  const auto ampere = [&](std::uint16_t counts) {
    valid = valid && counts > 0 && counts < design_->adc_full_scale;  // at a rail the current may be anything
    return static_cast<float>((counts - design_->current_zero_counts) * design_->current_A_per_count);
  };
  const wire::Abc current_A = {ampere(raw.current_counts[0]), ampere(raw.current_counts[1]),
                               ampere(raw.current_counts[2])};
  const int position = raw.encoder_counts % design_->encoder_counts_per_turn;
  return {.current_A = current_A,
          .bus_V = static_cast<float>(bench_->board_raw().bus_voltage_counts * design_->bus_V_per_count),
          .rotor_rad = static_cast<float>(position * (2 * std::numbers::pi / design_->encoder_counts_per_turn)),
          .sequence = raw.sequence,
          .valid = valid};
}

hal::Temperature thermistor(std::uint16_t counts, const host_sim::NtcDesign& design, int full_scale) {
  // Outside -40..250 degC a 10 kohm thermistor in this divider reads as open or short: within 1 % of a rail.
  const double ratio = static_cast<double>(counts) / full_scale;
  if (!(ratio > 0.002 && ratio < 0.99)) return {0.0f, false};
  const double ohm = design.pull_up_ohm * ratio / (1 - ratio);
  const double per_K = 1 / 298.15 + std::log(ohm / design.r25_ohm) / design.beta_K;
  return {static_cast<float>(1 / per_K - 273.15), true};
}

hal::AxisSlowSample slow_sample(const host_sim::AxisRaw& raw, const host_sim::SensorDesign& design) {
  return {thermistor(raw.housing_counts, design.housing, design.adc_full_scale)};
}

hal::BoardSlowSample slow_sample(const host_sim::BoardRaw& raw, const host_sim::SensorDesign& design) {
  const bool on_scale = raw.bus_current_counts > 0 && raw.bus_current_counts < design.adc_full_scale;
  return {.power_stage = thermistor(raw.power_stage_counts, design.power_stage, design.adc_full_scale),
          .bus_A = static_cast<float>((raw.bus_current_counts - design.bus_zero_counts) * design.bus_A_per_count),
          .bus_A_valid = on_scale};
}

}  // namespace boards::host

// SPDX-License-Identifier: MIT
#include "boards/host/board.hpp"

#include <numbers>

namespace boards::host {

hal::AxisSample AxisDoor::sample() noexcept {
  const host_sim::SensorDesign& design = bench_->sensor_design();
  const host_sim::AxisRaw raw = bench_->raw(axis_);
  const auto ampere = [&](int phase) {
    return static_cast<float>((raw.current[phase] - design.current_zero_counts) * design.current_A_per_count);
  };
  const auto at_rail = [&](int phase) { return raw.current[phase] == 0 || raw.current[phase] >= design.adc_full_scale; };
  return {.current_A = {ampere(0), ampere(1), ampere(2)},
          .bus_V = static_cast<float>(raw.bus_voltage * design.bus_V_per_count),
          .rotor_rad = static_cast<float>(raw.encoder * (2 * std::numbers::pi / design.encoder_counts_per_turn)),
          .sequence = raw.sequence,
          .valid = !at_rail(0) && !at_rail(1) && !at_rail(2)};
}

hal::Temperature thermistor(std::uint16_t counts, const host_sim::NtcDesign& design, int full_scale) {
  // Outside -40..250 degC a 10 kohm thermistor in this divider reads as open or short: within 1 % of a rail.
  const double ratio = static_cast<double>(counts) / full_scale;
  if (!(ratio > 0.002 && ratio < 0.99)) return {0.0f, false};
  const double ohm = design.pull_up_ohm * ratio / (1 - ratio);
  const double per_K = 1 / 298.15 + std::log(ohm / design.r25_ohm) / design.beta_K;
  return {static_cast<float>(1 / per_K - 273.15), true};
}

hal::AxisSlowSample slow_sample(host_sim::Bench& bench, int axis) {
  const host_sim::SensorDesign& design = bench.sensor_design();
  return {thermistor(bench.raw_slow(axis).housing, design.housing, design.adc_full_scale)};
}

hal::BoardSlowSample slow_sample(host_sim::Bench& bench) {
  const host_sim::SensorDesign& design = bench.sensor_design();
  const host_sim::BoardRaw raw = bench.raw_board();
  const bool on_scale = raw.bus_current > 0 && raw.bus_current < design.adc_full_scale;
  return {.power_stage = thermistor(raw.power_stage, design.power_stage, design.adc_full_scale),
          .bus_A = static_cast<float>((raw.bus_current - design.bus_zero_counts) * design.bus_A_per_count),
          .bus_A_valid = on_scale};
}

}  // namespace boards::host

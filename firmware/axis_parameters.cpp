// SPDX-License-Identifier: MIT
#include "firmware/axis_parameters.hpp"

#include "wire/bus_window.hpp"

namespace firmware {

namespace {

enum : std::uint16_t {
#define PARAM(id, name, unit, fallback, min, max, doc) id_##name = id,
#include "firmware/axis.params"
#undef PARAM
};

}  // namespace

Finding validate(const AxisParameters& p, const BoardRating& r) {
  const float values[] = {
#define PARAM(id, name, unit, fallback, min, max, doc) p.name##_##unit,
#include "firmware/axis.params"
#undef PARAM
  };
  const Finding outside = first_outside(axis_dictionary, values);
  if (outside.id != 0) return outside;
  if (p.pole_pairs_count != static_cast<float>(static_cast<int>(p.pole_pairs_count)))
    return {id_pole_pairs, p.pole_pairs_count, false};
  if (!(p.current_limit_A <= r.peak_A)) return {id_current_limit, p.current_limit_A, false};
  // Ten samples a time constant: beyond it the delay of 1.5 periods eats the phase margin.
  if (!(p.current_bandwidth_Hz <= 0.1f * r.pwm_Hz)) return {id_current_bandwidth, p.current_bandwidth_Hz, false};
  if (!(p.rotor_bandwidth_Hz <= 0.1f * r.pwm_Hz)) return {id_rotor_bandwidth, p.rotor_bandwidth_Hz, false};
  if (!(r.bus_min_V < p.bus_low_end_V)) return {id_bus_low_end, p.bus_low_end_V, false};
  if (!(p.bus_low_end_V < p.bus_low_start_V)) return {id_bus_low_start, p.bus_low_start_V, false};
  if (!(p.bus_low_start_V < p.bus_high_start_V)) return {id_bus_high_start, p.bus_high_start_V, false};
  if (!(p.bus_high_start_V < p.bus_high_end_V)) return {id_bus_high_end, p.bus_high_end_V, false};
  if (!(p.bus_high_end_V < r.bus_max_V)) return {id_bus_high_end, p.bus_high_end_V, false};
  return {0, 0.0f, false};
}

AxisParameters parameters_from(const wire::Motor& motor, const BoardRating& rating, const Installation& installation) {
  AxisParameters p;
  p.phase_resistance_ohm = static_cast<float>(motor.phase_resistance_ohm);
  p.inductance_d_H = static_cast<float>(motor.inductance_d_H);
  p.inductance_q_H = static_cast<float>(motor.inductance_q_H);
  p.flux_linkage_Wb = static_cast<float>(motor.flux_linkage_Wb);
  p.pole_pairs_count = static_cast<float>(motor.pole_pairs);
  p.angle_offset_rad = installation.angle_offset_rad;
  p.current_limit_A = rating.peak_A;
  const wire::BusWindow bus = wire::bus_window(installation.supply_V, rating.bus_min_V, rating.bus_max_V);
  p.bus_high_start_V = bus.high_start_V;
  p.bus_high_end_V = bus.high_end_V;
  p.bus_low_start_V = bus.low_start_V;
  p.bus_low_end_V = bus.low_end_V;
  return p;
}

}  // namespace firmware

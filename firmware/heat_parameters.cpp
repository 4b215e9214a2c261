// SPDX-License-Identifier: MIT
#include "firmware/heat_parameters.hpp"

#include "thermal/motor_set.hpp"

namespace firmware {

namespace {
enum : std::uint16_t {
#define PARAM(id, name, unit, fallback, min, max, doc) id_##name = id,
#include "firmware/heat.params"
#undef PARAM
};

// Five steps of the slow lane for a phase among the others, fifty for a winding alone: what is faster the governor
// cannot hold. Of 8000 motors above none passed its limit by 3 K, whatever the demand and the rotor did (300 of them
// are drawn in test_thermal, Governor.NoDemand*); windings of 0.2 to 0.4 s by up to 8 K, of 0.05 to 0.1 s by 30 K.
constexpr float shortest_winding_s = 0.5f, shortest_phase_s = 0.05f;
}  // namespace

Finding validate(const HeatParameters& p) {
  const float values[] = {
#define PARAM(id, name, unit, fallback, min, max, doc) p.name##_##unit,
#include "firmware/heat.params"
#undef PARAM
  };
  const Finding outside = first_outside(heat_dictionary, values);
  if (outside.id != 0) return outside;
  if (p.housing_sensor_count != 0.0f && p.housing_sensor_count != 1.0f)
    return {id_housing_sensor, p.housing_sensor_count, false};
  // The estimate would begin above the limit and never allow anything.
  if (!(p.ambient_degC < p.winding_max_degC)) return {id_ambient, p.ambient_degC, false};
  if (!(p.C1_J_per_K * p.R1_K_per_W >= shortest_winding_s)) return {id_C1, p.C1_J_per_K, false};
  const float out_W_per_K = 1.0f / (3.0f * p.R1_K_per_W) + 2.0f * p.phase_coupling_W_per_K;  // of a phase
  if (!(p.C1_J_per_K / 3.0f >= shortest_phase_s * out_W_per_K))
    return {id_phase_coupling, p.phase_coupling_W_per_K, false};
  return {0, 0.0f, false};
}

thermal::HeatSet<double> heat_set(const HeatParameters& p, float phase_resistance_ohm) {
  wire::Motor m{};
  m.phase_resistance_ohm = static_cast<double>(phase_resistance_ohm);
  m.R1_K_per_W = static_cast<double>(p.R1_K_per_W);
  m.R2_K_per_W = static_cast<double>(p.R2_K_per_W);
  m.C1_J_per_K = static_cast<double>(p.C1_J_per_K);
  m.C2_J_per_K = static_cast<double>(p.C2_J_per_K);
  m.copper_coefficient_per_K = static_cast<double>(p.copper_coefficient_per_K);
  m.winding_max_degC = static_cast<double>(p.winding_max_degC);
  m.phase_coupling_W_per_K = static_cast<double>(p.phase_coupling_W_per_K);
  thermal::HeatSet<double> set = thermal::three_phase_set(m);
  set.housing.lag_s = static_cast<double>(p.housing_lag_s);
  set.housing.offset_K = static_cast<double>(p.housing_offset_K);
  return set;
}

thermal::EstimatorSettings estimator_settings(const HeatParameters& p) {
  thermal::EstimatorSettings s;
  s.trust = {p.trust_power_share, p.trust_inner_share, p.trust_cooling_share};
  s.margin_sigmas = p.margin_sigmas_count;
  s.ambient_degC = p.ambient_degC;
  s.ambient_sigma_K = p.ambient_sigma_K;
  s.housing_noise_K = p.housing_noise_K;
  return s;
}

HeatParameters heat_parameters_from(const wire::Motor& m, const thermal::Trust& trust) {
  HeatParameters p;
  p.R1_K_per_W = static_cast<float>(m.R1_K_per_W);
  p.R2_K_per_W = static_cast<float>(m.R2_K_per_W);
  p.C1_J_per_K = static_cast<float>(m.C1_J_per_K);
  p.C2_J_per_K = static_cast<float>(m.C2_J_per_K);
  p.copper_coefficient_per_K = static_cast<float>(m.copper_coefficient_per_K);
  p.winding_max_degC = static_cast<float>(m.winding_max_degC);
  p.phase_coupling_W_per_K = static_cast<float>(m.phase_coupling_W_per_K);
  p.trust_power_share = trust.power;
  p.trust_inner_share = trust.inner_resistance;
  p.trust_cooling_share = trust.cooling;
  return p;
}

}  // namespace firmware

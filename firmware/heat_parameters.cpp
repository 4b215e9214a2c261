// SPDX-License-Identifier: MIT
#include "firmware/heat_parameters.hpp"

#include <limits>

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
/// What identification found beside two resistors; as many as find room, and one more makes the set refused.
void add_found(const HeatParameters& p, thermal::HeatSet<double>& set) {
  using thermal::Drive;
  const auto housing = static_cast<std::int8_t>(set.housing.node);
  set.source_count = 3;  // copper: no board measures power
  const auto heat = [&set](std::int8_t node, Drive drive, float gain, float share, double coefficient_per_K) {
    if (gain == 0.0f) return;
    const int at = set.source_count++;
    if (at < thermal::max_sources)
      set.sources[at] = {node, drive, static_cast<double>(gain * share), coefficient_per_K};
  };
  const double copper_per_K = static_cast<double>(p.copper_coefficient_per_K);
  for (std::int8_t phase = 0; phase < 3; ++phase) {
    constexpr float third = 1.0f / 3.0f;
    heat(phase, Drive::speed2_rad2_per_s2, p.winding_eddy_Nms, third, 0.0);
    heat(phase, Drive::current2_speed2, p.ac_copper_loss_ohms2, third, copper_per_K);
    heat(phase, Drive::current_A, p.bridge_loss_V, third, 0.0);
    heat(phase, Drive::enabled, p.enabled_loss_W, third, 0.0);
  }
  heat(housing, Drive::one, p.constant_heat_W, 1.0f, 0.0);
  heat(housing, Drive::speed_rad_per_s, p.speed_loss_linear_Nm, 1.0f, 0.0);
  heat(housing, Drive::speed2_rad2_per_s2, p.speed_loss_quadratic_Nms, 1.0f, 0.0);
  heat(housing, Drive::speed3_rad3_per_s3, p.windage_Nms2, 1.0f, 0.0);
  heat(housing, Drive::current_speed, p.load_friction_Nm_per_A, 1.0f, 0.0);
  heat(housing, Drive::current_A2, p.board_heat_ohm, 1.0f, 0.0);

  thermal::Link<double>& sink = set.links[set.link_count - 1];
  if (p.speed_cooling_count != 0.0f) {
    sink.law = thermal::LinkLaw::speed;
    sink.k = static_cast<double>(p.speed_cooling_count);
  } else if (p.natural_convection_count != 0.0f) {
    sink.law = thermal::LinkLaw::natural_convection;
    sink.k = static_cast<double>(p.natural_convection_count);
  }
  if (p.radiation_W_per_K != 0.0f)
    set.links[set.link_count++] = {housing, thermal::boundary_end(thermal::Boundary::ambient),
                                   thermal::LinkLaw::radiation, static_cast<double>(p.radiation_W_per_K), 0.0};
  if (p.neighbour_heat_W_per_K != 0.0f)
    set.links[set.link_count++] = {housing, thermal::boundary_end(thermal::Boundary::neighbour),
                                   thermal::LinkLaw::constant, static_cast<double>(p.neighbour_heat_W_per_K), 0.0};
  if (p.third_mass_J_per_K == 0.0f) return;
  const auto mass = static_cast<std::int8_t>(set.node_count++);
  set.nodes[mass] = {static_cast<double>(p.third_mass_J_per_K), std::numeric_limits<float>::infinity()};
  set.links[set.link_count++] = {housing, mass, thermal::LinkLaw::constant,
                                 1.0 / static_cast<double>(p.third_mass_path_K_per_W), 0.0};
}
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
  // A link has one law.
  if (p.speed_cooling_count != 0.0f && p.natural_convection_count != 0.0f)
    return {id_natural_convection, p.natural_convection_count, false};
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
  set.housing.gain_error = static_cast<double>(p.sensor_gain_share);
  add_found(p, set);
  return set;
}

thermal::EstimatorSettings estimator_settings(const HeatParameters& p) {
  thermal::EstimatorSettings s;
  s.trust = {p.trust_power_share, p.trust_inner_share, p.trust_cooling_share, p.trust_correlation_count};
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

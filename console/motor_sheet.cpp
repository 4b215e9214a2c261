// SPDX-License-Identifier: MIT
#include "console/motor_sheet.hpp"

#include <fmt/format.h>

#include <cmath>

#include "wire/pc/user_error.hpp"

namespace console {

double value_of(const Values& values, const std::string& name) {
  const auto at = values.find(name);
  if (at == values.end() || std::isnan(at->second)) {
    wire::pc::refuse(fmt::format("{} is {} on this axis; tell it its motor first, 'hotcore motor'.", name,
                                 at == values.end() ? "not known" : "unset"));
  }
  return double{at->second};
}

double continuous_A(const Values& values) {
  const auto get = [&](const char* name) { return value_of(values, name); };
  const double rise_K = get("winding_max_degC") - get("ambient_degC");
  const double warm = 1 + get("copper_coefficient_per_K") * (get("winding_max_degC") - 25);
  // All of the heat passes both resistances: 3/2 R i^2 (R1 + R2) = rise.
  return std::sqrt(rise_K / (1.5 * get("phase_resistance_ohm") * warm * (get("R1_K_per_W") + get("R2_K_per_W"))));
}

std::string sheet_of(const Values& values, const std::string& name) {
  const auto get = [&](const char* key) { return value_of(values, key); };
  const double pole_pairs = get("pole_pairs");
  return fmt::format(
      "name = \"{}\"\nsource = \"the parameters in force on the board\"\n"
      "terminal_resistance_ohm = {:.9g}\nterminal_inductance_mH = {:.9g}\ntorque_constant_mNm_per_A = {:.9g}\n"
      "pole_pairs = {}\nrotor_inertia_gcm2 = 1.0  # not a board's parameter, and nothing of heat depends on it\n"
      "rated_current_A = {:.9g}\nR1_K_per_W = {:.9g}\nR2_K_per_W = {:.9g}\ntau_winding_s = {:.9g}\ntau_motor_s = "
      "{:.9g}\n"
      "winding_max_degC = {:.9g}\ncopper_coefficient_per_K = {:.9g}\n",
      name, 2 * get("phase_resistance_ohm"), 2e3 * get("inductance_d_H"),
      1e3 * std::sqrt(3.0) * pole_pairs * get("flux_linkage_Wb"), pole_pairs,
      continuous_A(values) * wire::direct_per_amplitude, get("R1_K_per_W"), get("R2_K_per_W"),
      get("R1_K_per_W") * get("C1_J_per_K"), get("R2_K_per_W") * get("C2_J_per_K"), get("winding_max_degC"),
      get("copper_coefficient_per_K"));
}

Values parameters_of_sheet(const wire::Motor& motor, const wire::BusWindow& bus, const Values& defaults) {
  Values values = defaults;
  for (const char* stays : {"angle_offset_rad", "current_limit_A", "current_bandwidth_Hz", "rotor_bandwidth_Hz",
                            "setpoint_timeout_s", "ramp_s", "offset_bound_A", "dead_time_soft_A", "margin_sigmas",
                            "ambient_degC", "ambient_sigma_K", "housing_sensor", "housing_noise_K", "housing_lag_s"})
    values.erase(stays);
  const auto put = [&](const char* name, double value) { values[name] = static_cast<float>(value); };
  put("phase_resistance_ohm", motor.phase_resistance_ohm);
  put("inductance_d_H", motor.inductance_d_H);
  put("inductance_q_H", motor.inductance_q_H);
  put("flux_linkage_Wb", motor.flux_linkage_Wb);
  put("pole_pairs", motor.pole_pairs);
  put("bus_low_end_V", bus.low_end_V);
  put("bus_low_start_V", bus.low_start_V);
  put("bus_high_start_V", bus.high_start_V);
  put("bus_high_end_V", bus.high_end_V);
  put("R1_K_per_W", motor.R1_K_per_W);
  put("R2_K_per_W", motor.R2_K_per_W);
  put("C1_J_per_K", motor.C1_J_per_K);
  put("C2_J_per_K", motor.C2_J_per_K);
  put("winding_max_degC", motor.winding_max_degC);
  put("copper_coefficient_per_K", motor.copper_coefficient_per_K);
  put("phase_coupling_W_per_K", motor.phase_coupling_W_per_K);
  return values;
}

}  // namespace console

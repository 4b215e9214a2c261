// SPDX-License-Identifier: MIT
#include "host-sim/plant/hidden_causes.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace host_sim {
namespace {

using H = HiddenEffects;
using S = HiddenScale;

double half(Random& random) { return random.uniform() < 0.5 ? 0.0 : 1.0; }

}  // namespace

const std::vector<HiddenCause>& hidden_causes() {
  static const std::vector<HiddenCause> causes = {
      // Two physical members of a class are drawn with equal chance: they must not be told apart by name.
      {"speed_loss_linear", true, false, 100,
       [](H& h, const S& s, double x, Random& r) {
         (half(r) > 0 ? h.hysteresis_W_s : h.coulomb_drag_W_s) = x * 0.3 * s.rated_W / s.full_speed_rad_per_s;
       }},
      {"speed_loss_quadratic", true, false, 100,
       [](H& h, const S& s, double x, Random& r) {
         (half(r) > 0 ? h.eddy_W_s2 : h.viscous_drag_W_s2) =
             x * 0.3 * s.rated_W / (s.full_speed_rad_per_s * s.full_speed_rad_per_s);
       }},
      {"windage", true, false, 100,
       [](H& h, const S& s, double x, Random&) {
         h.windage_W_s3 = x * 0.3 * s.rated_W / std::pow(s.full_speed_rad_per_s, 3);
       }},
      {"winding_eddy", true, false, 100,
       [](H& h, const S& s, double x, Random&) {
         h.winding_eddy_W_s2 = x * 0.3 * s.rated_W / (s.full_speed_rad_per_s * s.full_speed_rad_per_s);
       }},
      {"ac_copper_loss", true, false, 100,
       [](H& h, const S& s, double x, Random&) {
         h.ac_copper_s2 = x / (s.full_speed_rad_per_s * s.full_speed_rad_per_s);
       }},
      {"load_friction", true, false, 100,
       [](H& h, const S& s, double x, Random&) {
         h.load_friction_W_s_per_A = x * 0.3 * s.rated_W / (s.rated_A * s.full_speed_rad_per_s);
       }},
      {"copper_coefficient", true, true, 1,
       [](H& h, const S&, double x, Random&) { h.copper_coefficient_per_K = 0.0039 * x; }},
      {"bridge_loss", true, false, 100,
       [](H& h, const S& s, double x, Random&) { h.bridge_loss_W_per_A = x * 0.3 * s.rated_W / s.rated_A; }},
      {"constant_heat", true, true, 20,
       [](H& h, const S& s, double x, Random&) { h.constant_heat_W = x * 0.2 * s.rated_W; }},
      {"board_heat", true, false, 100,
       [](H& h, const S& s, double x, Random&) { h.board_heat_ohm = x * 0.3 * s.rated_W / (s.rated_A * s.rated_A); }},
      {"stall_imbalance", true, false, 4,
       [](H& h, const S& s, double x, Random&) {
         h.stall_imbalance = 0.5 * x;
         h.stall_below_rad_per_s = 0.01 * s.full_speed_rad_per_s;
       }},
      {"speed_cooling", true, false, 100,
       [](H& h, const S& s, double x, Random&) {
         h.speed_cooling_per_speed08 = x / std::pow(s.full_speed_rad_per_s, 0.8);
       }},
      {"natural_convection", true, false, 3,
       [](H& h, const S&, double x, Random&) { h.convection_exponent = 0.25 * x; }},
      {"radiation", true, false, 100,
       [](H& h, const S& s, double x, Random&) { h.radiation_W_per_K = x * 0.3 / s.sheet.R2_K_per_W; }},
      {"cooling_change", true, true, 1.6,
       [](H& h, const S& s, double x, Random& r) {
         h.cooling_change = std::exp(x);
         h.cooling_change_s = s.length_s * r.uniform(0.25, 0.7);
       }},
      {"third_mass", true, false, 40,
       [](H& h, const S& s, double x, Random& r) {
         h.third_mass_J_per_K = x * 0.5 * s.sheet.C2_J_per_K;
         h.third_mass_K_per_W = s.sheet.R2_K_per_W * r.uniform(0.15, 0.5);
       }},
      {"hot_spot", true, false, 100,
       [](H& h, const S& s, double x, Random& r) {
         if (x <= 0) return;
         h.hot_spot_share = std::min(0.9, 0.3 * x);
         h.hot_spot_J_per_K = s.sheet.C1_J_per_K * r.uniform(0.3, 1) * std::max(1.0, x / 3);
         h.hot_spot_K_per_W = s.sheet.R1_K_per_W * r.uniform(0.5, 2);
       }},
      {"neighbour_heat", true, false, 100,
       [](H& h, const S& s, double x, Random&) { h.neighbour_W_per_K = x * 0.3 / s.sheet.R2_K_per_W; }},
      {"frame_conduction", true, false, 100,
       [](H& h, const S& s, double x, Random&) { h.frame_W_per_K = x * 0.3 / s.sheet.R2_K_per_W; }},
      {"current_offset", true, true, 20,
       [](H& h, const S& s, double x, Random&) { h.current_offset_A = 0.1 * x * s.rated_A; }},
      {"sensor_lag", true, false, 30, [](H& h, const S&, double x, Random&) { h.sensor_lag_s = 10 * x; }},
      {"sensor_offset", true, true, 15, [](H& h, const S&, double x, Random&) { h.sensor_offset_K = x; }},
      {"sensor_gain", true, true, 6, [](H& h, const S&, double x, Random&) { h.sensor_gain = 0.1 * x; }},
      {"sensor_placement", true, false, 3, [](H& h, const S&, double x, Random&) { h.sensor_share = 0.3 * x; }},
      {"ambient_drift", true, true, 15,
       [](H& h, const S&, double x, Random&) { h.ambient_drift_K_per_s = 0.003 * x; }},
      {"clock_delay", true, false, 30, [](H& h, const S&, double x, Random&) { h.clock_delay_s = 2 * x; }},
      // Outside the catalogue.
      {"latent_heat", false, false, 100,
       [](H& h, const S& s, double x, Random& r) {
         h.latent_J = x * 5 * s.sheet.C2_J_per_K;
         h.latent_degC = r.uniform(38, 55);
         h.latent_width_K = 2;
       }},
      {"gusts", false, false, 100,
       [](H& h, const S&, double x, Random& r) {
         h.gust_depth = x;
         h.gust_mean_s = r.uniform(30, 120);
       }},
      {"contact_temperature", false, true, 4, [](H& h, const S&, double x, Random&) { h.contact_per_K = 0.004 * x; }},
      {"grease", false, false, 100,
       [](H& h, const S& s, double x, Random&) { h.grease_W_s = x * 0.5 * s.rated_W / s.full_speed_rad_per_s; }},
      {"thermostat_fan", false, false, 100,
       [](H& h, const S&, double x, Random& r) {
         h.thermostat_gain = x;
         h.thermostat_degC = r.uniform(40, 55);
       }},
      {"curing", false, false, 1.8, [](H& h, const S&, double x, Random&) { h.curing_gain = 0.5 * x; }},
      {"overload_iron", false, false, 100,
       [](H& h, const S& s, double x, Random&) { h.overload_W_per_A4 = x * 0.1 * s.rated_W / std::pow(s.rated_A, 4); }},
  };
  return causes;
}

const HiddenCause& hidden_cause(const std::string& id) {
  for (const HiddenCause& cause : hidden_causes()) {
    if (id == cause.id) return cause;
  }
  throw std::invalid_argument("no hidden cause is called '" + id + "'");
}

double unrefitted_error_K(const ThermalDesign& design, const std::vector<Demand>& demands, double rate_Hz) {
  ThermalDesign quiet = design;
  quiet.noise = LogNoise::none();
  ThermalDesign plain = quiet;
  plain.hidden = {};
  plain.sheet.winding_max_degC = 1e6;  // the currents are already protected
  ThermalBench real(quiet, 1), believed(plain, 1);
  double winding_K2 = 0, housing_K2 = 0;
  for (const Demand& demand : demands) {
    Demand logged = real.advance(1 / rate_Hz, demand);
    logged.current_A = (logged.current_A - design.hidden.current_offset_A) / design.hidden.current_gain;
    believed.advance(1 / rate_Hz, logged);
    const double winding_K = real.stove().winding_degC() - believed.stove().winding_degC();
    const double housing_K = real.stove().sensed_degC() - believed.stove().sensed_degC();
    winding_K2 += winding_K * winding_K;
    housing_K2 += housing_K * housing_K;
  }
  return std::sqrt(std::max(winding_K2, housing_K2) / static_cast<double>(demands.size()));
}

DrawnEffect draw_effect(const HiddenCause& cause, const ThermalDesign& design, const std::vector<Demand>& demands,
                        double rate_Hz, double full_speed_rad_per_s, double target_K, std::uint64_t seed) {
  HiddenScale scale{};
  scale.sheet = design.sheet;
  scale.rated_A = rated_amplitude_A(design.sheet);
  scale.rated_W = (design.sheet.winding_max_degC - 25) / (design.sheet.R1_K_per_W + design.sheet.R2_K_per_W);
  scale.full_speed_rad_per_s = full_speed_rad_per_s;
  scale.length_s = static_cast<double>(demands.size()) / rate_Hz;
  const double sign = cause.either_sign && Random(seed).uniform() < 0.5 ? -1 : 1;

  const auto effect = [&](double amount) {
    ThermalDesign with = design;
    with.hidden = {};        // sized alone
    Random shape(seed + 1);  // the same shape at every amount
    cause.apply(with.hidden, scale, sign * amount, shape);
    return DrawnEffect{with.hidden, sign * amount, unrefitted_error_K(with, demands, rate_Hz)};
  };
  // Errors grow about in proportion with the amount, or slower: scale, and damp when it overshoots.
  double amount = std::min(1.0, cause.largest);
  DrawnEffect drawn = effect(amount);
  for (int round = 0; round < 10; ++round) {
    const double ratio = target_K / std::max(drawn.error_K, 1e-3);
    if (ratio > 0.9 && ratio < 1.1) break;
    const double next = std::min(cause.largest, amount * std::clamp(ratio, 0.1, 10.0));
    if (next == amount) break;
    amount = next;
    drawn = effect(amount);
  }
  drawn.hidden = design.hidden;
  Random shape(seed + 1);
  cause.apply(drawn.hidden, scale, drawn.amount, shape);
  return drawn;
}

}  // namespace host_sim

// SPDX-License-Identifier: MIT
#include "host-sim/plant/stove.hpp"

#include <algorithm>
#include <cmath>

namespace host_sim {
namespace {
enum { a = 0, b, c, teeth, yoke, housing, frame, rotor, third_mass, hot_spot };
constexpr double absolute_zero_degC = -273.15;
}  // namespace

Stove::Stove(const HeatDetail& detail, const HiddenEffects& hidden, std::uint64_t seed)
    : d_(detail), hidden_(hidden), random_(seed) {
  capacity_J_per_K_ = {
      d_.phase_J_per_K,   d_.phase_J_per_K, d_.phase_J_per_K, d_.teeth_J_per_K,           d_.yoke_J_per_K,
      d_.housing_J_per_K, d_.frame_J_per_K, d_.rotor_J_per_K, hidden_.third_mass_J_per_K, hidden_.hot_spot_J_per_K};
  if (hidden_.third_mass_J_per_K > 0) third_mass_W_per_K_ = 1 / hidden_.third_mass_K_per_W;
  if (hidden_.hot_spot_J_per_K > 0) hot_spot_W_per_K_ = 1 / hidden_.hot_spot_K_per_W;
  for (int i = 0; i < place_count; ++i) per_capacity_[i] = capacity_J_per_K_[i] > 0 ? 1 / capacity_J_per_K_[i] : 0;
  // Upper bound of the fastest rate: twice the largest sum of a node's conductances over its capacity.
  const double phase = d_.phase_to_teeth_W_per_K + 3 * d_.phase_coupling_W_per_K + hot_spot_W_per_K_ / 3;
  const Vector ways = {phase,
                       phase,
                       phase,
                       3 * d_.phase_to_teeth_W_per_K + d_.teeth_to_yoke_W_per_K,
                       d_.teeth_to_yoke_W_per_K + d_.yoke_to_housing_W_per_K,
                       d_.yoke_to_housing_W_per_K + d_.housing_to_frame_W_per_K + third_mass_W_per_K_ +
                           3 * (d_.housing_to_ambient_W_per_K + d_.housing_to_coolant_W_per_K),
                       d_.housing_to_frame_W_per_K + 3 * d_.frame_to_ambient_W_per_K,
                       d_.rotor_to_housing_W_per_K,
                       third_mass_W_per_K_,
                       hot_spot_W_per_K_};
  fastest_per_s_ = 0;
  for (int i = 0; i < place_count; ++i) fastest_per_s_ = std::max(fastest_per_s_, 2 * ways[i] * per_capacity_[i]);
  soak(25);
}

void Stove::soak(double degC) {
  T_degC_.fill(degC);
  sensed_degC_ = degC;
}

double Stove::hottest_degC() const {
  const double windings_degC = std::max({T_degC_[a], T_degC_[b], T_degC_[c]});
  return hot_spot_W_per_K_ > 0 ? std::max(windings_degC, T_degC_[hot_spot]) : windings_degC;
}

double Stove::copper_degC() const {
  const double share = hot_spot_W_per_K_ > 0 ? hidden_.hot_spot_share : 0;
  return (1 - share) * winding_degC() + share * T_degC_[hot_spot];
}

double Stove::magnet_degC() const { return d_.rotor_J_per_K > 0 ? T_degC_[rotor] : T_degC_[teeth]; }

double Stove::phase_ohm(int phase, double speed_rad_per_s) const {
  const double ac = d_.ac_copper_s2 + hidden_.ac_copper_s2;
  const double share = hot_spot_W_per_K_ > 0 ? hidden_.hot_spot_share : 0;
  return d_.phase_resistance_ohm * ((1 - share) * ohm_ratio(T_degC_[phase]) + share * ohm_ratio(T_degC_[hot_spot])) *
         (1 + ac * speed_rad_per_s * speed_rad_per_s);
}

double Stove::ohm_ratio(double copper_degC) const {
  return 1 + (d_.copper_coefficient_per_K + hidden_.copper_coefficient_per_K) * (copper_degC - 25);
}

double Stove::at_sensor_degC() const {
  return T_degC_[housing] + hidden_.sensor_share * (winding_degC() - T_degC_[housing]);
}

double Stove::sensed_degC() const {
  const double body_degC = hidden_.sensor_lag_s > 0 ? sensed_degC_ : at_sensor_degC();
  return body_degC + hidden_.sensor_offset_K + hidden_.sensor_gain * (body_degC - 25);
}

double Stove::stored_J() const {
  double energy_J = 0;
  for (int i = 0; i < place_count; ++i) energy_J += capacity_J_per_K_[i] * T_degC_[i];
  return energy_J;
}

/// Watts into each place.
Stove::Vector Stove::place_heat(const HeatDrive& drive, double& hidden_W) const {
  const HiddenEffects& x = hidden_;
  const double w = drive.speed_rad_per_s, w2 = w * w, amps = drive.current_A;
  Vector heat_W{};
  double copper_W = 0;
  for (int k = 0; k < 3; ++k) copper_W += heat_W[k] = drive.copper_W[k];
  heat_W[teeth] = drive.iron_W * d_.iron_in_teeth;
  heat_W[yoke] = drive.iron_W * (1 - d_.iron_in_teeth);
  heat_W[housing] = drive.friction_W;

  double winding_W = x.winding_eddy_W_s2 * w2 + x.bridge_loss_W_per_A * amps;
  if (drive.enabled) winding_W += x.enabled_heat_W;
  const double iron_W = x.hysteresis_W_s * w + x.eddy_W_s2 * w2;
  const double housing_W = x.coulomb_drag_W_s * w + x.viscous_drag_W_s2 * w2 + x.windage_W_s3 * w2 * w +
                           x.load_friction_W_s_per_A * amps * w + x.board_heat_ohm * drive.current2_A2 +
                           x.constant_heat_W +
                           (x.grease_W_s > 0 ? x.grease_W_s * w * std::exp(-(T_degC_[housing] - 25) / x.grease_K) : 0);
  const double overload_W = x.overload_W_per_A4 * drive.current2_A2 * drive.current2_A2;
  hidden_W = winding_W + iron_W + housing_W + overload_W;
  const double stall = w < x.stall_below_rad_per_s ? x.stall_imbalance : 0;
  hidden_W += stall * copper_W;
  for (int k = 0; k < 3; ++k) heat_W[k] += winding_W / 3 + stall * drive.copper_W[k];
  heat_W[teeth] += iron_W * d_.iron_in_teeth + overload_W;
  heat_W[yoke] += iron_W * (1 - d_.iron_in_teeth);
  heat_W[housing] += housing_W;
  if (hot_spot_W_per_K_ > 0) {
    for (int k = 0; k < 3; ++k) {
      // The same current flows through both parts: each takes the heat of its own resistance.
      const double there = x.hot_spot_share * ohm_ratio(T_degC_[hot_spot]);
      const double here = (1 - x.hot_spot_share) * ohm_ratio(T_degC_[k]);
      const double moved_W = there / (there + here) * heat_W[k];
      heat_W[k] -= moved_W;
      heat_W[hot_spot] += moved_W;
    }
  }
  return heat_W;
}

/// What changes between steps and not within one: draughts, fans, drift, curing.
void Stove::change_weather(double h_s) {
  const HiddenEffects& x = hidden_;
  ambient_degC_ = around.ambient_degC + x.ambient_drift_K_per_s * time_s_;
  cooling_ = around.cooling;
  if (x.cooling_change != 1 && time_s_ >= x.cooling_change_s) cooling_ /= x.cooling_change;
  if (x.gust_depth != 0) {
    gust_left_s_ -= h_s;
    if (gust_left_s_ <= 0) {
      gust_ = !gust_;
      gust_left_s_ = -x.gust_mean_s * std::log(1 - random_.uniform());
    }
    if (gust_) cooling_ *= 1 + x.gust_depth;
  }
  if (x.thermostat_gain != 0) {
    if (T_degC_[housing] > x.thermostat_degC) fan_ = true;
    if (T_degC_[housing] < x.thermostat_degC - 8) fan_ = false;
    if (fan_) cooling_ *= 1 + x.thermostat_gain;
  }
  winding_path_ = 1;
  if (x.contact_per_K != 0) winding_path_ /= std::max(0.1, 1 + x.contact_per_K * (winding_degC() - 40));
  if (x.curing_gain != 0) {
    cured_ += (1 - cured_) * std::min(1.0, h_s / x.curing_s * std::exp2((winding_degC() - 100) / 10));
    winding_path_ /= 1 - x.curing_gain * cured_;
  }
}

Stove::Flow Stove::flow(const Vector& T, const Vector& heat_W) const {
  Vector net_W = heat_W;
  const auto pass = [&](int from, int to, double W_per_K) {
    const double W = W_per_K * (T[from] - T[to]);
    net_W[from] -= W;
    net_W[to] += W;
  };
  const double to_teeth = d_.phase_to_teeth_W_per_K * winding_path_;
  pass(a, teeth, to_teeth);
  pass(b, teeth, to_teeth);
  pass(c, teeth, to_teeth);
  pass(a, b, d_.phase_coupling_W_per_K);
  pass(b, c, d_.phase_coupling_W_per_K);
  pass(c, a, d_.phase_coupling_W_per_K);
  pass(teeth, yoke, d_.teeth_to_yoke_W_per_K);
  pass(yoke, housing, d_.yoke_to_housing_W_per_K);
  pass(housing, frame, d_.housing_to_frame_W_per_K);
  if (per_capacity_[rotor] > 0) pass(rotor, housing, d_.rotor_to_housing_W_per_K);
  if (third_mass_W_per_K_ > 0) pass(housing, third_mass, third_mass_W_per_K_);
  if (hot_spot_W_per_K_ > 0) {
    for (int k = 0; k < 3; ++k) pass(hot_spot, k, hot_spot_W_per_K_ / 3);
  }

  const double exponent = d_.convection_exponent + hidden_.convection_exponent;
  const auto air_W = [&](int from, double W_per_K) {
    const double rise_K = T[from] - ambient_degC_;
    const double draught =
        exponent == 0 ? cooling_ : cooling_ * std::pow(std::max(std::fabs(rise_K), 1e-3) / 20, exponent);
    return W_per_K * draught * rise_K;
  };
  const double housing_air_W = air_W(housing, d_.housing_to_ambient_W_per_K);
  const double frame_air_W = air_W(frame, d_.frame_to_ambient_W_per_K);
  double more_W = d_.housing_to_coolant_W_per_K * (T[housing] - around.coolant_degC) +
                  hidden_.neighbour_W_per_K * (T[housing] - around.neighbour_degC) +
                  hidden_.frame_W_per_K * (T[housing] - around.frame_degC);
  const double radiation = d_.radiation_W_per_K + hidden_.radiation_W_per_K;
  if (radiation > 0) {
    const double hot_K = T[housing] - absolute_zero_degC, cold_K = ambient_degC_ - absolute_zero_degC;
    more_W += radiation / (4 * 300.0 * 300 * 300) * (hot_K * hot_K * hot_K * hot_K - cold_K * cold_K * cold_K * cold_K);
  }
  net_W[housing] -= housing_air_W + more_W;
  net_W[frame] -= frame_air_W;

  Flow out;
  out.out_W = housing_air_W + frame_air_W + more_W;
  for (int i = 0; i < place_count; ++i) out.rate_K_per_s[i] = net_W[i] * per_capacity_[i];
  if (hidden_.latent_J > 0) {
    const double z = (T[housing] - hidden_.latent_degC) / hidden_.latent_width_K;
    const double bump = hidden_.latent_J / (hidden_.latent_width_K * 2.5066282746310002) * std::exp(-0.5 * z * z);
    out.rate_K_per_s[housing] = net_W[housing] / (capacity_J_per_K_[housing] + bump);
  }
  return out;
}

void Stove::advance(double h_s, const HeatDrive& drive) {
  change_weather(h_s);
  const double speed_cooling = d_.speed_cooling_per_speed08 + hidden_.speed_cooling_per_speed08;
  if (speed_cooling != 0) cooling_ *= 1 + speed_cooling * std::pow(drive.speed_rad_per_s, 0.8);
  double hidden_W = 0;
  const Vector heat_W = place_heat(drive, hidden_W);
  double sum_W = 0;
  for (const double W : heat_W) sum_W += W;
  heat_J_ += sum_W * h_s;
  hidden_J_ += hidden_W * h_s;

  const double stiff = h_s * fastest_per_s_ * std::max(1.0, winding_path_);
  const int parts = std::max(1, static_cast<int>(std::ceil(stiff / 1.5)));  // explicit Runge-Kutta is stable up to 2.78
  const double part_s = h_s / parts;
  for (int part = 0; part < parts; ++part) {
    const auto along = [&](const Flow& slope, double by_s) {
      Vector T = T_degC_;
      for (int i = 0; i < place_count; ++i) T[i] += by_s * slope.rate_K_per_s[i];
      return T;
    };
    const Flow k1 = flow(T_degC_, heat_W);
    const Flow k2 = flow(along(k1, 0.5 * part_s), heat_W);
    const Flow k3 = flow(along(k2, 0.5 * part_s), heat_W);
    const Flow k4 = flow(along(k3, part_s), heat_W);
    for (int i = 0; i < place_count; ++i) {
      T_degC_[i] +=
          part_s / 6 * (k1.rate_K_per_s[i] + 2 * k2.rate_K_per_s[i] + 2 * k3.rate_K_per_s[i] + k4.rate_K_per_s[i]);
    }
    outflow_J_ += part_s / 6 * (k1.out_W + 2 * k2.out_W + 2 * k3.out_W + k4.out_W);
  }
  if (hidden_.sensor_lag_s > 0)
    sensed_degC_ += (at_sensor_degC() - sensed_degC_) * (1 - std::exp(-h_s / hidden_.sensor_lag_s));
  time_s_ += h_s;
}

}  // namespace host_sim

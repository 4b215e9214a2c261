// SPDX-License-Identifier: MIT
#include "host-sim/plant/thermal_bench.hpp"

#include <algorithm>
#include <cmath>

namespace host_sim {
namespace {

constexpr double turn_rad = 6.283185307179586;
/// Kelvin below the winding's limit over which the protection takes the current away.
constexpr double protection_K = 10;

}  // namespace

ThermalBench::ThermalBench(const ThermalDesign& design, std::uint64_t seed)
    : design_(design),
      random_(seed),
      stove_(heat_from_sheet(design.sheet, design.options), design.hidden, seed ^ 0x9e3779b9) {
  stove_.soak(design.start_housing_degC);
  for (const Place place : {Place::phase_a, Place::phase_b, Place::phase_c, Place::hot_spot}) {
    stove_.set(place, design.start_winding_degC);
  }
  stove_.around.ambient_degC = stove_.around.coolant_degC = design.ambient_degC;
  angle_rad_ = random_.uniform(0, turn_rad);
  wander_K_ = design.noise.housing_wander_K * random_.gauss();
}

Demand ThermalBench::advance(double h_s, Demand demand) {
  const double left_K = design_.sheet.winding_max_degC - stove_.hottest_degC();
  demand.current_A *= std::clamp(left_K / protection_K, 0.0, 1.0);

  // What is logged now heats later if the clocks differ.
  Demand acting = demand;
  if (design_.hidden.clock_delay_s > 0) {
    if (delayed_.empty()) {
      delayed_.assign(static_cast<std::size_t>(std::lround(std::max(1.0, design_.hidden.clock_delay_s / h_s))),
                      Demand{});
      for (Demand& d : delayed_) d.enabled = false;
    }
    std::swap(acting, delayed_[delayed_at_]);
    delayed_at_ = (delayed_at_ + 1) % delayed_.size();
  }

  HeatDrive drive;
  drive.speed_rad_per_s = std::fabs(acting.speed_rad_per_s);
  drive.current_A = std::fabs(acting.current_A);
  drive.current2_A2 = acting.current_A * acting.current_A;
  drive.enabled = acting.enabled;
  // Where the current stands in the stator. A rotor that turns by more than half a radian a step spreads it evenly.
  const double advance_rad = design_.sheet.pole_pairs * acting.speed_rad_per_s * h_s;
  angle_rad_ = std::remainder(angle_rad_ + advance_rad, turn_rad);
  for (int k = 0; k < 3; ++k) {
    const double along = std::sin(angle_rad_ - k * turn_rad / 3);  // torque current stands across the magnet
    const double share = std::fabs(advance_rad) > 0.5 ? 0.5 : along * along;
    drive.copper_W[k] = stove_.phase_ohm(k, drive.speed_rad_per_s) * drive.current2_A2 * share;
  }
  stove_.around.neighbour_degC = demand.neighbour_degC;
  stove_.around.frame_degC = demand.frame_degC;
  stove_.advance(h_s, drive);

  sum_s_ += h_s;
  current2_A2s_ += h_s * demand.current_A * demand.current_A;
  current_As_ += h_s * demand.current_A;
  speed2_ += h_s * demand.speed_rad_per_s * demand.speed_rad_per_s;
  speed_ += h_s * demand.speed_rad_per_s;
  enabled_s_ += demand.enabled ? h_s : 0;
  last_ = demand;
  return demand;
}

ThermalSample ThermalBench::sample() {
  const LogNoise& noise = design_.noise;
  const HiddenEffects& hidden = design_.hidden;
  const double now_s = stove_.time_s(), h_s = now_s - last_sample_s_;
  last_sample_s_ = now_s;
  ThermalSample s{};
  s.time_s = now_s;
  if (sum_s_ > 0) {
    s.true_current_A = std::copysign(std::sqrt(current2_A2s_ / sum_s_), current_As_);
    s.speed_rad_per_s = std::copysign(std::sqrt(speed2_ / sum_s_), speed_);
    s.enabled = enabled_s_ / sum_s_;
  }
  s.current_A =
      (s.true_current_A - hidden.current_offset_A) / hidden.current_gain * (1 + noise.current_share * random_.gauss());
  sum_s_ = current2_A2s_ = current_As_ = speed2_ = speed_ = enabled_s_ = 0;

  const double keep = std::exp(-h_s / noise.housing_wander_s);
  wander_K_ = keep * wander_K_ + std::sqrt(1 - keep * keep) * noise.housing_wander_K * random_.gauss();
  s.housing_degC = stove_.sensed_degC() + wander_K_ + noise.housing_white_K * random_.gauss();
  if (noise.housing_step_K > 0)
    s.housing_degC = std::round(s.housing_degC / noise.housing_step_K) * noise.housing_step_K;
  s.ambient_degC = design_.ambient_degC;
  s.neighbour_degC = last_.neighbour_degC;
  s.frame_degC = last_.frame_degC;
  if (noise.winding_every_s > 0 && now_s >= winding_due_s_) {
    s.winding_degC = stove_.winding_degC() + noise.winding_K * random_.gauss();
    winding_due_s_ = now_s + noise.winding_every_s - 1e-9;
  }
  s.true_winding_degC = stove_.winding_degC();
  s.true_hottest_degC = stove_.hottest_degC();
  s.true_housing_degC = stove_.degC(Place::housing);
  return s;
}

std::vector<ThermalSample> record(const ThermalDesign& design, const std::vector<Demand>& demands, double rate_Hz,
                                  double log_Hz, std::uint64_t seed) {
  ThermalBench bench(design, seed);
  const auto every = static_cast<std::size_t>(std::lround(std::max(1.0, rate_Hz / log_Hz)));
  std::vector<ThermalSample> log;
  log.reserve(demands.size() / every);
  for (std::size_t i = 0; i < demands.size(); ++i) {
    bench.advance(1 / rate_Hz, demands[i]);
    if ((i + 1) % every == 0) log.push_back(bench.sample());
  }
  return log;
}

}  // namespace host_sim

// SPDX-License-Identifier: MIT
#include "boards/host/virtual/plant.hpp"

#include <array>
#include <cmath>
#include <numbers>

#include "boards/host/board.hpp"
#include "host-sim/plant/bench.hpp"

namespace boards::host {

namespace {

constexpr double supply_V = 48, start_degC = 25;
constexpr double load_inertias = 10;  // a light joint; ours

class FullPlant final : public Plant {
 public:
  FullPlant(const host_sim::BenchDesign& design, const wire::Motor& motor, std::uint64_t seed)
      : design_(design), bench_(design_, seed), doors_{{bench_, design_.sensors, 0}, {bench_, design_.sensors, 1}} {
    for (int i = 0; i < firmware::axis_count; ++i)
      bench_.load(i).inertia_kg_m2 = load_inertias * motor.rotor_inertia_kg_m2;
  }
  hal::AxisSample sample(int axis) override { return doors_[axis].sample(); }
  void advance(const hal::Duty (&next)[firmware::axis_count]) override {
    const std::array<hal::Duty, 2> loaded{doors_[0].next(), doors_[1].next()};
    for (int i = 0; i < firmware::axis_count; ++i) doors_[i].drive(next[i]);
    bench_.advance_period(loaded);
  }
  hal::AxisSlowSample slow(int axis) override { return slow_sample(bench_.raw(axis), design_.sensors); }
  hal::BoardSlowSample slow() override { return slow_sample(bench_.board_raw(), design_.sensors); }

 private:
  host_sim::BenchDesign design_;
  host_sim::Bench bench_;
  AxisDoor doors_[firmware::axis_count];
};

class SimplePlant final : public Plant {
 public:
  SimplePlant(const wire::Motor& motor, const firmware::BoardRating& rating)
      : motor_(motor),
        period_s_(1 / static_cast<double>(rating.pwm_Hz)),
        lost_ratio_(static_cast<double>(rating.dead_time_s * rating.pwm_Hz)),
        // Exact over a period for R and L alone; the coupling of the axes is taken as it stands.
        decay_(std::exp(-motor.phase_resistance_ohm / motor.inductance_q_H * period_s_)) {}

  hal::AxisSample sample(int axis) override {
    const One& m = axes_[axis];
    double turned = std::fmod(m.angle_rad, 2 * std::numbers::pi);
    if (turned < 0) turned += 2 * std::numbers::pi;
    return {phases(m), static_cast<float>(supply_V), static_cast<float>(turned), sequence_, true};
  }

  void advance(const hal::Duty (&next)[firmware::axis_count]) override {
    ++sequence_;
    for (int i = 0; i < firmware::axis_count; ++i) {
      step(axes_[i]);
      axes_[i].loaded = next[i];
    }
  }

  hal::AxisSlowSample slow(int axis) override { return {{static_cast<float>(axes_[axis].housing_degC), true}}; }
  hal::BoardSlowSample slow() override { return {{40.0f, true}, 0.0f, true}; }

 private:
  struct One {
    hal::Duty loaded{{0.5f, 0.5f, 0.5f}, false};
    double id_A = 0, iq_A = 0, angle_rad = 0, rad_per_s = 0;
    double winding_degC = start_degC, housing_degC = start_degC;
  };

  wire::Abc phases(const One& m) const {
    const double e = m.angle_rad * motor_.pole_pairs, c = std::cos(e), s = std::sin(e);
    const double alpha = m.id_A * c - m.iq_A * s, beta = m.id_A * s + m.iq_A * c;
    constexpr double half_root_3 = std::numbers::sqrt3 / 2;
    return {static_cast<float>(alpha), static_cast<float>(-0.5 * alpha + half_root_3 * beta),
            static_cast<float>(-0.5 * alpha - half_root_3 * beta)};
  }

  void step(One& m) const {
    const double w = m.rad_per_s * motor_.pole_pairs;
    if (m.loaded.on) {
      const wire::Abc i = phases(m);
      const auto volts = [&](float ratio, float current_A) {
        return supply_V * (static_cast<double>(ratio) - (current_A > 0   ? lost_ratio_
                                                         : current_A < 0 ? -lost_ratio_
                                                                         : 0));
      };
      const double a = volts(m.loaded.ratio.a, i.a), b = volts(m.loaded.ratio.b, i.b), c = volts(m.loaded.ratio.c, i.c);
      const double alpha = (2 * a - b - c) / 3, beta = (b - c) / std::numbers::sqrt3;
      const double e = m.angle_rad * motor_.pole_pairs + 0.5 * w * period_s_;  // middle of the period
      const double vd = alpha * std::cos(e) + beta * std::sin(e), vq = beta * std::cos(e) - alpha * std::sin(e);
      const double per_ohm = (1 - decay_) / motor_.phase_resistance_ohm;
      const double id = m.id_A * decay_ + per_ohm * (vd + w * motor_.inductance_q_H * m.iq_A);
      m.iq_A = m.iq_A * decay_ + per_ohm * (vq - w * (motor_.inductance_d_H * m.id_A + motor_.flux_linkage_Wb));
      m.id_A = id;
    } else {
      m.id_A = m.iq_A = 0;
    }
    const double torque_Nm = 1.5 * motor_.pole_pairs * motor_.flux_linkage_Wb * m.iq_A;
    m.rad_per_s += torque_Nm / ((1 + load_inertias) * motor_.rotor_inertia_kg_m2) * period_s_;
    m.rad_per_s -= 2.0 * m.rad_per_s * period_s_;  // friction: coasts down in half a second, ours
    m.angle_rad += m.rad_per_s * period_s_;
    const double heat_W = 1.5 * motor_.phase_resistance_ohm * (m.id_A * m.id_A + m.iq_A * m.iq_A) *
                          (1 + motor_.copper_coefficient_per_K * (m.winding_degC - 25));
    const double inward_W = (m.winding_degC - m.housing_degC) / motor_.R1_K_per_W;
    m.winding_degC += (heat_W - inward_W) / motor_.C1_J_per_K * period_s_;
    m.housing_degC += (inward_W - (m.housing_degC - start_degC) / motor_.R2_K_per_W) / motor_.C2_J_per_K * period_s_;
  }

  wire::Motor motor_;
  double period_s_, lost_ratio_, decay_;
  One axes_[firmware::axis_count];
  std::uint32_t sequence_ = 0;
};

}  // namespace

std::unique_ptr<Plant> full_plant(const wire::Motor& motor, const firmware::BoardRating& rating, std::uint64_t seed) {
  host_sim::BenchDesign design;
  for (host_sim::AxisDesign& axis : design.axes) axis = host_sim::axis_from_sheet(motor);
  design.bridge.pwm_Hz = static_cast<double>(rating.pwm_Hz);
  design.bridge.dead_time_s = static_cast<double>(rating.dead_time_s);
  design.supply.open_V = supply_V;
  return std::make_unique<FullPlant>(design, motor, seed);
}

std::unique_ptr<Plant> simple_plant(const wire::Motor& motor, const firmware::BoardRating& rating) {
  return std::make_unique<SimplePlant>(motor, rating);
}

}  // namespace boards::host

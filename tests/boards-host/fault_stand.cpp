// SPDX-License-Identifier: MIT
#include "tests/boards-host/fault_stand.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "boards/dual_48v_20a.hpp"
#include "thermal/motor_set.hpp"
#include "wire/pc/motor_file.hpp"

namespace faults {
namespace {

using boards::host::Demand;
using boards::host::demand_A;
using boards::host::Shaft;

constexpr long setpoint_periods = 20;  // the robot's computer speaks every millisecond
constexpr long watch_periods = 20, slow_periods = 200;
constexpr double after_trip_s = 0.1;  // an open bridge only cools
constexpr double stage_max_degC = 100;
constexpr double no_current_A = 0.01;

host_sim::BenchDesign plant(const Design& design) {
  host_sim::BenchDesign plant = boards::host::bench_of(design.scene, design.truth);
  for (host_sim::AxisDesign& axis : plant.axes) axis.hidden = design.hidden;
  plant.sensors = design.sensors;
  return plant;
}

firmware::DriverSetup setup(const Design& design) {
  firmware::AxisSetup axis;
  const float supply_V = static_cast<float>(design.scene.supply_V);
  axis.parameters = firmware::parameters_from(design.known, boards::dual_48V_20A, {supply_V, 0.0f});
  axis.heat = thermal::three_phase_set(design.known);
  axis.estimator = design.estimator;
  axis.senses_housing = design.senses_housing;
  return {boards::dual_48V_20A, {axis, axis}};
}

}  // namespace

const char* name_of(Scenes scene) { return scene == push ? "push" : scene == stall ? "stall" : "walk"; }

Design design_of(const std::string& motor, Scenes scene, double seconds, host_sim::Random& random) {
  Design d;
  d.truth = wire::pc::read_motor(motor, HOTCORE_SOURCE_DIR "/boards/motors").motor;
  boards::host::Scene& s = d.scene;
  s.seconds = seconds;
  s.start_degC = scene == walk || motor != motors[0] ? 125 : 25;
  s.demands = {{.from_s = 0.1, .to_s = 1e6, .current_A = peak_A}};
  s.shaft.kind = scene == stall ? Shaft::Kind::locked : Shaft::Kind::imposed;
  s.shaft.angle_rad = random.uniform(0, 2 * std::numbers::pi);
  if (scene == push) s.shaft.speed_rad_per_s = random.uniform(200, 800);
  if (scene == walk) {
    s.shaft.speed_amplitude_rad_per_s = 600;
    s.shaft.frequency_Hz = 1.4;
    Demand gait{.from_s = 0.1, .to_s = 1e6, .current_A = 5, .ripple_ratio = 0.8, .frequency_Hz = 1.4};
    s.demands = {gait, gait};
    s.demands[1].axis = 1, s.demands[1].current_A = 3;
  }
  d.fault_s = random.uniform(0.3, 1.3);
  return d;
}

double largest_demand_Nm(const Design& design, int axis) {
  double most_A = 0;
  for (const boards::host::Demand& d : design.scene.demands) {
    if (d.axis == axis) most_A = std::max(most_A, std::abs(d.current_A) * (1 + d.ripple_ratio));
  }
  return 1.5 * design.truth.pole_pairs * design.truth.flux_linkage_Wb * most_A;
}

void tell_the_truth(Design& d) {
  d.known = host_sim::true_sheet(d.truth, host_sim::heat_from_sheet(d.truth));
  d.estimator.trust = thermal::exact_trust;
}

Stand::Stand(const Design& design, std::uint64_t seed)
    : bench(plant(design), seed),
      random(seed ^ 0x5EED),
      design_(design),
      doors_{boards::host::AxisDoor(bench, design_.sensors, 0), boards::host::AxisDoor(bench, design_.sensors, 1)} {
  driver.emplace(setup(design_));
  for (int axis = 0; axis < firmware::axis_count; ++axis) {
    bench.load(axis) = boards::host::load_of(design_.scene.shaft);
    bench.motor(axis).place(design_.scene.shaft.angle_rad / design_.truth.pole_pairs, 0);
  }
}

void Stand::breaks(host_sim::Channel channel, host_sim::FaultKind kind, double value, host_sim::Channel other,
                   int other_axis) {
  bench.faults().add({.channel = channel,
                      .kind = kind,
                      .value = value,
                      .from_s = bench.time_s(),
                      .other = other,
                      .other_axis = other_axis});
}

void Stand::restart() {
  const firmware::DriverMemory memory = driver->memory();
  driver.emplace(setup(design_));
  driver->restore(memory);
  for (int axis = 0; axis < firmware::axis_count; ++axis) {
    doors_[axis].release();
    armed_[axis] = false;
  }
}

double Stand::time_s() const { return static_cast<double>(periods_) * bench.period_s() - boards::host::warm_up_s; }

double Stand::worst_current_error_A() const {
  const auto true_A = truth().current_A;
  const float read_A[3] = {sample().current_A.a, sample().current_A.b, sample().current_A.c};
  double worst_A = 0;
  for (std::size_t k = 0; k < 3; ++k) worst_A = std::max(worst_A, std::abs(static_cast<double>(read_A[k]) - true_A[k]));
  return worst_A;
}

double Stand::angle_error_rad() const {
  const double off_rad = static_cast<double>(sample().rotor_rad) - truth().angle_rad;
  return std::abs(std::remainder(off_rad * design_.truth.pole_pairs, 2 * std::numbers::pi));
}

double Stand::phase_missed_A() const {
  const host_sim::AxisTruth now = truth();
  const wire::Dq wish = axis().fast().permitted_A;
  double worst_A = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double at = now.angle_rad * design_.truth.pole_pairs - static_cast<double>(k) * 2 * std::numbers::pi / 3;
    const double wish_A = static_cast<double>(wish.d) * std::cos(at) - static_cast<double>(wish.q) * std::sin(at);
    if (std::abs(now.current_A[k]) < no_current_A) worst_A = std::max(worst_A, std::abs(wish_A));
  }
  return worst_A;
}

void Stand::speak(int axis) {
  firmware::Axis& spoken_to = driver->axis(axis);
  if (time_s() < 0) return;
  if (!armed_[axis] && arms) {
    armed_[axis] = spoken_to.arm() == wire::Status::done;
    return;
  }
  const double wish_A = demand_A(design_.scene, axis, time_s());
  const double turned_A = turned && axis == 0 ? turned(wish_A) : wish_A;
  const wire::Status said = spoken_to.set_current({0.0f, static_cast<float>(turned_A)});
  if (axis == 0) said_ = said;
}

void Stand::period() {
  std::array<hal::Duty, 2> duty;
  for (std::size_t i = 0; i < duty.size(); ++i) {
    const int axis = static_cast<int>(i);
    duty[i] = doors_[i].next();
    if (design_.scene.shaft.kind == boards::host::Shaft::Kind::imposed)
      bench.load(axis).speed_rad_per_s = boards::host::imposed_speed_rad_per_s(design_.scene, time_s());
    if (skipped_ticks > 0 && random.uniform() < skipped_ticks) continue;
    samples_[i] = doors_[i].sample();
    samples_[i].sequence += design_.first_period;
    doors_[i].drive(driver->axis(axis).tick(samples_[i]));
    if (ticks_twice) doors_[i].drive(driver->axis(axis).tick(samples_[i]));
  }
  bench.advance_period(duty);
  ++periods_;
  next_ = doors_[0].sample();
  if (!slow_lane_alive) return;
  if (periods_ % watch_periods == 0) driver->watch();
  if (periods_ % watch_periods == 0) driver->look_ahead();
  if (periods_ % slow_periods == 0) {
    using boards::host::slow_sample;
    driver->slow_tick(slow_sample(bench.board_raw(), design_.sensors),
                      {slow_sample(bench.raw(0), design_.sensors), slow_sample(bench.raw(1), design_.sensors)});
  }
}

void Stand::step() {
  if (host_alive && periods_ % setpoint_periods == 0) {
    for (int axis = 0; axis < boards::host::axes_of(design_.scene); ++axis) speak(axis);
  }
  period();
}

Stand::Outcome Stand::play(const std::function<void(Stand&)>& fault, const Watch& evident, const Watch& reacted) {
  Outcome out;
  const double whole_Nm = largest_demand_Nm(design_, 0);
  double end_s = design_.scene.seconds;
  bool broken = false;
  while (time_s() < end_s) {
    if (!broken && time_s() >= design_.fault_s) {
      broken = true;
      if (fault) fault(*this);
    }
    if (broken && each) each();
    step();
    if (!broken) continue;

    const host_sim::AxisTruth now = truth();
    out.overshoot_K = std::max(out.overshoot_K, now.hottest_degC - design_.truth.winding_max_degC);
    for (const double i_A : now.current_A) out.peak_A = std::max(out.peak_A, std::abs(i_A));
    const double wish_A = turned ? 0 : demand_A(design_.scene, 0, time_s());
    if (wish_A != 0) out.wrong_way = std::max(out.wrong_way, (wish_A > 0 ? -1 : 1) * now.torque_Nm / whole_Nm);
    out.stage_over_K = std::max(out.stage_over_K, bench.power_stage_degC() - stage_max_degC);
    out.bus_V = std::max(out.bus_V, bench.bus_V());

    const bool tripped = axis().mode() == firmware::Mode::tripped;
    if (tripped && out.fault == wire::Fault::none) {
      const firmware::FaultRecord record = axis().fault();
      out.fault = record.fault;
      out.value = record.value;
      out.threshold = record.threshold;
      end_s = std::min(end_s, time_s() + after_trip_s);
    }
    if (out.evident_s < 0 && (tripped || !evident || evident(*this))) out.evident_s = since_fault_s();
    if (out.reacted_s < 0 && out.evident_s >= 0 && (tripped || (reacted && reacted(*this)))) {
      out.reacted_s = since_fault_s() - out.evident_s;
      out.limit = axis().fast().limit;
    }
  }
  if (out.reacted_s < 0) out.limit = axis().fast().limit;
  return out;
}

}  // namespace faults

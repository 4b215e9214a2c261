// SPDX-License-Identifier: MIT
#include "host-sim/plant/bench.hpp"

#include <cmath>

namespace host_sim {
namespace {

/// Heat moves at 1 kHz: the fastest node of a small motor needs 20 ms.
constexpr int periods_per_warming = 20;

BenchDesign completed(BenchDesign design) {
  if (design.power_stage.R_K_per_W == 0) {
    design.power_stage = power_stage_from_rating(design.bridge, design.supply.open_V);
  }
  return design;
}

}  // namespace

PowerStageDesign power_stage_from_rating(const BridgeDesign& bridge, double bus_V, double continuous_A, double rise_K,
                                         double tau_s) {
  // One axis with a sinusoidal current: 3/2 R i^2, and 2/pi i as mean of each phase's magnitude.
  const double mean_A = 2 / pi * continuous_A;
  const double loss_W =
      1.5 * bridge.on_resistance_ohm * continuous_A * continuous_A +
      3 * mean_A * bridge.pwm_Hz * (bus_V * bridge.overlap_s + 2 * bridge.diode_V * bridge.dead_time_s);
  return {rise_K / (2 * loss_W), tau_s};
}

AxisDesign axis_from_sheet(const wire::Motor& sheet, const HeatOptions& options) {
  return {motor_from_sheet(sheet), heat_from_sheet(sheet, options), {}};
}

Bench::Axis::Axis(const BenchDesign& design, int index, std::uint64_t seed)
    : motor(design.axes[index].motor, 1 / design.bridge.pwm_Hz),
      bridge(design.bridge),
      stove(design.axes[index].heat, design.axes[index].hidden, seed),
      hidden(design.axes[index].hidden),
      standing_ohm{} {
  motor.place(design.start_angle_rad[index], 0);
  stove.soak(design.start_degC);
  stove.around = {.ambient_degC = design.ambient_degC,
                  .coolant_degC = design.ambient_degC,
                  .neighbour_degC = design.ambient_degC,
                  .frame_degC = design.ambient_degC};
}

Bench::Bench(const BenchDesign& design, std::uint64_t seed)
    : board_ambient_degC(design.board_ambient_degC),
      design_(completed(design)),
      period_s_(1 / design.bridge.pwm_Hz),
      random_(seed),
      axes_{Axis(design, 0, seed + 1), Axis(design, 1, seed + 2)},
      supply_(design.supply),
      power_stage_degC_(design.board_ambient_degC),
      bus_filter_share_(1 - std::exp(-period_s_ / design.sensors.bus_filter_s)) {
  for (int i = 0; i < axes; ++i) {
    Axis& axis = axes_[i];
    renew_resistance(axis);
    if (axis.hidden.clock_delay_s > 0) {
      faults_.add(
          {.axis = i, .channel = Channel::housing, .kind = FaultKind::delayed, .value = axis.hidden.clock_delay_s});
    }
  }
  sense();
  sense_slowly(0);
}

void Bench::soak(double degC) {
  for (Axis& axis : axes_) {
    axis.stove.soak(degC);
    renew_resistance(axis);
  }
}

void Bench::renew_resistance(Axis& axis) {
  const double speed_rad_per_s = std::fabs(axis.motor.speed_rad_per_s());
  std::array<double, 3> turning_ohm;
  for (int k = 0; k < 3; ++k) {
    axis.standing_ohm[k] = axis.stove.phase_ohm(k, 0);
    turning_ohm[k] = axis.stove.phase_ohm(k, speed_rad_per_s);
  }
  axis.motor.set_resistance(turning_ohm, design_.bridge.on_resistance_ohm);
  axis.motor.set_magnet_degC(axis.stove.magnet_degC());
}

void Bench::advance_period(const std::array<hal::Duty, 2>& duty) {
  for (std::size_t i = 0; i < axes; ++i) move(axes_[i], duty[i]);
  share();
}

void Bench::advance_axis(int axis, const hal::Duty& duty) {
  move(axes_[static_cast<std::size_t>(axis)], duty);
  if (axis == 0)
    share();
  else
    sense();
}

void Bench::move(Axis& axis, const hal::Duty& duty) {
  axis.bridge.advance(axis.motor, duty, supply_.bus_V(), axis.standing_ohm);
  axis.current2_sum_A2 += axis.motor.current_squared_A2();
  axis.enabled_periods += duty.on;
}

/// What both axes have in common goes on by one period.
void Bench::share() {
  const double bus_V = supply_.bus_V();
  double load_J = 0;
  for (Axis& axis : axes_) {
    load_J += axis.bridge.work().bus_J - axis.bus_charged_J;
    axis.bus_charged_J = axis.bridge.work().bus_J;
  }
  supply_.advance(period_s_, load_J);
  bus_A_ += bus_filter_share_ * (load_J / (period_s_ * std::fmax(bus_V, 1.0)) - bus_A_);
  ++periods_;
  if (periods_ % periods_per_warming == 0) warm();
  sense();
  if (periods_ % periods_per_warming == 0) sense_slowly(time_s());
}

/// Hands the joules of the last millisecond to the stoves and takes new resistances from them.
void Bench::warm() {
  const double h_s = period_s_ * periods_per_warming;
  double stage_J = 0;
  for (std::size_t i = 0; i < axes; ++i) {
    Axis& axis = axes_[i];
    const MotorWork& now = axis.motor.work();
    const BridgeWork& bridge = axis.bridge.work();
    HeatDrive drive;
    double ripple_A2s = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      ripple_A2s += bridge.ripple_A2s[k] - axis.charged_bridge.ripple_A2s[k];
      drive.copper_W[k] =
          (now.copper_J[k] - axis.charged_motor.copper_J[k] + bridge.ripple_J[k] - axis.charged_bridge.ripple_J[k]) /
          h_s;
      stage_J += now.series_J[k] - axis.charged_motor.series_J[k];
    }
    stage_J +=
        bridge.heat_J - axis.charged_bridge.heat_J + bridge.ripple_series_J - axis.charged_bridge.ripple_series_J;
    drive.iron_W = (now.iron_J - axis.charged_motor.iron_J) / h_s;
    drive.friction_W = (now.friction_J - axis.charged_motor.friction_J) / h_s;
    const double sampled_A2 = axis.current2_sum_A2 / periods_per_warming;
    drive.current_A = std::sqrt(sampled_A2);
    drive.current2_A2 = sampled_A2 + ripple_A2s / 1.5 / h_s;  // a vector's square is 2/3 of its phases'
    drive.speed_rad_per_s = std::fabs(axis.motor.speed_rad_per_s());
    drive.enabled = axis.enabled_periods > 0;
    axis.stove.around.neighbour_degC = axes_[1 - i].stove.degC(Place::housing);
    axis.stove.advance(h_s, drive);
    axis.charged_motor = now;
    axis.charged_bridge = bridge;
    axis.current2_sum_A2 = 0;
    axis.enabled_periods = 0;
    renew_resistance(axis);
  }
  const PowerStageDesign& stage = design_.power_stage;
  const double final_degC = board_ambient_degC + stage.R_K_per_W * stage_J / h_s;
  power_stage_degC_ += (final_degC - power_stage_degC_) * (1 - std::exp(-h_s / stage.tau_s));
}

std::uint16_t Bench::converted(int axis, Channel channel, double counts, double time_s) {
  const int full_scale = design_.sensors.adc_full_scale;
  const std::uint16_t clean = to_counts(counts, full_scale);
  if (faults_.empty()) return clean;
  return to_counts(faults_.replace(axis, channel, clean, full_scale, time_s, random_), full_scale);
}

void Bench::sense() {
  const SensorDesign& s = design_.sensors;
  const double now_s = time_s();
  const std::array<AxisRaw, 2> last = raw_;
  sense_axis(0, now_s);
  sense_axis(1, now_s);
  if (!faults_.empty()) {
    const std::array<AxisRaw, 2> clean = raw_;
    const auto phase = [](Channel channel) { return static_cast<std::size_t>(channel); };
    for (int i = 0; i < axes; ++i) {
      AxisRaw& mine = raw_[i];
      for (const Channel channel : {Channel::current_a, Channel::current_b, Channel::current_c}) {
        if (const SensorFault* f = faults_.swap(i, channel, now_s); f != nullptr && f->other <= Channel::current_c) {
          mine.current_counts[phase(channel)] = clean[f->other_axis].current_counts[phase(f->other)];
        }
      }
      if (const SensorFault* f = faults_.swap(i, Channel::encoder, now_s)) {
        mine.encoder_counts = clean[f->other_axis].encoder_counts;
      }
      // A conversion that did not happen leaves everything of this axis as it was.
      if (faults_.replace(i, Channel::conversion, 1, 1, now_s, random_) < 0.5) {
        const std::uint16_t housing = mine.housing_counts;
        mine = last[i];
        mine.housing_counts = housing;
      }
    }
  }
  const double bus_V = bent(0, Channel::bus_voltage, supply_.bus_V(), now_s) + s.bus_noise_V * random_.gauss_quick();
  const double bus_A = bent(0, Channel::bus_current, bus_A_, now_s) + s.bus_noise_A * random_.gauss_quick();
  board_raw_.bus_voltage_counts = converted(0, Channel::bus_voltage, bus_V / s.bus_V_per_count, now_s);
  board_raw_.bus_current_counts =
      converted(0, Channel::bus_current, s.bus_zero_counts + bus_A / s.bus_A_per_count, now_s);
}

void Bench::sense_axis(int index, double now_s) {
  const SensorDesign& s = design_.sensors;
  Axis& axis = axes_[index];
  AxisRaw& raw = raw_[index];
  std::array<double, 3> current_A = axis.bridge.sampled_A(axis.motor);
  if (axis.bridge.short_from >= 0) {
    current_A[axis.bridge.short_from] += axis.bridge.short_A();
    current_A[axis.bridge.short_to] -= axis.bridge.short_A();
  }
  const double hidden_A[3] = {axis.hidden.current_offset_A, -0.5 * axis.hidden.current_offset_A,
                              -0.5 * axis.hidden.current_offset_A};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto channel = static_cast<Channel>(k);
    double seen_A = (current_A[k] - hidden_A[k]) / axis.hidden.current_gain;
    seen_A = seen_A * s.current_gain[k] + s.current_offset_A[k] + s.current_noise_A * random_.gauss_quick();
    seen_A = bent(index, channel, seen_A, now_s);
    raw.current_counts[k] = converted(index, channel, s.current_zero_counts + seen_A / s.current_A_per_count, now_s);
  }

  const double per_turn = s.encoder_counts_per_turn;
  const long turns = axis.motor.turns();
  const double angle_rad = axis.motor.angle_rad();
  long counts = turns * s.encoder_counts_per_turn + static_cast<long>(angle_rad * (per_turn / (2 * pi)));
  if (periods_ == 0) {
    axis.encoder_start = design_.encoder_knows_zero ? 0 : counts;
    axis.last_turns = turns;
  }
  counts -= axis.encoder_start;
  if (!faults_.empty()) {
    double seen = bent(index, Channel::encoder, static_cast<double>(counts), now_s);
    seen = faults_.replace(index, Channel::encoder, seen, 65536, now_s, random_);
    counts = static_cast<long>(std::floor(seen));
  }
  raw.encoder_counts = static_cast<std::uint16_t>(counts & 0xffff);
  if (turns != axis.last_turns) {
    const bool alive = faults_.empty() || faults_.replace(index, Channel::index, 1, 1, now_s, random_) >= 0.5;
    if (alive) {
      const long zero =
          (turns > axis.last_turns ? turns : axis.last_turns) * s.encoder_counts_per_turn - axis.encoder_start;
      raw.index_latch = static_cast<std::uint16_t>(zero & 0xffff);
      ++raw.index_pulses;
    }
    axis.last_turns = turns;
  }
  // Hall switches: high for half an electrical turn from 0, 120, 240 degrees.
  double electrical = axis.motor.design().pole_pairs * angle_rad / (2 * pi);
  electrical -= std::floor(electrical);
  const auto high = [&](double from) {
    const double past = electrical - from;
    return (past < 0 ? past + 1 : past) < 0.5 ? 1u : 0u;
  };
  raw.hall = static_cast<std::uint8_t>(high(0) | high(1.0 / 3) << 1 | high(2.0 / 3) << 2);
  if (!faults_.empty()) {
    raw.hall = static_cast<std::uint8_t>(faults_.replace(index, Channel::hall, raw.hall, 7, now_s, random_));
  }
  ++raw.sequence;
}

void Bench::sense_slowly(double now_s) {
  const SensorDesign& s = design_.sensors;
  for (int i = 0; i < axes; ++i) {
    const double body_degC = axes_[i].stove.sensed_degC();
    const double seen_degC = bent(i, Channel::housing, body_degC, now_s) + s.ntc_noise_K * random_.gauss_quick();
    raw_[i].housing_counts = converted(i, Channel::housing, ntc_counts(s.housing, seen_degC, s.adc_full_scale), now_s);
  }
  const double stage_degC =
      bent(0, Channel::power_stage, power_stage_degC_, now_s) + s.ntc_noise_K * random_.gauss_quick();
  board_raw_.power_stage_counts =
      converted(0, Channel::power_stage, ntc_counts(s.power_stage, stage_degC, s.adc_full_scale), now_s);
}

AxisTruth Bench::truth(int index) const {
  const Axis& axis = axes_[index];
  AxisTruth truth{};
  truth.phase_degC = {axis.stove.degC(Place::phase_a), axis.stove.degC(Place::phase_b),
                      axis.stove.degC(Place::phase_c)};
  truth.hottest_degC = axis.stove.hottest_degC();
  truth.winding_degC = axis.stove.copper_degC();
  truth.teeth_degC = axis.stove.degC(Place::teeth);
  truth.housing_degC = axis.stove.degC(Place::housing);
  truth.frame_degC = axis.stove.degC(Place::frame);
  truth.magnet_degC = axis.stove.magnet_degC();
  truth.current_A = axis.bridge.sampled_A(axis.motor);
  axis.motor.current_dq_A(truth.current_d_A, truth.current_q_A);
  truth.angle_rad = axis.motor.angle_rad();
  truth.speed_rad_per_s = axis.motor.speed_rad_per_s();
  truth.torque_Nm = axis.motor.torque_Nm();
  truth.shaft_W = truth.torque_Nm * truth.speed_rad_per_s;
  truth.shaft_J = axis.motor.work().shaft_J;
  return truth;
}

EnergyLedger Bench::energy() const {
  EnergyLedger e{};
  e.supply_J = supply_.work().given_J;
  e.supply_loss_J = supply_.work().loss_J;
  e.capacitor_J = supply_.stored_J();
  for (const Axis& axis : axes_) {
    const MotorWork& motor = axis.motor.work();
    const BridgeWork& bridge = axis.bridge.work();
    e.bridge_J += bridge.heat_J + bridge.ripple_series_J;
    for (std::size_t k = 0; k < 3; ++k) {
      e.bridge_J += motor.series_J[k];
      e.copper_J += motor.copper_J[k] + bridge.ripple_J[k];
    }
    e.iron_J += motor.iron_J;
    e.friction_J += motor.friction_J;
    e.shaft_J += motor.shaft_J;
    e.short_J += bridge.short_J;
    e.field_J += axis.motor.field_J();
    e.kinetic_J += axis.motor.kinetic_J();
  }
  return e;
}

}  // namespace host_sim

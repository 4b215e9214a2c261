// SPDX-License-Identifier: MIT
// The whole plant of a dual-axis board: two motors, two bridges, one supply, sensors and stoves. The board above it
// reads raw counts and hands down duties; whoever judges it reads the truth. One call advances one PWM period (50 us).
//
//   bench.advance_period(duties);   // these duties act during this period; a board that loads at the next period
//   delays bench.raw(i), bench.board_raw() // what was converted at its end, in the middle of the zero vector
//
// Two benches share nothing; the same design, seed and duties give the same bits.
#pragma once

#include <array>
#include <cstdint>

#include "hal/axis_port.hpp"
#include "host-sim/plant/bridge.hpp"
#include "host-sim/plant/motor.hpp"
#include "host-sim/plant/sensors.hpp"
#include "host-sim/plant/stove.hpp"
#include "host-sim/plant/supply.hpp"

namespace host_sim {

/// The power stage's own heat, shared by both axes: one pole.
struct PowerStageDesign {
  double R_K_per_W;
  double tau_s;
};

/// A stage that warms by rise_K when both axes carry the continuous amplitude for ever. The board's published curve (6
/// A continuous, 20 A for 15 s) fits one pole of 159 s; 60 K over 40 degC ambient is our assumption.
PowerStageDesign power_stage_from_rating(const BridgeDesign& bridge, double bus_V, double continuous_A = 6,
                                         double rise_K = 60, double tau_s = 159);

struct AxisDesign {
  MotorDesign motor;
  HeatDetail heat;
  HiddenEffects hidden;
};

AxisDesign axis_from_sheet(const wire::Motor& sheet, const HeatOptions& options = {});

struct BenchDesign {
  std::array<AxisDesign, 2> axes;
  BridgeDesign bridge;
  SupplyDesign supply;
  SensorDesign sensors;
  PowerStageDesign power_stage{0, 159};  // R 0: taken from the rating
  double start_degC = 25;                // everything soaked
  double ambient_degC = 25;
  double board_ambient_degC = 40;
  std::array<double, 2> start_angle_rad{};  // mechanical
  bool encoder_knows_zero = true;           // false: the counter starts at 0 wherever the rotor stands
};

/// Converted readings of one axis.
struct AxisRaw {
  std::array<std::uint16_t, 3> current_counts;  // phase a, b, c, positive into the motor above the zero
  std::uint16_t encoder_counts;                 // free-running 16-bit counter
  std::uint16_t index_latch;                    // counter at the last index pulse (mechanical zero)
  std::uint32_t index_pulses;
  std::uint8_t hall;  // bits 0..2: electrical angle within half a turn after 0, 120, 240 deg
  std::uint16_t housing_counts;
  std::uint32_t sequence;  // rises when a new conversion arrived
};

struct BoardRaw {
  std::uint16_t bus_voltage_counts, bus_current_counts, power_stage_counts;
};

/// What really happens in one axis; for judges and pictures only.
struct AxisTruth {
  std::array<double, 3> phase_degC;
  double hottest_degC, winding_degC, teeth_degC, housing_degC, frame_degC, magnet_degC;
  std::array<double, 3> current_A;  // now, when it is sampled
  double current_d_A, current_q_A;  // mean
  double angle_rad, speed_rad_per_s, torque_Nm;
  double shaft_W;  // of the air gap, mean of the last period
  double shaft_J;  // given to the load so far
};

/// Joules since construction: supply = sums of all the rest, to rounding (the bench's tests hold it to 1e-6).
struct EnergyLedger {
  double supply_J, supply_loss_J, capacitor_J;  // capacitor: stored now
  double bridge_J, copper_J, iron_J, friction_J, shaft_J, short_J;
  double field_J, kinetic_J;  // stored now
};

class Bench {
 public:
  static constexpr int axes = 2;

  Bench(const BenchDesign& design, std::uint64_t seed);

  void advance_period(const std::array<hal::Duty, 2>& duty);
  /// One axis alone, for a board whose axes alternate and which calls this at the end of each axis' own period. Supply,
  /// heat and slow sensors go on with axis 0; axis 1 sees a bus voltage half a period old.
  void advance_axis(int axis, const hal::Duty& duty);

  const AxisRaw& raw(int axis) const { return raw_[axis]; }
  const BoardRaw& board_raw() const { return board_raw_; }
  AxisTruth truth(int axis) const;
  EnergyLedger energy() const;
  double bus_V() const { return supply_.bus_V(); }
  double supply_A() const { return supply_.supply_A(); }
  double power_stage_degC() const { return power_stage_degC_; }
  double time_s() const { return static_cast<double>(periods_) * period_s_; }
  double period_s() const { return period_s_; }

  // What a scene may change while it runs.
  Load& load(int axis) { return axes_[axis].motor.load; }
  Bridge& bridge(int axis) { return axes_[axis].bridge; }
  const Bridge& bridge(int axis) const { return axes_[axis].bridge; }
  Stove& stove(int axis) { return axes_[axis].stove; }
  Motor& motor(int axis) { return axes_[axis].motor; }
  SupplyDesign& supply() { return supply_.design(); }
  FaultTable& faults() { return faults_; }
  double board_ambient_degC;
  void soak(double degC);  // both motors; the power stage keeps its temperature
  void set_power_stage_degC(double degC) { power_stage_degC_ = degC; }

 private:
  struct Axis {
    Axis(const BenchDesign& design, int index, std::uint64_t seed);
    Motor motor;
    Bridge bridge;
    Stove stove;
    HiddenEffects hidden;
    std::array<double, 3> standing_ohm;  // of the ripple: what turning adds is a loss of the turning field
    MotorWork charged_motor;             // what the stove already got
    BridgeWork charged_bridge;
    double current2_sum_A2 = 0, bus_charged_J = 0;
    long enabled_periods = 0;
    long encoder_start = 0, last_turns = 0;
  };
  void move(Axis& axis, const hal::Duty& duty);
  void share();
  void warm();
  void renew_resistance(Axis& axis);
  void sense();
  void sense_axis(int index, double time_s);
  void sense_slowly(double time_s);
  double bent(int axis, Channel channel, double value, double time_s) {
    return faults_.empty() ? value : faults_.bend(axis, channel, value, time_s, random_);
  }
  std::uint16_t converted(int axis, Channel channel, double counts, double time_s);

  BenchDesign design_;
  double period_s_;
  Random random_;
  std::array<Axis, 2> axes_;
  Supply supply_;
  FaultTable faults_;
  std::array<AxisRaw, 2> raw_{};
  BoardRaw board_raw_{};
  double power_stage_degC_, bus_A_ = 0, bus_filter_share_;
  std::uint64_t periods_ = 0;
};

}  // namespace host_sim

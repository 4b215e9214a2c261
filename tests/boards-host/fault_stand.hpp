// SPDX-License-Identifier: MIT
// One board with two motors, and the firmware that would be flashed, in which something breaks at an instant: what the
// firmware did, how soon, and what the windings, the currents and the torque were meanwhile. Knows no table of faults.
#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <optional>

#include "boards/host/board.hpp"
#include "boards/host/scene.hpp"
#include "boards/host/stage.hpp"
#include "firmware/driver.hpp"
#include "host-sim/plant/bench.hpp"
#include "host-sim/plant/random.hpp"

namespace faults {

/// What is set up; a fault may change it before the start.
struct Design {
  boards::host::Scene scene;
  wire::Motor known, truth;  // as the firmware believes, as it is
  host_sim::HiddenEffects hidden;
  host_sim::SensorDesign sensors;
  thermal::EstimatorSettings estimator;
  bool senses_housing = true;
  double fault_s = 0;              // its instant, scene time
  std::uint32_t first_period = 0;  // the number of the first PWM period
};

enum Scenes : unsigned { push = 1, stall = 2, walk = 4, all = 7 };
const char* name_of(Scenes scene);  // of one
inline constexpr const char* motors[] = {"ec-16-40w", "ec-powermax-30-48v", "ec-powermax-30-24v"};
inline constexpr double peak_A = 20;  // the board's

/// What a scene asks of a motor; a large one is warm already, or the push would not last. The firmware is not told yet.
Design design_of(const std::string& motor, Scenes scene, double seconds, host_sim::Random& random);
/// What the largest demand on an axis makes.
double largest_demand_Nm(const Design& design, int axis);
/// The firmware knows the motor.
void tell_the_truth(Design& design);

class Stand {
 public:
  using Watch = std::function<bool(const Stand&)>;

  Stand(const Design& design, std::uint64_t seed);

  // What a fault may turn, of axis 0 unless said otherwise.
  host_sim::Bench bench;
  std::optional<firmware::Driver> driver;
  host_sim::Random random;
  std::function<void()> each;                     // before each period, from the fault on
  std::function<double(double demand_A)> turned;  // what becomes of the demand
  double skipped_ticks = 0;                       // share of control interrupts that do not happen, of both axes
  bool ticks_twice = false, slow_lane_alive = true, host_alive = true, arms = true;

  void breaks(host_sim::Channel channel, host_sim::FaultKind kind, double value = 0,
              host_sim::Channel other = host_sim::Channel::current_a, int other_axis = 0);
  void restart();  // reset of the chip: what was saved is restored; armed again as soon as it lets itself be

  // What it looks like.
  const firmware::Axis& axis() const { return driver->axis(0); }
  const Design& design() const { return design_; }
  const hal::AxisSample& sample() const { return next_; }  // that the next tick gets; the truth is of the same instant
  host_sim::AxisTruth truth() const { return bench.truth(0); }
  double time_s() const;
  double since_fault_s() const { return time_s() - design_.fault_s; }
  wire::Status said() const { return said_; }  // to the last setpoint
  double worst_current_error_A() const;        // of a phase's reading
  double angle_error_rad() const;              // of the encoder, electrical
  double phase_missed_A() const;               // the most that was permitted for a phase in which nothing flows
  double short_A() const { return std::abs(bench.bridge(0).short_A()); }  // between two leads

  struct Outcome {
    double evident_s = -1, reacted_s = -1;  // from the fault; from there on. Negative: never
    wire::Fault fault = wire::Fault::none;
    float value = 0, threshold = 0;         // its evidence
    wire::Limit limit = wire::Limit::none;  // at the reaction, or at the end
    double overshoot_K = -1e9, peak_A = 0;  // of the true winding over its limit; of a true phase current
    double wrong_way = 0;                   // torque against what is asked for, in what the largest demand makes
    double stage_over_K = -1e9, bus_V = 0;
  };
  /// One PWM period, and what the host says before it.
  void step();
  /// `evident`: the samples show it; `reacted`: besides a trip. Looked at each period from the fault on; all worst
  /// values are from there on.
  Outcome play(const std::function<void(Stand&)>& fault, const Watch& evident, const Watch& reacted);

 private:
  void period();
  void speak(int axis);

  Design design_;
  boards::host::AxisDoor doors_[2];
  std::array<hal::AxisSample, 2> samples_{};
  hal::AxisSample next_{};
  long periods_ = 0;
  bool armed_[2] = {false, false};
  wire::Status said_ = wire::Status::done;
};

}  // namespace faults

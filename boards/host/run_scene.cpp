// SPDX-License-Identifier: MIT
#include "boards/host/run_scene.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <numbers>

#include "boards/host/board.hpp"
#include "boards/host/optimum.hpp"
#include "firmware/driver.hpp"
#include "host-sim/plant/bench.hpp"
#include "thermal/motor_set.hpp"
#include "wire/pc/motor_file.hpp"

namespace boards::host {
namespace {

constexpr double root_3_over_2 = std::numbers::sqrt3 / 2;  // direct current that heats like a phase amplitude of 1 A
constexpr double comparison_limit_degC = 1000;             // for limiters that must do without the governor
constexpr double restart_K = 10;                           // a cut limiter comes back this far below its limit
constexpr int setpoint_periods = 20;                       // the robot's computer speaks every millisecond
constexpr double warm_up_s = 0.05;                         // offset learning before the scene's own time starts

/// What stands between the demand and the firmware.
class Wish {
 public:
  Wish(const Scene& scene, Limiter limiter, const wire::pc::MotorFile& file) : scene_(scene), limiter_(limiter), motor_(file.motor) {}

  double amperes(double demand_A, double estimated_core_degC, const hal::Temperature& housing) {
    switch (limiter_) {
      case Limiter::governor: return demand_A;
      case Limiter::rated: return std::clamp(demand_A, -motor_.rated_current_A / root_3_over_2, motor_.rated_current_A / root_3_over_2);
      case Limiter::housing: return cut(housing.value_degC, scene_.housing_limit_degC) ? 0 : demand_A;
      case Limiter::hard_cut: return cut(estimated_core_degC, motor_.winding_max_degC) ? 0 : demand_A;
    }
    return 0;
  }

 private:
  bool cut(double degC, double limit_degC) {
    if (degC >= limit_degC) cut_ = true;
    if (degC < limit_degC - restart_K) cut_ = false;
    return cut_;
  }

  const Scene& scene_;
  Limiter limiter_;
  const wire::Motor& motor_;
  bool cut_ = false;
};

/// Means over one log interval.
class Sums {
 public:
  void add(const firmware::FastView& fast, const host_sim::AxisTruth& truth) {
    square_A2_ += static_cast<double>(fast.current_A.d * fast.current_A.d + fast.current_A.q * fast.current_A.q);
    speed_ += static_cast<double>(fast.rad_per_s);
    bus_V_ += static_cast<double>(fast.bus_V);
    torque_Nm_ += truth.torque_Nm;
    shaft_W_ += truth.shaft_W;
    ++count_;
  }
  void write(Row& row) {
    const double n = std::max(count_, 1);
    row.current_A = root_3_over_2 * std::sqrt(square_A2_ / n);
    row.speed_rad_per_s = speed_ / n;
    row.bus_V = bus_V_ / n;
    row.torque_Nm = torque_Nm_ / n;
    row.shaft_W = shaft_W_ / n;
    *this = {};
  }

 private:
  double square_A2_ = 0, speed_ = 0, bus_V_ = 0, torque_Nm_ = 0, shaft_W_ = 0;
  int count_ = 0;
};

host_sim::Load load_of(const Shaft& shaft) {
  host_sim::Load load;
  if (shaft.kind == Shaft::Kind::locked) load.mode = host_sim::Load::Mode::locked;
  if (shaft.kind == Shaft::Kind::imposed) load.mode = host_sim::Load::Mode::imposed_speed;
  load.inertia_kg_m2 = shaft.load_inertia_kg_m2;
  return load;
}

double imposed_speed_rad_per_s(const Shaft& shaft, double time_s) {
  return shaft.speed_rad_per_s +
         shaft.speed_amplitude_rad_per_s * std::sin(2 * std::numbers::pi * shaft.frequency_Hz * time_s);
}

}  // namespace
}  // namespace boards::host

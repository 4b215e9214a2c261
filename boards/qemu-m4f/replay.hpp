// SPDX-License-Identifier: MIT
// A recorded walk without a recording: the whole driver, both axes, against two small motors in plain float arithmetic
// and an integer noise source, so that every number is the same wherever IEEE floats are.
//
// Four seconds that visit the lanes' branches: offset learning, arming, opposite currents, the board's peak, voltage
// saturation at speed, bus derating on both sides, core limit on a stalled rotor, time-out, missed samples, a gap, lost
// housing reading, over-current, clearing. Not a model to learn from: host-sim is the plant.
#pragma once

#include <cstdint>

#include "boards/dual_48v_20a.hpp"
#include "firmware/driver.hpp"
#include "thermal/motor_set.hpp"

namespace replay {

inline constexpr int periods_per_slow_tick = 200;
inline constexpr int slow_ticks = 400;

/// An EC 16 (40 W) sheet: the smallest winding of the project's motors, so that four seconds are long enough to heat
/// it.
constexpr wire::Motor small_motor() {
  wire::Motor m{};
  m.phase_resistance_ohm = 0.5;
  m.inductance_d_H = m.inductance_q_H = 30e-6;
  m.flux_linkage_Wb = 4.33e-3;
  m.pole_pairs = 1;
  m.rotor_inertia_kg_m2 = 1e-7;
  m.R1_K_per_W = 1.08;
  m.R2_K_per_W = 16.3;
  m.C1_J_per_K = 1.22 / 1.08;
  m.C2_J_per_K = 294 / 16.3;
  m.copper_coefficient_per_K = 0.00393;
  m.winding_max_degC = 155;
  m.phase_coupling_W_per_K = 0.5;
  return m;
}

/// The walk's plant: d and q as two R-L windings with back-EMF, on an averaged bridge, one Euler step a period.
struct PlainMotor {
  float id_A = 0.0f, iq_A = 0.0f, angle_rad = 0.0f, rad_per_s = 0.0f, bus_V = 48.0f;
  std::uint32_t noise = 1, sequence = 0xFFFFF000u;  // the counter wraps on the way
  hal::Duty loaded{{0.5f, 0.5f, 0.5f}, false};

  static firmware::ElectricalAngle angle(float rad) {  // one pole pair; rad from -1 to 7
    return {static_cast<std::uint32_t>(static_cast<std::int32_t>(rad * (1073741824.0f / 6.2831853f))) << 2};
  }

  float hiss_A() {  // -0.05..0.05, a linear congruence (Numerical Recipes' constants)
    noise = noise * 1664525u + 1013904223u;
    return static_cast<float>(static_cast<int>(noise >> 16) - 32768) * (0.05f / 32768.0f);
  }

  hal::AxisSample sample() noexcept {
    const wire::Abc i = firmware::inverse_clarke(firmware::unpark({id_A, iq_A}, firmware::sin_cos(angle(angle_rad))));
    return {
        {i.a + 0.12f + hiss_A(), i.b - 0.08f + hiss_A(), i.c + 0.03f + hiss_A()}, bus_V, angle_rad, ++sequence, true};
  }

  void release() noexcept { loaded.on = false; }

  /// One PWM period with the duty loaded before; `next` loads for the following one.
  void drive(const hal::Duty& next) noexcept {
    constexpr float period_s = 5e-5f, R_ohm = 0.5f, L_H = 30e-6f, flux_Wb = 4.33e-3f;
    if (!loaded.on) {
      id_A = iq_A = 0.0f;
    } else {
      const wire::AlphaBeta ratio = firmware::clarke(loaded.ratio);
      const wire::Dq v = firmware::park(ratio, firmware::sin_cos(angle(angle_rad + 0.5f * rad_per_s * period_s)));
      constexpr int steps = 4;  // a quarter of a period: R T / L would be 0.8
      for (int k = 0; k < steps; ++k) {
        const float did = v.d * bus_V - R_ohm * id_A + rad_per_s * L_H * iq_A;
        const float diq = v.q * bus_V - R_ohm * iq_A - rad_per_s * (L_H * id_A + flux_Wb);
        id_A += did * (period_s / L_H / steps);
        iq_A += diq * (period_s / L_H / steps);
      }
    }
    loaded = next;
    angle_rad += rad_per_s * period_s;
    if (angle_rad >= 6.2831855f) angle_rad -= 6.2831855f;
    if (angle_rad < 0.0f) angle_rad += 6.2831855f;
  }
};

static_assert(hal::AxisPort<PlainMotor>);

inline firmware::DriverSetup setup() {
  const wire::Motor motor = small_motor();
  const firmware::AxisSetup axis{firmware::parameters_from(motor, boards::dual_48V_20A, {48.0f, 0.0f}),
                                 thermal::three_phase_set(motor)};
  return {boards::dual_48V_20A, {axis, axis}};
}

/// `Watch` is called around each tick: before(), after_tick(axis index, duty), after_slow().
template <class Watch>
class Walk {
 public:
  explicit Walk(Watch& watch) : driver_(setup()), watch_(watch) {
    motors_[1].noise = 7;
    motors_[1].sequence = 5;
  }

  const firmware::Driver& driver() const { return driver_; }

  /// One slow tick and the 200 fast ticks of each axis before it.
  void run(int slow_tick) {
    script(slow_tick);
    for (int period = 0; period < periods_per_slow_tick; ++period) {
      for (int i = 0; i < firmware::axis_count; ++i) fast(i, slow_tick, period);
    }
    const bool blind = slow_tick >= 300 && slow_tick < 320;
    const hal::AxisSlowSample slow[2] = {{{30.0f, true}}, {{31.5f, !blind}}};
    watch_.before();
    driver_.slow_tick({{35.0f, true}, 0.0f, false}, slow);
    watch_.after_slow();
  }

 private:
  void fast(int i, int slow_tick, int period) {
    PlainMotor& motor = motors_[i];
    hal::AxisSample sample = motor.sample();
    if (i == 0 && slow_tick == 180 && period == 50) sample.valid = false;                    // one miss: bridged
    if (i == 1 && slow_tick == 181 && period >= 50 && period < 70) return;                   // a gap of 20 periods
    if (i == 0 && slow_tick == 220 && (period == 10 || period == 11)) sample.valid = false;  // two: trips
    if (i == 1 && slow_tick == 340 && period == 7) sample.current_A.b = -31.0f;              // over-current
    if (i == 0 && slow_tick == 86 && (period == 50 || period == 90)) return;  // misses one when all limits hold at once
    watch_.before();
    const hal::Duty duty = driver_.axis(i).tick(sample);
    watch_.after_tick(i, duty);
    motor.drive(duty);
  }

  void ask(int i, float d_A, float q_A) {
    if (driver_.axis(i).set_current({d_A, q_A}) != wire::Status::done) ++refused;
  }

  void script(int t) {
    firmware::Axis &one = driver_.axis(0), &two = driver_.axis(1);
    // Speeds in rad/s, by a hand that is stronger than the motors.
    motors_[0].rad_per_s = t < 20    ? 0.0f
                           : t < 67  ? 140.0f * static_cast<float>(t - 20)  // back-EMF reaches the hexagon
                           : t < 90  ? 6580.0f
                           : t < 118 ? 6580.0f - 235.0f * static_cast<float>(t - 90)
                                     : 0.0f;
    motors_[1].rad_per_s = t < 30 ? 0.0f : t < 150 ? -350.0f : t < 200 ? 1500.0f : -40.0f;
    motors_[0].bus_V = t < 75 ? 48.0f : t < 82 ? 53.5f : t < 90 ? 30.0f : 48.0f;
    motors_[1].bus_V = motors_[0].bus_V;
    if (t == 12 || t == 240) refused += one.arm() == wire::Status::done ? 0 : 1;
    if (t == 12 || t == 360) refused += two.arm() == wire::Status::done ? 0 : 1;
    if (t == 225) refused += one.clear() == wire::Status::done ? 0 : 1;  // refused: its setpoint is not zero
    if (t == 229 || t == 230) ask(0, 0.0f, 0.0f);
    if (t == 230) refused += one.clear() == wire::Status::done ? 0 : 1;
    if (t == 345) ask(1, 0.0f, 0.0f);
    if (t == 346) refused += two.clear() == wire::Status::done ? 0 : 1;
    if (t < 13) return;
    if (t < 73) ask(0, t < 40 ? 0.0f : -1.5f, t % 20 < 10 ? 6.0f : -6.0f);  // square wave, with id
    if (t == 73) ask(0, 0.0f, 25.0f);  // then silence: fades from t = 83, saturated, limited and on a sagging bus
    if (t < 215) ask(1, 0.0f, t % 20 < 10 ? -6.0f : 6.0f);
    if (t >= 130 && t < 215) ask(0, 0.0f, 30.0f);  // stalled, above the peak, until the core limits
    if (t >= 250 && t < 330) ask(0, 2.0f, 12.0f);
    if (t >= 245 && t < 345) ask(1, 0.0f, 3.0f);  // 30 ticks without a setpoint before: times out, then wakes
  }

  firmware::Driver driver_;
  Watch& watch_;
  PlainMotor motors_[firmware::axis_count];

 public:
  int refused = 0;  // calls that answered no
};

}  // namespace replay

// SPDX-License-Identifier: MIT
#include "host-sim/plant/excitation.hpp"

#include <algorithm>
#include <cmath>

namespace host_sim {
namespace {

constexpr double turn_rad = 6.283185307179586;

/// A stretch of a log with one character.
struct Stretch {
  double seconds;
  double current, speed;             // of rating, of full speed; signed
  double ripple = 0, ripple_Hz = 0;  // share of current and speed, together
  bool enabled = true;
};

/// A stretch of the designed profile. Where `on` is not 0 its current flows for so many time constants of the winding
/// and rests for `off` of them, again and again: readings now and then meet the winding on its way up and down.
struct Step {
  double share;           // of the log
  double current, speed;  // as in Stretch
  double on = 0, off = 0;
};

/// All assumed: shares of time, loads and speeds that a legged robot's axis might see; bursts up to 4.5 times the
/// rating.
Stretch next_of_robot(Random& random) {
  const double kind = random.uniform(), sign = random.uniform() < 0.5 ? -1 : 1;
  if (kind < 0.45) {  // walking: the more load the more speed
    const double effort = random.uniform(0.3, 1.1);
    return {random.uniform(15, 70), sign * effort, sign * effort * random.uniform(0.25, 0.6), random.uniform(0.5, 0.9),
            random.uniform(1, 2)};
  }
  if (kind < 0.65) return {random.uniform(0.3, 1.5), sign * random.uniform(2, 4.5), sign * random.uniform(0.2, 0.9)};
  if (kind < 0.80) return {random.uniform(5, 30), sign * random.uniform(0.4, 0.9), 0};  // holding a posture
  if (kind < 0.90)
    return {random.uniform(5, 20), sign * random.uniform(0.05, 0.2), sign * random.uniform(0.3, 1)};  // swinging
  return {random.uniform(10, 60), 0, 0, 0, 0, random.uniform() < 0.5};
}

/// Found by search, in the linear approximation: of some thousand drawn changes those were kept with which most effects
/// of 1 to 10 K, of 16 motors within the winding's limit, stand clear of every rival, alone and beside another, and
/// which leave R1 and C1 the least uncertain; rounded afterwards.
constexpr Step designed_steps[] = {
    {8, -0.12, 0},
    {11, -0.57, -0.06, 0.7, 0.5},
    {5, -1.35, 0.12, 2.2, 0.3},
    {38, 0, 0},
    {1.6, 3.76, 0.08, 2.9, 1.7},
    {2, 0, 0.2},
    {4, 2.03, 0, 0.8, 1.2},
    {11.7, 0, 0},
    {9, 0, 0.6},
    {21, 0, 0},
    {3.5, 0.1, 0, 0.5, 1.2},
    {9, 0, 0},
    {11, 0.28, 0.03, 5, 2.7},
    {4, 2.14, 1, 0.6, 2.6},
    {2.5, 0.21, 0, 2.1, 1.6},
    {9.5, -0.34, 0.28},
    {4, -0.16, 0.07, 1.8, 0.8},
    {4.6, -3.76, -0.14, 1.4, 0.8},
    {2, -0.12, 1},
    {6, 3.96, 0.03, 1.1, 3},
    {3.9, 0.16, 0.08},
    {2.6, 0, 0},
};

std::vector<Stretch> designed(double length_s, double winding_s, Random& random) {
  constexpr double shortest_s = 0.5;  // of a pulse: ten demands
  double shares = 0;
  for (const Step& step : designed_steps) shares += step.share;
  std::vector<Stretch> out;
  for (const Step& step : designed_steps) {
    double left_s = length_s * step.share / shares * random.uniform(0.9, 1.1);  // so that no two logs are alike
    const bool pulsed = step.on > 0;
    for (bool on = true; left_s > 0; on = !on) {
      const double pulse_s = std::max(shortest_s, winding_s * (on ? step.on : step.off));
      const double seconds = pulsed ? std::min(left_s, pulse_s) : left_s;
      out.push_back({seconds, on ? step.current : 0, step.speed, 0, 0, step.current != 0 || step.speed != 0});
      left_s -= seconds;
    }
  }
  out.push_back({length_s, 0, 0, 0, 0, false});
  return out;
}

/// Something that drifts between levels like a housing does: first order towards random targets.
class Wanderer {
 public:
  Wanderer(double low, double high, double tau_s, Random& random)
      : low_(low), high_(high), tau_s_(tau_s), value_(low), random_(random) {}
  double next(double h_s) {
    left_s_ -= h_s;
    if (left_s_ <= 0) {
      target_ = random_.uniform(low_, high_);
      left_s_ = random_.uniform(100, 400);
    }
    return value_ += (target_ - value_) * h_s / tau_s_;
  }

 private:
  double low_, high_, tau_s_, value_, target_ = 0, left_s_ = 0;
  Random& random_;
};

}  // namespace

double rated_amplitude_A(const wire::Motor& sheet) {
  const double rise_K = sheet.winding_max_degC - 25;
  const double hot_ohm = sheet.phase_resistance_ohm * (1 + sheet.copper_coefficient_per_K * rise_K);
  return std::sqrt(rise_K / ((sheet.R1_K_per_W + sheet.R2_K_per_W) * 1.5 * hot_ohm));
}

double full_speed_rad_per_s(const wire::Motor& sheet, double bus_V) {
  return 0.8 * bus_V / (std::sqrt(3.0) * sheet.pole_pairs * sheet.flux_linkage_Wb);
}

std::vector<Demand> make_excitation(Excitation kind, const wire::Motor& sheet, double full_speed_rad_per_s,
                                    double length_s, double rate_Hz, std::uint64_t seed) {
  Random random(seed);
  const double rated_A = rated_amplitude_A(sheet), h_s = 1 / rate_Hz;
  std::vector<Stretch> plan;
  if (kind == Excitation::designed) plan = designed(length_s, sheet.R1_K_per_W * sheet.C1_J_per_K, random);
  if (kind == Excitation::one_step) {
    plan = {{60, 0, 0}, {length_s, random.uniform(0.7, 0.95), random.uniform(0.2, 0.8)}};
  }
  Random surroundings(seed ^ 0x5bd1e995);
  Wanderer neighbour(25, 75, 150, surroundings), frame(25, 50, 250, surroundings);

  const auto count = static_cast<std::size_t>(length_s * rate_Hz);
  std::vector<Demand> out(count);
  std::size_t next = 0;
  Stretch now{0, 0, 0};
  double left_s = 0, phase_rad = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (left_s <= 0) {
      // A log starts at rest for a while: what is soaked and what is not can be seen.
      if (i == 0 && kind == Excitation::robot_duty) {
        now = {random.uniform(5, 20), 0, 0, 0, 0, false};
      } else {
        now = next < plan.size() ? plan[next++] : next_of_robot(random);
      }
      left_s += now.seconds;
    }
    left_s -= h_s;
    phase_rad += turn_rad * now.ripple_Hz * h_s;
    const double wave = 1 + now.ripple * std::sin(phase_rad);
    out[i].current_A = rated_A * now.current * wave;
    out[i].speed_rad_per_s = full_speed_rad_per_s * now.speed * wave;
    out[i].enabled = now.enabled;
    out[i].neighbour_degC = neighbour.next(h_s);
    out[i].frame_degC = frame.next(h_s);
  }
  return out;
}

}  // namespace host_sim

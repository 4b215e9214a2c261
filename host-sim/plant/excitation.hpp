// SPDX-License-Identifier: MIT
// What a motor is asked to do in a long log, from a seed: amplitude and speed over time, at a slow rate. No physics
// here but the motor's rating, which scales the amperes.
#pragma once

#include <cstdint>
#include <vector>

#include "host-sim/plant/random.hpp"
#include "wire/motor.hpp"

namespace host_sim {

enum class Excitation {
  one_step,    // a rest, then one load for good
  robot_duty,  // gait with a ripple of 1..2 Hz, bursts, holding, rests; current and speed go together
  designed,    // pulses as long as the winding takes to warm, weak loads, spins, both signs, rests: tells causes apart
};

/// One instant. Amplitude of the current vector, signed like its torque.
struct Demand {
  double current_A = 0;
  double speed_rad_per_s = 0;
  bool enabled = true;
  double neighbour_degC = 25;
  double frame_degC = 25;
};

/// Amplitude that would bring the winding to its limit in the end, from the sheet, 25 degC around.
double rated_amplitude_A(const wire::Motor& sheet);

/// Demands at a steady rate for the whole length of a log; currents go by the sheet's rating, pulses by its winding's
/// time constant. `full_speed_rad_per_s` is what 1 means for speeds.
std::vector<Demand> make_excitation(Excitation kind, const wire::Motor& sheet, double full_speed_rad_per_s,
                                    double length_s, double rate_Hz, std::uint64_t seed);

/// Speed at which the motor's voltage reaches 80 % of what a bus can give.
double full_speed_rad_per_s(const wire::Motor& sheet, double bus_V);

}  // namespace host_sim

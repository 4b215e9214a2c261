// SPDX-License-Identifier: MIT
// A log on an even grid of short bins, ready for the replay.
//
// Every nonlinear feature (i^2, |i||w|, w^0.8 ...) is formed from the raw samples and averaged afterwards: squaring an
// averaged current costs 12..25 K of winding temperature under a gait's ripple. Inputs are held from one sample to the
// next (zero-order hold), so that a bin that is as long as the sampling interval loses nothing.
//
// Current is the amplitude of the current vector: heat = 3/2 R_phase i^2. A current_A column is the direct current that
// heats alike through two terminals, so i = 2/sqrt(3) times it (wire/motor.hpp). It holds the ripple of the pulses,
// which makes heat and no torque: where iq_A is there too, what goes with |i|, its sign or current and speed is taken
// from that.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "identify/log/log.hpp"
#include "thermal/heat_set.hpp"

namespace identify {

/// Amplitude of the current vector over the direct current that heats alike.
inline constexpr double amplitude_per_direct = 1 / wire::direct_per_amplitude;
inline constexpr double stalled_rad_per_s = 2;  // about three seconds a turn
inline constexpr double longest_bin_s = 2;      // but of many hours under a slow winding (problem.cpp)

/// Of a coarse sensor's step: how well its moment is known at worst (disturbance.cpp asks the residual for better).
/// Noise of 0 to 0.4 of it leaves readings 0.02 to 0.12 off (Masks.ASensorOfWholeDegreesIsReadAsItSteps holds them to
/// this).
inline constexpr double step_noise_share = 0.15;

struct Bin {
  thermal::HeatInput<double> input;  // means over the bin
  double signed_A;                   // mean current with its sign
  double stalled_A2;                 // mean of i^2 while |w| is below stalled_rad_per_s, else of 0
  double uneven_A4;                  // of what warms a standing rotor's phases unequally (Problem::uneven_per_A2)
  double housing_degC, core_degC;    // mean reading, NaN: none
  float housing_at, core_at;         // where in the bin, 0..1, its mean time lies
  float housing_n, core_n;           // readings in it
  /// How far the integral of what heats the winding (i^2 in A2 s; W s where power was recorded) had run ahead of the
  /// bin's mean when the winding, or a housing sensor that may feel it, was read: a step of load inside a bin is seen
  /// by its moment.
  double housing_ahead, core_ahead;
  bool idle;  // nothing heats and nothing turns
};

inline constexpr int first_readings = 5;  // of a housing, averaged: noisy by less than half of one

/// Where a log begins, and where it begins again after a pause in which nothing tells what heated.
struct Start {
  std::size_t bin = 0;
  double housing_degC = missing, core_degC = missing;  // as the first readings say; NaN: none
  std::size_t paused = 0;                              // bins before it in which nothing is told
};

struct Bins {
  std::string name;
  double width_s = 0, interval_s = 0;  // of a bin; from row to row of the log, usually
  std::vector<Bin> bins;
  bool torque_for_A = false;    // as in Log
  bool averaged = false;        // as in Log
  bool sink_assumed = false;    // to be as warm as what the log begins at
  bool sink_unwatched = false;  // or as a person said once: how it moved is not known
  bool has_power = false, has_speed = false, has_frame = false, has_neighbour = false, has_core = false,
       has_housing = false;
  std::vector<Start> starts = {Start{}};         // the first at bin 0
  bool begins_warm = false;                      // or cold: the housing at another temperature than the sink
  double housing_noise_K = 0, core_noise_K = 0;  // of one raw reading, from its differences
  double missing_share = 0, gap_share = 0, housing_step_K = 0, core_step_K = 0;  // as in Log
  Reference core_reference = {};                                                 // as in Log
  double uneven_per_A2 = 0;                                                      // as in Problem
  double current_noise_A = 0;  // of one row's amplitude, white, as rest shows it
  double noisy_share = 1;      // of the heat's noise by it: what speed does not take away
  std::vector<std::string> notes;

  std::size_t bin_at(double s) const { return static_cast<std::size_t>(s / width_s + 1e-9); }  // the later at a limit
  double duration_s() const { return width_s * static_cast<double>(bins.size()); }
};

/// `finest_s`: bins no longer than this where the sampling allows it (a quarter to a half of the winding's time
/// constant). Throws UserError (unusable) when the rows are too few, or share their times.
Bins bins_of(const Log& log, double finest_s);

/// Adds what flows at one moment, each nonlinear form for itself, with its share of the bin. `sampled_A`: amplitude
/// with the sign of its torque, without ripple where that is known. Speed mechanical. Whether the bridge is on is left
/// to who knows it.
void add_moment(Bin& bin, double share, double amplitude_A, double sampled_A, double speed_rad_per_s);

/// Takes the readings of the bins from one to before another away; what they said of the start stays.
void forget_readings(Bins& log, std::size_t from, std::size_t before);

/// Every `together` bins as one.
Bins merged(const Bins& log, std::size_t together);

}  // namespace identify

// SPDX-License-Identifier: MIT
// The heat of one motor alone, driven by given current and speed at 20..100 Hz: long logs for identification at a
// hundred thousand times real time. Same stove as the bench; copper loss from the phases' share of the amplitude at the
// rotor's angle; sensors with raw noise. A protection as a robot would have: near the limit the current is reduced.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "host-sim/plant/excitation.hpp"
#include "host-sim/plant/stove.hpp"

namespace host_sim {

/// Raw noise of one log. `winding_*`: a winding temperature from resistance; 0 s between readings: none.
struct LogNoise {
  double housing_white_K = 0.2, housing_wander_K = 0.05, housing_wander_s = 20, housing_step_K = 0.1;
  double current_share = 0.01;
  double winding_K = 2, winding_every_s = 0;
  static LogNoise none() { return {0, 0, 20, 0, 0, 0, 0}; }
};

struct ThermalDesign {
  wire::Motor sheet;  // of this very motor: truth, not what somebody believes
  HeatOptions options;
  HiddenEffects hidden;
  LogNoise noise;
  double ambient_degC = 25;
  double start_housing_degC = 25;  // all nodes but the windings
  double start_winding_degC = 25;
};

/// One line of a log, and the truth beside it.
struct ThermalSample {
  double time_s;
  double current_A;        // signed root mean square of the amplitude over the interval, as measured; heat = 3/2 R I^2
  double speed_rad_per_s;  // signed root mean square
  double enabled;          // share of the interval
  double housing_degC, ambient_degC, neighbour_degC, frame_degC;
  std::optional<double> winding_degC;
  double true_winding_degC, true_hottest_degC, true_housing_degC, true_current_A;
};

class ThermalBench {
 public:
  ThermalBench(const ThermalDesign& design, std::uint64_t seed);

  /// One plant step; returns the demand that was carried out (protection may have reduced its current).
  Demand advance(double h_s, Demand demand);
  /// Closes the interval since the last sample.
  ThermalSample sample();
  const Stove& stove() const { return stove_; }

 private:
  ThermalDesign design_;
  Random random_;
  Stove stove_;
  std::vector<Demand> delayed_;
  std::size_t delayed_at_ = 0;
  double angle_rad_;
  double sum_s_ = 0, current2_A2s_ = 0, current_As_ = 0, speed2_ = 0, speed_ = 0, enabled_s_ = 0;
  double wander_K_ = 0, winding_due_s_ = 0, last_sample_s_ = 0;
  Demand last_;
};

/// A whole log.
std::vector<ThermalSample> record(const ThermalDesign& design, const std::vector<Demand>& demands, double rate_Hz,
                                  double log_Hz, std::uint64_t seed);

}  // namespace host_sim

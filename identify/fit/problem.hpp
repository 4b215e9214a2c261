// SPDX-License-Identifier: MIT
// One identification task: the logs of one motor, where its parameters are believed to lie, and how noisy the readings
// are.
#pragma once

#include <string>
#include <vector>

#include "identify/log/bins.hpp"
#include "identify/model/cause.hpp"

namespace identify {

/// R1 over R2 and C1 over C2 in catalogues (maxon, of 5 to 200 W).
struct InCatalogues {
  double least, middle, most;
};
inline constexpr InCatalogues R1_of_R2{0.03, 0.2, 1.4}, C1_of_C2{0.02, 0.11, 0.6};
inline constexpr double beyond_catalogues = 3;  // so many times as far is believed of a motor either way
inline constexpr double heaviest_winding = C1_of_C2.most * beyond_catalogues;  // of its housing, J/K over J/K

/// Where the fit starts and how far it may be off.
struct Belief {
  bool known = false;  // a motor file was given; otherwise found from the data, and as good as unknown
  std::string motor = "unknown";
  double ohm = 1;  // heat per squared amplitude, 3/2 R_phase at 25 degC; 1 when unknown: only P R and P/C are then seen
  double copper_per_K = 0.00393;
  double R1_K_per_W = 1, R2_K_per_W = 5, C1_J_per_K = 10, C2_J_per_K = 200;
  /// Shipped actuators had 1.8 times their sheet's R1; a mount that cools five times better raises no alarm yet.
  double log_sd = 0.5;
  double log_room = 3.4;  // box: a factor of 30 either way
  double winding_max_degC = 155;
};

/// What a thermistor on a housing wanders by, and within how long: assumed as host-sim's is (thermal_bench.hpp,
/// LogNoise) where no rest tells. Less hides behind the steps of 0.1 K that it is read in.
inline constexpr double usual_slow_K = 0.05, usual_slow_s = 20, least_slow_K = 0.02;
/// A slow disturbance takes one to four minutes: a slower one is the model's own time constants, a faster one the
/// sensor's wander.
inline constexpr double fast_disturbance_s = 60, slow_disturbance_s = 240;

/// A reading = truth + white + slow, slow a first-order process; the mean of n readings has white / sqrt(n). Where a
/// model is known to be off for reasons without a name, a disturbance comes on top: another one, slower.
struct Noise {
  double housing_white_K = 0.2, housing_slow_K = usual_slow_K, slow_s = usual_slow_s;
  double core_white_K = 1, core_slow_K = 0;  // slow 0: read so rarely that all is white
  // Of the housing; a winding that wanders more is disturbed more.
  double disturbance_K = 0, disturbance_s = fast_disturbance_s;
  double idle_s = 0;        // how much rest it was taken from; 0: assumed
  double of_current_K = 0;  // what the noise of the current moves a simulated winding, rms
};

/// What no motor is without and no cause is to be named for: how far its ordinary size moves the readings, for each log
/// and bin. A fit averages over it (prior standard deviation 1 in that unit).
struct Leeway {
  std::vector<std::vector<double>> housing_K, core_K;
  bool of_each_log = false;  // each log has its own amount of it; else all have the same
  double uneven_per_A2 = 0;  // of uneven phases: that ordinary size, on top of Problem::uneven_per_A2
};

struct Problem {
  std::vector<Bins> logs;
  Belief belief;
  Noise noise;
  std::vector<Leeway> leeway;  // what fits average over
  double uneven_per_A2 = 0;    // times i^4: what the uneven phases of a standing rotor heat more than i^2 says
  double heat_W = 1;           // mean copper heat, and means of the drives: the scales of cause.hpp
  double drive_mean[thermal::drive_count] = {};
  double rms_A = 1, speed08_mean = 1, duration_s = 1;

  bool heated_by_power() const { return logs.front().has_power; }
  bool in_amperes() const { return !logs.front().has_power && !logs.front().torque_for_A; }
  bool any_core() const;
  double scale(Scale s, thermal::Drive drive) const;
  bool possible(const Cause& cause) const;  // the logs hold what it needs
  void warm_unevenly(double per_A2);        // changes the inputs to this uneven_per_A2
};

/// The column that `chosen` goes by and that this log does not have: what it explains elsewhere cannot be seen there.
/// Empty: it has all.
std::string column_lacking(const std::vector<Chosen>& chosen, const Bins& log);

/// A standing rotor's phases take unequal heat P_k and warm unequally, and the warmer ones then take more still:
/// wherever it stands, alpha R_u sum (P_k - P/3)^2 = alpha R_u P^2 / 6 above P, the heat of equal phases, with one P as
/// long ago as phases of C1/3 need to warm. Between one phase and the others lies R_u: 0 where they share their heat at
/// once, 3 R1 where they share none. The middle is assumed.
void warm_phases_unequally(Problem& problem);

/// Each log without its last `fraction`; and each whole, but with the readings of that part alone.
Problem first_part(const Problem& problem, double fraction);
Problem last_part(const Problem& problem, double fraction);

/// Without the readings that answer to a load after the log where temperatures are ahead of the load by up to
/// `early_s`: nobody recorded it. Of a load before the log, the first stands for it.
Problem heard(Problem problem, double early_s);

/// Logs that `fitted` has not seen, under what it believes and assumes: only the inputs and the readings are theirs.
Problem unseen_by(const Problem& fitted, const std::vector<Log>& logs);

}  // namespace identify

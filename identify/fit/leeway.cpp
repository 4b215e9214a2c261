// SPDX-License-Identifier: MIT
#include "identify/fit/leeway.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "identify/fit/replayed.hpp"

namespace identify {
namespace {

/// Chosen on clean logs of host-sim's default motor, whose housing is of several parts (seeds from 930), and small
/// enough that lags and delays of a few seconds keep their names (seeds 800, 801).
constexpr double ordinary_late_s = 0.5, ordinary_late_share = 0.002;
/// When in its row's interval a dense winding was read: anywhere in it, this standard deviation.
const double ordinary_moment_share = 1 / std::sqrt(12.0);
/// A row's current may flow until the next row, have flowed since the row before, or anything between: the winding read
/// beside it is up to an interval ahead of it, evenly likely, the root of whose mean square this is.
const double ordinary_ahead_share = 1 / std::sqrt(3.0);
/// Phases may share all of their heat or none (problem.cpp): of what was assumed, in the middle, this standard
/// deviation.
const double ordinary_uneven_share = 1 / std::sqrt(3.0);
/// A frame on the housing: so much of its capacity, behind so much of its resistance to the sink. Assumed, as of
/// host-sim's default motor: a standard deviation is one of these more or less.
constexpr double ordinary_frame_share_of_C2 = 0.2, ordinary_frame_share_of_R2 = 0.02;
/// Of what rest shows of the current's noise, flows all or nothing: of its square, this standard deviation.
const double ordinary_ripple_share = 1 / std::sqrt(12.0);
/// Of the heat, where the current squared is its mean over the heat: a standard deviation. The current that host-sim
/// records says -0.5 to 0.4 percent more heat than the plant's joules, and down to -1.3 with load at top speed
/// (designed, hidden motor 4110).
constexpr double ordinary_load_share = 0.002;

/// Of a sensor's step: many that tell whole degrees cut off the rest, half a step on average, as many round it, which
/// is what is assumed. The root of the mean square.
const double ordinary_cut_share = 0.5 / std::sqrt(2.0);

/// How far a room that nobody watched moves while a log is recorded, a standard deviation: in half a wave over the
/// log; in n halves by the root of n less. Heating that is regulated holds a room to some tenths of a kelvin. All along
/// it is as much warmer or cooler than what is taken for it.
constexpr double ordinary_room_K = 0.3;
constexpr int room_waves = 4;

/// Of the rise, as still air cools: between none and all of a motor's cooling may go so, evenly likely, the root of
/// whose mean square this is. And a thermistor of one percent in a divider of one percent, over the range of a motor.
const double ordinary_convection_exponent = 0.25 / std::sqrt(3.0);
constexpr double ordinary_sensor_gain = 0.03;

/// How well a winding that its resistance tells is known where its reference was taken. The middle half of normal
/// readings tells their mean to 1.1 times what all of them do. The housing is read as often or more, but what it
/// wanders by, or where between its steps it stood, is the same for the whole of a rest.
double reference_sd_K(const Noise& noise, const Bins& log) {
  const double each_K = 1.1 * std::hypot(noise.core_white_K, noise.housing_white_K);
  return std::hypot(each_K / std::sqrt(static_cast<double>(log.core_reference.readings)), noise.housing_slow_K,
                    log.housing_step_K / std::sqrt(12.0));
}

/// What that makes of a winding's temperatures: all in proportion to the resistance.
std::vector<double> off_by_reference_K(std::vector<double> core_degC, const Noise& noise, const Bins& log) {
  const double share =
      log.core_reference.readings > 0 ? reference_sd_K(noise, log) / (log.core_reference.degC - no_ohm_degC) : 0;
  for (double& x : core_degC) x = share * (x - no_ohm_degC);
  return core_degC;
}

/// How far apart two simulations of one log are, `times` over.
std::vector<double> difference_K(std::vector<double> moved, const std::vector<double>& plain, double times = 1) {
  for (std::size_t k = 0; k < moved.size(); ++k) moved[k] = (moved[k] - plain[k]) * times;
  return moved;
}

struct Run {
  const Problem& problem;
  const Fit& motor;
};

/// How far the readings move from one simulation to another, `times` over.
Leeway moved(const Run& from, const Run& to, double times = 1) {
  Leeway out;
  for (std::size_t l = 0; l < from.problem.logs.size(); ++l) {
    const Replayed a = replayed(from.problem, from.motor, l), b = replayed(to.problem, to.motor, l);
    out.housing_K.push_back(difference_K(b.housing_degC, a.housing_degC, times));
    out.core_K.push_back(difference_K(b.core_degC, a.core_degC, times));
  }
  return out;
}

void forget(std::vector<std::vector<double>>& readings_K) {
  for (std::vector<double>& log : readings_K) std::fill(log.begin(), log.end(), 0.0);
}

Leeway lateness(const Run& prompt) {
  constexpr double lag_s = 0.2;  // short: it shows the slope
  const Physical p = physical(prompt.motor.x);
  const double late_s = ordinary_late_s + ordinary_late_share * p.R2_K_per_W * p.C2_J_per_K;
  Problem unread = prompt.problem;  // what noise read behind a pause is no lateness
  for (Bins& log : unread.logs) {
    for (Start& start : log.starts) start.housing_degC = missing;
  }
  Leeway out = moved({unread, prompt.motor}, {unread, with_cause(prompt.motor, "sensor_lag", {lag_s})},
                     late_s / (lag_s + least_lag_s));
  forget(out.core_K);
  return out;
}

Leeway frame(const Run& baseline) {
  const auto& [problem, motor] = baseline;
  const Physical p = physical(motor.x);
  Fit framed = with_cause(motor, "third_mass",
                          {std::log(ordinary_frame_share_of_C2 * p.C2_J_per_K / problem.belief.C2_J_per_K),
                           std::log(ordinary_frame_share_of_R2 * p.R2_K_per_W / problem.belief.R2_K_per_W)});
  framed.x[3] += std::log(1 - ordinary_frame_share_of_C2);
  return moved(baseline, {problem, framed});
}

Leeway uneven_phases(const Run& whole) {
  Problem uneven = whole.problem;
  uneven.warm_unevenly((1 + ordinary_uneven_share) * whole.problem.uneven_per_A2);
  Leeway out = moved(whole, {uneven, whole.motor});
  out.uneven_per_A2 = uneven.uneven_per_A2 - whole.problem.uneven_per_A2;
  return out;
}

/// A winding that was read behind its row's begin, in whose interval, and one that was read ahead of it: another load
/// begins with a row, so that the one goes by what flows, the other by what flowed.
Leeway read_behind(const Run& prompt) {
  constexpr double delay_s = 0.01;  // short: it shows the slope
  Leeway out = moved(prompt, {prompt.problem, with_cause(prompt.motor, "clock_delay", {delay_s})});
  forget(out.housing_K);
  for (std::size_t l = 0; l < out.core_K.size(); ++l) {
    for (double& x : out.core_K[l]) x *= ordinary_moment_share * prompt.problem.logs[l].interval_s / delay_s;
  }
  return out;
}

Leeway read_ahead(const Run& prompt) {
  const auto& [problem, motor] = prompt;
  Leeway out;
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    const Fit half_a_row = with_cause(motor, "clock_delay", {-problem.logs[l].interval_s / 2});
    out.core_K.push_back(difference_K(replayed(problem, half_a_row, l).core_degC, replayed(problem, motor, l).core_degC,
                                      2 * ordinary_ahead_share));
  }
  out.housing_K = out.core_K;
  forget(out.housing_K);
  return out;
}

/// As of a current's noise that flowed; empty where no current is noisy.
std::optional<Leeway> ripple(const Run& whole) {
  Problem rippling = whole.problem;
  bool ripples = false;
  for (Bins& log : rippling.logs) {
    ripples = ripples || log.current_noise_A > 0;
    for (Bin& bin : log.bins)
      bin.input[thermal::Drive::current_A2] += ordinary_ripple_share * log.current_noise_A * log.current_noise_A;
  }
  if (!ripples || whole.problem.heated_by_power()) return std::nullopt;
  return moved(whole, {rippling, whole.motor});
}

/// A winding whose reference at rest was off; empty where no resistance tells one.
std::optional<Leeway> reference(const Run& whole) {
  const auto& [problem, motor] = whole;
  if (std::none_of(problem.logs.begin(), problem.logs.end(),
                   [](const Bins& b) { return b.core_reference.readings > 0; }))
    return std::nullopt;
  Leeway out;
  out.of_each_log = true;
  for (std::size_t l = 0; l < problem.logs.size(); ++l)
    out.core_K.push_back(off_by_reference_K(replayed(problem, motor, l).core_degC, problem.noise, problem.logs[l]));
  out.housing_K = out.core_K;
  forget(out.housing_K);
  return out;
}

/// Of sensors that cut off what is below their step instead of rounding it; empty where no step is that coarse.
std::optional<Leeway> cut_off(const Problem& problem, std::vector<std::vector<double>> Leeway::*channel,
                              double Bins::*step_K) {
  Leeway out;
  double most_K = 0;
  for (const Bins& log : problem.logs) {
    most_K = std::max(most_K, log.*step_K);
    out.housing_K.emplace_back(log.bins.size(), 0.0);
    out.core_K.emplace_back(log.bins.size(), 0.0);
    (out.*channel).back().assign(log.bins.size(), ordinary_cut_share * log.*step_K);
  }
  if (most_K == 0) return std::nullopt;
  return out;
}

/// Where unwatched rooms move in `halves` half waves over their logs.
Leeway room(const Run& whole, int halves) {
  Problem swung = whole.problem;
  for (Bins& log : swung.logs) {
    for (std::size_t k = 0; k < log.bins.size() && log.sink_unwatched; ++k) {
      const double share = (static_cast<double>(k) + 0.5) / static_cast<double>(log.bins.size());
      const double room_K =
          ordinary_room_K / std::sqrt(std::max(1, halves)) * std::cos(std::numbers::pi * halves * share);
      log.bins[k].input[thermal::Boundary::ambient] += room_K;
    }
  }
  Leeway out = moved(whole, {swung, whole.motor});
  out.of_each_log = true;
  return out;
}

}  // namespace

std::vector<Leeway> ordinary_leeway(const Problem& problem, const Fit& motor) {
  const Fit baseline = bare(problem, motor);
  // Beside its causes, for the heat they make is late too; not beside what the sensor or its clock does already.
  const bool sensor = std::any_of(motor.chosen.begin(), motor.chosen.end(), [](const Chosen& c) {
    const Edit e = cause_of(c).edit;
    return e == Edit::sensor_lag || e == Edit::sensor_share || e == Edit::delay || e == Edit::winding_lag;
  });
  const Run whole{problem, motor}, prompt{problem, sensor ? baseline : motor};
  std::vector<Leeway> out = {lateness(prompt), frame({problem, baseline})};
  if (problem.uneven_per_A2 > 0) out.push_back(uneven_phases(whole));
  if (problem.noise.core_slow_K > 0) out.insert(out.end(), {read_ahead(prompt), read_behind(prompt)});
  if (auto more = ripple(whole)) out.push_back(std::move(*more));
  if (auto more = reference(whole)) out.push_back(std::move(*more));
  if (auto more = cut_off(problem, &Leeway::housing_K, &Bins::housing_step_K)) out.push_back(std::move(*more));
  if (auto more = cut_off(problem, &Leeway::core_K, &Bins::core_step_K)) out.push_back(std::move(*more));
  const bool unwatched =
      std::any_of(problem.logs.begin(), problem.logs.end(), [](const Bins& log) { return log.sink_unwatched; });
  for (int halves = 0; unwatched && halves <= room_waves; ++halves) out.push_back(room(whole, halves));
  return out;
}

std::vector<Leeway> leeway_of_an_unseen_winding(const Problem& problem, const Fit& fit) {
  const Fit motor = bare(problem, fit);
  std::vector<Leeway> out;
  for (const auto& [id, size] :
       {std::pair{"natural_convection", ordinary_convection_exponent}, std::pair{"sensor_gain", ordinary_sensor_gain}})
    out.push_back(moved({problem, motor}, {problem, with_cause(motor, id, {size})}));
  return out;
}

Leeway leeway_of_load(const Problem& problem, const Fit& baseline) {
  Problem bent = problem;
  double sum_A2 = 0, sum_A4 = 0;
  for (const Bins& log : problem.logs) {
    for (const Bin& bin : log.bins) {
      const double A2 = bin.input[thermal::Drive::current_A2];
      sum_A2 += A2;
      sum_A4 += A2 * A2;
    }
  }
  for (Bins& log : bent.logs) {
    for (Bin& bin : log.bins) {
      double& A2 = bin.input[thermal::Drive::current_A2];
      if (sum_A4 > 0) A2 *= 1 + ordinary_load_share * A2 * sum_A2 / sum_A4;
    }
  }
  return moved({problem, baseline}, {bent, baseline});
}

}  // namespace identify

// SPDX-License-Identifier: MIT
#include "identify/answer/gain.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "identify/answer/model_file.hpp"
#include "thermal/indices.hpp"
#include "thermal/look_ahead.hpp"
#include "thermal/validate.hpp"

namespace identify {
namespace {

using thermal::Boundary, thermal::CoreEstimator, thermal::Drive, thermal::estimator_dt_s;
using Network = thermal::HeatNetwork<double>;

constexpr thermal::PhaseShares turning{{0.5f, 0.5f, 0.5f}};
// A burst is asked at three times what the motor carries for an hour: an ordinary overload, whatever the motor's size.
constexpr double burst_over_continuous = 3;
// It is pushed for longer than the board says, to see how far the motor then goes over its limit. Chosen: half and
// double change nothing that is told of three logs.
constexpr double push_over_burst = 3, push_more_s = 30;
constexpr double longest_push_s = 600, hour_s = 3600;
constexpr double asked_over_rms = 50;  // currents up to this are asked about: beyond what any drive gives

/// How this motor is usually run: mean speed features under load, mean temperatures around it.
thermal::HeatInput<> working_point(const Problem& problem) {
  thermal::HeatInput<> sum, around;
  double loaded = 0, bins = 0;
  for (const Bins& log : problem.logs) {
    for (const Bin& bin : log.bins) {
      for (int b = 0; b < thermal::boundary_count; ++b) around.boundary_degC[b] += bin.input.boundary_degC[b];
      ++bins;
      if (!(bin.input[Drive::current_A2] > 0.01 * problem.rms_A * problem.rms_A)) continue;
      for (int d = 0; d < thermal::drive_count; ++d) sum.drive[d] += bin.input.drive[d];
      ++loaded;
    }
  }
  for (double& d : sum.drive) d /= std::max(loaded, 1.0);
  for (int b = 0; b < thermal::boundary_count; ++b)
    sum.boundary_degC[b] = around.boundary_degC[b] / std::max(bins, 1.0);
  sum[Drive::one] = 1;
  sum[Drive::power_W] = 0;
  return sum;
}

/// The same, as fast as in the fastest tenth of the logs: where sets that differ by a loss of speed differ most.
thermal::HeatInput<> fast_point(const Problem& problem) {
  std::vector<const thermal::HeatInput<>*> by_speed;
  for (const Bins& log : problem.logs)
    for (const Bin& bin : log.bins) by_speed.push_back(&bin.input);
  thermal::HeatInput<> fast = working_point(problem);
  const std::size_t tenth = (by_speed.size() + 9) / 10;
  std::partial_sort(
      by_speed.begin(), by_speed.begin() + static_cast<std::ptrdiff_t>(tenth), by_speed.end(),
      [](const auto* a, const auto* b) { return (*a)[Drive::speed2_rad2_per_s2] > (*b)[Drive::speed2_rad2_per_s2]; });
  for (const Drive d :
       {Drive::speed_rad_per_s, Drive::speed2_rad2_per_s2, Drive::speed3_rad3_per_s3, Drive::speed_to_0_8}) {
    fast[d] = 0;
    for (std::size_t i = 0; i < tenth; ++i) fast[d] += (*by_speed[i])[d] / static_cast<double>(tenth);
  }
  return fast;
}

/// The working point at a current that turns with the rotor.
thermal::HeatInput<> under(thermal::HeatInput<> input, double amplitude_A) {
  const double square = amplitude_A * amplitude_A;
  for (const Drive phase : {Drive::phase_a_A2, Drive::phase_b_A2, Drive::phase_c_A2}) input[phase] = 0.5 * square;
  input[Drive::current_A2] = square;
  input[Drive::current_A] = amplitude_A;
  input[Drive::current2_speed2] = square * input[Drive::speed2_rad2_per_s2];
  input[Drive::current_speed] = amplitude_A * input[Drive::speed_rad_per_s];
  return input;
}

thermal::HeatInput<> resting(thermal::HeatInput<> input) {
  std::fill(std::begin(input.drive), std::end(input.drive), 0.0);
  input[Drive::one] = 1;
  return input;
}

/// The motor: the set taken for true, and what its housing sensor says.
class Plant {
 public:
  Plant(const thermal::HeatSet<double>& set, const thermal::HeatInput<>& rest)
      : set_(set), network_(set), step_(network_.transition(estimator_dt_s)) {
    degC_ = Network::Vector::Constant(set.node_count, rest[Boundary::ambient]);
    const auto long_step = network_.transition(20.0);
    for (int i = 0; i < 3000; ++i) degC_ = network_.step(long_step, degC_, rest);  // 17 h: at rest with all around it
    sensed_degC_ = seen();
  }
  void advance(const thermal::HeatInput<>& input) {
    degC_ = network_.step(step_, degC_, input);
    const double lag_s = set_.housing.lag_s;
    sensed_degC_ += (seen() - sensed_degC_) * (lag_s > 0 ? 1 - std::exp(-estimator_dt_s / lag_s) : 1);
  }
  double over_limit_K() const {
    double most = -1e300;
    for (int i = 0; i < set_.node_count; ++i)
      most = std::max(most, degC_[i] - static_cast<double>(set_.nodes[i].max_degC));
    return most;
  }
  thermal::Reading housing() const { return {static_cast<float>(sensed_degC_), true}; }

 private:
  double seen() const {
    const double T = degC_[set_.housing.node];
    return T + set_.housing.offset_K + set_.housing.gain_error * (T - 25);
  }
  const thermal::HeatSet<double>& set_;
  Network network_;
  thermal::Transition<double> step_;
  Network::Vector degC_;
  double sensed_degC_ = 0;
};

struct Answers {
  double continuous_A;  // amplitude
  double burst_s, overshoot_K;
};

/// What a board that runs `believed` says and does. `burst_A` 0: not asked yet.
Answers answers_of(const thermal::HeatSet<double>& believed, const thermal::Trust& trust,
                   const thermal::HeatSet<double>& truth, const thermal::HeatInput<>& work, double most_A,
                   double burst_A) {
  thermal::EstimatorSettings settings;
  settings.trust = trust;
  Plant plant(truth, resting(work));
  CoreEstimator core(believed, settings);
  const thermal::Reading ambient{static_cast<float>(work[Boundary::ambient]), true};
  // A second at rest: the board has heard its sensors.
  for (double t_s = 0; t_s < 1; t_s += estimator_dt_s) core.tick(resting(work), plant.housing(), ambient);
  core.tick(under(work, 0), plant.housing(), ambient);
  const thermal::LookAhead look(core.network());
  Answers out{};
  // Found to a thousandth of the most that is asked about: once to know where, once more closely.
  const auto for_an_hour_A = [&](double most) {
    return static_cast<double>(look.current_for_A(core, static_cast<float>(hour_s), static_cast<float>(most), turning));
  };
  out.continuous_A = for_an_hour_A(2 * for_an_hour_A(most_A));
  if (burst_A <= 0) return out;
  out.burst_s = static_cast<double>(look.seconds_left(core, static_cast<float>(burst_A), turning));

  thermal::GovernorSettings limits;
  limits.max_A = static_cast<float>(burst_A);
  thermal::Governor governor(limits);
  const double push_s = std::min(longest_push_s, push_over_burst * out.burst_s + push_more_s);
  double allowed_A = static_cast<double>(governor.tick(core).current_A);
  for (double t_s = 0; t_s < push_s; t_s += estimator_dt_s) {
    const auto input = under(work, std::min(allowed_A, burst_A));
    plant.advance(input);
    core.tick(input, plant.housing(), ambient);
    allowed_A = static_cast<double>(governor.tick(core).current_A);
    out.overshoot_K = std::max(out.overshoot_K, plant.over_limit_K());
  }
  return out;
}

}  // namespace

std::optional<Gain> gain_of(const Problem& problem, const Fit& baseline, const Fit& extended) {
  if (!problem.in_amperes()) return std::nullopt;
  const auto before_set = heat_set_of(problem, baseline), truth = heat_set_of(problem, extended);
  if (!thermal::validate(before_set, estimator_dt_s).ok() || !thermal::validate(truth, estimator_dt_s).ok())
    return std::nullopt;
  const thermal::HeatInput<> work = working_point(problem);
  const thermal::Trust trust = trust_of(problem, extended);
  const double most_A = asked_over_rms * problem.rms_A;
  const double continuous_A = answers_of(truth, trust, truth, work, most_A, 0).continuous_A;
  if (!(continuous_A > 0)) return std::nullopt;
  const double burst_A = burst_over_continuous * continuous_A;
  const Answers before = answers_of(before_set, trust_of(problem, baseline), truth, work, most_A, burst_A),
                after = answers_of(truth, trust, truth, work, most_A, burst_A);
  using thermal::direct_A;
  return Gain{.like = {},
              .overshoot_before_K = before.overshoot_K,
              .overshoot_after_K = after.overshoot_K,
              .burst_s_before = before.burst_s,
              .burst_s_after = after.burst_s,
              .continuous_A_before = direct_A(before.continuous_A),
              .continuous_A_after = direct_A(after.continuous_A),
              .burst_A = direct_A(burst_A),
              .speed_rad_per_s = work[Drive::speed_rad_per_s],
              .ambient_degC = work[Boundary::ambient]};
}

Offer most_cautious(const Problem& problem, const std::vector<Offer>& offers) {
  if (!problem.in_amperes()) return offers.front();
  const thermal::HeatInput<> work = working_point(problem), fast = fast_point(problem);
  const double most_A = asked_over_rms * problem.rms_A;
  struct Asked {
    const Offer* offer;
    thermal::HeatSet<double> set;
    double fast_A;  // for an hour
  };
  std::vector<Asked> asked;
  const auto answers = [&](const Asked& a, const thermal::HeatInput<>& at, double burst_A) {
    return answers_of(a.set, a.offer->trust, a.set, at, most_A, burst_A);
  };
  // One current for all, above what any of them carries for an hour.
  double burst_A = 0, least_A = std::numeric_limits<double>::infinity();
  for (const Offer& offer : offers) {
    Asked a{&offer, heat_set_of(problem, offer.fit), 0};
    if (!thermal::validate(a.set, estimator_dt_s).ok()) continue;
    a.fast_A = answers(a, fast, 0).continuous_A;
    least_A = std::min(least_A, a.fast_A);
    burst_A = std::max(burst_A, burst_over_continuous * answers(a, work, 0).continuous_A);
    asked.push_back(a);
  }
  if (!(burst_A > 0)) return offers.front();
  const Asked* best = nullptr;
  double least_s = std::numeric_limits<double>::infinity();
  for (const Asked& a : asked) {
    const double s = answers(a, work, burst_A).burst_s;
    if (!best || s < least_s) least_s = s, best = &a;
  }
  // The board limits a rise of 1 + 2 sigma; what one of them must not carry for an hour is not carried.
  Offer given = *best->offer;
  const double more_heat = best->fast_A * best->fast_A / (least_A * least_A) - 1;
  given.trust.cooling = std::max(given.trust.cooling, static_cast<float>(std::min(0.5 * more_heat, 0.5)));
  return given;
}

}  // namespace identify

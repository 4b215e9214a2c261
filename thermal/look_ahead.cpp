// SPDX-License-Identifier: MIT
#include "thermal/look_ahead.hpp"

#include <cmath>
#include <limits>

namespace thermal {

namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

/// The drives of a future step: speeds and powers go on as they are, everything that follows current is replaced.
HeatInput<> future_input(const CoreEstimator& core, float current_A, const PhaseShares& shares) {
  HeatInput<> input = core.input();
  const double i_A = std::abs(static_cast<double>(current_A)), i_A2 = i_A * i_A;  // what goes the other way heats too
  for (int k = 0; k < 3; ++k) {
    input[phase_drive(k)] = i_A2 * static_cast<double>(shares.k[k]);
  }
  input[Drive::current_A2] = i_A2;
  input[Drive::current_A] = i_A;
  input[Drive::current2_speed2] = i_A2 * input[Drive::speed2_rad2_per_s2];
  input[Drive::current_speed] = i_A * input[Drive::speed_rad_per_s];
  input[Drive::enabled] = 1.0;  // a bridge at rest is asked what it will do
  input[Drive::power_W] = 0.0;  // bus power and ripple of the past say nothing about the next motion
  return input;
}

/// Where the estimator stands, after a rest; what is over its limit already is said at once.
Walk begin_walk(const CoreEstimator& core, double rest_s) {
  const Estimate& now = core.estimate();
  Walk walk;
  walk.degC.resize(now.node_count);
  for (int i = 0; i < now.node_count; ++i) {
    walk.degC[i] = std::isfinite(now.max_degC[i]) ? static_cast<double>(now.margin_degC[i]) : now.degC[i];
  }
  if (rest_s > 0.0) {
    walk.degC = core.network().step(core.network().transition(rest_s), walk.degC,
                                    future_input(core, 0.0f, {{0.0f, 0.0f, 0.0f}}));
  }
  walk.began_degC = walk.degC;
  walk.forecast = {true, -infinity, infinity};
  float least_room_K = infinity;
  for (int i = 0; i < now.node_count; ++i) {
    const float degC = static_cast<float>(walk.degC[i]), room_K = now.max_degC[i] - degC;
    if (!std::isfinite(now.max_degC[i])) continue;
    if (!(room_K >= least_room_K)) least_room_K = room_K, walk.forecast.peak_degC = degC;
    if (!(room_K >= 0.0f)) walk.forecast.feasible = false, walk.forecast.limits_after_s = 0.0f;
  }
  return walk;
}

/// One step, or its first `left_s`; returns the seconds that were walked.
double step_walk(Walk& walk, const CoreEstimator& core, const Transition<double>& t, const HeatInput<>& input,
                 double left_s) {
  const Estimate& now = core.estimate();
  const HeatNetwork<double>::Vector next = core.network().step(t, walk.degC, input);
  const double part = left_s < t.dt_s ? left_s / t.dt_s : 1.0;  // of the last step: a straight line within 10 ms
  const Walk last = walk;
  walk.degC += part * (next - walk.degC);
  for (int i = 0; i < now.node_count; ++i) {
    if (!std::isfinite(now.max_degC[i])) continue;
    const double before = last.margin_degC(i), after = walk.margin_degC(i),
                 limit = static_cast<double>(now.max_degC[i]);
    if (!(after <= static_cast<double>(walk.forecast.peak_degC))) walk.forecast.peak_degC = static_cast<float>(after);
    if (after <= limit) continue;
    const double within = after > before ? (limit - before) / (after - before) : 0.0;
    const float at_s = static_cast<float>(walk.time_s + part * t.dt_s * (within > 0.0 ? within : 0.0));
    if (!(at_s >= walk.forecast.limits_after_s)) walk.forecast.limits_after_s = at_s;
    walk.forecast.feasible = false;
  }
  walk.time_s += part * t.dt_s;
  return part * t.dt_s;
}

bool usable(const Piece& piece) {
  return piece.seconds >= 0.0f && piece.seconds < 1e6f && std::abs(piece.current_A) < 1e4f;
}

/// Where a board's question begins.
Walk begin_at(const CoreEstimator& core) {
  Walk walk = begin_walk(core, 0.0);
  walk.growth = static_cast<double>(core.load_margin() - 1.0f);
  walk.heard_node = core.heard_node();
  return walk;
}

}  // namespace

double Walk::margin_degC(int node) const {
  const double shared_K = heard_node < 0 ? 0.0 : degC[heard_node] - began_degC[heard_node];
  const double rise_K = degC[node] - began_degC[node] - shared_K;
  return rise_K > 0.0 ? degC[node] + growth * rise_K : degC[node];
}

LookAhead::LookAhead(const HeatNetwork<double>& network)
    : fine_(network.transition(0.01)), middle_(network.transition(0.1)), coarse_(network.transition(5.0)) {}

/// Plays one piece; false when there is no more sense in going on (limit passed, or too long to look at).
bool LookAhead::advance(Walk& run, int& steps, const CoreEstimator& core, const Piece& piece,
                        const PhaseShares& shares) const {
  const HeatInput<> input = future_input(core, piece.current_A, shares);
  double done_s = 0.0;
  const double whole_s = static_cast<double>(piece.seconds);
  while (done_s < whole_s) {
    if (++steps > most_steps) {
      run.forecast.feasible = false;
      run.forecast.limits_after_s = static_cast<float>(run.time_s);
      return false;
    }
    const double left_s = whole_s - done_s;
    const Transition<double>& t = done_s < 1.0 || left_s < 0.1    ? fine_
                                  : done_s < 20.0 || left_s < 5.0 ? middle_
                                                                  : coarse_;
    const double walked_s = step_walk(run, core, t, input, left_s);
    done_s += walked_s;
    if (walked_s < t.dt_s) break;
  }
  return true;
}

Forecast LookAhead::play_after(double rest_s, const CoreEstimator& core, const Piece* pieces, int count,
                               const PhaseShares& shares) const {
  Walk run = begin_walk(core, rest_s);
  int steps = 0;
  for (int i = 0; i < count; ++i) {
    const Piece& piece = pieces[i];
    if (!usable(piece)) {
      run.forecast.feasible = false;
      if (!(run.forecast.limits_after_s <= static_cast<float>(run.time_s)))
        run.forecast.limits_after_s = static_cast<float>(run.time_s);
      break;
    }
    if (!advance(run, steps, core, piece, shares)) break;
  }
  return run.forecast;
}

Forecast LookAhead::play(const CoreEstimator& core, const Piece* pieces, int count, const PhaseShares& shares) const {
  return play_after(0.0, core, pieces, count, shares);
}

float LookAhead::wait_s(const CoreEstimator& core, const Piece* pieces, int count, const PhaseShares& shares) const {
  const auto fits = [&](double rest_s) { return play_after(rest_s, core, pieces, count, shares).feasible; };
  if (fits(0.0)) return 0.0f;
  double enough_s = 0.01;
  while (!fits(enough_s)) {
    enough_s *= 2.0;
    if (!(enough_s < 4.0 * 3600.0)) return infinity;
  }
  double short_s = enough_s > 0.01 ? 0.5 * enough_s : 0.0;
  for (int i = 0; i < 7; ++i) {
    const double middle_s = 0.5 * (short_s + enough_s);
    (fits(middle_s) ? enough_s : short_s) = middle_s;
  }
  return static_cast<float>(enough_s);
}

float LookAhead::seconds_left(const CoreEstimator& core, float current_A, const PhaseShares& shares) const {
  const Piece hour{3600.0f, current_A};
  return play(core, &hour, 1, shares).limits_after_s;
}

float LookAhead::current_for_A(const CoreEstimator& core, float seconds, float max_A, const PhaseShares& shares) const {
  const auto fits = [&](float current_A) {
    const Piece piece{seconds, current_A};
    return play(core, &piece, 1, shares).feasible;
  };
  if (fits(max_A)) return max_A;
  float good_A = 0.0f, bad_A = max_A;
  for (int i = 0; i < 10; ++i) {  // to a thousandth of max_A, always on the safe side
    const float middle_A = 0.5f * (good_A + bad_A);
    (fits(middle_A) ? good_A : bad_A) = middle_A;
  }
  return good_A;
}

bool ProfileRun::begin(const CoreEstimator& core, const Piece* pieces, int count, const PhaseShares& shares,
                       float ripple_A2) {
  if (count < 1 || count > most_pieces) return false;
  float whole_s = 0.0f;
  asked_As_ = before_As_ = done_s_ = 0.0;
  for (int i = 0; i < count; ++i) {
    if (!usable(pieces[i])) return false;
    pieces_[i] = pieces[i];
    whole_s += pieces[i].seconds;
    asked_As_ += static_cast<double>(pieces[i].seconds * std::abs(pieces[i].current_A));
  }
  if (!(whole_s <= most_s)) return false;
  count_ = count;
  piece_ = 0;
  shares_ = shares;
  ripple_A2_ = ripple_A2 <= 0.0f ? 0.0 : static_cast<double>(ripple_A2);  // NaN stays: it is not feasible
  walk_ = begin_at(core);
  return true;
}

bool ProfileRun::go_on(const CoreEstimator& core, int most_steps) {
  for (int step = 0; step < most_steps && piece_ < count_; ++step) {
    const Piece& piece = pieces_[piece_];
    const double left_s = static_cast<double>(piece.seconds) - done_s_, from_s = walk_.time_s;
    if (left_s > 0.0) {
      HeatInput<> input = future_input(core, piece.current_A, shares_);
      input[Drive::speed_to_0_8] = 0.0;  // what turns now may stand then
      for (int k = 0; k < 3; ++k) input[phase_drive(k)] += 0.5 * ripple_A2_;
      input[Drive::current_A2] += ripple_A2_;
      done_s_ += step_walk(walk_, core, core.transition(), input, left_s);
      const double until_s = std::fmin(walk_.time_s, static_cast<double>(walk_.forecast.limits_after_s));
      if (until_s > from_s) before_As_ += (until_s - from_s) * static_cast<double>(std::abs(piece.current_A));
    }
    if (left_s <= core.transition().dt_s) ++piece_, done_s_ = 0.0;
  }
  return piece_ == count_;
}

Endurance::Endurance(const HeatNetwork<double>& network, float max_A)
    : coarse_(network.transition(0.25)), max_A_(max_A), left_(sum()) {}

std::uint32_t Endurance::sum() const {
  const Forecast& found = walk_.forecast;
  return FlipSum()
      .add(coarse_.phi0, coarse_.phi1, coarse_.phi2, coarse_.dt_s, max_A_, sum_, slices_, shares_, walk_.degC,
           walk_.began_degC, walk_.growth, walk_.heard_node, walk_.time_s, found.feasible, found.peak_degC,
           found.limits_after_s, piece_, good_A_, bad_A_, walking_, seconds_left_, current_A_)
      .word();
}

void Endurance::begin(const CoreEstimator& core) {
  if (piece_.seconds == longest_s) {
    for (int k = 0; k < 3; ++k) sum_[phase_drive(k)] /= slices_;
    shares_ = phase_shares(sum_);
    piece_.current_A = static_cast<float>(
        std::sqrt((sum_[Drive::phase_a_A2] + sum_[Drive::phase_b_A2] + sum_[Drive::phase_c_A2]) / 1.5));
    sum_ = {};
    slices_ = 0;
  }
  walk_ = begin_at(core);
  walking_ = true;
}

/// Takes the walk's answer and chooses what to ask next; true: the last was.
bool Endurance::answer() {
  walking_ = false;
  if (piece_.seconds == longest_s) {
    seconds_left_ = walk_.forecast.limits_after_s;
    piece_ = {ahead_s, max_A_};
    good_A_ = 0.0f, bad_A_ = max_A_;
    return false;
  }
  (walk_.forecast.feasible ? good_A_ : bad_A_) = piece_.current_A;
  piece_.current_A = 0.5f * (good_A_ + bad_A_);
  if (bad_A_ - good_A_ > 0.01f * max_A_) return false;
  current_A_ = good_A_;
  piece_ = {longest_s, 0.0f};
  return true;
}

void Endurance::forget() {
  if (!whole()) return;
  sum_ = {};
  slices_ = 0;
  walking_ = false;
  piece_ = {longest_s, 0.0f};
  seconds_left_ = current_A_ = 0.0f;
  left_ = sum();
}

bool Endurance::go_on(const CoreEstimator& core, int steps) {
  bool anew = false;
  for (int k = 0; k < 3; ++k) sum_[phase_drive(k)] += core.input()[phase_drive(k)];
  ++slices_;
  for (int step = 0; step < steps; ++step) {
    if (!walking_) begin(core);
    const double left_s = static_cast<double>(piece_.seconds) - walk_.time_s;
    const Transition<double>& t = walk_.time_s < coarse_.dt_s ? core.transition() : coarse_;
    if (walk_.forecast.feasible) step_walk(walk_, core, t, future_input(core, piece_.current_A, shares_), left_s);
    if (left_s <= t.dt_s || !walk_.forecast.feasible) anew = answer() || anew;
  }
  left_ = sum();
  return anew;
}

}  // namespace thermal

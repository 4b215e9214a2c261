// SPDX-License-Identifier: MIT
#include "thermal/core_estimator.hpp"

#include <cmath>
#include <limits>
#include <new>

namespace thermal {

namespace {

constexpr double dt_s = estimator_dt_s;
constexpr float dt_f = static_cast<float>(estimator_dt_s);

// Between these a temperature can be true; outside them the arithmetic or the memory is broken.
constexpr double coldest_degC = -60.0, hottest_possible_degC = 1000.0;
constexpr int most_lost_steps = 200;     // 2 s: no watchdog waits longer
constexpr float most_follow = 1.4f;      // K of a winding by which copper follows a kelvin of its housing
constexpr float unheard_sigma_K = 3.0f;  // that housing and ambient are less known by, once nothing tells them; chosen
constexpr float start_sigma_K = 15.0f, most_sigma_K = 100.0f;  // the latter as it is kept: more says no more
constexpr float restored_hotter_K = 10.0f;
constexpr float known_sigma_K = 3.0f;     // of a housing that is known: from here on its sensor pulls little; chosen
constexpr float soaked_within_K = 1.0f;   // of the housing: what a start that believes it may be off
constexpr float unknown_below_K = 10.0f;  // safety table: limit minus 10 K until probed

// Drift of the ambient: 10 K in 20 min, at most 10 K off while it is observed; it also takes up cooling that differs
// from the sheet's. Of any node: 0.1 K in a second's square root, what no parameter explains.
constexpr float ambient_walk_K2_per_s = 100.0f / 1200.0f, ambient_worst_K = 10.0f, node_walk_K2_per_s = 1e-2f;

// One sigma of what a housing sensor may lag beside what was told, where only the sheet is known; in proportion less
// where the trust says that more is. Glued or potted ones lag 10..60 s, and the rms of anything up to 60 s is 35 s.
constexpr double untold_lag_s = 35.0, told_lag_share = 0.5;  // the latter, of what was told: chosen

float squared(float x) { return x * x; }

bool plausible(double degC) { return degC > coldest_degC && degC < hottest_possible_degC; }  // false for NaN

}  // namespace

float Estimate::hottest_margin_degC() const {
  float hottest = -std::numeric_limits<float>::infinity();
  for (int i = 0; i < node_count; ++i) {
    if (std::isfinite(max_degC[i]) && !(margin_degC[i] <= hottest)) hottest = margin_degC[i];
  }
  return hottest;
}

double Estimate::hottest_degC() const {
  double hottest = -std::numeric_limits<double>::infinity();
  for (int i = 0; i < node_count; ++i) {
    if (std::isfinite(max_degC[i]) && !(degC[i] <= hottest)) hottest = degC[i];
  }
  return hottest;
}

CoreEstimator::CoreEstimator(const HeatSet<double>& set, const EstimatorSettings& settings)
    : network_(set),
      transition_(network_.transition(dt_s)),
      settings_(settings),
      housing_(set.housing),
      n_(set.node_count),
      ambient_degC_(static_cast<double>(settings.ambient_degC)) {
  for (int i = 0; i < n_; ++i) max_degC_[i] = set.nodes[i].max_degC;
  degC_ = Vector::Constant(n_, ambient_degC_);
  good_degC_ = degC_;
  good_ambient_degC_ = ambient_degC_;
  sensor_degC_ = sensed_degC(ambient_degC_);
  watch_.model_jumped(static_cast<float>(sensor_degC_));
  input_[Boundary::ambient] = ambient_degC_;
  for (Boundary b : {Boundary::coolant, Boundary::frame, Boundary::neighbour}) input_[b] = ambient_degC_;
  due_K_ = due_margin_K_ = doubted_K_ = kept_K_ = Row::Zero(n_ + 5);
  const double doubt = static_cast<double>(settings.trust.inner_resistance / sheet_trust.inner_resistance);
  const double late_s = doubt * (housing_.lag_s > 0.0 ? told_lag_share * housing_.lag_s : untold_lag_s);
  late_take_ = dt_s / (dt_s + housing_.lag_s + late_s);
  widen_all();
  soak();
  publish();
}

/// Whatever the housing turns out to be, the winding is too.
void CoreEstimator::soak() {
  p_.topLeftCorner(n_, n_).setConstant(squared(start_sigma_K));
  p_.row(sensor()) = p_.row(housing_.node);
  p_.col(sensor()) = p_.col(housing_.node);
  p_(sensor(), sensor()) = squared(start_sigma_K);
}

/// Nothing is known about the temperatures but the state itself; the parameters stay what the trust says.
void CoreEstimator::widen_all() {
  p_ = Covariance::Zero(n_ + 5, n_ + 5);
  late_shared_K_ = Row::Zero(n_ + 5);
  for (int i = 0; i < n_; ++i) p_(i, i) = squared(start_sigma_K);
  p_(ambient(), ambient()) = squared(settings_.ambient_sigma_K);
  p_(sensor(), sensor()) = squared(start_sigma_K);
  const float trust[3] = {settings_.trust.power, settings_.trust.inner_resistance, settings_.trust.cooling};
  for (int i = 0; i < 3; ++i) p_(n_ + 2 + i, n_ + 2 + i) = squared(trust[i]);
  // The states are power over capacity and conductance: both signs turned.
  p_(n_ + 2, n_ + 3) = p_(n_ + 3, n_ + 2) = settings_.trust.correlation * trust[0] * trust[1];
}

const Estimate& CoreEstimator::tick(const HeatInput<>& input, Reading housing, Reading measured_ambient,
                                    int lost_steps) {
  flags_ &= ~(input_replaced | lost_time | state_restored);
  if (!take_input(input)) flags_ |= input_replaced;
  if (lost_steps > 0) {
    flags_ |= lost_time;
    for (int i = 0; i < lost_steps && i < most_lost_steps; ++i) step();
    if (lost_steps > most_lost_steps) raise_to(static_cast<float>(hottest_limit_degC()) - unknown_below_K);
  }
  ambient_known_ = measured_ambient.usable();
  if (ambient_known_) ambient_degC_ = static_cast<double>(measured_ambient.value);
  step();
  hear_housing(housing);
  guard_state();
  publish();
  return estimate_;
}

/// Takes over what is usable; what is not becomes the last value times 1.1, a current the full scale. False if any was.
bool CoreEstimator::take_input(const HeatInput<>& input) {
  bool good = true;
  for (int i = 0; i < drive_count; ++i) {
    const double x = input.drive[i];
    if (x >= 0.0 && std::isfinite(x)) {
      input_.drive[i] = x;
      continue;
    }
    good = false;
    input_.drive[i] *= 1.1;
    const bool square = is_current_square(static_cast<Drive>(i));
    const double full_scale = square ? static_cast<double>(settings_.full_scale_A2) : 1e4;
    if (square || !(input_.drive[i] < full_scale)) input_.drive[i] = full_scale;
  }
  input_[Drive::one] = 1.0;  // constant heat does not wait to be reported
  for (Boundary b : {Boundary::coolant, Boundary::frame, Boundary::neighbour}) {
    if (plausible(input[b])) {
      input_[b] = input[b];
    } else {
      good = false;
    }
  }
  return good;
}

void CoreEstimator::step() {
  input_[Boundary::ambient] = ambient_degC_;
  propagate_covariance(network_.rates(degC_, input_));
  degC_ = network_.step(transition_, degC_, input_);
  const double target = sensed_degC(degC_[housing_.node]);
  const double moved_K = (target - sensor_degC_) / (1.0 + housing_.lag_s / dt_s);
  late_K_ += moved_K - late_take_ * (target - sensor_degC_ + late_K_);
  sensor_degC_ += moved_K;
}

/// What the sensor reads of a housing that has been as warm as this for long, and the other way round.
double CoreEstimator::sensed_degC(double housing_degC) const {
  return housing_degC * (1.0 + housing_.gain_error) - 25.0 * housing_.gain_error + housing_.offset_K;
}
double CoreEstimator::housing_of_degC(double sensed_degC) const {
  return (sensed_degC + 25.0 * housing_.gain_error - housing_.offset_K) / (1.0 + housing_.gain_error);
}

/// P = F P F' + Q with F = [phi0, phi1 d(rate)/d(ambient, parameters); 0, 1], and the sensor's lag as a row of its own.
/// What the untold lag shares with the states moves with them.
void CoreEstimator::propagate_covariance(const HeatNetwork<double>::Rates& rates) {
  const int size = n_ + 5;
  using Mat = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, 0, max_nodes, max_nodes>;
  using Vec = Eigen::Matrix<float, Eigen::Dynamic, 1, 0, max_nodes, 1>;
  const Mat phi1 = transition_.phi1.cast<float>();
  Covariance f = Covariance::Identity(size, size);
  Mat nodes = transition_.phi0.cast<float>();
  const Vec slope = rates.source_slope_per_s.cast<float>();
  for (int i = 0; i < n_; ++i) nodes.col(i) += phi1.col(i) * slope[i];  // hot copper heats more
  f.topLeftCorner(n_, n_) = nodes;
  const auto column = [&](int index, const Vec& rate) { f.col(index).head(n_) = phi1.lazyProduct(rate); };
  column(ambient(), network_.boundary_gain_per_s(Boundary::ambient).cast<float>());
  // A winding whose capacity is off warms and cools at another rate, and the housing gets no more for it.
  Vec warming = (rates.sources + rates.inner + rates.outer).cast<float>();
  for (int i = 0; i < n_; ++i) {
    if (!std::isfinite(max_degC_[i])) warming[i] = 0.0f;
  }
  column(n_ + 2, warming);
  column(n_ + 3, rates.inner.cast<float>());
  column(n_ + 4, rates.outer.cast<float>());
  const float take = 1.0f / (1.0f + static_cast<float>(housing_.lag_s) / dt_f);
  f.row(sensor()) = f.row(housing_.node) * (take * (1.0f + static_cast<float>(housing_.gain_error)));
  f(sensor(), sensor()) = 1.0f - take;

  const Covariance fp = f.lazyProduct(p_);
  p_ = fp.lazyProduct(f.transpose());
  late_shared_K_ = f.lazyProduct(late_shared_K_).eval();
  doubted_K_ = f.lazyProduct(doubted_K_).eval();
  kept_K_ = f.lazyProduct(kept_K_).eval();
  for (int i = 0; i < n_; ++i) p_(i, i) += node_walk_K2_per_s * dt_f;
  if (watch_.housing_known() && p_(ambient(), ambient()) < squared(ambient_worst_K))
    p_(ambient(), ambient()) += ambient_walk_K2_per_s * dt_f;
  if (ambient_known_) {
    p_.row(ambient()).setZero();
    p_.col(ambient()).setZero();
    late_shared_K_[ambient()] = 0.0f;
    p_(ambient(), ambient()) = 1.0f;  // a sensor beside the motor is good to 1 K
  }
}

void CoreEstimator::hear_housing(Reading housing) {
  watch_.model_moved(static_cast<float>(sensor_degC_) - kept_K_[sensor()]);
  settle(1);
  const auto heard = watch_.hear(housing, sensor_degC_ + static_cast<double>(due_K_[sensor()]));
  if (heard.fell_silent) lose_surroundings();
  if (!heard.full) return;
  if (!watch_.housing_known()) believe_ambient_below(housing_of_degC(static_cast<double>(heard.reading_degC)));
  if (heard.first && resumed_ && housing_.lag_s > 0.0)
    meet_sensor(heard.reading_degC);
  else if (watch_.housing_known())
    follow_housing(heard.above_model_K);
  else
    meet_housing(heard.reading_degC, heard.above_model_K);
}

/// Nothing tells any more what housing and ambient are.
void CoreEstimator::lose_surroundings() {
  p_(housing_.node, housing_.node) += squared(unheard_sigma_K);
  p_(ambient(), ambient()) += squared(unheard_sigma_K);
}

/// The ambient is hardly warmer than a soaked housing, and believed no colder than a room.
void CoreEstimator::believe_ambient_below(double housing_degC) {
  if (!ambient_known_ && housing_degC < ambient_degC_) ambient_degC_ = housing_degC > 20.0 ? housing_degC : 20.0;
}

/// The first reading of a sensor that lags says where the sensor is; the next, by how it moves, where the housing is.
void CoreEstimator::meet_sensor(float reading_degC) {
  sensor_degC_ = static_cast<double>(reading_degC);
  watch_.model_jumped(reading_degC - kept_K_[sensor()]);
  p_.row(sensor()).setZero();
  p_.col(sensor()).setZero();
  late_shared_K_[sensor()] = 0.0f;
  late_K_ = 0.0;
  p_(sensor(), sensor()) = squared(settings_.housing_noise_K);
  raise_to(static_cast<float>(housing_of_degC(sensor_degC_)));
}

/// The minute is over, and a start that was a guess would contradict the sensor for hours: it is as cold as it reads,
/// with what is left as margin.
void CoreEstimator::doubt(float left_K) {
  degC_.array() -= static_cast<double>(left_K);
  sensor_degC_ -= static_cast<double>(left_K);
  watch_.model_corrected(-left_K);
  doubted_K_.head(n_).array() += left_K;
  doubted_K_[sensor()] += left_K;
}

/// Until the housing is known its readings count without limit.
void CoreEstimator::meet_housing(float reading_degC, float above_model_K) {
  const Vector before_degC = degC_;
  const float no_limit_K = std::numeric_limits<float>::infinity();
  if (!correct_by_sensor(above_model_K, no_limit_K, 1)) return;
  const int h = housing_.node;
  const bool known = watch_.meet(p_(h, h) + squared(late_shared_K_[h]) < squared(known_sigma_K), ambient_degC_);
  // After a reset the winding does not follow the housing by itself.
  raise_to(static_cast<float>(housing_of_degC(static_cast<double>(reading_degC))));
  if (remembers_) {
    const Vector fall_K = before_degC - degC_;
    doubted_K_.head(n_) += fall_K.cast<float>();
    kept_K_.head(n_) += (Vector::Constant(n_, fall_K[h]) - fall_K).cast<float>();
  }
  const float left_K = static_cast<float>(sensor_degC_) - reading_degC;
  if (known && guessed_ && left_K > least_gate_K) doubt(left_K);
}

/// From then on only as far as its sensor is believed.
void CoreEstimator::follow_housing(float above_model_K) {
  const float late_K = late_shared_K_[sensor()] - static_cast<float>(late_K_);
  const float sigma_K = std::sqrt(p_(sensor(), sensor()) + squared(late_K) + squared(settings_.housing_noise_K));
  const auto verdict = watch_.judge(above_model_K, sigma_K, std::fmax(kept_K_[sensor()], 0.0f), ambient_degC_);
  if (verdict.lives) doubted_K_.setZero();
  if (verdict.believed)
    correct_by_sensor(verdict.counts_as_above_K, verdict.most_down_K, HousingWatch::window_steps);
  else if (verdict.believed_till_now)
    give_back();
}

bool CoreEstimator::correct_by_sensor(float above_model_K, float most_down_K, int over_steps) {
  Row seen = Row::Zero(n_ + 5);
  seen[sensor()] = 1.0f;
  return correct(seen, above_model_K, squared(settings_.housing_noise_K), static_cast<float>(late_K_), most_down_K,
                 over_steps);
}

/// What a sensor had taken away that is no longer believed.
void CoreEstimator::give_back() {
  settle(due_steps_);
  due_margin_K_ = doubted_K_.cwiseMax(0.0f);  // until it has flowed in
  due_K_ = due_margin_K_ + Row::Constant(n_ + 5, watch_.pulled_K());
  doubted_K_.setZero();
  due_K_[ambient()] = std::fmax(static_cast<float>(watch_.trusted_ambient_degC() - ambient_degC_), 0.0f);
  due_steps_ = HousingWatch::window_steps;
  lose_surroundings();
}

/// How far a correction lowers the winding, K; negative if it raises all of them. What the housing falls the windings
/// will, even those that it shares no error with.
float CoreEstimator::down_by(const Row& gain, float innovation_K) const {
  float down_K = -std::numeric_limits<float>::infinity();
  for (int i = 0; i < n_; ++i) {
    const float fall_K = -gain[i] * innovation_K;
    if ((std::isfinite(max_degC_[i]) || i == housing_.node) && fall_K > down_K) down_K = fall_K;
  }
  return down_K;
}

/// Lets `steps` parts of the correction that is due flow into the state.
void CoreEstimator::settle(int steps) {
  if (due_steps_ <= 0 || steps <= 0) return;
  const float part = static_cast<float>(steps) / static_cast<float>(due_steps_);
  for (int i = 0; i < n_; ++i) degC_[i] += static_cast<double>(part * due_K_[i]);
  ambient_degC_ += static_cast<double>(part * due_K_[ambient()]);
  sensor_degC_ += static_cast<double>(part * due_K_[sensor()]);
  watch_.model_corrected(part * due_K_[sensor()]);
  due_K_ *= 1.0f - part;
  due_margin_K_ *= 1.0f - part;
  due_steps_ -= steps;
}

/// Schmidt-Kalman correction in Joseph form by a reading that may be late_K too low for each sigma of the untold lag
/// (an error that stays, and that no reading teaches: hearing it twice a second makes nothing surer), shortened so that
/// it lowers no winding by more than most_down_K. It flows in over some steps: a jump of the estimate would be a jump
/// of the allowance, which drops the robot.
bool CoreEstimator::correct(const Row& seen, float innovation_K, float variance_K2, float late_K, float most_down_K,
                            int over_steps) {
  Row shared = Row::Zero(n_ + 5);
  shared = p_.lazyProduct(seen);
  float expected_K2 = seen.dot(shared) + variance_K2;
  // A lag only makes a warming housing read colder: the hotter the reading, the less it is doubted for one. While the
  // model cools a lag would make it read hotter, but so does a model that cools too fast, and that would be cold.
  const bool raises = late_K != 0.0f && innovation_K > 0.0f;
  const float doubt = !raises ? 1.0f : late_K < 0.0f ? 0.0f : 1.0f - innovation_K / least_gate_K;
  const float lag_K = doubt > 0.0f ? doubt * (seen.dot(late_shared_K_) - late_K) : 0.0f;
  shared += late_shared_K_ * lag_K;
  expected_K2 += squared(lag_K);
  if (!(expected_K2 > 0.0f) || !std::isfinite(innovation_K)) return false;
  Row gain = shared / expected_K2;
  gain.tail(3).setZero();  // a housing reading does not teach parameters
  if (ambient_known_ || (!watch_.housing_known() && innovation_K < 0.0f))
    gain[ambient()] = 0.0f;  // the first reading did that
  const float down_K = down_by(gain, innovation_K);
  if (down_K > most_down_K) gain *= most_down_K / down_K;
  if (std::isfinite(most_down_K)) watch_.note_pull(down_by(gain, innovation_K));
  // A housing that is colder than thought may be cooled better; to the filter it also looks like a winding that gets
  // less heat. So a winding falls no further than it would follow.
  if (seen[sensor()] != 0.0f && innovation_K < 0.0f) {
    for (int i = 0; i < n_; ++i) gain[i] = std::fmin(gain[i], most_follow * std::fmax(gain[housing_.node], 0.0f));
  }

  settle(due_steps_);
  due_margin_K_ = margins_K();
  const Covariance keep = Covariance::Identity(n_ + 5, n_ + 5) - gain.lazyProduct(seen.transpose());
  const Covariance half = keep.lazyProduct(p_);
  p_ = half.lazyProduct(keep.transpose());
  p_ += (gain * variance_K2).lazyProduct(gain.transpose());
  // Raised, a state is no colder than it was: what a lag may hide grows only when a reading lowers.
  if (!raises) late_shared_K_ = (keep.lazyProduct(late_shared_K_) + gain * late_K).eval();
  p_ = ((p_ + p_.transpose()) * 0.5f).eval();
  due_K_ = gain * innovation_K;
  due_margin_K_ -= margins_K();
  due_steps_ = over_steps;
  if (over_steps == 1) settle(1);
  return true;
}

/// k sigma of each node.
CoreEstimator::Row CoreEstimator::margins_K() const {
  Row margins = Row::Zero(n_ + 5);
  for (int i = 0; i < n_; ++i) margins[i] = settings_.margin_sigmas * std::sqrt(p_(i, i) + squared(late_shared_K_[i]));
  return margins;
}

void CoreEstimator::observe_winding_ohm(float ohm, float sigma_ohm, float ohm_at_25_degC,
                                        float copper_coefficient_per_K) {
  const float ohm_per_K = ohm_at_25_degC * copper_coefficient_per_K;
  const bool usable = ohm > 0.0f && sigma_ohm > 0.0f && ohm_per_K > 0.0f;
  const float seen_degC = usable ? 25.0f + (ohm - ohm_at_25_degC) / ohm_per_K : std::numeric_limits<float>::quiet_NaN();
  flags_ |= winding_ohm_refused;
  if (hear_winding(seen_degC, sigma_ohm / ohm_per_K)) flags_ &= ~static_cast<std::uint32_t>(winding_ohm_refused);
  guard_state();
  publish();
}

/// A mean winding temperature seen with a known error; false if it cannot be or is colder than four sigmas.
bool CoreEstimator::hear_winding(float seen_degC, float sigma_K) {
  if (!plausible(static_cast<double>(seen_degC)) || !(sigma_K > 0.0f)) return false;
  int windings = 0;
  double sum_degC = 0.0;
  for (int i = 0; i < n_; ++i) {
    if (!std::isfinite(max_degC_[i])) continue;
    ++windings;
    sum_degC += degC_[i];
  }
  if (windings == 0) return false;
  Row seen = Row::Zero(n_ + 5);
  for (int i = 0; i < n_; ++i) seen[i] = std::isfinite(max_degC_[i]) ? 1.0f / static_cast<float>(windings) : 0.0f;
  const float gate_K =
      gate_sigmas * std::sqrt(seen.dot(p_.lazyProduct(seen)) + squared(seen.dot(late_shared_K_)) + squared(sigma_K));
  const float innovation_K = seen_degC - static_cast<float>(sum_degC / windings);
  if (!(innovation_K > -gate_K)) return false;
  // Hotter than believable still counts, but one reading is only one.
  return correct(seen, innovation_K < gate_K ? innovation_K : gate_K, squared(sigma_K), 0.0f,
                 std::numeric_limits<float>::infinity(), 1);
}

void CoreEstimator::raise_to(float winding_degC) {
  if (!plausible(static_cast<double>(winding_degC))) return;
  for (int i = 0; i < n_; ++i) {
    if (std::isfinite(max_degC_[i]) && !(degC_[i] >= static_cast<double>(winding_degC)))
      degC_[i] = static_cast<double>(winding_degC);
  }
  publish();
}

HeatMemory CoreEstimator::save() const {
  HeatMemory memory{n_,
                    {},
                    {},
                    static_cast<float>(ambient_degC_),
                    watch_.contradicts() ? 1u : 0u,
                    late_K_ > 0.0 ? static_cast<float>(late_K_) : 0.0f};
  for (int i = 0; i < n_; ++i) {
    // What is due now is so later, and what is doubted not proven.
    memory.degC[i] = static_cast<float>(degC_[i]) + std::fmax(due_K_[i], 0.0f) + std::fmax(doubted_K_[i], 0.0f);
    memory.sigma_K[i] = estimate_.sigma_K[i];
  }
  return memory;
}

void CoreEstimator::restore(const HeatMemory& memory, double off_s) {
  if (memory.node_count != n_) return start_hot();
  const double believed = static_cast<double>(settings_.ambient_degC);
  const double saved_ambient = static_cast<double>(memory.ambient_degC);
  ambient_degC_ = plausible(saved_ambient) && saved_ambient > believed ? saved_ambient : believed;
  const double hottest = hottest_limit_degC();
  Vector rise(n_);
  float sigma_K[max_nodes];
  for (int i = 0; i < n_; ++i) {
    const double saved = static_cast<double>(memory.degC[i]);
    const double limit = std::isfinite(max_degC_[i]) ? static_cast<double>(max_degC_[i]) : hottest;
    rise[i] = (plausible(saved) ? saved : limit) - ambient_degC_;
    if (!(rise[i] > 0.0)) rise[i] = 0.0;
    sigma_K[i] = memory.sigma_K[i] >= 0.0f ? std::fmin(memory.sigma_K[i], most_sigma_K) : start_sigma_K;
  }
  if (off_s > 0.0 && off_s < 1e9) rise = network_.transition(off_s).phi0.lazyProduct(rise).eval();
  degC_ = rise.array() + ambient_degC_;
  double sum_degC = 0.0;
  int windings = 0;
  for (int i = 0; i < n_; ++i) {
    if (!std::isfinite(max_degC_[i])) continue;
    sum_degC += degC_[i];
    ++windings;
  }
  bool soaked = true;
  for (int i = 0; i < n_; ++i) soaked = soaked && memory.degC[i] <= memory.degC[housing_.node] + soaked_within_K;
  begin_anew(sigma_K);
  remembers_ = memory.degC[housing_.node] > settings_.ambient_degC;  // or it was no warmer than its surroundings
  if (memory.late_K >= 0.0f && memory.late_K < most_sigma_K) late_K_ = static_cast<double>(memory.late_K);
  if (soaked) soak();
  if (windings > 0) raise_to(static_cast<float>(sum_degC / windings));
  for (int i = 0; i < n_; ++i) {  // what was only believed is no memory that a reading contradicts
    const double saved = static_cast<double>(memory.degC[i]);
    if (plausible(saved)) doubted_K_[i] = static_cast<float>(std::fmin(saved - degC_[i], 0.0));
    if (remembers_) kept_K_[i] = static_cast<float>(degC_[i] - degC_[housing_.node]);
  }
  if (memory.disbelieved != 0) {
    watch_.disbelieve();
    know_housing(sigma_K[housing_.node]);
  }
  publish();
}

/// As well as if its sensor had been heard for long.
void CoreEstimator::know_housing(float sigma_K) {
  const int h = housing_.node;
  watch_.know_housing(ambient_degC_);
  p_(h, h) = p_(h, sensor()) = p_(sensor(), h) = p_(sensor(), sensor()) = squared(sigma_K);
}

void CoreEstimator::replace(const HeatSet<double>& set, const EstimatorSettings& settings) {
  const HeatMemory memory = save();
  const HousingSensor<double> described = housing_;
  const HousingWatch record = watch_;
  const float doubted_K = std::fmax(doubted_K_[housing_.node], 0.0f);
  const double sensed = sensor_degC_ + std::fmax(static_cast<double>(due_K_[sensor()]), 0.0);
  new (this) CoreEstimator(set, settings);  // in place: too large for the stack
  restore(memory, 0.0);
  const bool same_sensor = memory.node_count == n_ && described.node == housing_.node &&
                           described.lag_s == housing_.lag_s && described.offset_K == housing_.offset_K &&
                           described.gain_error == housing_.gain_error;
  if (!same_sensor) return;
  watch_ = record;
  watch_.drop_window();
  if (watch_.housing_known() && !watch_.contradicts()) {
    const int h = housing_.node;
    degC_[h] = static_cast<double>(memory.degC[h] - doubted_K);  // not raised: what the sensor said of it stays said
    doubted_K_[h] = doubted_K;
    sensor_degC_ = sensed;
    good_degC_ = degC_;
    know_housing(memory.sigma_K[h]);
    believe_ambient_below(static_cast<double>(memory.ambient_degC));  // it would show at once if that is too cold
  }
  watch_.model_jumped(static_cast<float>(sensor_degC_));
  publish();
}

void CoreEstimator::start_hot() {
  const double hot = hottest_limit_degC() - static_cast<double>(unknown_below_K);
  ambient_degC_ = static_cast<double>(settings_.ambient_degC);
  degC_ = Vector::Constant(n_, hot > ambient_degC_ ? hot : ambient_degC_);
  float sigma_K[max_nodes];
  for (float& s : sigma_K)
    s = settings_.margin_sigmas > 0.0f ? unknown_below_K / settings_.margin_sigmas : start_sigma_K;
  begin_anew(sigma_K);
  guessed_ = true;
}

/// The lowest limit of the windings; without one, class F's 155 degC.
double CoreEstimator::hottest_limit_degC() const {
  float lowest = 155.0f;
  for (int i = 0; i < n_; ++i) {
    if (max_degC_[i] < lowest) lowest = max_degC_[i];
  }
  return static_cast<double>(lowest);
}

/// Nothing but temperatures and their sigmas has survived. What the windings were off by is taken for an error of how
/// fast they warm (the worst case: the next burst adds to it), and for one that the housing does not show.
void CoreEstimator::begin_anew(const float (&sigma_K)[max_nodes]) {
  sensor_degC_ = sensed_degC(degC_[housing_.node]);
  good_degC_ = degC_;
  good_ambient_degC_ = ambient_degC_;
  watch_ = HousingWatch(static_cast<float>(sensor_degC_));
  resumed_ = true;
  remembers_ = guessed_ = false;
  due_steps_ = 0;
  due_K_ = due_margin_K_ = doubted_K_ = kept_K_ = Row::Zero(n_ + 5);
  late_K_ = static_cast<double>(most_sigma_K);  // of a sensor of which nothing is known
  widen_all();
  const int power = n_ + 2, inner = n_ + 3;
  for (int i = 0; i < n_; ++i) {
    if (i == housing_.node) continue;
    for (int j = 0; j < n_; ++j) {
      if (j != housing_.node) p_(i, j) = sigma_K[i] * sigma_K[j];
    }
    p_(i, power) = p_(power, i) = sigma_K[i] * settings_.trust.power;
    p_(i, inner) = p_(inner, i) = settings_.trust.correlation * sigma_K[i] * settings_.trust.inner_resistance;
  }
  p_(sensor(), sensor()) = p_(housing_.node, housing_.node);  // the sensor is as warm as what it sits on
  p_(sensor(), housing_.node) = p_(housing_.node, sensor()) = p_(housing_.node, housing_.node);
  publish();
}

/// A state that is not finite or not possible is replaced by the last good one, hotter, and says so for one call. What
/// has a limit and was not too cold may have been as hot as it seemed: it is at its limit at least.
void CoreEstimator::guard_state() {
  bool good = plausible(ambient_degC_) && plausible(sensor_degC_) && std::abs(late_K_) < hottest_possible_degC;
  for (int i = 0; i < n_; ++i) good = good && plausible(degC_[i]);
  bool sure = true;
  for (int i = 0; i < n_ + 5; ++i)
    sure = sure && p_(i, i) >= 0.0f && p_(i, i) < 1e6f && std::abs(late_shared_K_[i]) < 1e3f;
  for (int i = 0; i < n_ + 5; ++i) {
    if (!(std::abs(doubted_K_[i]) < 1e3f)) doubted_K_[i] = most_sigma_K;
    if (!(std::abs(kept_K_[i]) < 1e3f)) kept_K_[i] = 0.0f;
  }
  if (!sure) widen_all();
  if (good) {
    good_degC_ = degC_;
    good_ambient_degC_ = ambient_degC_;
    return;
  }
  flags_ |= state_restored;
  for (int i = 0; i < n_; ++i) {
    const double last = plausible(good_degC_[i]) ? good_degC_[i] : hottest_possible_degC - 100.0;
    const double limit = static_cast<double>(max_degC_[i]), hotter = last + static_cast<double>(restored_hotter_K);
    degC_[i] = !(degC_[i] <= coldest_degC) && std::isfinite(limit) && limit > hotter ? limit : hotter;
  }
  ambient_degC_ = plausible(good_ambient_degC_) ? good_ambient_degC_ : static_cast<double>(settings_.ambient_degC);
  sensor_degC_ = sensed_degC(degC_[housing_.node]);
  watch_.model_jumped(static_cast<float>(sensor_degC_));
  watch_.forget_movement();
  late_K_ = 0.0;
  due_steps_ = 0;
  due_K_ = due_margin_K_ = Row::Zero(n_ + 5);
  good_degC_ = degC_;
}

void CoreEstimator::publish() {
  estimate_.node_count = n_;
  for (int i = 0; i < n_; ++i) {
    estimate_.degC[i] = degC_[i];
    estimate_.sigma_K[i] = std::sqrt(p_(i, i) + squared(late_shared_K_[i]));
    estimate_.margin_degC[i] = flags_ & state_restored
                                   ? std::numeric_limits<float>::infinity()
                                   : static_cast<float>(degC_[i]) + settings_.margin_sigmas * estimate_.sigma_K[i] +
                                         due_above_K(i) + doubt_above_K(i);
    estimate_.max_degC[i] = max_degC_[i];
  }
  estimate_.housing_degC = degC_[housing_.node];
  estimate_.ambient_degC = ambient_degC_;
  estimate_.flags =
      flags_ | (watch_.missing() ? housing_missing : 0u) | (watch_.contradicts() ? housing_contradicts : 0u);
}

}  // namespace thermal

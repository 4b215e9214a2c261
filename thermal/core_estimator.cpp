// SPDX-License-Identifier: MIT
#include "thermal/core_estimator.hpp"

#include <cmath>
#include <limits>
#include <new>

namespace thermal {

namespace {

constexpr double dt_s = estimator_dt_s;

// Between these a temperature can be true; outside them the arithmetic or the memory is broken.
constexpr double coldest_degC = -60.0, hottest_possible_degC = 1000.0;
constexpr int most_lost_steps = 200;        // 2 s: no watchdog waits longer
constexpr float most_follow = 1.4f;         // K of a winding by which copper follows a kelvin of its housing
constexpr float restored_hotter_K = 10.0f;  // than the last good state, when there is none: chosen
constexpr float known_sigma_K = 3.0f;       // of a housing that is known: from here on its sensor pulls little; chosen
constexpr float soaked_within_K = 1.0f;     // of the housing: what a start that believes it may be off
constexpr float unknown_below_K = 10.0f;    // safety table: limit minus 10 K until probed

constexpr float no_bound_K = std::numeric_limits<float>::infinity();

float squared(float x) { return x * x; }

bool plausible(double degC) { return degC > coldest_degC && degC < hottest_possible_degC; }  // false for NaN

/// Of the nodes that have a limit; NaN counts as the hottest.
template <class T>
T hottest(const Estimate& estimate, const T (&degC)[max_nodes]) {
  T hottest = -std::numeric_limits<T>::infinity();
  for (int i = 0; i < estimate.node_count && i < max_nodes; ++i) {  // it may be looked at after a flip
    if (std::isfinite(estimate.max_degC[i]) && !(degC[i] <= hottest)) hottest = degC[i];
  }
  return hottest;
}

}  // namespace

float Estimate::hottest_margin_degC() const { return hottest(*this, margin_degC); }
double Estimate::hottest_degC() const { return hottest(*this, degC); }

CoreEstimator::CoreEstimator(const HeatSet<double>& set, const EstimatorSettings& settings)
    : network_(set),
      transition_(network_.transition(dt_s)),
      settings_(settings),
      housing_(set.housing),
      n_(set.node_count),
      uncertainty_(set, settings.trust, settings.ambient_sigma_K),
      ambient_degC_(static_cast<double>(settings.ambient_degC)) {
  for (int i = 0; i < n_; ++i) {
    max_degC_[i] = set.nodes[i].max_degC;
    if (has_limit(i)) ++limited_nodes_;
  }
  degC_ = good_degC_ = Vector::Constant(n_, ambient_degC_);
  good_ambient_degC_ = ambient_degC_;
  input_[Boundary::ambient] = ambient_degC_;
  for (Boundary b : {Boundary::coolant, Boundary::frame, Boundary::neighbour}) input_[b] = ambient_degC_;
  doubted_K_.setZero(uncertainty_.size());
  kept_K_.setZero(uncertainty_.size());
  settle_sensor();
  uncertainty_.soak();
  built_ = built_sum();
  publish();
}

// ---- one step ------------------------------------------------------------------------------------------------------

const Estimate& CoreEstimator::tick(const HeatInput<>& input, Reading housing, Reading measured_ambient,
                                    int lost_steps) {
  if (built_sum() != built_) return give_up();
  if (state_sum() == left_)
    flags_ &= ~(input_replaced | lost_time | state_restored);
  else
    start_hotter();
  if (!take_input(input)) flags_ |= input_replaced;
  if (lost_steps > 0) {
    flags_ |= lost_time;
    for (int i = 0; i < lost_steps && i < most_lost_steps; ++i) step();
    if (lost_steps > most_lost_steps) raise_to(static_cast<float>(lowest_limit_degC()) - unknown_below_K);
  }
  ambient_known_ = measured_ambient.usable();
  if (ambient_known_) ambient_degC_ = static_cast<double>(measured_ambient.value);
  step();
  hear_housing(housing);
  guard_state();
  publish();
  return estimate_;
}

/// Takes over what is usable; what is not becomes the last value times 1.1, a current the full scale, what cools
/// nothing. False if any was.
bool CoreEstimator::take_input(const HeatInput<>& input) {
  bool good = true;
  for (int i = 0; i < drive_count; ++i) {
    const double x = input.drive[i];
    if (x >= 0.0 && std::isfinite(x)) {
      input_.drive[i] = x;
      continue;
    }
    good = false;
    if (static_cast<Drive>(i) == Drive::speed_to_0_8) {  // it only cools
      input_.drive[i] = 0.0;
      continue;
    }
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
  step_uncertainty();
  meet_copy();
  degC_ = network_.step(transition_, degC_, input_);
  keep_copy();
  const double behind_K = sensed_degC(degC_[housing_.node]) - sensor_degC_;
  const double moved_K = behind_K / (1.0 + housing_.lag_s / dt_s);
  uncertainty_.step_lag(behind_K, moved_K);
  sensor_degC_ += moved_K;
}

void CoreEstimator::step_uncertainty() {
  const auto f = uncertainty_.step_matrix(network_, transition_, network_.rates(degC_, input_));
  uncertainty_.step(f, watch_.housing_known());
  if (ambient_known_) uncertainty_.know_ambient();
  doubted_K_ = f.lazyProduct(doubted_K_).eval();
  kept_K_ = f.lazyProduct(kept_K_).eval();
}

// ---- the housing sensor --------------------------------------------------------------------------------------------

/// What the sensor reads of a housing that has been as warm as this for long, and the other way round.
double CoreEstimator::sensed_degC(double housing_degC) const {
  return housing_degC * (1.0 + housing_.gain_error) - 25.0 * housing_.gain_error + housing_.offset_K;
}
double CoreEstimator::housing_of_degC(double sensed_degC) const {
  return (sensed_degC + 25.0 * housing_.gain_error - housing_.offset_K) / (1.0 + housing_.gain_error);
}

void CoreEstimator::hear_housing(Reading housing) {
  watch_.model_moved(static_cast<float>(sensor_degC_) - kept_K_[sensor()]);
  settle(1);
  const auto heard = watch_.hear(housing, sensor_degC_ + static_cast<double>(due_K_[sensor()]));
  if (heard.fell_silent) uncertainty_.lose_surroundings();
  if (!heard.full) return;
  if (!watch_.housing_known()) believe_ambient_below(housing_of_degC(static_cast<double>(heard.reading_degC)));
  if (heard.first && resumed_ && housing_.lag_s > 0.0)
    meet_sensor(heard.reading_degC);
  else if (watch_.housing_known())
    follow_housing(heard.above_model_K);
  else
    meet_housing(heard.reading_degC, heard.above_model_K);
}

/// The ambient is hardly warmer than a soaked housing, and believed no colder than a room.
void CoreEstimator::believe_ambient_below(double housing_degC) {
  if (!ambient_known_ && housing_degC < ambient_degC_) ambient_degC_ = housing_degC > 20.0 ? housing_degC : 20.0;
}

/// The first reading of a sensor that lags says where the sensor is; the next, by how it moves, where the housing is.
void CoreEstimator::meet_sensor(float reading_degC) {
  sensor_degC_ = static_cast<double>(reading_degC);
  watch_.model_jumped(reading_degC - kept_K_[sensor()]);
  uncertainty_.know_sensor(settings_.housing_noise_K);
  raise_to(static_cast<float>(housing_of_degC(sensor_degC_)));
}

/// The minute is over, and a start that was a guess, or the memory of one, would contradict the sensor for hours: it is
/// as cold as it reads, with what is left as margin.
void CoreEstimator::doubt(float left_K) {
  meet_copy();
  degC_.array() -= static_cast<double>(left_K);
  keep_copy();
  sensor_degC_ -= static_cast<double>(left_K);
  watch_.model_corrected(-left_K);
  doubted_K_.head(n_).array() += left_K;
  doubted_K_[sensor()] += left_K;
}

/// Until the housing is known its readings count without limit.
void CoreEstimator::meet_housing(float reading_degC, float above_model_K) {
  const Vector before_degC = degC_;
  if (!correct(sensor_sight(above_model_K), no_bound_K, 1)) return;
  const int h = housing_.node;
  const bool known = watch_.meet(uncertainty_.variance_K2(h) < squared(known_sigma_K), ambient_degC_);
  // After a reset the winding does not follow the housing by itself.
  raise_to(static_cast<float>(housing_of_degC(static_cast<double>(reading_degC))));
  if (remembers_) {
    const Vector fall_K = before_degC - degC_;
    doubted_K_.head(n_) += fall_K.cast<float>();
    kept_K_.head(n_) += (Vector::Constant(n_, fall_K[h]) - fall_K).cast<float>();
  }
  const float left_K = static_cast<float>(sensor_degC_) - reading_degC;
  if (!known) return;
  if ((guessed_ || remembers_) && left_K > least_gate_K) doubt(left_K);
  if (doubted_K_[h] > least_gate_K) watch_.forget_movement();  // a model that was too hot cooled: no test
}

/// From then on only as far as its sensor is believed.
void CoreEstimator::follow_housing(float above_model_K) {
  Sight seen = sensor_sight(above_model_K);
  const float kept_K = std::fmax(kept_K_[sensor()], 0.0f);
  const auto verdict = watch_.judge(above_model_K, uncertainty_.sigma_K(seen), kept_K, ambient_degC_);
  if (verdict.warms) doubted_K_.setZero();
  if (verdict.believed) {
    seen.above_K = verdict.counts_as_above_K;
    correct(seen, verdict.most_down_K, HousingWatch::window_steps);
  } else if (verdict.believed_till_now) {
    give_back();
  }
}

CoreEstimator::Sight CoreEstimator::sensor_sight(float above_model_K) const {
  Sight seen{Row::Zero(uncertainty_.size()), above_model_K, squared(settings_.housing_noise_K),
             static_cast<float>(uncertainty_.late_K())};
  seen.of[sensor()] = 1.0f;
  return seen;
}

/// What a sensor had taken away that is no longer believed.
void CoreEstimator::give_back() {
  settle(due_steps_);
  due_margin_K_ = doubted_K_.cwiseMax(0.0f);  // until it has flowed in
  due_K_ = due_margin_K_ + Row::Constant(uncertainty_.size(), watch_.pulled_K());
  doubted_K_.setZero();
  due_K_[ambient()] = std::fmax(static_cast<float>(watch_.trusted_ambient_degC() - ambient_degC_), 0.0f);
  due_steps_ = HousingWatch::window_steps;
  uncertainty_.lose_surroundings();
}

// ---- the winding's resistance --------------------------------------------------------------------------------------

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
  Sight seen{Row::Zero(uncertainty_.size()), seen_degC - static_cast<float>(mean_winding_degC()), squared(sigma_K),
             0.0f};
  for (int i = 0; i < n_; ++i) seen.of[i] = has_limit(i) ? 1.0f / static_cast<float>(limited_nodes_) : 0.0f;
  const float gate_K = gate_sigmas * uncertainty_.sigma_K(seen);
  if (!(seen.above_K > -gate_K)) return false;
  seen.above_K = std::fmin(seen.above_K, gate_K);  // hotter than believable still counts, but one reading is only one
  return correct(seen, no_bound_K, 1);
}

/// Of the nodes that have a limit; NaN, which nobody believes, if none has.
double CoreEstimator::mean_winding_degC() const {
  double sum_degC = 0.0;
  for (int i = 0; i < n_; ++i) {
    if (has_limit(i)) sum_degC += degC_[i];
  }
  return limited_nodes_ > 0 ? sum_degC / limited_nodes_ : std::numeric_limits<double>::quiet_NaN();
}

// ---- corrections ---------------------------------------------------------------------------------------------------

/// Lets what is seen correct the states, by no more than lowers a winding by most_down_K. It flows in over some steps:
/// a jump of the estimate would be a jump of the allowance, which drops the robot.
bool CoreEstimator::correct(const Sight& seen, float most_down_K, int over_steps) {
  Row gain;
  if (!uncertainty_.gain(seen, gain)) return false;
  if (ambient_known_ || (!watch_.housing_known() && seen.above_K < 0.0f))
    gain[ambient()] = 0.0f;  // measured, or lowered by believe_ambient_below already
  const float down_K = down_by(gain, seen.above_K);
  if (down_K > most_down_K) gain *= most_down_K / down_K;
  if (most_down_K < no_bound_K) watch_.note_pull(down_by(gain, seen.above_K));
  // A housing that is colder than thought may be cooled better; to the filter it also looks like a winding that gets
  // less heat. So a winding falls no further than it would follow.
  if (seen.of[sensor()] != 0.0f && seen.above_K < 0.0f) {
    for (int i = 0; i < n_; ++i) gain[i] = std::fmin(gain[i], most_follow * std::fmax(gain[housing_.node], 0.0f));
  }

  settle(due_steps_);
  due_margin_K_ = margins_K();
  uncertainty_.follow(seen, gain);
  due_K_ = gain * seen.above_K;
  due_margin_K_ -= margins_K();
  due_steps_ = over_steps;
  if (over_steps == 1) settle(1);
  return true;
}

/// How far a correction lowers the winding, K; negative if it raises all of them. What the housing falls the windings
/// will, even those that it shares no error with.
float CoreEstimator::down_by(const Row& gain, float above_K) const {
  float down_K = -std::numeric_limits<float>::infinity();
  for (int i = 0; i < n_; ++i) {
    const float fall_K = -gain[i] * above_K;
    if ((has_limit(i) || i == housing_.node) && fall_K > down_K) down_K = fall_K;
  }
  return down_K;
}

/// k sigma of each node.
CoreEstimator::Row CoreEstimator::margins_K() const {
  Row margins = Row::Zero(uncertainty_.size());
  for (int i = 0; i < n_; ++i) margins[i] = settings_.margin_sigmas * uncertainty_.sigma_K(i);
  return margins;
}

/// Lets `steps` parts of the correction that is due flow into the state.
void CoreEstimator::settle(int steps) {
  if (due_steps_ <= 0 || steps <= 0) return;
  const float part = static_cast<float>(steps) / static_cast<float>(due_steps_);
  meet_copy();
  for (int i = 0; i < n_; ++i) degC_[i] += static_cast<double>(part * due_K_[i]);
  keep_copy();
  ambient_degC_ += static_cast<double>(part * due_K_[ambient()]);
  sensor_degC_ += static_cast<double>(part * due_K_[sensor()]);
  watch_.model_corrected(part * due_K_[sensor()]);
  due_K_ *= 1.0f - part;
  due_margin_K_ *= 1.0f - part;
  due_steps_ -= steps;
}

void CoreEstimator::raise_to(float winding_degC) {
  if (!plausible(static_cast<double>(winding_degC))) return;
  for (int i = 0; i < n_; ++i) {
    if (has_limit(i) && !(degC_[i] >= static_cast<double>(winding_degC))) degC_[i] = static_cast<double>(winding_degC);
  }
  keep_copy();
  publish();
}

// ---- resets --------------------------------------------------------------------------------------------------------

HeatMemory CoreEstimator::save() const {
  HeatMemory memory{whole() ? n_ : 0,
                    {},
                    {},
                    static_cast<float>(ambient_degC_),
                    watch_.contradicts() ? 1u : 0u,
                    std::fmax(static_cast<float>(uncertainty_.late_K()), 0.0f)};
  for (int i = 0; i < memory.node_count; ++i) {
    // What is due now is so later, and what is doubted not proven.
    memory.degC[i] = static_cast<float>(degC_[i]) + std::fmax(due_K_[i], 0.0f) + std::fmax(doubted_K_[i], 0.0f);
    memory.sigma_K[i] = estimate_.sigma_K[i];
  }
  return memory;
}

void CoreEstimator::restore(const HeatMemory& memory, double off_s) {
  if (memory.node_count != n_) return start_as_hot_as(memory);
  const double believed = static_cast<double>(settings_.ambient_degC);
  const double saved_ambient = static_cast<double>(memory.ambient_degC);
  ambient_degC_ = plausible(saved_ambient) && saved_ambient > believed ? saved_ambient : believed;
  const double hottest = lowest_limit_degC();
  Vector rise(n_);
  float sigma_K[max_nodes];
  for (int i = 0; i < n_; ++i) {
    const double saved = static_cast<double>(memory.degC[i]);
    const double limit = has_limit(i) ? static_cast<double>(max_degC_[i]) : hottest;
    rise[i] = (plausible(saved) ? saved : limit) - ambient_degC_;
    if (!(rise[i] > 0.0)) rise[i] = 0.0;
    sigma_K[i] = memory.sigma_K[i] >= 0.0f ? std::fmin(memory.sigma_K[i], most_sigma_K) : start_sigma_K;
  }
  if (off_s > 0.0 && off_s < 1e9) rise = network_.transition(off_s).phi0.lazyProduct(rise).eval();
  degC_ = rise.array() + ambient_degC_;
  bool soaked = true;
  float soaked_sigma_K = start_sigma_K;
  for (int i = 0; i < n_; ++i) {
    soaked = soaked && memory.degC[i] <= memory.degC[housing_.node] + soaked_within_K;
    soaked_sigma_K = std::fmax(soaked_sigma_K, sigma_K[i]);
  }
  begin_anew(sigma_K);
  remembers_ = memory.degC[housing_.node] > settings_.ambient_degC;  // or it was no warmer than its surroundings
  if (memory.late_K >= 0.0f && memory.late_K < most_sigma_K)
    uncertainty_.set_late_K(static_cast<double>(memory.late_K));
  if (soaked) uncertainty_.soak(soaked_sigma_K);
  raise_to(static_cast<float>(mean_winding_degC()));
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

/// Another model's nodes are not these: all are as hot as its hottest. Sensor and surroundings are the same. A single
/// node is no motor's.
void CoreEstimator::start_as_hot_as(const HeatMemory& memory) {
  start_hot();
  if (memory.node_count < 2) return;
  double hottest_degC = degC_[housing_.node];
  for (int i = 0; i < memory.node_count && i < max_nodes; ++i) {
    const double saved = static_cast<double>(memory.degC[i]);
    if (plausible(saved) && saved > hottest_degC) hottest_degC = saved;
  }
  degC_.setConstant(hottest_degC);
  good_degC_ = degC_;
  const double saved_ambient = static_cast<double>(memory.ambient_degC);
  if (plausible(saved_ambient) && saved_ambient > ambient_degC_) good_ambient_degC_ = ambient_degC_ = saved_ambient;
  settle_sensor();
  if (memory.disbelieved != 0) {
    watch_.disbelieve();
    know_housing(start_sigma_K);
  }
  publish();
}

/// The sensor is as warm as what it sits on, and nothing is due.
void CoreEstimator::settle_sensor() {
  sensor_degC_ = sensed_degC(degC_[housing_.node]);
  watch_.model_jumped(static_cast<float>(sensor_degC_));
  due_K_.setZero(uncertainty_.size());
  due_margin_K_.setZero(uncertainty_.size());
  due_steps_ = 0;
}

/// As well as if its sensor had been heard for long.
void CoreEstimator::know_housing(float sigma_K) {
  watch_.know_housing(ambient_degC_);
  uncertainty_.know_housing(sigma_K);
}

void CoreEstimator::replace(const HeatSet<double>& set, const EstimatorSettings& settings) {
  const HeatMemory memory = save();
  if (memory.node_count == 0) {  // not even what is known of the sensor may be looked at
    new (this) CoreEstimator(set, settings);
    return start_hot();
  }
  const HousingSensor<double> described = housing_;
  const HousingWatch record = watch_;
  const float doubted_K = std::fmax(doubted_K_[housing_.node], 0.0f);
  const double sensed = sensor_degC_ + std::fmax(static_cast<double>(due_K_[sensor()]), 0.0);
  new (this) CoreEstimator(set, settings);  // in place: too large for the stack
  restore(memory, 0.0);
  if (memory.node_count != n_ || !(described == housing_)) return;  // another sensor
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
  const double hot = lowest_limit_degC() - static_cast<double>(unknown_below_K);
  ambient_degC_ = static_cast<double>(settings_.ambient_degC);
  degC_ = Vector::Constant(n_, hot > ambient_degC_ ? hot : ambient_degC_);
  float sigma_K[max_nodes];
  for (float& s : sigma_K)
    s = settings_.margin_sigmas > 0.0f ? unknown_below_K / settings_.margin_sigmas : start_sigma_K;
  begin_anew(sigma_K);
  guessed_ = true;
  publish();
}

/// The lowest limit of the windings; without one, class F's 155 degC.
double CoreEstimator::lowest_limit_degC() const {
  double lowest = hottest_possible_degC;
  for (int i = 0; i < n_; ++i) lowest = std::fmin(lowest, static_cast<double>(max_degC_[i]));
  return lowest < hottest_possible_degC ? lowest : 155.0;
}

/// Nothing but temperatures and their sigmas has survived.
void CoreEstimator::begin_anew(const float (&sigma_K)[max_nodes]) {
  good_degC_ = degC_;
  good_ambient_degC_ = ambient_degC_;
  watch_ = {};
  settle_sensor();
  resumed_ = true;
  remembers_ = guessed_ = false;
  doubted_K_.setZero(uncertainty_.size());
  kept_K_.setZero(uncertainty_.size());
  uncertainty_.begin_anew(sigma_K);
  publish();
}

// ---- state ---------------------------------------------------------------------------------------------------------

std::uint32_t CoreEstimator::built_sum() const {
  FlipSum sum;
  network_.add_to(sum);
  uncertainty_.add_built_to(sum);
  sum.add(transition_.phi0, transition_.phi1, transition_.phi2, settings_, housing_.node, housing_.lag_s,
          housing_.offset_K, housing_.gain_error, n_, limited_nodes_);
  return sum.add_first(n_, max_degC_).word();
}

std::uint32_t CoreEstimator::state_sum() const {
  FlipSum sum;
  uncertainty_.add_state_to(sum);
  watch_.add_to(sum);
  return sum
      .add(degC_, ambient_degC_, sensor_degC_, due_K_, due_margin_K_, due_steps_, resumed_, doubted_K_, kept_K_,
           remembers_, guessed_, flags_, estimate_.node_count)
      .word();
}

/// With another model nothing can be said of the state. The estimate stays as it was but for what it allows.
const Estimate& CoreEstimator::give_up() {
  for (float& margin_degC : estimate_.margin_degC) margin_degC = std::numeric_limits<float>::infinity();
  estimate_.flags |= model_changed;
  return estimate_;
}

/// Nobody knows which bit of the state it was, but what was published with it is whole: only one flips at a time.
void CoreEstimator::start_hotter() {
  const float hottest_degC = static_cast<float>(estimate_.hottest_degC());
  start_hot();
  raise_to(hottest_degC);
  flags_ = state_restored;
}

/// A bit that flips in the middle of a call, which takes a millisecond, no sum shows: it would pass for the result. The
/// hotter of both is true.
void CoreEstimator::meet_copy() {
  if (!possible()) return;  // guard_state knows better
  for (int i = 0; i < n_; ++i) {
    const double copy = good_degC_.data()[i];  // its size is in no sum
    if (degC_[i] == copy) continue;
    if (degC_[i] < copy) degC_[i] = copy;
    flags_ |= state_restored;
  }
}

void CoreEstimator::keep_copy() {
  if (possible()) good_degC_ = degC_;
}

bool CoreEstimator::possible() const {
  for (int i = 0; i < n_; ++i) {
    if (!plausible(degC_[i])) return false;
  }
  return true;
}

/// A state that is not finite or not possible is replaced by the last good one, hotter, and says so for one call. What
/// has a limit and was not too cold may have been as hot as it seemed: it is at its limit at least.
void CoreEstimator::guard_state() {
  meet_copy();
  const bool good = possible() && plausible(ambient_degC_) && plausible(sensor_degC_) &&
                    std::abs(uncertainty_.late_K()) < hottest_possible_degC;
  for (int i = 0; i < uncertainty_.size(); ++i) {
    if (!(std::abs(doubted_K_[i]) < 1e3f)) doubted_K_[i] = most_sigma_K;
    if (!(std::abs(kept_K_[i]) < 1e3f)) kept_K_[i] = 0.0f;
  }
  if (!uncertainty_.sound()) uncertainty_.widen_all();
  if (good) {
    good_degC_ = degC_;
    good_ambient_degC_ = ambient_degC_;
    return;
  }
  flags_ |= state_restored;
  for (int i = 0; i < n_; ++i) {
    const double last = plausible(good_degC_[i]) ? good_degC_[i] : hottest_possible_degC - 100.0;
    const double limit = static_cast<double>(max_degC_[i]), hotter = last + static_cast<double>(restored_hotter_K);
    degC_[i] = !(degC_[i] <= coldest_degC) && has_limit(i) && limit > hotter ? limit : hotter;
  }
  ambient_degC_ = plausible(good_ambient_degC_) ? good_ambient_degC_ : static_cast<double>(settings_.ambient_degC);
  settle_sensor();
  watch_.forget_movement();
  uncertainty_.set_late_K(0.0);
  good_degC_ = degC_;
}

void CoreEstimator::publish() {
  estimate_.node_count = n_;
  for (int i = 0; i < n_; ++i) {
    estimate_.degC[i] = degC_[i];
    estimate_.sigma_K[i] = uncertainty_.sigma_K(i);
    estimate_.margin_degC[i] = flags_ & state_restored
                                   ? std::numeric_limits<float>::infinity()
                                   : static_cast<float>(degC_[i]) + settings_.margin_sigmas * estimate_.sigma_K[i] +
                                         due_above_K(i) + doubt_above_K(i);
    estimate_.max_degC[i] = max_degC_[i];
  }
  estimate_.housing_degC = degC_[housing_.node];
  estimate_.ambient_degC = ambient_degC_;
  estimate_.flags = flags_;
  if (watch_.missing()) estimate_.flags |= housing_missing;
  if (watch_.contradicts()) estimate_.flags |= housing_contradicts;
  left_ = state_sum();
}

}  // namespace thermal

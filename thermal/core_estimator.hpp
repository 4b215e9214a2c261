// SPDX-License-Identifier: MIT
// Says how hot the winding is, which no sensor can touch, and how sure it is of that.
//
//   in    the means of one 10 ms step (currents squared, speeds, power), the housing sensor, which may be missing
//   out   every node's temperature, its standard deviation, and what went wrong
//
// State in double at 100 Hz: float at the PWM rate loses small increments and reads up to 55 K too cold. A HeatNetwork
// says how temperatures move, Uncertainty how sure that is, HousingWatch whether the housing sensor is to be believed.
// Here they meet: what is seen corrects the state, and what is doubted after a reset stays a margin. The ambient is a
// slow state, since most boards cannot measure it. Everything fails towards hot. Knows neither clock nor sensor. No
// heap; every call costs the same but for lost time. Not for an ISR.
#pragma once

#include <cmath>

#include "thermal/housing_watch.hpp"
#include "thermal/network.hpp"
#include "thermal/uncertainty.hpp"

namespace thermal {

struct EstimatorSettings {
  Trust trust = sheet_trust;
  float margin_sigmas = 2.0f;  // k of T + k sigma: one in forty stays hotter
  float ambient_degC = 40.0f;  // believed when nothing says otherwise: the usual rating of drives
  float ambient_sigma_K = 5.0f;
  float housing_noise_K = 0.5f;  // of a mean over 0.5 s, wander of a thermistor chain included
  float full_scale_A2 = 400.0f;  // counted when a current is not a number
};

enum EstimateFlag : std::uint32_t {
  housing_missing = 1u << 0,      // no usable reading for 100 ms, or not half a second of them within two
  housing_contradicts = 1u << 1,  // colder than the model can believe: ignored until it agrees again
  input_replaced = 1u << 2,       // a drive was not finite or negative: something hotter was taken
  lost_time = 1u << 3,            // this call stood for more than one step
  state_restored = 1u << 4,       // the state was not finite: last good one, 10 K hotter, for this call no allowance;
                                  // or a bit of it had flipped since the last call: as start_hot, and no colder
  winding_ohm_refused = 1u << 5,  // the last resistance reading was implausible
  model_changed = 1u << 6,        // a bit of what it is built from has flipped: no allowance until it is replaced
};

struct Estimate {
  int node_count;
  double degC[max_nodes];
  float sigma_K[max_nodes];
  float margin_degC[max_nodes];  // T + k sigma: what the governor limits; +infinity when the state was not finite
  float max_degC[max_nodes];     // from the set
  double housing_degC, ambient_degC;
  std::uint32_t flags;

  float hottest_margin_degC() const;  // of the nodes that have a limit
  double hottest_degC() const;
};

/// The estimator's state as it is kept in backup memory.
struct HeatMemory {
  std::int32_t node_count;
  float degC[max_nodes], sigma_K[max_nodes];
  float ambient_degC;
  std::uint32_t disbelieved = 0;  // 1: the housing sensor was, and is until it agrees again
  float late_K = 0.0f;            // how much less a sensor may read that lags untold, per sigma of that
};

class CoreEstimator {
 public:
  using Vector = HeatNetwork<double>::Vector;

  /// The set must have passed validate(set, estimator_dt_s). Starts soaked at the ambient believed; the first good
  /// housing reading moves all of it. After a reset call restore() instead of trusting that.
  CoreEstimator(const HeatSet<double>& set, const EstimatorSettings& settings);

  /// One step of 10 ms, and `lost_steps` more of them that passed since the last call: the input is the mean over all.
  /// After more than 200 lost ones nothing is known of a winding: it is 10 K below its limit, or hotter.
  /// input[Boundary::ambient] is not used: give `ambient` when it is measured.
  const Estimate& tick(const HeatInput<>& input, Reading housing, Reading ambient = {0.0f, false}, int lost_steps = 0);

  /// Resistance of the winding as a thermometer: the mean over the nodes that have a limit. Refused if implausibly
  /// cold.
  void observe_winding_ohm(float ohm, float sigma_ohm, float ohm_at_25_degC, float copper_coefficient_per_K);

  /// The host knows better only upwards.
  void raise_to(float winding_degC);

  /// What must survive a reset: of the last tick. Nothing, once a bit has flipped.
  HeatMemory save() const;
  /// After a reset. A time off that is negative or NaN is unknown: then nothing has cooled. The ambient is at least the
  /// one believed; each winding is at least as warm as the mean of them, which they may have reached meanwhile, and as
  /// the first housing reading. What is not a temperature counts as the node's limit; of another number of nodes the
  /// hottest counts for all, and see start_hot.
  void restore(const HeatMemory& memory, double off_s);
  /// After a reset of which nothing is known: every node 10 K below the winding's limit, and that with the margin on
  /// it; the housing sensor, the model's cooling or a resistance reading prove otherwise. After either of both a cold
  /// reading may come from a sensor that lags, and lowers as much as it cannot.
  void start_hot();
  /// Another model takes over at once, as by restore(save(), 0) of a new one. Of a sensor that it describes as the last
  /// one did nothing is forgotten: or one that stands still would be believed for a minute after each.
  void replace(const HeatSet<double>& set, const EstimatorSettings& settings);

  /// No bit has flipped since the last call: it may be looked at.
  bool whole() const { return built_sum() == built_ && state_sum() == left_; }

  const Estimate& estimate() const { return estimate_; }
  /// All that the governor adds to a node, as a sigma of it: what is doubted after a reset counts as much as k sigma.
  float counted_sigma_K(int node) const {
    const float k = settings_.margin_sigmas, sigma_K = estimate_.sigma_K[node];
    return k > 0.0f ? sigma_K + (due_above_K(node) + doubt_above_K(node)) / k : sigma_K;
  }
  /// How much faster T + k sigma rises than T when heat is poured in.
  float burst_margin() const { return 1.0f + settings_.margin_sigmas * settings_.trust.power; }
  /// The same once a winding is as warm as its load makes it, or on the way there: whatever is more.
  float load_margin() const {
    return 1.0f + settings_.margin_sigmas * std::fmax(settings_.trust.power, settings_.trust.inner_resistance);
  }
  /// The node whose sensor corrects it; -1: no sensor is heard.
  int heard_node() const {
    return (estimate_.flags & (housing_missing | housing_contradicts)) != 0 ? -1 : housing_.node;
  }
  const HeatNetwork<double>& network() const { return network_; }
  /// Of one step of 10 ms.
  const Transition<double>& transition() const { return transition_; }
  /// The input of the last step as it was believed, ambient included.
  const HeatInput<>& input() const { return input_; }

 private:
  using Row = Uncertainty::Row;
  using Sight = Uncertainty::Sight;

  bool take_input(const HeatInput<>& input);
  void step();
  void step_uncertainty();

  double sensed_degC(double housing_degC) const;
  double housing_of_degC(double sensed_degC) const;
  void hear_housing(Reading housing);
  void believe_ambient_below(double housing_degC);
  void meet_sensor(float reading_degC);
  void meet_housing(float reading_degC, float above_model_K);
  void follow_housing(float above_model_K);
  Sight sensor_sight(float above_model_K) const;
  void doubt(float left_K);
  void give_back();
  bool hear_winding(float seen_degC, float sigma_K);
  double mean_winding_degC() const;

  bool correct(const Sight& seen, float most_down_K, int over_steps);
  float down_by(const Row& gain, float above_K) const;
  Row margins_K() const;
  void settle(int steps);

  void begin_anew(const float (&sigma_K)[max_nodes]);
  void start_as_hot_as(const HeatMemory& memory);
  void settle_sensor();
  void know_housing(float sigma_K);
  double lowest_limit_degC() const;

  std::uint32_t built_sum() const;
  std::uint32_t state_sum() const;
  const Estimate& give_up();
  void start_hotter();
  bool possible() const;
  void meet_copy();
  void keep_copy();
  void guard_state();
  void publish();
  float due_above_K(int node) const { return due_margin_K_[node] > 0.0f ? due_margin_K_[node] : 0.0f; }
  float doubt_above_K(int node) const { return doubted_K_[node] > 0.0f ? doubted_K_[node] : 0.0f; }

  bool has_limit(int node) const { return std::isfinite(max_degC_[node]); }
  int ambient() const { return uncertainty_.ambient(); }
  int sensor() const { return uncertainty_.sensor(); }

  HeatNetwork<double> network_;
  Transition<double> transition_;
  EstimatorSettings settings_;
  HousingSensor<double> housing_;
  int n_, limited_nodes_ = 0;  // nodes; those of them that have a limit: windings, mostly
  float max_degC_[max_nodes];

  Uncertainty uncertainty_;
  Vector degC_, good_degC_;  // the latter: the last that was possible, kept wherever the first is written
  double ambient_degC_, good_ambient_degC_, sensor_degC_;  // the latter: what it reads, lag and all
  bool ambient_known_ = false;                             // measured
  HeatInput<> input_;
  Row due_K_;         // what the last correction has yet to add, in due_steps_ steps,
  Row due_margin_K_;  // and what it has yet to take from the margins: surer at once, they would be colder at once
  int due_steps_ = 0;

  HousingWatch watch_;
  bool resumed_ = false;  // after a reset: the sensor may lag behind what was remembered
  // How much hotter the states would be had the first readings after a reset not lowered what was remembered. Counts as
  // margin until the sensor proves that it lives: it may have come off, or sit on another motor.
  Row doubted_K_;
  Row kept_K_;  // how much hotter they are than those of a motor that cooled meanwhile; a sensor need not show that
  bool remembers_ = false, guessed_ = false;  // since the reset: a warm motor; nothing

  std::uint32_t flags_ = 0;
  Estimate estimate_{};
  // A flipped bit is found before it is used: of what does not change, and of the state as each call left it.
  std::uint32_t built_, left_ = 0;
};

}  // namespace thermal

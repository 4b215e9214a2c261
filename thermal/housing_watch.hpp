// SPDX-License-Identifier: MIT
// Whether the housing sensor is to be believed, and how far: is it heard, does it move with the load, how much of the
// estimate has it taken away.
//
//   in    every 10 ms, what the model says the sensor reads, and what it does read, which may be missing
//   out   twice a second, the mean of its readings and what that may do to the estimate
//
// A reading may raise within seconds. It may lower only a little, until the sensor shows by moving with a load that it
// lives; at first, until the housing is known, without limit. Knows the sensor's record and no network: what is done
// with a reading is the estimator's. No heap; same cost every call. Not for an ISR.
#pragma once

#include "thermal/flip_sum.hpp"
#include "thermal/heat_set.hpp"

namespace thermal {

inline constexpr float least_gate_K = 5.0f;  // safety table: what no sensor may lower the estimate by
inline constexpr float gate_sigmas = 4.0f;   // one of a good sensor's readings in 30,000 is colder by more

/// A measured value that may be missing; `valid` false: open, short, stale. Then the value means nothing.
struct Reading {
  float value;
  bool valid;

  /// A thermistor chain that is alive reads so.
  bool usable() const;
};

class HousingWatch {
 public:
  static constexpr int window_steps = 50;  // the housing is heard twice a second: faster only averages its noise

  struct Heard {
    bool fell_silent;     // counts as missing from this step on
    bool full;            // half a second of readings is together, and so the rest is given
    bool first;           // there was none before
    float reading_degC;   // their mean,
    float above_model_K;  // and how much more that is than what the model said meanwhile
  };

  struct Verdict {
    bool lives;               // the reading has moved with the model, far enough to prove it
    bool warms;               // and upwards: one that has come off cools as well, and a model that follows it
    bool believed;            // or else it counts for nothing,
    bool believed_till_now;   // and what the sensor has taken is to be given back
    float counts_as_above_K;  // how much more than the model's it is taken for
    float most_down_K;        // how far it may lower a winding
  };

  /// First in each step: what the model says that the sensor reads now. Only that moves the model; corrections are told
  /// by model_corrected, and where it begins anew by model_jumped.
  void model_moved(float to_degC);
  void model_corrected(float by_K) { model_degC_ += by_K; }
  void model_jumped(float to_degC) { model_degC_ = to_degC; }
  void forget_movement() { model_moved_K_ = 0.0f; }

  /// Then: what the sensor reads, and what the model says once all that is due has flowed into it.
  Heard hear(Reading reading, double model_degC);
  /// Another model takes over: half a window of the old one is of no use.
  void drop_window();

  /// Until the housing is known each mean counts without limit; true: it is known from here on, since it is `sure` or
  /// has been heard for a minute.
  bool meet(bool sure, double ambient_degC);
  void know_housing(double ambient_degC);
  bool housing_known() const { return housing_known_; }

  /// Of a full mean of a known housing. `sigma_K` of the difference; `kept_K`: by how much the model may be too hot
  /// with the sensor none the worse; `ambient_degC` is trusted if the sensor lives.
  Verdict judge(float above_model_K, float sigma_K, float kept_K, double ambient_degC);
  /// What a believed mean lowered the windings by; negative if it raised them: noise up and down cancels.
  void note_pull(float down_K);

  /// What the sensor has taken away since it last proved that it lives: from the windings, and the ambient of that
  /// time.
  float pulled_K() const { return pulled_K_; }
  double trusted_ambient_degC() const { return trusted_ambient_degC_; }

  bool missing() const { return missing_; }
  bool contradicts() const { return contradicts_; }
  /// A memory says so. Or a reset would have it believed without limit, as a first reading is.
  void disbelieve() { contradicts_ = true; }

  void add_to(FlipSum& sum) const {
    sum.add(missing_, contradicts_, silent_steps_, steps_since_full_, window_, reading_sum_degC_, model_sum_degC_,
            read_, housing_known_, met_, model_degC_, model_moved_K_, reading_slow_degC_, reading_moved_K_, pulled_K_,
            trusted_ambient_degC_, hotter_K_);
  }

 private:
  bool missing_ = false, contradicts_ = false;
  int silent_steps_ = 0, steps_since_full_ = 0;  // without a usable reading; since a window was full
  int window_ = 0;                               // readings in it, and sums of them and of what the model said
  double reading_sum_degC_ = 0.0, model_sum_degC_ = 0.0;

  bool read_ = false, housing_known_ = false;
  int met_ = 0;  // means that counted without limit

  // How far both moved in about two minutes: each against a mean of itself that forgets as fast.
  float model_degC_ = 0.0f, model_moved_K_ = 0.0f;
  float reading_slow_degC_ = 0.0f, reading_moved_K_ = 0.0f;

  float pulled_K_ = 0.0f;  // forgotten slowly
  double trusted_ambient_degC_ = 0.0;
  float hotter_K_ = 0.0f;  // what the next mean that is too hot counts for
};

}  // namespace thermal

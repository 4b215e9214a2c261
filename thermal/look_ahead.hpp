// SPDX-License-Identifier: MIT
// Answers before the motion: can this be done, how hot does it get, when would the governor hold it back, how long to
// wait for it, how long does the present current last. The same network and the same step as the estimator's.
//
//   in   temperatures now (with margin, from the estimator), pieces of (seconds, amperes), boundary temperatures
//   out  peak temperature of any node that has a limit, the moment it would be reached
//
// Steps of 10 ms in the first second of a piece, 0.1 s to 20 s, 5 s beyond; at most most_steps a run: every call is
// bounded. Knows no slopes: it asks whether the demand itself fits, not what the governor would make of it.
//
// A board asks otherwise, in slices short enough to stand between two steps of a lane, and lets the margin grow with a
// winding's rise, as it will: a ProfileRun answers the first question, an Endurance the last, all the time. A LookAhead
// compares models on a PC, and keeps the margin as it is.
#pragma once

#include "thermal/core_estimator.hpp"
#include "thermal/governor.hpp"

namespace thermal {

/// A piece of a motion: |i| for some time. How it lies on the phases is said beside it (1/2 each when rotating).
struct Piece {
  float seconds;
  float current_A;
};

struct Forecast {
  bool feasible;         // no limit is passed, and the whole profile was looked at
  float peak_degC;       // of the node that comes closest to its limit
  float limits_after_s;  // +infinity when feasible
};

/// Temperatures on their way through a profile.
struct Walk {
  HeatNetwork<double>::Vector degC, began_degC;
  double growth = 0.0;  // of the margin, with what a winding rises more than the housing that is heard
  int heard_node = -1;
  double time_s = 0.0;
  Forecast forecast{};

  /// What is limited.
  double margin_degC(int node) const;
};

class LookAhead {
 public:
  explicit LookAhead(const HeatNetwork<double>& network);

  /// Plays the profile from the estimator's present state. At most `count` pieces; unusable pieces are not feasible.
  Forecast play(const CoreEstimator& core, const Piece* pieces, int count, const PhaseShares& shares) const;

  /// How long to rest (no current) until the profile fits, s, found to 1 %; +infinity if not within four hours.
  float wait_s(const CoreEstimator& core, const Piece* pieces, int count, const PhaseShares& shares) const;

  /// How long a current may go on, s, up to an hour; +infinity beyond.
  float seconds_left(const CoreEstimator& core, float current_A, const PhaseShares& shares) const;

  /// Largest |i| that may go on for this long, A, up to max_A.
  float current_for_A(const CoreEstimator& core, float seconds, float max_A, const PhaseShares& shares) const;

 private:
  static constexpr int most_steps = 2000;

  bool advance(Walk& run, int& steps, const CoreEstimator& core, const Piece& piece, const PhaseShares& shares) const;
  Forecast play_after(double rest_s, const CoreEstimator& core, const Piece* pieces, int count,
                      const PhaseShares& shares) const;

  Transition<double> fine_, middle_, coarse_;
};

/// A profile played in slices, in the estimator's own steps of 10 ms. The estimator may step on in between: the run
/// began at its temperatures and keeps its own. Heat by speed goes on as it is, cooling by speed is not counted on.
class ProfileRun {
 public:
  static constexpr int most_pieces = 16;
  static constexpr float most_s = 60.0f;

  /// False: no piece, a piece that is not one, or longer than most_s. ripple_A2: of |i|^2, what heats now whatever
  /// flows, and will then.
  bool begin(const CoreEstimator& core, const Piece* pieces, int count, const PhaseShares& shares,
             float ripple_A2 = 0.0f);
  /// Up to so many steps; true: played to its end.
  bool go_on(const CoreEstimator& core, int most_steps);

  /// After the end; not feasible: when the limit is first passed.
  const Forecast& forecast() const { return walk_.forecast; }
  /// Of the ampere-seconds asked for, those before a limit is passed. A governor delivers more: it goes on with less.
  float share_before_limit() const { return asked_As_ > 0.0 ? static_cast<float>(before_As_ / asked_As_) : 1.0f; }

 private:
  Walk walk_;
  Piece pieces_[most_pieces]{};
  PhaseShares shares_{};
  double ripple_A2_ = 0.0;
  int count_ = 0, piece_ = 0;
  double done_s_ = 0.0;  // of the present piece
  double asked_As_ = 0.0, before_As_ = 0.0;
};

/// What is always known: how long the load may go on, and what may flow for a second. An answer is as old as it took to
/// find, at most 400 steps: of 10 ms for a quarter of a second, of that much beyond.
class Endurance {
 public:
  static constexpr float longest_s = 30.0f;
  static constexpr float ahead_s = 1.0f;

  /// max_A: largest |i| that is asked about. Another network, another Endurance: until it has looked, nothing may flow.
  Endurance(const HeatNetwork<double>& network, float max_A);

  /// A slice, often and in equal intervals: the load is the mean square of what flows while an answer is worked out.
  /// True: both answers are new.
  bool go_on(const CoreEstimator& core, int steps);

  /// Begins anew: until it has looked, nothing may flow. Not once a bit has flipped.
  void forget();

  /// Until a limit is passed, s; +infinity where that is not within longest_s.
  float seconds_left() const { return seconds_left_; }
  /// Largest |i| for ahead_s, A, to 1 % of max_A on the safe side. It lies on the phases as the load does.
  float current_A() const { return current_A_; }

  /// No bit has flipped since the last call.
  bool whole() const { return sum() == left_; }

 private:
  std::uint32_t sum() const;
  void begin(const CoreEstimator& core);
  bool answer();

  Transition<double> coarse_;
  float max_A_;
  HeatInput<> sum_{};  // of the phases' squares, over so many slices
  int slices_ = 0;
  PhaseShares shares_{};
  Walk walk_;
  Piece piece_{longest_s, 0.0f};        // asked about: first the load, then what may flow for ahead_s
  float good_A_ = 0.0f, bad_A_ = 0.0f;  // that lies between them
  bool walking_ = false;
  float seconds_left_ = 0.0f, current_A_ = 0.0f;
  std::uint32_t left_;
};

}  // namespace thermal

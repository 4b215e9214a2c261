// SPDX-License-Identifier: MIT
// F19: what became of a flipped bit. Sees both axes period by period, whoever plays them (the firmware built for this
// PC, or the flash image), and holds that against the same run without the flip.
//
//   no effect   the plant ended as without the flip, to the last digit
//   harmless    it did not, but nothing below happened
//   detected    an axis said so: tripped or stopped, or a flag of its estimate rose; and nothing below happened
//   watchdog    the program hung, or wrecked itself: a watchdog opens the bridge
//   harmful     a winding more than 3 K above its limit, or the power stage above its own; or for longer than 10 ms
//               more than a tenth above the peak current, torque against or beyond the demand; above the trip level
//               for more than the 100 us of a saturated reading, bridge on; half of the torque lost without a word; a
//               bridge still on when the host has been silent for as long as it may be; or the program crashed
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <type_traits>

#include "tests/boards-host/fault_stand.hpp"

namespace faults {

inline constexpr int axes = firmware::axis_count;
inline constexpr double noticed_s = 0.010;  // F19

/// What is seen of both axes in a trial; crosses a pipe.
struct Seen {
  double over_K[axes] = {-1e9, -1e9}, stage_over_K = -1e9;  // hottest winding over its limit
  double above_peak_s = 0, above_trip_s = 0, wrong_s = 0;   // longest stretches
  double last_Nm[axes] = {}, last_A[axes] = {}, told_s = -1;
  std::uint32_t flags[axes] = {};
  bool limited[axes] = {}, silent_on = false, watchdog = false, same = false;
  double digits[5 * axes] = {};  // how the plant ended
  char mistake[64] = {};         // what no board may do, in words
};

/// One axis at the end of a period.
struct AxisView {
  host_sim::AxisTruth truth;
  bool on, elsewhere, tripped, limited;  // bridge; neither as before the flip nor where a fault leads; held back
  std::uint32_t flags;
};

class FlipJudge {
 public:
  /// `asked`: setpoints are obeyed. `calm`: what is seen without the flip, nullptr: this is it.
  FlipJudge(const Design& design, bool asked, const Seen* calm) : design_(design), asked_(asked), calm_(calm) {}

  /// `time_s` of the scene, `since_s` the flip. `last`: torque counts for what was lost.
  void see(const AxisView (&now)[axes], double stage_degC, double time_s, double since_s, double dt_s, bool host_alive,
           bool last);
  Seen ended(const AxisView (&now)[axes], const bool (&still_on)[axes]);
  bool told() const { return seen_.told_s >= 0; }

 private:
  /// The longest stretch of time in which something was so.
  struct Stretch {
    double now_s = 0, worst_s = 0;
    void see(bool so, double dt_s) { worst_s = std::max(worst_s, now_s = so ? now_s + dt_s : 0); }
  };
  bool is_wrong(const host_sim::AxisTruth& now, int axis, double time_s) const;

  const Design& design_;
  bool asked_;
  const Seen* calm_;
  Seen seen_;
  Stretch above_peak_, above_trip_[axes], wrong_[axes], elsewhere_[axes];
  int last_ = 0;
};

enum class Became { no_effect, harmless, detected, watchdog, harmful };
inline constexpr int kinds = 5;

struct Verdict {
  Became became;
  std::string why;
  double told_s = -1;
};
Verdict verdict_of(const Seen& seen, const Seen& calm);

/// Plays a trial in a process of its own, which a flip may wreck. False: it did not come to its end; why is in `status`
/// of waitpid.
bool play_forked(const std::function<const void*()>& trial, void* found, std::size_t bytes, int& status);
template <class Found>
bool play_forked(const std::function<Found()>& trial, Found& found, int& status) {
  static_assert(std::is_trivially_copyable_v<Found>);
  Found theirs;
  return play_forked([&] { return &(theirs = trial()); }, &found, sizeof found, status);
}

struct Tally {
  int became[kinds] = {}, soon = 0;  // the latter: detected within the 10 ms of F19
  int all() const;
  int of(Became b) const { return became[static_cast<int>(b)]; }
  void add(const Verdict& v);
};
std::string head_line();
std::string line(const std::string& name, std::size_t bytes, const Tally& tally);
/// The last lines: shares. Returns the share that is detected or harmless.
double print_sum(const Tally& sum, std::size_t bytes);

}  // namespace faults

// SPDX-License-Identifier: MIT
// F19: a campaign of flipped bits. Draws scenes in which both axes work near their limits (a push, a stall, a walk) or
// are disarmed and spoken to all the same; sees both axes period by period, whoever plays them (the firmware built for
// this PC, or the flash image), and holds that against the same run without the flip. What may become of one:
//
//   no effect   the plant ended as without the flip, to the last digit
//   harmless    it did not, but nothing below happened
//   detected    an axis said so: tripped or stopped, or a flag of its estimate rose; and nothing below happened
//   watchdog    the program hung, or wrecked itself: a watchdog opens the bridge
//   harmful     a winding more than 3 K above its limit, or the power stage above its own; or for longer than 10 ms
//               more than a tenth above the peak current, torque against or beyond the demand; above the trip level
//               for more than the 100 us of a saturated reading, bridge on; half of the torque lost without a word (a
//               limit is one if the current fell with it); a bridge still on when the host has been silent for as long
//               as it may be; an estimate too cold after a reset; a shorted bridge; or the program crashed
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

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
  /// `now`: when the host has been silent for as long as it may be.
  Seen ended(const AxisView (&now)[axes]);
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

/// The command line of a campaign.
struct Options {
  int flips, at_once, motor_count = 3;  // at_once: of the same scene
  double seconds, least = -1;
  std::uint64_t seed = 1000;
  std::vector<std::string> only{};
  bool list = false, json = false;
  void add_to(CLI::App& app);
};

struct Scenery {
  const char* motor;
  Scenes scene;
  Design design;
  std::uint64_t seed;
  bool arms;
};

struct Part {
  std::string name, full_name;  // the first in the table and for --part
  std::size_t at, bytes;
  bool holds(std::size_t byte) const { return byte >= at && byte < at + bytes; }
};

struct Flip {
  std::size_t byte;
  unsigned bit;
};

/// A board in the middle of a scene; each trial begins there.
class Victim {
 public:
  virtual ~Victim() = default;
  /// The first that holds a byte gives it its name; the last one is all of it.
  virtual std::vector<Part> parts() const = 0;
  /// nullptr, the first time: without a flip; what is seen then is what others are held against.
  virtual Verdict trial(const Flip* flip) = 0;
};

/// Flips, and prints the table. The exit code.
int run_campaign(
    const Options& options,
    const std::function<std::unique_ptr<Victim>(const Scenery& scenery, host_sim::Random& random)>& set_up);

}  // namespace faults

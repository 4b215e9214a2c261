// SPDX-License-Identifier: MIT
// F19: flips one bit of the firmware's Driver, any bit of any byte, at a random instant on a simulated board whose axes
// both work near their limits (a push, a stall, a walk) or are disarmed and spoken to all the same. Each flip is a
// forked trial beside one that nothing happens to; then the host falls silent. What became of it:
//
//   no effect   the plant ended as without the flip, to the last digit
//   harmless    it did not, but nothing below happened
//   detected    an axis said so: tripped or stopped, or a flag of its estimate rose; and nothing below happened
//   watchdog    the program hung in a tick: on the chip a watchdog opens the bridge
//   harmful     a winding more than 3 K above its limit, or the power stage above its own; or for longer than 10 ms
//               more than a tenth above the peak current, torque against or beyond the demand; above the trip level
//               for more than the 100 us of a saturated reading, bridge on; half of the torque lost without a word; a
//               bridge still on 310 ms after the host's last word; or the program crashed
//
// The host's object stands for the chip's: its sizes are 64 bits where those of the chip are 32. A flip comes between
// two PWM periods, so never into the middle of a tick; on the chip the slow lane works for 1.4 of its 10 ms at least
// (both axes, 235,000 instructions at 168 MHz), and what flips in a state that it works on may be taken for its result.
#include <fmt/format.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstring>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "boards/dual_48v_20a.hpp"
#include "tests/boards-host/fault_stand.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/program.hpp"

namespace firmware {

struct AxisProbe {
  static void name_parts(const Axis& a, const std::function<void(const char*, const void*, std::size_t)>& part) {
#define PART(member) part(#member, &a.member, sizeof a.member)
    PART(heat_), PART(allowance_), PART(commands_), PART(rating_), PART(next_), PART(next_state_), PART(finding_);
    PART(guard_), PART(offsets_), PART(rotor_), PART(setpoint_), PART(permit_), PART(current_loop_), PART(dead_time_);
    PART(usable_ratio_), PART(last_), PART(trace_), PART(mode_), PART(control_), PART(A_per_Nm_), PART(configured_);
    PART(sees_), PART(quiet_rad_per_s_per_V_), PART(offset_bound_A_), PART(core_), PART(governor_), PART(endurance_);
    PART(looked_), PART(looks_), PART(unseen_), PART(input_), PART(owed_steps_), PART(steps_), PART(charge_),
        PART(phase_ohm_);
    PART(copper_per_K_), PART(flux_Wb_), PART(inductance_H_), PART(pwm_Hz_), PART(peak_A_), PART(blind_A_);
    PART(blind_cap_A_), PART(senses_housing_), PART(watch_), PART(doubted_), PART(tripped_periods_), PART(period_s_);
    PART(fault_), PART(behind_), PART(housing_measured_degC_), PART(state_), PART(index_);
#undef PART
  }
};

}  // namespace firmware

namespace {

using namespace faults;
using host_sim::Random;

constexpr int axes = firmware::axis_count;
constexpr double most_over_K = 3, stage_max_degC = 100;    // as F19 promises; the stage's own limit
constexpr double noticed_s = 0.010, silent_s = 0.310;      // F19; time-out, ramp and 5 ms of F21, and one tick
constexpr double torque_share = 0.2, current_share = 1.1;  // of the largest demand, of the peak
constexpr double trip_A = static_cast<double>(boards::dual_48V_20A.trip_A), trip_s = 125e-6;  // two periods
constexpr double lost_share = 0.5, last_s = 0.5;  // of the torque of the same run without the flip; its end
constexpr double after_trip_s = 0.3;              // an open bridge only cools
constexpr long hang_us = 300'000;                 // of CPU without a period, which takes 10: it hangs

constexpr const char* examples =
    "F19: what becomes of single flipped bits in the firmware's state, on simulated boards\n"
    "\n"
    "Examples\n"
    "  flips                        3000 flips on three motors, 10 s each: some minutes\n"
    "  flips --flips 400 --seconds 2 --motors 1 --check 0.99\n"
    "  flips --part rotor_ --list   only there, and each flip that did harm\n"
    "Exit codes: 0 done, 1 fewer than --check asks for are detected or harmless, 2 the command line is\n"
    "wrong.\n";

/// What is seen of both axes in a trial; crosses a pipe.
struct Seen {
  double over_K[axes] = {-1e9, -1e9}, stage_over_K = -1e9;  // hottest winding over its limit
  double most_A = 0;
  double above_peak_s = 0, above_trip_s = 0, wrong_s = 0;  // longest stretches
  double last_Nm[axes] = {}, told_s = -1;
  std::uint32_t flags[axes] = {};
  bool limited[axes] = {}, silent_on = false;
  double digits[5 * axes] = {};  // how the plant ended
};

/// The longest stretch of time in which something was so.
struct Stretch {
  double now_s = 0, worst_s = 0;
  void see(bool so, double dt_s) { worst_s = std::max(worst_s, now_s = so ? now_s + dt_s : 0); }
};

/// The torque is against what is asked for, or more than that.
bool is_wrong(const Stand& s, int axis) {
  const double wish_A = s.arms ? boards::host::demand_A(s.design().scene, axis, s.time_s()) : 0;
  const double per_A = 1.5 * s.design().truth.pole_pairs * s.design().truth.flux_linkage_Wb;
  const double slack_Nm = torque_share * s.largest_demand_Nm(axis), torque_Nm = s.bench.truth(axis).torque_Nm;
  return torque_Nm < std::min(0.0, wish_A * per_A) - slack_Nm || torque_Nm > std::max(0.0, wish_A * per_A) + slack_Nm;
}

volatile std::sig_atomic_t periods_since_look = 1;
constexpr int hung = 3;

void look_for_a_hang(int) {
  if (periods_since_look == 0) _exit(hung);
  periods_since_look = 0;
}

/// Runs on for `seconds`, then without a host. `calm`: what is seen without the flip, nullptr: this is it.
Seen watched(Stand& s, double seconds, const Seen* calm) {
  Seen seen;
  Stretch above_peak, above_trip[axes], wrong[axes], elsewhere[axes];
  firmware::Mode before[axes];
  for (int a = 0; a < axes; ++a) before[a] = s.arms ? firmware::Mode::running : firmware::Mode::off;
  const double dt_s = s.bench.period_s(), from_s = s.time_s();
  double to_s = from_s + seconds;
  int last = 0;
  const auto period = [&] {
    s.step();
    periods_since_look = 1;
    double most_A = 0;
    bool told = false;
    for (int a = 0; a < axes; ++a) {
      const host_sim::AxisTruth now = s.bench.truth(a);
      const firmware::Axis& axis = s.driver->axis(a);
      seen.over_K[a] = std::max(seen.over_K[a], now.hottest_degC - s.design().truth.winding_max_degC);
      double largest_A = 0;
      for (const double i_A : now.current_A) largest_A = std::max(largest_A, std::abs(i_A));
      most_A = std::max(most_A, largest_A);
      seen.flags[a] |= axis.state().estimate_flags;
      const firmware::Mode mode = axis.mode();
      above_trip[a].see(largest_A > trip_A && mode == firmware::Mode::running, dt_s);
      elsewhere[a].see(mode != before[a] && mode <= firmware::Mode::tripped, dt_s);
      told = told || mode == firmware::Mode::tripped || elsewhere[a].now_s > noticed_s ||
             (calm != nullptr && (seen.flags[a] & ~calm->flags[a]) != 0);
      if (s.host_alive) seen.limited[a] = axis.fast().limit != wire::Limit::none || mode == firmware::Mode::tripped;
      if (mode == firmware::Mode::tripped) to_s = std::min(to_s, s.time_s() + after_trip_s);
      if (s.host_alive) wrong[a].see(is_wrong(s, a), dt_s);
      if (s.host_alive && s.time_s() > to_s - last_s) seen.last_Nm[a] += now.torque_Nm;
    }
    last += s.host_alive && s.time_s() > to_s - last_s;
    if (told && s.host_alive && seen.told_s < 0) seen.told_s = s.time_s() - from_s;
    seen.stage_over_K = std::max(seen.stage_over_K, s.bench.power_stage_degC() - stage_max_degC);
    above_peak.see(most_A > current_share * peak_A, dt_s);
  };
  while (s.time_s() < to_s) period();
  s.host_alive = false;
  const double silent_from_s = s.time_s();
  while (s.time_s() < silent_from_s + silent_s) period();
  std::size_t digit = 0;
  for (int a = 0; a < axes; ++a) {
    const host_sim::AxisTruth end = s.bench.truth(a);
    for (const double x : {end.hottest_degC, end.housing_degC, end.current_A[0], end.current_A[1], end.torque_Nm})
      seen.digits[digit++] = x;
    seen.last_Nm[a] /= std::max(last, 1);
    seen.silent_on = seen.silent_on || s.driver->axis(a).mode() == firmware::Mode::running;
    seen.wrong_s = std::max(seen.wrong_s, wrong[a].worst_s);
    seen.above_trip_s = std::max(seen.above_trip_s, above_trip[a].worst_s);
  }
  seen.above_peak_s = above_peak.worst_s;
  return seen;
}

enum class Became { no_effect, harmless, detected, watchdog, harmful };
constexpr int kinds = 5;

/// What is wrong in a trial; empty: nothing.
std::string harm(const Seen& seen, const Seen& calm) {
  for (int a = 0; a < axes; ++a) {
    if (seen.over_K[a] - std::max(calm.over_K[a], 0.0) > most_over_K)
      return fmt::format("axis {}: winding {:.1f} K over", a, seen.over_K[a]);
    if (std::abs(seen.last_Nm[a]) < lost_share * std::abs(calm.last_Nm[a]) && seen.told_s < 0 && !seen.limited[a])
      return fmt::format("axis {}: torque lost", a);
  }
  if (seen.stage_over_K - std::max(calm.stage_over_K, 0.0) > 0)
    return fmt::format("power stage {:.1f} K over", seen.stage_over_K);
  if (seen.above_trip_s > trip_s) return fmt::format("above the trip level for {:.4f} s", seen.above_trip_s);
  if (seen.above_peak_s > noticed_s) return fmt::format("above the peak for {:.3f} s", seen.above_peak_s);
  if (seen.wrong_s > noticed_s) return fmt::format("wrong torque for {:.3f} s", seen.wrong_s);
  if (seen.silent_on) return "runs on without a host";
  return "";
}

struct Flip {
  std::size_t byte;
  unsigned bit;
};

struct Verdict {
  Became became;
  std::string why;
  double told_s = -1;
};

/// A trial in a process of its own. Without a flip: what is seen is the calm that others are held against.
Verdict trial(Stand& stand, double seconds, const Flip* flip, Seen& calm) {
  int ends[2];
  if (pipe(ends) != 0) throw std::runtime_error("no pipe");
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("no process");
  if (child == 0) {
    (void)!freopen("/dev/null", "w", stderr);  // an assertion speaks up
    std::signal(SIGPROF, look_for_a_hang);
    const itimerval beat{{0, hang_us}, {0, hang_us}};
    setitimer(ITIMER_PROF, &beat, nullptr);
    if (flip != nullptr)
      reinterpret_cast<unsigned char*>(&*stand.driver)[flip->byte] ^= static_cast<unsigned char>(1u << flip->bit);
    const Seen seen = watched(stand, seconds, flip == nullptr ? nullptr : &calm);
    _exit(write(ends[1], &seen, sizeof seen) == sizeof seen ? 0 : 1);
  }
  close(ends[1]);
  Seen seen;
  const bool whole = read(ends[0], &seen, sizeof seen) == sizeof seen;
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  if (!whole && WIFEXITED(status) && WEXITSTATUS(status) == hung) return {Became::watchdog, "hangs"};
  if (!whole) return {Became::harmful, fmt::format("crashes, signal {}", WIFSIGNALED(status) ? WTERMSIG(status) : 0)};
  if (flip == nullptr) calm = seen;
  const std::string why = harm(seen, calm);
  if (!why.empty()) return {Became::harmful, why, seen.told_s};
  if (seen.told_s >= 0) return {Became::detected, "", seen.told_s};
  const bool same = std::memcmp(seen.digits, calm.digits, sizeof seen.digits) == 0;
  return {same ? Became::no_effect : Became::harmless, ""};
}

/// A part of the object; the first that holds a byte gives it its name.
struct Part {
  std::string name;
  std::size_t at, bytes;
  bool holds(std::size_t byte) const { return byte >= at && byte < at + bytes; }
};

/// The last one is all of it.
std::vector<Part> parts_of(const firmware::Driver& driver) {
  std::vector<Part> parts;
  const auto offset = [&driver](const void* at) {
    return static_cast<std::size_t>(static_cast<const char*>(at) - reinterpret_cast<const char*>(&driver));
  };
  for (int a = 0; a < axes; ++a) {
    firmware::AxisProbe::name_parts(driver.axis(a), [&](const char* name, const void* at, std::size_t bytes) {
      parts.push_back({name, offset(at), bytes});
    });
  }
  parts.push_back({"board_heat_", offset(&driver.board_heat()), sizeof driver.board_heat()});
  parts.push_back({"the rest", 0, sizeof driver});
  return parts;
}

struct Tally {
  int became[kinds] = {}, soon = 0;  // the latter: detected within the 10 ms of F19
  int all() const {
    int sum = 0;
    for (const int n : became) sum += n;
    return sum;
  }
  int of(Became b) const { return became[static_cast<int>(b)]; }
  void add(const Verdict& v) {
    ++became[static_cast<int>(v.became)];
    soon += v.became == Became::detected && v.told_s <= noticed_s;
  }
};

std::string line(const std::string& name, std::size_t bytes, const Tally& t) {
  return fmt::format("{:<24} {:>6} {:>6} {:>9} {:>8} {:>8} {:>8} {:>7}\n", name, bytes, t.all(),
                     t.of(Became::no_effect), t.of(Became::harmless), t.of(Became::detected), t.of(Became::watchdog),
                     t.of(Became::harmful));
}

nlohmann::ordered_json json_of(std::size_t bytes, const Tally& t) {
  return {{"bytes", bytes},
          {"flips", t.all()},
          {"no_effect", t.of(Became::no_effect)},
          {"harmless", t.of(Became::harmless)},
          {"detected", t.of(Became::detected)},
          {"detected_within_10_ms", t.soon},
          {"watchdog", t.of(Became::watchdog)},
          {"harmful", t.of(Became::harmful)}};
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{examples};
  wire::pc::use_help(app, "flips");
  int flips = 3000, motor_count = 3, at_once = 20;
  double seconds = 10, least = -1;
  std::uint64_t seed = 1000;
  std::vector<std::string> only;
  bool list = false, json = false;
  app.add_option("--flips", flips, "how many")->capture_default_str()->check(wire::pc::between(1, 1e6));
  app.add_option("--seconds", seconds, "simulated after each")
      ->capture_default_str()
      ->check(wire::pc::between(0.6, 1e3));
  app.add_option("--motors", motor_count, "1: only the small one, whose winding warms soonest")
      ->capture_default_str()
      ->check(wire::pc::between(1, 3));
  app.add_option("--seed", seed, "of everything drawn")->capture_default_str()->check(wire::pc::between(0, 1e15));
  app.add_option("--part", only, "only bytes of these members");
  app.add_flag("--list", list, "each flip that did harm, on standard error");
  app.add_option("--check", least, "end with an error when a smaller share is detected or harmless")
      ->check(wire::pc::between(0, 1));
  app.add_flag("--json", json, "the table as JSON");
  return wire::pc::run_program(app, argc, argv, [&] {
    Random random(seed);
    std::map<std::string, std::pair<std::size_t, Tally>> by_part;
    Tally sum;
    std::size_t size = 0;
    for (int n = 0; n < flips;) {
      const Scenes scene = std::array{push, stall, walk, stall}[random.next() % 4];
      const char* const motor = motors[random.next() % static_cast<unsigned>(motor_count)];
      Design design = design_of(motor, scene, 1e6, random);
      tell_the_truth(design);
      if (design.scene.demands.size() < axes) {
        design.scene.demands.push_back(design.scene.demands[0]);
        design.scene.demands[1].axis = 1;
      }
      Stand stand(design, random.next());
      stand.arms = scene != stall || random.next() % 4 != 0;
      const double instant_s = design.fault_s + random.uniform(0, 1);
      while (stand.time_s() < instant_s) stand.step();

      const std::vector<Part> parts = parts_of(*stand.driver);
      size = parts.back().bytes;
      std::vector<Part> chosen;
      for (const Part& p : parts) {
        if (std::find(only.begin(), only.end(), p.name) != only.end()) chosen.push_back(p);
      }
      if (only.empty()) chosen = {parts.back()};
      if (chosen.empty()) wire::pc::refuse("--part: there is no such member; the table of all flips has them.");
      Seen calm;
      const Verdict without = trial(stand, seconds, nullptr, calm);
      if (without.became == Became::harmful) throw std::runtime_error("without a flip: " + without.why);
      for (int k = 0; k < at_once && n < flips; ++k, ++n) {
        const Part& one = chosen[random.next() % chosen.size()];
        const Flip flip = {one.at + random.next() % one.bytes, static_cast<unsigned>(random.next() % 8)};
        const auto holds = [&flip](const Part& p) { return p.holds(flip.byte); };
        const Part& part = *std::find_if(parts.begin(), parts.end(), holds);
        const Verdict verdict = trial(stand, seconds, &flip, calm);
        auto& [bytes, tally] = by_part[part.name];
        bytes = part.bytes;
        tally.add(verdict);
        sum.add(verdict);
        if (list && verdict.became == Became::harmful)
          fmt::print(stderr, "{}, {}{}: {} + {} bit {}: {}{}\n", motor, name_of(scene), stand.arms ? "" : " disarmed",
                     part.name, flip.byte - part.at, flip.bit, verdict.why,
                     verdict.told_s >= 0 ? fmt::format(", told after {:.3f} s", verdict.told_s) : "");
      }
    }
    const double share = 1 - static_cast<double>(sum.of(Became::harmful)) / sum.all();
    if (json) {
      nlohmann::ordered_json parts = json_of(size, sum);
      for (const auto& [name, found] : by_part) parts["parts"][name] = json_of(found.first, found.second);
      fmt::print("{}\n", parts.dump(2));
      return share < least ? 1 : 0;
    }
    fmt::print("{:<24} {:>6} {:>6} {:>9} {:>8} {:>8} {:>8} {:>7}\n", "part", "bytes", "flips", "no effect", "harmless",
               "detected", "watchdog", "harmful");
    for (const auto& [name, found] : by_part) fmt::print("{}", line(name, found.first, found.second));
    fmt::print("{}", line("all", size, sum));
    fmt::print("{:.2f} % detected or harmless; {} of {} detected within 10 ms\n", 100 * share, sum.soon,
               sum.of(Became::detected));
    return share < least ? 1 : 0;
  });
}

// SPDX-License-Identifier: MIT
// F19: flips one bit of the firmware's Driver, any bit of any byte, at a random instant on a simulated board whose axes
// both work near their limits (a push, a stall, a walk) or are disarmed and spoken to all the same. Each flip is a
// forked trial beside one that nothing happens to; then the host falls silent (flip_judge.hpp: what may become of it).
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

#include "tests/boards-host/flip_judge.hpp"
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

constexpr double silent_s = 0.310;    // time-out, ramp and 5 ms of F21, and one tick
constexpr double last_s = 0.5;        // in which torque is compared
constexpr double after_trip_s = 0.3;  // an open bridge only cools
constexpr long hang_us = 300'000;     // of CPU without a period, which takes 10: it hangs

constexpr const char* examples =
    "Examples:\n"
    "  flips                        3000 flips on three motors, 10 s each: some minutes\n"
    "  flips --flips 400 --seconds 2 --motors 1 --check 0.99\n"
    "  flips --part rotor_ --list   only there, and each flip that did harm\n"
    "Exit codes: 0 done, 1 fewer than --check asks for are detected or harmless, 2 the command line is wrong.\n";

volatile std::sig_atomic_t periods_since_look = 1;
constexpr int hung = 3;

void look_for_a_hang(int) {
  if (periods_since_look == 0) _exit(hung);
  periods_since_look = 0;
}

/// Runs on for `seconds`, then without a host. `calm`: what is seen without the flip, nullptr: this is it.
Seen watched(Stand& s, double seconds, const Seen* calm) {
  FlipJudge judge(s.design(), s.arms, calm);
  const firmware::Mode before = s.arms ? firmware::Mode::running : firmware::Mode::off;
  const double from_s = s.time_s();
  double to_s = from_s + seconds;
  AxisView now[axes];
  const auto period = [&] {
    s.step();
    periods_since_look = 1;
    for (int a = 0; a < axes; ++a) {
      const firmware::Axis& axis = s.driver->axis(a);
      const firmware::Mode mode = axis.mode();
      now[a] = {s.bench.truth(a),
                mode == firmware::Mode::running,
                mode != before && mode <= firmware::Mode::tripped,
                mode == firmware::Mode::tripped,
                axis.fast().limit != wire::Limit::none,
                axis.state().estimate_flags};
      if (now[a].tripped) to_s = std::min(to_s, s.time_s() + after_trip_s);
    }
    judge.see(now, s.bench.power_stage_degC(), s.time_s(), s.time_s() - from_s, s.bench.period_s(), s.host_alive,
              s.time_s() > to_s - last_s);
  };
  while (s.time_s() < to_s) period();
  s.host_alive = false;
  const double silent_from_s = s.time_s();
  while (s.time_s() < silent_from_s + silent_s) period();
  return judge.ended(now, {now[0].on, now[1].on});
}

struct Flip {
  std::size_t byte;
  unsigned bit;
};

/// Without a flip: what is seen is the calm that others are held against.
Verdict trial(Stand& stand, double seconds, const Flip* flip, Seen& calm) {
  const auto play = [&] {
    std::signal(SIGPROF, look_for_a_hang);
    const itimerval beat{{0, hang_us}, {0, hang_us}};
    setitimer(ITIMER_PROF, &beat, nullptr);
    if (flip != nullptr)
      reinterpret_cast<unsigned char*>(&*stand.driver)[flip->byte] ^= static_cast<unsigned char>(1u << flip->bit);
    return watched(stand, seconds, flip == nullptr ? nullptr : &calm);
  };
  Seen seen;
  int status = 0;
  if (!play_forked<Seen>(play, seen, status)) {
    if (WIFEXITED(status) && WEXITSTATUS(status) == hung) return {Became::watchdog, "hangs"};
    return {Became::harmful, fmt::format("crashes, signal {}", WIFSIGNALED(status) ? WTERMSIG(status) : 0)};
  }
  if (flip == nullptr) calm = seen;
  return verdict_of(seen, calm);
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

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"F19: what becomes of single flipped bits in the firmware's state, on simulated boards"};
  wire::pc::use_help(app, "flips --help");
  app.footer(examples);
  int flips = 3000, motor_count = 3, at_once = 20;
  double seconds = 10, least = -1;
  std::uint64_t seed = 1000;
  std::vector<std::string> only;
  bool list = false;
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
  app.add_option("--check", least, "end with an error when a smaller share is detected or harmless");
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
    fmt::print("{}", head_line());
    for (const auto& [name, found] : by_part) fmt::print("{}", line(name, found.first, found.second));
    return print_sum(sum, size) < least ? 1 : 0;
  });
}

// SPDX-License-Identifier: MIT
// F19: flips one bit of the firmware's Driver, any bit of any byte, at a random instant on a simulated board. Each flip
// is a forked trial beside one that nothing happens to; then the host falls silent (flip_campaign.hpp).
//
// The host's object stands for the chip's: its sizes are 64 bits where those of the chip are 32. A flip comes between
// two PWM periods, so never into the middle of a tick; on the chip the slow lane works for 1.4 of its 10 ms at least
// (both axes, 235,000 instructions at 168 MHz), and what flips in a state that it works on may be taken for its result:
// for that, and for the rest of the image's memory, see tests/chip/image_flips.cpp.
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

#include "tests/boards-host/flip_campaign.hpp"
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
    "F19: what becomes of single flipped bits in the firmware's state, on simulated boards\n"
    "\n"
    "Examples\n"
    "  flips                        3000 flips on three motors, 10 s each: some minutes\n"
    "  flips --flips 400 --seconds 2 --motors 1 --check 0.99\n"
    "  flips --part rotor_ --list   only there, and each flip that did harm\n"
    "Exit codes: 0 done, 1 fewer than --check asks for are detected or harmless, 2 the command line is\n"
    "wrong.\n";

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
  return judge.ended(now);
}

class Board : public Victim {
 public:
  Board(const Scenery& scenery, Random& random, double seconds)
      : stand_(scenery.design, scenery.seed), seconds_(seconds) {
    stand_.arms = scenery.arms;
    const double instant_s = scenery.design.fault_s + random.uniform(0, 1);
    while (stand_.time_s() < instant_s) stand_.step();
  }

  std::vector<Part> parts() const override {
    const firmware::Driver& driver = *stand_.driver;
    std::vector<Part> parts;
    const auto offset = [&driver](const void* at) {
      return static_cast<std::size_t>(static_cast<const char*>(at) - reinterpret_cast<const char*>(&driver));
    };
    for (int a = 0; a < axes; ++a) {
      firmware::AxisProbe::name_parts(driver.axis(a), [&](const char* name, const void* at, std::size_t bytes) {
        parts.push_back({name, name, offset(at), bytes});
      });
    }
    parts.push_back({"board_heat_", "board_heat_", offset(&driver.board_heat()), sizeof driver.board_heat()});
    parts.push_back({"the rest", "the rest", 0, sizeof driver});
    return parts;
  }

  Verdict trial(const Flip* flip) override {
    const auto play = [&] {
      std::signal(SIGPROF, look_for_a_hang);
      const itimerval beat{{0, hang_us}, {0, hang_us}};
      setitimer(ITIMER_PROF, &beat, nullptr);
      if (flip != nullptr)
        reinterpret_cast<unsigned char*>(&*stand_.driver)[flip->byte] ^= static_cast<unsigned char>(1u << flip->bit);
      return watched(stand_, seconds_, flip == nullptr ? nullptr : &calm_);
    };
    Seen seen;
    int status = 0;
    if (!play_forked<Seen>(play, seen, status)) {
      if (WIFEXITED(status) && WEXITSTATUS(status) == hung) return {Became::watchdog, "hangs"};
      return {Became::harmful, fmt::format("crashes, signal {}", WIFSIGNALED(status) ? WTERMSIG(status) : 0)};
    }
    if (flip == nullptr) calm_ = seen;
    return verdict_of(seen, calm_);
  }

 private:
  Stand stand_;
  double seconds_;
  Seen calm_;
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{examples};
  wire::pc::use_help(app, "flips");
  Options options{.flips = 3000, .at_once = 20, .seconds = 10};
  options.add_to(app);
  return wire::pc::run_program(app, argc, argv, [&] {
    return run_campaign(options, [&](const Scenery& scenery, Random& random) {
      return std::make_unique<Board>(scenery, random, options.seconds);
    });
  });
}

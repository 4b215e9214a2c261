// SPDX-License-Identifier: MIT
// The fault campaign: breaks one thing at a time on a simulated board (three motors; a push, a stall, a walk; instant
// and size drawn from seeds) and holds what the firmware did against what was promised for that fault.
//
// Time counts from the first sample that shows the fault: a current reading off by 2 A and a tenth of the largest, an
// encoder off by 30 electrical degrees under 2 A, a phase that lacks 2 A. Before that a stuck sensor is right. A trip
// opens the bridge, which is more than a ramp to zero or a reduced current, and counts for either. Overshoot is held
// beside that of the same run without a fault, which may be 3 K (F00).
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tests/boards-host/fault_stand.hpp"
#include "tests/identify/chance.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/program.hpp"

namespace firmware {

/// Damages what no sample can reach, as a flipped bit would.
struct AxisProbe {
  static void allowance(Axis& axis, float value) { axis.allowance_.current_A = value; }
  static void current_loop(Axis& axis, float value) {
    axis.current_loop_.settle({value, value}, {value, value}, value);
  }
};

}  // namespace firmware

namespace {

using boards::host::Shaft;
using namespace faults;
using host_sim::Channel;
using host_sim::FaultKind;
using host_sim::Random;
using wire::Limit;

constexpr double never = std::numeric_limits<double>::infinity(), ms = 1e-3, pi = std::numbers::pi;
constexpr double period_s = 50e-6;
constexpr double shown_A = 2, shown_share = 0.1, shown_rad = pi / 6;
constexpr double reduced_A = 0.6 * 6;  // R2: of the board's continuous current

constexpr const char* examples =
    "The fault campaign: what the firmware does when one thing breaks, on simulated boards\n"
    "\n"
    "Examples\n"
    "  faults                       every fault, three motors, three scenes\n"
    "  faults --only F02 --seeds 20 --runs\n"
    "  faults --honest 10           hours without a fault: noise, gains apart, drift; nothing may trip\n"
    "Elsewhere: F15, F26 and the hangs of F20 are tested in tests/chip, F23 and the frames of F21 in\n"
    "tests/usb, F29 and the other counters of F17 in tests/firmware. F19 (bits that flip) is the program\n"
    "flips beside this one.\n"
    "Exit codes: 0 done, 1 a promise is broken that README does not tell of (--check) or something\n"
    "tripped in vain (--honest), 2 the command line is wrong.\n";

/// One fault, what was promised for it, and where that is not kept, why, and what the check holds instead.
struct Row {
  std::string id, words, reaction;
  double bound_s, overshoot_K;  // never: no reaction was promised, and a trip is one in vain
  std::function<void(Stand&)> fault = {};
  std::function<void(Design&, Random&)> before = {};
  Stand::Watch evident = {}, reacted = {};
  unsigned scenes = all;
  double seconds = 3;
  bool may_trip = false;
  bool small_motor_only = false;  // whose housing warms soonest
  std::string missed = {};
  double held_s = 0, held_K = 0;

  Row& breaks(std::function<void(Stand&)> what) { return fault = std::move(what), *this; }
  Row& sets(std::function<void(Design&, Random&)> what) { return before = std::move(what), *this; }
  Row& shows(Stand::Watch what) { return evident = std::move(what), *this; }
  Row& answers(Stand::Watch what) { return reacted = std::move(what), *this; }
  Row& in(unsigned which, double time_s) { return scenes = which, seconds = time_s, *this; }
  Row& lets_trip() { return may_trip = true, *this; }
  Row& small() { return small_motor_only = true, *this; }
  Row& misses(double time_s, double overshoot, std::string why) {
    return held_s = time_s, held_K = overshoot, missed = std::move(why), *this;
  }
};

// ---- what shows a fault, and what answers it
double permitted_A(const Stand& s) {
  const wire::Dq permitted = s.axis().fast().permitted_A;
  return static_cast<double>(std::hypot(permitted.d, permitted.q));
}
bool reduced(const Stand& s) { return permitted_A(s) <= reduced_A * 1.001; }
bool gives_nothing(const Stand& s) { return permitted_A(s) == 0; }
bool opened(const Stand& s) { return s.axis().mode() != firmware::Mode::running; }
bool refuses(const Stand& s) { return s.said() == wire::Status::not_a_current; }
bool doubts_housing(const Stand& s) {
  return (s.axis().state().estimate_flags & (thermal::housing_missing | thermal::housing_contradicts)) != 0;
}
bool current_is_off(const Stand& s) {
  double most_A = 0;
  for (const double i_A : s.truth().current_A) most_A = std::max(most_A, std::abs(i_A));
  return s.worst_current_error_A() > shown_A + shown_share * most_A;
}
bool angle_is_off(const Stand& s) {
  const host_sim::AxisTruth now = s.truth();
  return s.angle_error_rad() > shown_rad && std::hypot(now.current_d_A, now.current_q_A) > shown_A;
}
bool phase_lacks_current(const Stand& s) { return s.phase_missed_A() > shown_A; }
bool short_carries_the_peak(const Stand& s) { return s.short_A() > peak_A; }
bool drives(const Stand& s) {
  const double wish_A = boards::host::demand_A(s.design().scene, 0, s.time_s());
  return wish_A * s.truth().speed_rad_per_s >= 0 && std::abs(wish_A) > shown_A;
}

// ---- what breaks
constexpr Channel currents[] = {Channel::current_a, Channel::current_b, Channel::current_c};

std::function<void(Stand&)> breaks(Channel channel, FaultKind kind, double value = 0) {
  return [=](Stand& s) { s.breaks(channel, kind, value); };
}
std::function<void(Stand&)> breaks_a_phase(FaultKind kind, double value = 0) {
  return [=](Stand& s) { s.breaks(currents[s.random.next() % 3], kind, value); };
}
void swaps_two_phases(Stand& s) {
  const std::size_t k = s.random.next() % 3;
  const Channel one = currents[k], other = currents[(k + 1) % 3];
  s.breaks(one, FaultKind::swapped, 0, other);
  s.breaks(other, FaultKind::swapped, 0, one);
}
void sees_the_other_axis(Stand& s) {
  for (const Channel c : {currents[0], currents[1], currents[2], Channel::encoder})
    s.breaks(c, FaultKind::swapped, 0, c, 1);
}
void shorts_two_phases(Stand& s) {
  host_sim::Bridge& bridge = s.bench.bridge(0);
  bridge.short_from = static_cast<int>(s.random.next() % 3);
  bridge.short_to = (bridge.short_from + 1) % 3;
}
void interrupts_the_housing(Stand& s) {
  const double now_s = s.bench.time_s();
  for (int n = 0; n < 10; ++n)
    s.bench.faults().add({.channel = Channel::housing,
                          .kind = FaultKind::fixed,
                          .value = 4095,
                          .from_s = now_s + n,
                          .to_s = now_s + n + 0.5});
}
void takes_the_housing_off(Stand& s) {
  s.breaks(Channel::housing, FaultKind::gain, 0);
  s.breaks(Channel::housing, FaultKind::offset, s.design().scene.ambient_degC);
}
void restarts_twenty_times(Stand& s) {
  s.each = [&s, n = 0]() mutable {
    if (n < 20 && s.since_fault_s() >= 0.2 * n) s.restart(), ++n;
  };
}
void skips_control_for_5_ms(Stand& s) {
  s.each = [&s] { s.skipped_ticks = s.since_fault_s() < 5 * ms ? 1 : 0; };
}
void turns_the_setpoint_round(Stand& s) {
  const double Hz = std::pow(1000, s.random.uniform());
  s.turned = [&s, Hz](double) { return std::sin(2 * pi * Hz * s.time_s()) < 0 ? -peak_A : peak_A; };
}

std::vector<Row> table() {
  std::vector<Row> rows;
  const auto row = [&](const char* id, const char* words, const char* reaction, double bound_s, double K) -> Row& {
    return rows.emplace_back(Row{id, words, reaction, bound_s, K});
  };
  rows.reserve(64);  // references stay

  row("F00", "none", "runs", never, 3);
  row("F01", "a phase current stuck", "R1", 10 * ms, 1)
      .breaks(breaks_a_phase(FaultKind::stuck))
      .shows(current_is_off)
      .misses(60 * ms, 1, "below 3 A, while turning, not every look shows it");
  row("F02", "a phase reads 0 while conducting", "R1", 5 * ms, 1)
      .breaks(breaks_a_phase(FaultKind::fixed, 2048))
      .shows(current_is_off)
      .misses(150 * ms, 4, "the first look is a millisecond away; below 3 A, while turning, not every look shows it");
  row("F03", "a phase at the rail", "R0", 0.1 * ms, 0).breaks(breaks_a_phase(FaultKind::fixed, 4095));
  row("F04a", "offset step 0.5 A", "R2", 1, 3)
      .breaks(breaks_a_phase(FaultKind::offset, 0.5))
      .misses(never, 3, "half an ampere is what honest gains make; its heat is counted");
  row("F04b", "offset drift 1 A a minute", "R2", 5, 3)
      .breaks(breaks_a_phase(FaultKind::drift, 1.0 / 60))
      .shows([](const Stand& s) { return s.since_fault_s() > 30; })  // half an ampere
      .in(walk, 40)
      .small()
      .misses(never, 3, "half an ampere is what honest gains make; its heat is counted");
  row("F05a", "a gain of 0.9", "runs", never, 5).breaks(breaks_a_phase(FaultKind::gain, 0.9));
  row("F05b", "a gain of 0.5", "R2", 2, 5).breaks(breaks_a_phase(FaultKind::gain, 0.5)).shows(current_is_off);
  row("F06", "current noise times 10", "runs", never, 0)
      .breaks([](Stand& s) {
        for (const Channel c : currents) s.breaks(c, FaultKind::noise, 10 * s.design().sensors.current_noise_A);
      })
      .misses(never, 1, "half a kelvin in one run of ninety");
  row("F07a", "two phase currents swapped", "R1", 20 * ms, 1).breaks(swaps_two_phases).shows(current_is_off);
  row("F07b", "sees the other axis' currents and angle", "R1", 20 * ms, 1)
      .breaks(sees_the_other_axis)
      .shows(current_is_off)
      .misses(60 * ms, 15, "a current that nobody sees heats for the 4 to 8 ms until it is missed");
  row("F08", "conversion missing", "R0", 2 * period_s, 0).breaks(breaks(Channel::conversion, FaultKind::off));
  row("F09a", "a phase open", "R1", 10 * ms, 2)
      .breaks([](Stand& s) { s.bench.bridge(0).open_phases = 1u << s.random.next() % 3; })
      .shows(phase_lacks_current)
      .misses(600 * ms, 2, "below 4 A not every look shows it");
  row("F09b", "two phases touch", "R0", period_s, 2)
      .breaks(shorts_two_phases)
      .shows(short_carries_the_peak)
      .misses(0.4 * ms, 2, "a reading at the rail is a lost sample, and the second opens");

  const Channel housing = Channel::housing;
  row("F10a", "housing sensor open", "R2", 100 * ms, 3)
      .breaks(breaks(housing, FaultKind::fixed, 4095))
      .answers(doubts_housing);
  row("F10b", "housing sensor short", "R2", 100 * ms, 3)
      .breaks(breaks(housing, FaultKind::fixed, 0))
      .answers(doubts_housing);
  row("F10c", "housing sensor open for half of each second", "R2", 100 * ms, 3)
      .breaks(interrupts_the_housing)
      .answers(doubts_housing);
  row("F10d", "housing sensor reads 30 K more", "runs", never, 3).breaks(breaks(housing, FaultKind::offset, 30));
  const auto from_cold = [](Design& d, Random&) { d.scene.start_degC = 25; };
  row("F10e", "housing sensor stuck", "R2", 120, 3)
      .breaks(breaks(housing, FaultKind::stuck))
      .sets(from_cold)
      .answers(doubts_housing)
      .in(walk, 135)
      .small();
  row("F10f", "housing sensor comes off", "R2", 120, 3)
      .breaks(takes_the_housing_off)
      .sets(from_cold)
      .answers(doubts_housing)
      .in(walk, 135)
      .small();

  row("F11a", "ambient 60 degC believed 25", "runs", never, 5).in(all, 8).small().sets([](Design& d, Random&) {
    d.scene.ambient_degC = d.scene.start_degC = 60;
    d.estimator.ambient_degC = 25;
  });
  row("F11b", "60 degC believed 40, no housing sensor", "runs", never, 5)
      .in(all, 8)
      .small()
      .sets([](Design& d, Random&) {
        d.scene.ambient_degC = d.scene.start_degC = 60;
        d.senses_housing = false;
      });
  row("F12a", "stalled at any angle", "runs", never, 3).in(stall, 6);
  row("F12b", "creeps at 0.01 to 5 Hz", "runs", never, 3).in(stall, 6).sets([](Design& d, Random& random) {
    d.scene.shaft.kind = Shaft::Kind::imposed;
    d.scene.shaft.speed_rad_per_s = 2 * pi * 0.01 * std::pow(500, random.uniform()) / d.truth.pole_pairs;
  });
  row("F13a", "R1 30 % more than believed", "runs", never, 10).sets([](Design& d, Random&) {
    d.truth.R1_K_per_W *= 1.3;
  });
  row("F13b", "C1 30 % less than believed", "runs", never, 10).sets([](Design& d, Random&) {
    d.truth.C1_J_per_K *= 0.7;
  });
  row("F13c", "half of the cooling lost", "runs", never, 6)
      .breaks([](Stand& s) { s.bench.stove(0).around.cooling = 0.5; })
      .sets([](Design& d, Random&) { d.scene.start_degC = 60; })
      .in(walk, 120)
      .small();
  row("F13d", "10 W from a neighbour", "runs", never, 10)
      .sets([](Design& d, Random&) { d.scene.start_degC = 60, d.hidden.constant_heat_W = 10; })
      .in(walk, 120)
      .small();

  row("F14a", "reset in the middle of a burst", "runs", never, 2).breaks([](Stand& s) { s.restart(); });
  row("F14b", "twenty resets, five a second", "runs", never, 2).breaks(restarts_twenty_times).in(all, 7);
  row("F16a", "a tenth of control interrupts dropped", "runs", never, 1).breaks([](Stand& s) {
    s.skipped_ticks = 0.1;
  });
  row("F16b", "no control interrupt for 5 ms", "charged", never, 1).breaks(skips_control_for_5_ms).lets_trip();
  row("F16c", "each control interrupt twice", "runs", never, 1).breaks([](Stand& s) { s.ticks_twice = true; });
  row("F17", "the number of the period wraps", "runs", never, 0).sets([](Design& d, Random&) {
    d.first_period = 0u - static_cast<std::uint32_t>((boards::host::warm_up_s + d.fault_s) / period_s);
  });
  row("F18a", "allowance not a number", "R1", 10 * ms, 1).answers(gives_nothing).breaks([](Stand& s) {
    firmware::AxisProbe::allowance(s.driver->axis(0), std::nanf(""));
  });
  row("F18b", "current loop not a number", "R1", 10 * ms, 1).breaks([](Stand& s) {
    firmware::AxisProbe::current_loop(s.driver->axis(0), std::nanf(""));
  });
  row("F20", "slow lane starved", "R2", 35 * ms, 3).answers(reduced).breaks([](Stand& s) {
    s.slow_lane_alive = false;
  });
  // 100 ms and the ramp of 200 ms, +- 5 ms
  row("F21", "host silent: bridge open", "R1", 305 * ms, 0).answers(opened).breaks([](Stand& s) {
    s.host_alive = false;
  });
  row("F22a", "setpoints not a number", "refused", 1 * ms, 2).answers(refuses).breaks([](Stand& s) {
    s.turned = [](double) { return std::nan(""); };
  });
  row("F22b", "setpoint +-20 A, 1 Hz to 1 kHz", "runs", never, 2).breaks(turns_the_setpoint_round);
  row("F22c", "20 A for ever", "runs", never, 2)
      .in(push | stall, 12)
      .misses(never, 3, "at some angle of a blocked rotor the limit is passed by 2.2 K, as without a fault");

  const auto encoder_row = [&](const char* id, const char* words, double bound_s, FaultKind kind, double value) {
    row(id, words, "R1", bound_s, 2)
        .breaks(breaks(Channel::encoder, kind, value))
        .shows(angle_is_off)
        .misses(never, 2, "not seen at rest, nor while the back-EMF is within what the resistance may be off by");
  };
  encoder_row("F24a", "encoder frozen", 50 * ms, FaultKind::stuck, 0);
  encoder_row("F24b", "encoder jumps by 90 degrees", 20 * ms, FaultKind::offset, 1024);
  encoder_row("F24c", "encoder reversed", 50 * ms, FaultKind::gain, -1);
  encoder_row("F24d", "encoder slips by 200 counts a second", 50 * ms, FaultKind::drift, 200);

  row("F25a", "bus dips from 48 to 20 V", "R1", 1 * ms, 0).shows(drives).answers(gives_nothing).breaks([](Stand& s) {
    s.bench.supply().open_V = 20;
  });
  row("F25b", "supply cannot sink full braking", "runs", never, 0).in(push, 3).sets([](Design& d, Random&) {
    d.scene.supply_sinks = false;
    d.scene.shaft.speed_rad_per_s = 600;
    d.scene.demands[0].current_A = -peak_A;
  });
  row("F27", "20 A on both axes for 15 s, board at 50 degC", "runs", never, 3)
      .breaks([](Stand& s) { s.bench.set_power_stage_degC(50); })
      .sets([](Design& d, Random&) {
        d.scene.demands.push_back(d.scene.demands[0]);
        d.scene.demands[1].axis = 1;
        d.scene.start_degC = 25;
      })
      .in(push | stall, 17);
  row("F28", "driven by hand against 20 A of braking", "runs", never, 3).in(push, 3).sets([](Design& d, Random&) {
    d.scene.demands[0].current_A = -peak_A;
  });
  return rows;
}

Stand::Outcome played(const Row& row, const std::string& motor, Scenes scene, std::uint64_t seed) {
  Random random(seed);
  Design design = design_of(motor, scene, row.seconds, random);
  const wire::Motor sheet = design.truth;
  if (row.before) row.before(design, random);
  const bool another = row.id.rfind("F13", 0) == 0;  // than its sheet says; else the firmware knows the motor
  tell_the_truth(design);
  if (another) design.known = sheet, design.estimator.trust = thermal::sheet_trust;
  Stand stand(design, random.next());
  return stand.play(row.fault, row.evident, row.reacted);
}

/// What a run reaches without its fault; many rows share one.
double overshoot_without_K(const std::string& motor, Scenes scene, std::uint64_t seed,
                           std::map<std::uint64_t, double>& known) {
  const auto [place, is_new] = known.try_emplace(seed, 0.0);
  if (is_new) place->second = played(Row{"F00", "none", "runs", never, 3}, motor, scene, seed).overshoot_K;
  return place->second;
}

/// The worst of all runs of a row.
struct Found {
  int runs = 0, shown = 0, tripped = 0;
  double time_s = 0, overshoot_K = -1e9, added_K = -1e9, peak_A = 0, wrong_way = 0, stage_over_K = -1e9, bus_V = 0;
  std::vector<std::string> did = {};  // codes, as they first appeared

  /// `without_K`: overshoot of the same run without the fault.
  void add(const Stand::Outcome& o, double without_K) {
    ++runs;
    shown += o.evident_s >= 0;
    tripped += o.fault != wire::Fault::none;
    if (o.evident_s >= 0) time_s = std::max(time_s, o.reacted_s >= 0 ? o.reacted_s : never);
    overshoot_K = std::max(overshoot_K, o.overshoot_K);
    added_K = std::max(added_K, o.overshoot_K - std::max(without_K, 0.0));
    peak_A = std::max(peak_A, o.peak_A);
    wrong_way = std::max(wrong_way, o.wrong_way);
    stage_over_K = std::max(stage_over_K, o.stage_over_K);
    bus_V = std::max(bus_V, o.bus_V);
    const std::string name = o.fault != wire::Fault::none ? wire::text_of(o.fault).name : wire::text_of(o.limit).name;
    if (name != "none" && std::find(did.begin(), did.end(), name) == did.end()) did.push_back(name);
  }
  bool within(const Row& row, double bound_s, double most_K) const {
    return added_K <= most_K && (std::isfinite(row.bound_s) ? time_s <= bound_s + 1e-9 : row.may_trip || tripped == 0);
  }
  bool kept(const Row& row) const { return within(row, row.bound_s, row.overshoot_K); }
  bool holds(const Row& row) const { return kept(row) || (!row.missed.empty() && within(row, row.held_s, row.held_K)); }
};

std::string milliseconds(double s) { return std::isfinite(s) ? fmt::format("{:.4g}", 1e3 * s) : "-"; }

std::string line(const Row& row, const Found& found) {
  const bool timed = std::isfinite(row.bound_s);
  return fmt::format("{:<5} {:<45} {:<7} {:>7} {:>7} {:>4.3g} {:>+6.1f} {:>6.1f} {:>5.0f} {:>4}/{:<4} {}  {}{}\n",
                     row.id, row.words, row.reaction, timed ? milliseconds(row.bound_s) : "",
                     timed ? milliseconds(found.time_s) : "", row.overshoot_K, found.overshoot_K, found.peak_A,
                     100 * found.wrong_way, found.shown, found.runs, found.kept(row) ? "ok    " : "MISSED",
                     fmt::join(found.did, ", "),
                     found.kept(row)    ? ""
                     : found.holds(row) ? "; README tells: " + row.missed
                                        : "; README does not tell");
}

nlohmann::ordered_json json_of(const Row& row, const Found& found) {
  const auto seconds = [](double s) { return std::isfinite(s) ? nlohmann::ordered_json(s) : nullptr; };
  return {{"id", row.id},
          {"fault", row.words},
          {"reaction", row.reaction},
          {"bound_s", seconds(row.bound_s)},
          {"worst_s", seconds(found.time_s)},
          {"overshoot_promised_K", row.overshoot_K},
          {"overshoot_K", found.overshoot_K},
          {"of_it_by_the_fault_K", found.added_K},
          {"peak_A", found.peak_A},
          {"torque_wrong_way_share", found.wrong_way},
          {"power_stage_over_K", found.stage_over_K},
          {"bus_V", found.bus_V},
          {"runs", found.runs},
          {"shown", found.shown},
          {"tripped", found.tripped},
          {"did", found.did},
          {"kept", found.kept(row)},
          {"told", row.missed}};
}

/// A minute of honest duty: everything a board may be without being broken. Gains apart by 3 %, offsets of 0.3 A that
/// drift by as much again, noise; currents up to the peak, steps of it, speeds up to where the voltage ends.
Stand::Outcome honest_minute(std::uint64_t seed) {
  Random random(seed);
  const std::string motor = motors[random.next() % 3];
  Design d = design_of(motor, random.next() % 3 == 0 ? stall : walk, 60, random);
  d.scene.start_degC = random.uniform(0, 110);
  const double no_load_rad_per_s = 48 / std::sqrt(3.0) / (d.truth.flux_linkage_Wb * d.truth.pole_pairs);
  d.scene.shaft.speed_amplitude_rad_per_s = no_load_rad_per_s * random.uniform(0, 1);
  d.scene.shaft.frequency_Hz = std::exp(random.uniform(std::log(0.05), std::log(2.0)));
  d.scene.demands.clear();
  for (const int axis : {0, 1}) {
    for (int n = 0; n < 6; ++n)
      d.scene.demands.push_back({.axis = axis,
                                 .from_s = 10.0 * n,
                                 .to_s = 10.0 * n + random.uniform(1, 10),
                                 .current_A = random.uniform(-peak_A, peak_A),
                                 .ripple_ratio = random.uniform(0, 2),
                                 .frequency_Hz = std::exp(random.uniform(std::log(0.1), std::log(200.0)))});
  }
  for (int k = 0; k < 3; ++k) {
    d.sensors.current_gain[k] = 1 + random.uniform(-0.03, 0.03);
    d.sensors.current_offset_A[k] = random.uniform(-0.3, 0.3);
  }
  d.known = host_sim::true_sheet(d.truth, host_sim::heat_from_sheet(d.truth));
  d.estimator.trust = thermal::identified_trust;
  d.fault_s = 0;
  Stand stand(d, random.next());
  return stand.play(
      [](Stand& s) {
        for (const Channel c : currents) s.breaks(c, FaultKind::drift, s.random.uniform(-0.005, 0.005));
      },
      {}, {});
}

int play_honestly(double hours, std::uint64_t first, bool terminal) {
  const int minutes = static_cast<int>(std::ceil(60 * hours));
  int trips = 0;
  double hottest_K = -1e9;
  for (int m = 0; m < minutes; ++m) {
    const std::uint64_t seed = first + static_cast<std::uint64_t>(m);
    const Stand::Outcome o = honest_minute(seed);
    hottest_K = std::max(hottest_K, o.overshoot_K);
    if (o.fault != wire::Fault::none) {
      ++trips;
      fmt::print(stderr, "{}seed {}: {} ({:g} of {:g}) after {:.3f} s\n", terminal ? "\r" : "", seed,
                 wire::text_of(o.fault).name, static_cast<double>(o.value), static_cast<double>(o.threshold),
                 o.reacted_s);
    }
    if (terminal) fmt::print(stderr, "\r{}/{} minutes\033[K", m + 1, minutes);
  }
  if (terminal) fmt::print(stderr, "\r\033[K");
  fmt::print("{} simulated minutes without a fault: {} trips, the hottest winding {:+.1f} K from its limit\n", minutes,
             trips, hottest_K);
  return trips > 0 ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{examples};
  wire::pc::use_help(app, "faults");
  int seeds = 1;
  std::uint64_t first = tests::rotating_seed();
  double honest_hours = 0;
  std::vector<std::string> only;
  bool json = false, check = false, each_run = false;
  app.add_option("--seeds", seeds, "runs of each fault, motor and scene")
      ->capture_default_str()
      ->check(wire::pc::between(1, 1e6));
  app.add_option("--first", first, "first seed")
      ->capture_default_str()
      ->check(wire::pc::between(0, wire::pc::most_seed));
  app.add_option("--only", only, "these faults; F04 is F04a and F04b");
  app.add_option("--honest", honest_hours, "hours without a fault instead")->check(wire::pc::between(0, 1e6));
  app.add_flag("--runs", each_run, "each run in a line, on standard error");
  app.add_flag("--check", check, "end with an error when a promise is broken that README does not tell of");
  app.add_flag("--json", json, "the table as JSON");
  return wire::pc::run_program(app, argc, argv, [&] {
    const bool terminal = isatty(STDERR_FILENO) != 0;
    if (honest_hours > 0) return play_honestly(honest_hours, first, terminal);

    bool holds = true;
    std::map<std::uint64_t, double> without_K;
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    std::string text = fmt::format("{:<51} {:<7} {:>7} {:>7} {:>4} {:>6} {:>6} {:>5} {:>9} {}\n", "fault", "promise",
                                   "ms", "found", "K", "found", "A", "wrong", "shown", "what it did");
    for (const Row& row : table()) {
      const auto asked = [&](const std::string& id) { return row.id.rfind(id, 0) == 0; };
      if (!only.empty() && std::none_of(only.begin(), only.end(), asked)) continue;
      Found found;
      for (int s = 0; s < seeds; ++s) {
        for (std::size_t m = 0; m < std::size(motors); ++m) {
          if (row.small_motor_only && m > 0) continue;
          for (const Scenes scene : {push, stall, walk}) {
            if ((row.scenes & scene) == 0) continue;
            if (terminal) fmt::print(stderr, "\r  {} {}, {}\033[K", row.id, row.words, motors[m]);
            const std::uint64_t seed = first + 100 * static_cast<std::uint64_t>(s) + 10 * m + scene;
            const Stand::Outcome o = played(row, motors[m], scene, seed);
            // Where nothing breaks, the setting is the fault.
            const bool breaks = row.fault || row.overshoot_K == 0;
            found.add(o, breaks ? overshoot_without_K(motors[m], scene, seed, without_K) : 0);
            if (each_run)
              fmt::print(
                  stderr, "{}{:<5} {:<19} {:<5} shown {:7.2f} ms, answered {:7.2f} ms, {} {}, {:+.2f} K, {:.1f} A\n",
                  terminal ? "\r" : "", row.id, motors[m], faults::name_of(scene), 1e3 * o.evident_s, 1e3 * o.reacted_s,
                  wire::text_of(o.fault).name, wire::text_of(o.limit).name, o.overshoot_K, o.peak_A);
          }
        }
      }
      holds = holds && found.holds(row);
      text += line(row, found);
      list.push_back(json_of(row, found));
    }
    if (terminal) fmt::print(stderr, "\r\033[K");
    if (list.empty()) wire::pc::refuse("--only: there is no such fault here; --help says which are tested elsewhere.");
    fmt::print("{}", json ? list.dump(2) + "\n" : text);
    return check && !holds ? 1 : 0;
  });
}

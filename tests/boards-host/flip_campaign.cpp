// SPDX-License-Identifier: MIT
#include "tests/boards-host/flip_campaign.hpp"

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>

#include "boards/dual_48v_20a.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/program.hpp"

namespace faults {
namespace {

constexpr double most_over_K = 3, stage_max_degC = 100;    // as F19 promises; the stage's own limit
constexpr double torque_share = 0.2, current_share = 1.1;  // of the largest demand, of the peak
constexpr double trip_A = static_cast<double>(boards::dual_48V_20A.trip_A), trip_s = 125e-6;  // two periods
constexpr double lost_share = 0.5;  // of the torque of the same run without the flip

/// What is wrong in a trial; empty: nothing.
std::string harm(const Seen& seen, const Seen& calm) {
  if (seen.mistake[0] != 0) return seen.mistake;
  for (int a = 0; a < axes; ++a) {
    if (seen.over_K[a] - std::max(calm.over_K[a], 0.0) > most_over_K)
      return fmt::format("axis {}: winding {:.1f} K over", a, seen.over_K[a]);
    const bool held_back = seen.limited[a] && seen.last_A[a] < lost_share * calm.last_A[a];
    if (std::abs(seen.last_Nm[a]) < lost_share * std::abs(calm.last_Nm[a]) && seen.told_s < 0 && !seen.watchdog &&
        !held_back)
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

}  // namespace

/// The torque is against what is asked for, or more than that.
bool FlipJudge::is_wrong(const host_sim::AxisTruth& now, int axis, double time_s) const {
  const double wish_A = asked_ ? boards::host::demand_A(design_.scene, axis, time_s) : 0;
  const double per_A = 1.5 * design_.truth.pole_pairs * design_.truth.flux_linkage_Wb;
  const double slack_Nm = torque_share * largest_demand_Nm(design_, axis);
  return now.torque_Nm < std::min(0.0, wish_A * per_A) - slack_Nm ||
         now.torque_Nm > std::max(0.0, wish_A * per_A) + slack_Nm;
}

void FlipJudge::see(const AxisView (&now)[axes], double stage_degC, double time_s, double since_s, double dt_s,
                    bool host_alive, bool last) {
  double most_A = 0;
  bool told = false;
  for (int a = 0; a < axes; ++a) {
    const AxisView& axis = now[a];
    seen_.over_K[a] = std::max(seen_.over_K[a], axis.truth.hottest_degC - design_.truth.winding_max_degC);
    double largest_A = 0;
    for (const double i_A : axis.truth.current_A) largest_A = std::max(largest_A, std::abs(i_A));
    most_A = std::max(most_A, largest_A);
    seen_.flags[a] |= axis.flags;
    above_trip_[a].see(largest_A > trip_A && axis.on, dt_s);
    elsewhere_[a].see(axis.elsewhere, dt_s);
    told = told || axis.tripped || elsewhere_[a].now_s > noticed_s ||
           (calm_ != nullptr && (seen_.flags[a] & ~calm_->flags[a]) != 0);
    if (host_alive) seen_.limited[a] = axis.limited || axis.tripped;
    if (host_alive) wrong_[a].see(is_wrong(axis.truth, a, time_s), dt_s);
    if (!host_alive || !last) continue;
    seen_.last_Nm[a] += axis.truth.torque_Nm;
    seen_.last_A[a] += std::hypot(axis.truth.current_d_A, axis.truth.current_q_A);
  }
  last_ += host_alive && last;
  if (told && host_alive && seen_.told_s < 0) seen_.told_s = since_s;
  seen_.stage_over_K = std::max(seen_.stage_over_K, stage_degC - stage_max_degC);
  above_peak_.see(most_A > current_share * peak_A, dt_s);
}

Seen FlipJudge::ended(const AxisView (&now)[axes]) {
  std::size_t digit = 0;
  for (int a = 0; a < axes; ++a) {
    const host_sim::AxisTruth& end = now[a].truth;
    for (const double x : {end.hottest_degC, end.housing_degC, end.current_A[0], end.current_A[1], end.torque_Nm})
      seen_.digits[digit++] = x;
    seen_.last_Nm[a] /= std::max(last_, 1);
    seen_.last_A[a] /= std::max(last_, 1);
    seen_.silent_on = seen_.silent_on || now[a].on;
    seen_.wrong_s = std::max(seen_.wrong_s, wrong_[a].worst_s);
    seen_.above_trip_s = std::max(seen_.above_trip_s, above_trip_[a].worst_s);
  }
  seen_.above_peak_s = above_peak_.worst_s;
  return seen_;
}

Verdict verdict_of(const Seen& seen, const Seen& calm) {
  if (seen.same) return {Became::no_effect, ""};
  const std::string why = harm(seen, calm);
  if (!why.empty()) return {Became::harmful, why, seen.told_s};
  if (seen.watchdog) return {Became::watchdog, ""};
  if (seen.told_s >= 0) return {Became::detected, "", seen.told_s};
  const bool same = std::memcmp(seen.digits, calm.digits, sizeof seen.digits) == 0;
  return {same ? Became::no_effect : Became::harmless, ""};
}

bool play_forked(const std::function<const void*()>& trial, void* found, std::size_t bytes, int& status) {
  int ends[2];
  if (pipe(ends) != 0) throw std::runtime_error("no pipe");
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("no process");
  const auto all = static_cast<ssize_t>(bytes);
  if (child == 0) {
    (void)!freopen("/dev/null", "w", stderr);              // an assertion speaks up
    _exit(write(ends[1], trial(), bytes) == all ? 0 : 1);  // less than a pipe holds
  }
  close(ends[1]);
  const bool whole = read(ends[0], found, bytes) == all;
  close(ends[0]);
  waitpid(child, &status, 0);
  return whole;
}

namespace {

struct Tally {
  std::size_t bytes = 0;
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

void print(const std::string& name, const Tally& t) {
  fmt::print("{:<24} {:>6} {:>6} {:>9} {:>8} {:>8} {:>8} {:>7}\n", name, t.bytes, t.all(), t.of(Became::no_effect),
             t.of(Became::harmless), t.of(Became::detected), t.of(Became::watchdog), t.of(Became::harmful));
}

nlohmann::ordered_json json_of(const Tally& t) {
  return {{"bytes", t.bytes},
          {"flips", t.all()},
          {"no_effect", t.of(Became::no_effect)},
          {"harmless", t.of(Became::harmless)},
          {"detected", t.of(Became::detected)},
          {"detected_within_10_ms", t.soon},
          {"watchdog", t.of(Became::watchdog)},
          {"harmful", t.of(Became::harmful)}};
}

Scenery draw(host_sim::Random& random, int motor_count) {
  Scenery s;
  s.scene = std::array{push, stall, walk, stall}[random.next() % 4];
  s.motor = motors[random.next() % static_cast<unsigned>(motor_count)];
  s.design = design_of(s.motor, s.scene, 1e6, random);
  tell_the_truth(s.design);
  if (s.design.scene.demands.size() < axes) {
    s.design.scene.demands.push_back(s.design.scene.demands[0]);
    s.design.scene.demands[1].axis = 1;
  }
  s.seed = random.next();
  s.arms = s.scene != stall || random.next() % 4 != 0;
  return s;
}

}  // namespace

void Options::add_to(CLI::App& app) {
  app.add_option("--flips", flips, "how many")->capture_default_str()->check(wire::pc::between(1, 1e6));
  app.add_option("--seconds", seconds, "simulated after each")
      ->capture_default_str()
      ->check(wire::pc::between(0.05, 1e3));
  app.add_option("--motors", motor_count, "1: only the small one, whose winding warms soonest")
      ->capture_default_str()
      ->check(wire::pc::between(1, 3));
  app.add_option("--seed", seed, "of everything drawn")->capture_default_str()->check(wire::pc::between(0, 1e15));
  app.add_option("--part", only, "only bytes of these parts");
  app.add_flag("--list", list, "each flip that did harm, on standard error");
  app.add_option("--check", least, "end with an error when a smaller share is detected or harmless")
      ->check(wire::pc::between(0, 1));
  app.add_flag("--json", json, "the table as JSON");
}

int run_campaign(const Options& o,
                 const std::function<std::unique_ptr<Victim>(const Scenery&, host_sim::Random&)>& set_up) {
  host_sim::Random random(o.seed);
  std::map<std::string, Tally> by_part;
  Tally sum;
  for (int n = 0; n < o.flips;) {
    const Scenery scenery = draw(random, o.motor_count);
    const std::unique_ptr<Victim> victim = set_up(scenery, random);
    const std::vector<Part> parts = victim->parts();
    sum.bytes = parts.back().bytes;
    std::vector<Part> chosen;
    for (const Part& p : parts) {
      const auto means = [&p](const std::string& one) { return p.name == one || p.full_name.ends_with(one); };
      if (std::any_of(o.only.begin(), o.only.end(), means)) chosen.push_back(p);
    }
    if (o.only.empty()) chosen = {parts.back()};
    if (chosen.empty()) wire::pc::refuse("--part: there is no such part; the table of all flips has them.");
    const Verdict without = victim->trial(nullptr);
    if (without.became == Became::harmful) throw std::runtime_error("without a flip: " + without.why);
    for (int k = 0; k < o.at_once && n < o.flips; ++k, ++n) {
      const Part& one = chosen[random.next() % chosen.size()];
      const Flip flip = {one.at + random.next() % one.bytes, static_cast<unsigned>(random.next() % 8)};
      const auto holds = [&flip](const Part& p) { return p.holds(flip.byte); };
      const Part& part = *std::find_if(parts.begin(), parts.end(), holds);
      const Verdict verdict = victim->trial(&flip);
      by_part[part.name].add(verdict);
      sum.add(verdict);
      if (!o.list || verdict.became != Became::harmful) continue;
      fmt::print(stderr, "{}, {}{}: {} + {} bit {}: {}{}\n", scenery.motor, name_of(scenery.scene),
                 scenery.arms ? "" : " disarmed", part.full_name, flip.byte - part.at, flip.bit, verdict.why,
                 verdict.told_s >= 0 ? fmt::format(", told after {:.3f} s", verdict.told_s) : "");
    }
    for (auto& [name, tally] : by_part) {
      tally.bytes = 0;
      for (const Part& p : parts) tally.bytes += p.name == name ? p.bytes : 0;
    }
  }
  const double share = 1 - static_cast<double>(sum.of(Became::harmful)) / sum.all();
  if (o.json) {
    nlohmann::ordered_json all = json_of(sum);
    for (const auto& [name, tally] : by_part) all["parts"][name] = json_of(tally);
    fmt::print("{}\n", all.dump(2));
    return share < o.least ? 1 : 0;
  }
  fmt::print("{:<24} {:>6} {:>6} {:>9} {:>8} {:>8} {:>8} {:>7}\n", "part", "bytes", "flips", "no effect", "harmless",
             "detected", "watchdog", "harmful");
  for (const auto& [name, tally] : by_part) print(name, tally);
  print("all", sum);
  fmt::print("{:.2f} % detected or harmless; {} of {} detected within 10 ms\n", 100 * share, sum.soon,
             sum.of(Became::detected));
  return share < o.least ? 1 : 0;
}

}  // namespace faults

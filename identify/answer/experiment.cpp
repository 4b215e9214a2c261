// SPDX-License-Identifier: MIT
#include "identify/answer/experiment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "identify/fit/replayed.hpp"
#include "thermal/indices.hpp"

namespace identify {
namespace {

using thermal::Drive;

constexpr double spare_K = 10;  // below the winding's limit: identification must not burn what it measures
/// A protocol that is too hot is tried with less, down to a quarter of the current; each time it loses a quarter of its
/// heat, so that it is no cooler than that below what the winding bears.
constexpr double weaker = 0.88;
constexpr int most_tries = 12;
/// A winding's resistance is read as seldom in host-sim's logs and in score's.
constexpr double between_core_readings_s = 30;
/// Of a neighbour under load: in host-sim's logs it goes up to 50 K above its room.
constexpr double neighbour_warmer_K = 30;

struct Protocol {
  const char* why;
  std::vector<ProfileStep> steps;  // current in units of the log's rms (less where it is too hot), speed of its largest
};

/// Twenty minutes each: what the table's separating experiments ask for.
const std::vector<Protocol>& protocols() {
  static const std::vector<Protocol> all = {
      {"stall hot and cool down fully at rest", {{60, 0, 0}, {420, 1.7, 0}, {360, 0, 0}, {60, 2.2, 0}, {300, 0, 0}}},
      {"spin without load at three speeds, resting between",
       {{60, 0, 0}, {240, 0.05, 0.3}, {90, 0, 0}, {240, 0.05, 0.6}, {90, 0, 0}, {300, 0.05, 1}, {180, 0, 0}}},
      {"load and speed crossed: stalled, unloaded, both",
       {{60, 0, 0},
        {180, 1.5, 0},
        {120, 0, 0},
        {180, 0.05, 1},
        {180, 1.4, 1},
        {120, 0, 0},
        {180, 1.4, 0.4},
        {180, 0, 0}}},
      {"bursts at standstill with rests",
       {{60, 0, 0}, {30, 2.6, 0}, {120, 0, 0}, {60, 2.2, 0}, {180, 0, 0}, {240, 1.5, 0}, {60, 2.2, 0}, {450, 0, 0}}},
      {"low and high currents of both signs",
       {{60, 0, 0},
        {180, 0.4, 0},
        {180, -0.4, 0},
        {150, 1.6, 0},
        {150, -1.6, 0},
        {150, 0.8, 0},
        {150, -0.8, 0},
        {180, 0, 0}}},
      {"heat up, cool at rest; heat up, cool turning without load",
       {{60, 0, 0}, {240, 1.7, 0}, {300, 0, 0}, {240, 1.7, 0}, {300, 0.05, 1}, {60, 0, 0}}},
      {"a bit of everything",
       {{60, 0, 0},
        {120, 1.6, 0},
        {60, 0, 0},
        {120, 0.05, 0.95},
        {90, -1.6, 0},
        {60, 2.2, 0},
        {90, 0.05, 0.4},
        {120, 1.3, 0.9},
        {60, 0.5, 0},
        {120, 0, 0},
        {90, 1.5, -0.5},
        {30, 2.4, 0},
        {180, 0, 0}}},
  };
  return all;
}

/// The protocol as bins, no readings yet.
Bins bins_for(const Problem& problem, const std::vector<ProfileStep>& steps, double unit_A, double unit_rad_per_s) {
  const Bins& like = problem.logs.front();
  Bins out;
  out.name = "experiment";
  out.width_s = std::min(longest_bin_s, 4 * like.width_s);  // a rival is fitted in each protocol: for speed
  out.has_housing = like.has_housing;
  // As often as the log was read: not in every row, where the sensor is slow or coarse.
  double readings = 0;
  for (const Bin& bin : like.bins) readings += double{bin.housing_n};
  const double housing_n = out.width_s * readings / like.duration_s();
  out.has_core = problem.any_core();
  double sink = 0;
  for (const Bin& bin : like.bins) sink += bin.input.boundary_degC[0] / static_cast<double>(like.bins.size());
  double since_core_s = 0;
  out.starts = {{0, out.has_housing ? sink : missing, out.has_core ? sink : missing}};
  for (const ProfileStep& step : steps) {
    for (double t = 0; t < step.seconds; t += out.width_s) {
      Bin bin{};
      const double amps = step.current_A * unit_A;
      add_moment(bin, 1, amps, amps, step.speed_rad_per_s * unit_rad_per_s);
      auto& in = bin.input;
      for (double& b : in.boundary_degC) b = sink;
      // A neighbour that runs on its own: warm in the middle third.
      const double share = static_cast<double>(out.bins.size()) * out.width_s / 1200;
      if (like.has_neighbour && share > 0.33 && share < 0.66)
        in[thermal::Boundary::neighbour] = sink + neighbour_warmer_K;
      bin.housing_at = bin.core_at = 0.5f;
      bin.housing_n = static_cast<float>(housing_n);
      bin.idle = step.current_A == 0 && step.speed_rad_per_s == 0;
      in[thermal::Drive::enabled] = bin.idle ? 0 : 1;
      since_core_s += out.width_s;
      if (out.has_core && since_core_s >= between_core_readings_s) bin.core_n = 1, since_core_s = 0;
      out.bins.push_back(bin);
    }
  }
  return out;
}

/// `truth`, starting the trial from rest.
Fit resting(const Problem& trial, const Fit& truth) {
  const Bins& log = trial.logs.front();
  Fit at_rest = truth;
  const double sink = log.bins.front().input.boundary_degC[0];
  const Eigen::Index shared = base_count + truth.cause_coordinates();
  at_rest.x.conservativeResize(shared + per_start_count);
  at_rest.x[shared] = sink;
  at_rest.x[shared + 1] = 0;
  return at_rest;
}

/// Fills the readings with what `truth` says from rest.
void fill(Problem& trial, const Fit& truth) {
  const Replayed r = replayed(trial, resting(trial, truth), 0);
  Bins& log = trial.logs.front();
  for (std::size_t k = 0; k < log.bins.size(); ++k) {
    log.bins[k].housing_degC = log.bins[k].housing_n > 0 ? r.housing_degC[k] : missing;
    log.bins[k].core_degC = log.bins[k].core_n > 0 ? r.core_degC[k] : missing;
  }
}

/// The sets that tie, but for those of one of several logs.
std::vector<const Candidate*> tied_sets(const Found& found) {
  std::vector<const Candidate*> out;
  for (const Candidate& c : found.sets) {
    const bool picks_a_log =
        std::any_of(c.fit.chosen.begin(), c.fit.chosen.end(), [](const Chosen& x) { return x.log >= 0; });
    if ((c.chosen || c.tied) && !picks_a_log) out.push_back(&c);
  }
  return out;
}

/// How far the nearest rival stays from what any of them says of the trial, in squared noise units.
double least_apart(Problem& trial, const std::vector<const Candidate*>& tied) {
  double least = 1e300;
  for (const Candidate* truth : tied) {
    fill(trial, truth->fit);
    for (const Candidate* rival : tied) {
      if (rival != truth) least = std::min(least, 2 * fit(trial, rival->fit.chosen).misfit);
    }
  }
  return least;
}

}  // namespace

std::optional<Experiment> experiment(const Problem& problem, const Found& found, double most_A) {
  if (found.verdict != Verdict::ambiguous || !problem.in_amperes()) return std::nullopt;
  const std::vector<const Candidate*> all = tied_sets(found);
  if (all.size() < 2) return std::nullopt;
  constexpr std::ptrdiff_t most = 3;  // each is fitted to each other, in each protocol
  const std::vector<const Candidate*> tied(all.begin(), all.begin() + std::min(most, std::ssize(all)));
  double top = 0;
  for (const Bins& log : problem.logs) {
    for (const Bin& bin : log.bins) top = std::max(top, bin.input[Drive::speed_rad_per_s]);
  }

  Experiment best;
  double best_D = -1;
  for (const Protocol& protocol : protocols()) {
    const bool turns = std::any_of(protocol.steps.begin(), protocol.steps.end(),
                                   [](const ProfileStep& s) { return s.speed_rad_per_s != 0; });
    if (turns && top <= 0) continue;
    double largest = 0;
    for (const ProfileStep& step : protocol.steps) largest = std::max(largest, std::abs(step.current_A));
    double amps = std::min(problem.rms_A, most_A / largest);
    Problem trial = problem;
    trial.noise = found.noise;
    const auto stays_cool = [&](const Candidate* truth) {  // under every one of the models
      const double hottest = hottest_degC(trial, resting(trial, truth->fit), 0);
      return hottest < problem.belief.winding_max_degC - spare_K;
    };
    bool cool = false;
    for (int i = 0; i < most_tries && !cool; ++i) {
      trial.logs = {bins_for(problem, protocol.steps, amps, top)};
      cool = std::all_of(all.begin(), all.end(), stays_cool);
      if (!cool) amps *= weaker;
    }
    if (!cool) continue;
    const double D = least_apart(trial, tied);
    if (D > best_D) {
      best_D = D;
      best.profile.clear();
      for (const ProfileStep& s : protocol.steps)
        best.profile.push_back({s.seconds, thermal::direct_A(s.current_A * amps), s.speed_rad_per_s * top});
      best.why = protocol.why;
    }
  }
  if (best_D < 0) return std::nullopt;
  // Named of the logs that D was measured on (experiment.hpp): below 3 3 %, from 20 to 40 90 %, above 100 99 %.
  const char* chance = best_D < 3    ? "hardly a chance"
                       : best_D < 10 ? "perhaps half a chance"
                       : best_D < 20 ? "a fair chance"
                       : best_D < 40 ? "a chance of about 90 %"
                                     : "near certainty";
  if (best_D < 3) best.why = "No course known here is likely to tell. The best of them: " + best.why;
  best.why = fmt::format(
      "{}: the tied models then differ by {:.0f} squared noise units or more, with {} of telling them apart; the "
      "winding stays below {:.0f} degC",
      best.why, best_D, chance, problem.belief.winding_max_degC - spare_K);
  for (const Candidate* c : tied) {
    for (const std::string& id : ids_of(c->fit.chosen)) {
      if (std::find(best.separates.begin(), best.separates.end(), id) == best.separates.end())
        best.separates.push_back(id);
    }
  }
  return best;
}

}  // namespace identify

// SPDX-License-Identifier: MIT
#include "identify/answer/model_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "identify/fit/replayed.hpp"
#include "thermal/heat_names.hpp"

namespace identify {
namespace {

using thermal::boundary_names, thermal::drive_names, thermal::law_names;

constexpr double least_share = 0.01;  // a sensor nearer to an end than this sits there: 0 the housing, 1 the winding

std::string end_name(int end) {
  return end < thermal::first_boundary ? fmt::format("{}", end)
                                       : fmt::format("\"{}\"", boundary_names[end - thermal::first_boundary]);
}

/// Covariance of the coordinates as a board should take it: what ended at a bound is not known for that, and where the
/// fit leaves more than noise nothing is known as well as it seems.
Eigen::MatrixXd doubts(const Fit& f) {
  const double widened = std::max(1.0, f.ratio());
  return f.covariance(false) * (widened * widened);
}

/// Of the logs, and of before and after their cooling changed, the one that heats most and cools least: a board cannot
/// know whether the fan that a log had runs. What one log's room or sensor was, though, is not the motor's.
Model<double> hottest_model_of(const Problem& problem, const Fit& fitted) {
  Fit f = fitted;
  for (Chosen& c : f.chosen) {
    const Edit e = cause_of(c).edit;
    if (e == Edit::source || e == Edit::sensor_offset || e == Edit::sensor_gain) c.log = -1;
  }
  Model<double> hottest;
  double most_K_per_drive = -1;
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    Model<double> m = model_of(problem, f, l);
    double& sink_W_per_K = m.set.links[m.sink_link].conductance_W_per_K;
    if (m.cooling_changes) sink_W_per_K *= std::min(1.0, m.cooling_factor);
    const double K_per_drive = m.set.sources[0].gain / sink_W_per_K;
    if (K_per_drive > most_K_per_drive) most_K_per_drive = K_per_drive, hottest = m;
  }
  if (std::none_of(problem.logs.begin(), problem.logs.end(), [](const Bins& log) { return log.sink_assumed; }))
    return hottest;
  // Of a log that began warmer than a room it does not tell; a board would take its motor for cooler than it is.
  for (int s = 0; s < hottest.set.source_count; ++s) {
    auto& source = hottest.set.sources[s];
    if (source.drive == thermal::Drive::one) source.gain = std::max(source.gain, 0.0);
  }
  hottest.set.housing.offset_K = std::min(hottest.set.housing.offset_K, 0.0);
  return hottest;
}

/// Where the board is to believe that its sensor sits: where it does, less its doubt. A sensor taken to feel more of
/// the winding than it does makes the winding look cooler, and no trust in a resistance covers that.
double cautious_share(const Model<double>& m, const Fit& f) {
  const int at = coordinate_of(f, Edit::sensor_share);
  if (at < 0) return m.sensor_share;
  return m.sensor_share -
         static_cast<double>(thermal::EstimatorSettings{}.margin_sigmas) * std::sqrt(std::max(0.0, doubts(f)(at, at)));
}

/// The board's sensor reads a node. Between winding and housing that is a thin one, which the heat passes through.
void place_sensor(const Model<double>& m, double share, thermal::HeatSet<double>& set) {
  constexpr double thin = 0.02;  // of the winding's capacity
  if (share < least_share) return;
  if (share > 1 - least_share) {
    set.housing.node = static_cast<std::int8_t>(m.core);
    return;
  }
  const int sensor = set.node_count++;
  set.nodes[sensor] = {thin * set.nodes[m.core].capacity_J_per_K, {}};
  set.nodes[m.core].capacity_J_per_K *= 1 - thin;
  auto& way = set.links[m.core_link];
  set.links[set.link_count++] = {static_cast<std::int8_t>(sensor), way.to, way.law, way.conductance_W_per_K / share,
                                 way.k};
  way.to = static_cast<std::int8_t>(sensor);
  way.conductance_W_per_K /= 1 - share;
  set.housing.node = way.to;
}

/// How much of the motor's rise over its sink is put down to a drift of that, which no board is told of: it may as well
/// be a motor that cools worse.
double drifted_share(const Problem& problem, const Fit& f) {
  const int at = coordinate_of(f, Edit::drift);
  if (at < 0) return 0;
  double most = 0;
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    const Bins& log = problem.logs[l];
    double rise_K = 0;
    for (const Bin& bin : log.bins) {
      for (const double read_degC : {bin.housing_degC, bin.core_degC})
        rise_K = std::fmax(rise_K, read_degC - bin.input[thermal::Boundary::ambient]);
    }
    const double drifting_s = log.duration_s() + model_of(problem, f, l).drifted_s;
    most = std::max(most, std::abs(f.x[at]) * drifting_s / std::max(rise_K, 1.0));
  }
  return most;
}

}  // namespace

thermal::HeatSet<double> heat_set_of(const Problem& problem, const Fit& f) {
  const Model<double> m = hottest_model_of(problem, f);
  thermal::HeatSet<double> set = m.set;
  place_sensor(m, cautious_share(m, f), set);
  for (int i = 0; i < set.node_count; ++i) {
    const bool winding = i == m.core || i == m.hot_node;
    set.nodes[i].max_degC =
        winding ? static_cast<float>(problem.belief.winding_max_degC) : std::numeric_limits<float>::infinity();
  }
  return set;
}

thermal::Trust trust_of(const Problem& problem, const Fit& f, const thermal::Trust& least) {
  const Eigen::MatrixXd doubt = doubts(f);
  const auto unit = [&](int coordinate) -> Eigen::VectorXd { return Eigen::VectorXd::Unit(f.x.size(), coordinate); };
  // Slopes of logarithms: heat against capacity goes as 1/C1.
  int capacity = 2, resistance = 0;
  if (const int at = coordinate_of(f, Edit::hot_spot); at >= 0) capacity = at, resistance = at + 1;  // the hottest node
  Eigen::VectorXd power = -unit(capacity);
  if (const int at = coordinate_of(f, Edit::coefficient); at >= 0) {
    const double most_K = problem.belief.winding_max_degC - 25;
    power += unit(at) * most_K / (1 + f.x[at] * most_K);
  }
  const auto together = [&](const Eigen::VectorXd& a, const Eigen::VectorXd& b) { return a.dot(doubt * b); };
  const auto deviation = [&](const Eigen::VectorXd& of, float at_least) {
    return std::max(std::sqrt(std::max(0.0, together(of, of))), static_cast<double>(at_least));
  };
  const double power_sd = deviation(power, least.power),
               resistance_sd = deviation(unit(resistance), least.inner_resistance);
  // The board spreads a doubt to first order, and that of more than a half is none.
  const auto share = [](double sd) { return static_cast<float>(std::min(sd, 0.5)); };
  // More power is less capacity.
  const double correlation = -together(power, unit(resistance)) / (power_sd * resistance_sd);
  const double cooling_sd = std::max(deviation(unit(1), least.cooling), drifted_share(problem, f));
  return {share(power_sd), share(resistance_sd), share(cooling_sd),
          static_cast<float>(std::clamp(correlation, -1.0, 1.0))};
}

std::string heat_set_toml(const Problem& problem, const Fit& f, const std::string& sentence,
                          const thermal::Trust& trust) {
  const Model<double> m = hottest_model_of(problem, f);
  const thermal::HeatSet<double> set = heat_set_of(problem, f);
  std::string s = "# " + sentence + "\n";
  if (!problem.belief.known && !problem.heated_by_power())
    s += "# No motor file was given: the winding counts as 1 ohm. With its true g (3/4 of the resistance between two "
         "terminals, 3/2 of a phase's), multiply gains, conductances and capacities by g.\n";
  s += "format = 1\n";
  if (problem.belief.known) s += fmt::format("motor = \"{}\"\n", problem.belief.motor);
  for (int i = 0; i < set.node_count; ++i) {
    s += fmt::format("\n[[node]]  # {}: {}\ncapacity_J_per_K = {:.6g}\n", i,
                     i == m.core             ? "winding"
                     : i == m.housing        ? "housing"
                     : i == m.hot_node       ? "hot spot"
                     : i == set.housing.node ? "where the sensor sits"
                                             : "further mass",
                     set.nodes[i].capacity_J_per_K);
    if (std::isfinite(set.nodes[i].max_degC)) s += fmt::format("max_degC = {:g}\n", set.nodes[i].max_degC);
  }
  for (int i = 0; i < set.link_count; ++i) {
    const auto& link = set.links[i];
    s +=
        fmt::format("\n[[link]]\nfrom = {}\nto = {}\nlaw = \"{}\"\nconductance_W_per_K = {:.6g}\n", end_name(link.from),
                    end_name(link.to), law_names[static_cast<int>(link.law)], link.conductance_W_per_K);
    if (link.k != 0) s += fmt::format("k = {:.6g}\n", link.k);
  }
  for (int i = 0; i < set.source_count; ++i) {
    const auto& source = set.sources[i];
    s += fmt::format("\n[[source]]\nnode = {}\ndrive = \"{}\"\ngain = {:.6g}\n", int{source.node},
                     drive_names[static_cast<int>(source.drive)], source.gain);
    if (source.coefficient_per_K != 0) s += fmt::format("coefficient_per_K = {:.6g}\n", source.coefficient_per_K);
  }
  s += fmt::format("\n[housing_sensor]\nnode = {}\nlag_s = {:.6g}\noffset_K = {:.6g}\ngain_error = {:.6g}\n",
                   int{set.housing.node}, set.housing.lag_s, set.housing.offset_K, set.housing.gain_error);
  s += fmt::format("\n[trust]\npower = {:.3f}\ninner_resistance = {:.3f}\ncooling = {:.3f}\ncorrelation = {:.3f}\n",
                   trust.power, trust.inner_resistance, trust.cooling, trust.correlation);
  std::string recording;
  if (m.offset) recording += fmt::format("current_offset_A = {:.6g}\n", m.current_offset_A);
  if (m.delayed) recording += fmt::format("delay_s = {:.6g}\n", m.delay_s);
  if (m.drifts) recording += fmt::format("ambient_drift_K_per_s = {:.6g}\n", m.drift_K_per_s);
  if (m.stalls)
    recording += fmt::format("stall_share = {:.6g}  # the board's three phase nodes hold it already\n", m.stall_share);
  if (m.cooling_changes)
    recording += fmt::format("cooling_factor = {:.6g}  # the lesser cooling is in the links\ncooling_from_s = {:.6g}\n",
                             m.cooling_factor, m.cooling_from_s);
  if (!recording.empty()) s += "\n[recording]  # of this log, not of the motor\n" + recording;
  return s;
}

}  // namespace identify

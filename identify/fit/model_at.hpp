// SPDX-License-Identifier: MIT
// The model that coordinates stand for, in numbers to look and in dual numbers to fit.
#pragma once

#include "identify/fit/coordinates.hpp"
#include "identify/model/replay.hpp"

namespace identify {

/// What simulates log `l` at coordinates x of base and causes; `before`: of what was before it, where it begins warm.
template <class S>
Model<S> model_at(const Problem& problem, const std::vector<Chosen>& chosen, const S* x, const S* before,
                  std::size_t l) {
  using std::exp;
  const Belief& belief = problem.belief;
  Model<S> m;
  auto& set = m.set;
  set.node_count = 2;
  set.nodes[0] = {exp(x[2]), {}};
  set.nodes[1] = {exp(x[3]), {}};
  set.link_count = 2;
  set.links[0] = {0, 1, thermal::LinkLaw::constant, exp(-x[0]), S(0)};
  set.links[1] = {1, thermal::boundary_end(thermal::Boundary::ambient), thermal::LinkLaw::constant, exp(-x[1]), S(0)};
  set.source_count = 1;
  if (problem.heated_by_power())
    set.sources[0] = {0, thermal::Drive::power_W, S(1), S(0)};
  else
    set.sources[0] = {0, thermal::Drive::current_A2, S(belief.ohm), S(belief.copper_per_K)};
  set.housing = {1, S(0), S(0), S(0)};
  S mass_s(0);
  int at = base_count;
  for (const Chosen& c : chosen) {
    const Cause& cause = cause_of(c);
    S k[4];
    for (std::size_t p = 0; p < cause.parameters.size(); ++p, ++at) {
      const Parameter& parameter = cause.parameters[p];
      const double scale = problem.scale(parameter.scale, cause.drive);
      k[p] = (parameter.logarithmic ? exp(x[at]) : x[at]) * scale;
    }
    if (cause.edit == Edit::mass) mass_s = k[0] * k[1];
    apply(cause, k, c, l, m);
  }
  if (!problem.logs[l].begins_warm) return m;
  // What lags is behind by how the housing moved within its time constant.
  const S housing_s = exp(x[1] + x[3]);
  m.mass_behind = before[mass_before] * mass_s / (mass_s + housing_s);
  m.sensor_behind = before[sensor_before] * set.housing.lag_s / housing_s;
  m.drifted_s = before[drift_before] * problem.duration_s;
  return m;
}

/// From what the housing's sensor reads and what the winding is above that; where no winding is read, above the
/// housing. Of a sensor that feels a winding that is read it is right to first order in its share: all of it would
/// leave the housing untold.
template <class S>
Initial<S> begin_at(const Model<S>& model, const Bins& log, const Start& start, const S& read_degC, const S& excess_K) {
  S housing_degC = replay_detail::housing_behind(model.set.housing, read_degC);
  if (model.feels_winding) housing_degC -= model.sensor_share * excess_K;
  const S sensed_degC = housing_degC;
  S mass_degC = housing_degC;
  if (log.begins_warm && start.bin == 0) {
    const double sink_degC = log.bins.front().input.boundary_degC[0];
    housing_degC += model.sensor_behind * (sensed_degC - sink_degC);
    mass_degC = housing_degC - model.mass_behind * (housing_degC - sink_degC);
  }
  return {(std::isnan(start.core_degC) ? housing_degC : read_degC) + excess_K, housing_degC, mass_degC, sensed_degC,
          read_degC + excess_K};
}

}  // namespace identify

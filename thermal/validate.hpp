// SPDX-License-Identifier: MIT
// Says what is wrong with a heat set before any of it is used: the first problem and where. A set comes from flash,
// from a file or from a fit, and each of them can be torn. Comparisons are written so that NaN is refused. No heap; not
// for an ISR.
#pragma once

#include <cmath>
#include <type_traits>

#include "thermal/heat_set.hpp"

namespace thermal {

/// Plain value of a scalar; a dual number brings its own, found by argument-dependent lookup.
template <class T>
requires std::is_arithmetic_v<T>
constexpr double value_of(T x) { return static_cast<double>(x); }

enum class SetProblem : std::uint8_t {
  none,
  bad_count,         // no node, or more nodes, links or sources than there is room for
  bad_capacity,      // not positive and finite
  bad_limit,         // max_degC is NaN
  bad_link_end,      // neither a node nor a boundary, or both ends the same, or two boundaries
  bad_conductance,   // negative or not finite
  bad_law,           // unknown, or its parameter is not finite
  bad_source,        // node or drive unknown, gain or coefficient not finite; a current that cools, copper that cools
  bad_sensor,        // its node unknown, a value not finite, lag negative, or gain error <= -1
  unconnected_node,  // no path to a boundary: its heat could never leave
  time_constant_too_short  // of the node, against the step: see largest_stiffness
};

struct SetCheck {
  SetProblem problem;
  int index;  // of the node, link or source that has it
  bool ok() const { return problem == SetProblem::none; }
};

/// G dt / C of a node up to which a step is trusted: the exponential stays exact to 1e-16 * this, 1e-10 of a rise.
inline constexpr double largest_stiffness = 1e6;

namespace validation {

template <class Scalar>
bool finite(const Scalar& x) {
  return std::isfinite(value_of(x));
}

constexpr bool is_node(int end, int node_count) { return end >= 0 && end < node_count; }
constexpr bool is_boundary(int end) { return end >= first_boundary && end < first_boundary + boundary_count; }

template <class Scalar>
SetProblem check_link(const Link<Scalar>& link, int node_count) {
  const bool node_from = is_node(link.from, node_count), node_to = is_node(link.to, node_count);
  if (!(node_from || is_boundary(link.from)) || !(node_to || is_boundary(link.to))) return SetProblem::bad_link_end;
  if (link.from == link.to || !(node_from || node_to)) return SetProblem::bad_link_end;
  if (!finite(link.conductance_W_per_K) || !(value_of(link.conductance_W_per_K) >= 0.0))
    return SetProblem::bad_conductance;
  if (link.law >= LinkLaw::count || !finite(link.k)) return SetProblem::bad_law;
  return SetProblem::none;
}

/// First node from which no chain of conducting links leads to a boundary; node_count if all are connected.
template <class Scalar>
int first_unconnected(const HeatSet<Scalar>& set) {
  bool reached[max_nodes] = {};
  for (int pass = 0; pass < set.node_count; ++pass) {
    for (int i = 0; i < set.link_count; ++i) {
      const Link<Scalar>& link = set.links[i];
      if (!(value_of(link.conductance_W_per_K) > 0.0)) continue;
      const bool from = link.from >= first_boundary || reached[link.from];
      const bool to = link.to >= first_boundary || reached[link.to];
      if (from && link.to < first_boundary) reached[link.to] = true;
      if (to && link.from < first_boundary) reached[link.from] = true;
    }
  }
  for (int i = 0; i < set.node_count; ++i) {
    if (!reached[i]) return i;
  }
  return set.node_count;
}

}  // namespace validation

/// First problem of a set that is to be stepped by dt_s, or none.
template <class Scalar>
SetCheck validate(const HeatSet<Scalar>& set, double dt_s) {
  using namespace validation;
  if (set.node_count < 1 || set.node_count > max_nodes) return {SetProblem::bad_count, 0};
  if (set.link_count < 0 || set.link_count > max_links) return {SetProblem::bad_count, 1};
  if (set.source_count < 0 || set.source_count > max_sources) return {SetProblem::bad_count, 2};
  for (int i = 0; i < set.node_count; ++i) {
    const double c = value_of(set.nodes[i].capacity_J_per_K);
    if (!std::isfinite(c) || !(c > 0.0)) return {SetProblem::bad_capacity, i};
    if (std::isnan(set.nodes[i].max_degC)) return {SetProblem::bad_limit, i};
  }
  for (int i = 0; i < set.link_count; ++i) {
    const SetProblem problem = check_link(set.links[i], set.node_count);
    if (problem != SetProblem::none) return {problem, i};
  }
  for (int i = 0; i < set.source_count; ++i) {
    const Source<Scalar>& s = set.sources[i];
    if (!is_node(s.node, set.node_count) || s.drive >= Drive::count || !finite(s.gain) ||
        !finite(s.coefficient_per_K) || (is_current_square(s.drive) && !(value_of(s.gain) >= 0.0)) ||
        !(value_of(s.coefficient_per_K) >= 0.0)) {
      return {SetProblem::bad_source, i};
    }
  }
  const HousingSensor<Scalar>& h = set.housing;
  if (!is_node(h.node, set.node_count) || !finite(h.lag_s) || !finite(h.offset_K) || !finite(h.gain_error) ||
      !(value_of(h.lag_s) >= 0.0) || !(value_of(h.gain_error) > -1.0)) {
    return {SetProblem::bad_sensor, 0};
  }
  const int alone = first_unconnected(set);
  if (alone < set.node_count) return {SetProblem::unconnected_node, alone};
  for (int i = 0; i < set.node_count; ++i) {
    double g_W_per_K = 0.0;
    for (int j = 0; j < set.link_count; ++j) {
      if (set.links[j].from == i || set.links[j].to == i) g_W_per_K += value_of(set.links[j].conductance_W_per_K);
    }
    if (!(g_W_per_K * dt_s / value_of(set.nodes[i].capacity_J_per_K) <= largest_stiffness)) {
      return {SetProblem::time_constant_too_short, i};
    }
  }
  return {SetProblem::none, 0};
}

}  // namespace thermal

// SPDX-License-Identifier: MIT
// A motor's sheet as a heat set: the two-resistor motor (eq. 1 and 2) and the three-phase motor, which is the same
// motor with its winding told apart into phases, because a standing rotor heats one phase twice as much as the mean.
//
// Winding heat (eq. 3, 4): 3/2 R_ph |i|^2 = R_ph (ia^2 + ib^2 + ic^2), R_ph following the node's own temperature;
// besides it takes power_W (sensor set B, or heat measured elsewhere). Fill either the currents or power_W. Knows no
// speed losses: they are sources that identification adds. Not for an ISR.
#pragma once

#include <limits>

#include "thermal/heat_set.hpp"
#include "wire/motor.hpp"

namespace thermal {

namespace motor_set {
inline constexpr float no_limit_degC = std::numeric_limits<float>::infinity();

constexpr Link<double> link(int from, int to, double conductance_W_per_K) {
  return {static_cast<std::int8_t>(from), static_cast<std::int8_t>(to), LinkLaw::constant, conductance_W_per_K, 0.0};
}
}  // namespace motor_set

/// Nodes: 0 winding, 1 housing. Fed by current_A2 and power_W.
constexpr HeatSet<double> two_resistor_set(const wire::Motor& m) {
  HeatSet<double> set{};
  set.node_count = 2;
  set.nodes[0] = {m.C1_J_per_K, static_cast<float>(m.winding_max_degC)};
  set.nodes[1] = {m.C2_J_per_K, motor_set::no_limit_degC};
  set.link_count = 2;
  set.links[0] = motor_set::link(0, 1, 1.0 / m.R1_K_per_W);
  set.links[1] = motor_set::link(1, boundary_end(Boundary::ambient), 1.0 / m.R2_K_per_W);
  set.source_count = 2;
  set.sources[0] = {0, Drive::current_A2, 1.5 * m.phase_resistance_ohm, m.copper_coefficient_per_K};
  set.sources[1] = {0, Drive::power_W, 1.0, 0.0};
  set.housing = {1, 0.0, 0.0, 0.0};
  return set;
}

/// Nodes: 0..2 phase windings (C1/3 each, 3 R1 to the housing, coupled to each other), 3 housing.
/// Fed by phase_a_A2 .. phase_c_A2 and power_W (a third to each phase: power alone does not tell them apart).
constexpr HeatSet<double> three_phase_set(const wire::Motor& m) {
  HeatSet<double> set{};
  constexpr int housing = 3;
  set.node_count = 4;
  set.nodes[housing] = {m.C2_J_per_K, motor_set::no_limit_degC};
  for (int k = 0; k < 3; ++k) {
    set.nodes[k] = {m.C1_J_per_K / 3.0, static_cast<float>(m.winding_max_degC)};
    set.links[k] = motor_set::link(k, housing, 1.0 / (3.0 * m.R1_K_per_W));
    set.links[3 + k] = motor_set::link(k, (k + 1) % 3, m.phase_coupling_W_per_K);
    set.sources[k] = {static_cast<std::int8_t>(k), phase_drive(k), m.phase_resistance_ohm, m.copper_coefficient_per_K};
    set.sources[3 + k] = {static_cast<std::int8_t>(k), Drive::power_W, 1.0 / 3.0, 0.0};
  }
  set.links[6] = motor_set::link(housing, boundary_end(Boundary::ambient), 1.0 / m.R2_K_per_W);
  set.link_count = 7;
  set.source_count = 6;
  set.housing = {housing, 0.0, 0.0, 0.0};
  return set;
}

/// A set with one lumped winding (node 0, fed by current_A2) told apart into three phases, as a standing rotor demands:
/// what identification writes cannot see the phases. Nodes 0..2 become the phases, the others move up by two.
/// `coupling_W_per_K` between each pair; 0 is the safe side. A set without room for that is returned as it is.
constexpr HeatSet<double> split_phases(const HeatSet<double>& lumped, double coupling_W_per_K) {
  HeatSet<double> set{};
  const auto moved = [](int end) {
    return static_cast<std::int8_t>(end == 0 || end >= first_boundary ? end : end + 2);
  };
  if (lumped.node_count + 2 > max_nodes) return lumped;
  set.node_count = lumped.node_count + 2;
  for (int i = 1; i < lumped.node_count; ++i) set.nodes[i + 2] = lumped.nodes[i];
  for (int k = 0; k < 3; ++k) {
    set.nodes[k] = {lumped.nodes[0].capacity_J_per_K / 3.0, lumped.nodes[0].max_degC};
    set.links[set.link_count++] = motor_set::link(k, (k + 1) % 3, coupling_W_per_K);
  }
  for (int i = 0; i < lumped.link_count; ++i) {
    Link<double> link = lumped.links[i];
    const bool from_winding = link.from == 0, of_winding = from_winding || link.to == 0;
    const int copies = of_winding ? 3 : 1;
    if (set.link_count + copies > max_links) return lumped;
    link.from = moved(link.from);
    link.to = moved(link.to);
    link.conductance_W_per_K /= copies;
    for (int k = 0; k < copies; ++k) {
      if (of_winding) (from_winding ? link.from : link.to) = static_cast<std::int8_t>(k);
      set.links[set.link_count++] = link;
    }
  }
  for (int i = 0; i < lumped.source_count; ++i) {
    Source<double> source = lumped.sources[i];
    const int copies = source.node == 0 ? 3 : 1;
    if (set.source_count + copies > max_sources) return lumped;
    // |i|^2 = 2/3 (ia^2 + ib^2 + ic^2): the heat of each phase follows its own current.
    const bool copper = source.node == 0 && source.drive == Drive::current_A2;
    source.gain *= copper ? 2.0 / 3.0 : 1.0 / copies;
    for (int k = 0; k < copies; ++k) {
      source.node = copies == 3 ? static_cast<std::int8_t>(k) : moved(lumped.sources[i].node);
      if (copper) source.drive = phase_drive(k);
      set.sources[set.source_count++] = source;
    }
  }
  set.housing = lumped.housing;
  set.housing.node = moved(lumped.housing.node);
  return set;
}

}  // namespace thermal

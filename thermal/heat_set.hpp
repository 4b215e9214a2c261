// SPDX-License-Identifier: MIT
// A heat network as plain data: nodes that store heat, links that carry it, sources that make it.
//
// The two-resistor motor is one such set, the three-phase motor another, and what identification finds is written back
// as a third: the firmware runs them all without new code. Fixed capacity, no heap, no pointers; a set is validated as
// a whole (validate) before any of it is used.
//
//   C_n dT_n/dt = sum_links G(law) (T_other - T_n) + sum_sources gain * drive * (1 + alpha (T_n - 25))
//
// Templated on the scalar: double on the board, dual numbers in identify. Temperatures in degC, w in rad/s.
#pragma once

#include <cstdint>

namespace thermal {

inline constexpr int max_nodes = 8;
inline constexpr int max_links = 16;
inline constexpr int max_sources = 16;

inline constexpr double estimator_dt_s = 0.01;  // what CoreEstimator and all in it step by

/// Temperatures that the network does not compute but is given; a link may end at one.
enum class Boundary : std::uint8_t { ambient, coolant, frame, neighbour, count };
inline constexpr int boundary_count = static_cast<int>(Boundary::count);

/// What drives a source: means over one step, each nonlinear form taken before the mean.
enum class Drive : std::uint8_t {
  one,         // constant heat: 1 (the estimator takes it as 1 whatever it is given)
  phase_a_A2,  // square of the current in one phase
  phase_b_A2,
  phase_c_A2,
  current_A2,  // squared amplitude of the current vector, id^2 + iq^2, PWM ripple included: what resistance heats by
  current_A,   // amplitude without the ripple: what torque, and so friction, goes by
  speed_rad_per_s,  // |mechanical speed|
  speed2_rad2_per_s2,
  speed3_rad3_per_s3,
  current2_speed2,  // |i|^2 w^2, without the ripple: the loss of a field that turns
  current_speed,    // |i| |w|, without the ripple
  enabled,          // share of the time the bridge switched
  power_W,          // heat known from elsewhere: measured, or from bus power (sensor set B)
  speed_to_0_8,     // |w|^0.8, for forced convection: its mean, or less
  count
};
constexpr bool is_current_square(Drive drive) { return drive >= Drive::phase_a_A2 && drive <= Drive::current_A2; }
/// The square of the current in phase k, 0..2.
constexpr Drive phase_drive(int k) { return static_cast<Drive>(static_cast<int>(Drive::phase_a_A2) + k); }
inline constexpr int drive_count = static_cast<int>(Drive::count);

enum class LinkLaw : std::uint8_t {
  constant,            // G
  speed,               // G (1 + k w^0.8)            forced convection, w in rad/s
  natural_convection,  // G (|dT| / 20 K)^k, |dT| rounded off below 0.1 K
  radiation,           // G (Ta^4 - Tb^4) / (4 (300 K)^3 (Ta - Tb)), in kelvin: G is the conductance at 300 K
  temperature,         // G / (1 + k (T_from - 40 degC))   a contact that changes as it warms
  count
};

/// What happens during one step: means of the drives over it, and the boundary temperatures. Unused ones stay 0.
/// Data is double, or a dual number where a boundary or a drive is itself being fitted.
template <class Data = double>
struct HeatInput {
  Data drive[drive_count] = {};
  Data boundary_degC[boundary_count] = {};

  Data& operator[](Drive d) { return drive[static_cast<int>(d)]; }
  const Data& operator[](Drive d) const { return drive[static_cast<int>(d)]; }
  Data& operator[](Boundary b) { return boundary_degC[static_cast<int>(b)]; }
  const Data& operator[](Boundary b) const { return boundary_degC[static_cast<int>(b)]; }
};

/// End of a link: a node (0..node_count-1) or a boundary (boundary_end(...)).
inline constexpr int first_boundary = 64;
constexpr std::int8_t boundary_end(Boundary b) {
  return static_cast<std::int8_t>(first_boundary + static_cast<int>(b));
}

template <class Scalar>
struct Node {
  Scalar capacity_J_per_K;
  float max_degC;  // limit of the governor; +infinity for a node that has none
};

template <class Scalar>
struct Link {
  std::int8_t from, to;
  LinkLaw law;
  Scalar conductance_W_per_K;  // zero is allowed and carries nothing
  Scalar k;                    // parameter of the law, 0 where it has none
};

template <class Scalar>
struct Source {
  std::int8_t node;
  Drive drive;
  Scalar gain;               // W per unit of the drive
  Scalar coefficient_per_K;  // of the gain, referred to the node's own temperature at 25 degC
};

/// How the housing sensor sees its node: y + lag dy/dt = T + offset + gain_error (T - 25).
template <class Scalar>
struct HousingSensor {
  std::int8_t node;
  Scalar lag_s;
  Scalar offset_K;
  Scalar gain_error;

  bool operator==(const HousingSensor&) const = default;
};

template <class Scalar>
struct HeatSet {
  int node_count, link_count, source_count;
  Node<Scalar> nodes[max_nodes];
  Link<Scalar> links[max_links];
  Source<Scalar> sources[max_sources];
  HousingSensor<Scalar> housing;
};

}  // namespace thermal

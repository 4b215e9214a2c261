// SPDX-License-Identifier: MIT
// Steps a heat network through time: exact for its linear part at any step length, second order for the rest.
//
//   dT/dt = A T + s(T):   A from the links, s from boundaries, sources with R(T), and what a link's law adds to its G
//   start    a  = phi0 T + phi1 s(T)              exact if s stays what it is (eq. 1 and 2)
//   correct  T' = a + phi2 (s(a) - s(T))          because R grows within the step: explicit Euler reads too cold
//
// phi_k are the exponential integrator's functions of A dt; they are a Transition, made once for a step length. Scalar
// is double on the board, a dual number in identify: it needs + - * / with itself and double, == with double (true of a
// constant only), Eigen::NumTraits, and, found by argument-dependent lookup, value_of(x) (its plain value) and exp,
// log. Branches look at plain values only. N is the number of nodes, or Eigen::Dynamic (storage for max_nodes). No
// heap, no state; same cost every call. Not for an ISR.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <type_traits>

#include "thermal/flip_sum.hpp"
#include "thermal/heat_set.hpp"
#include "thermal/validate.hpp"

namespace thermal {

template <class Scalar, int N = Eigen::Dynamic>
struct Shape {
  static constexpr int max = N == Eigen::Dynamic ? max_nodes : N;
  using Vector = Eigen::Matrix<Scalar, N, 1, 0, max, 1>;
  using Matrix = Eigen::Matrix<Scalar, N, N, 0, max, max>;
};

/// What one step of a given length does: phi0 = exp(A dt), phi1 and phi2 already times dt.
template <class Scalar, int N = Eigen::Dynamic>
struct Transition {
  typename Shape<Scalar, N>::Matrix phi0, phi1, phi2;
  double dt_s;
};

/// phi-functions of A dt: Taylor series of A dt / 2^k (14 terms: 1e-17 below norm 1/2), then k doublings. Bounded: k
/// <= 40.
template <class Matrix>
void phi_functions(const Matrix& a, double dt_s, Matrix& phi0, Matrix& phi1, Matrix& phi2) {
  using Scalar = typename Matrix::Scalar;
  const int n = static_cast<int>(a.rows());
  double norm = 0.0;
  for (int row = 0; row < n; ++row) {
    double sum = 0.0;
    for (int column = 0; column < n; ++column) sum += std::abs(value_of(a(row, column)));
    if (sum > norm) norm = sum;
  }
  int doublings = 0;
  double h_s = dt_s;
  while (norm * h_s > 0.5 && doublings < 40) {
    h_s *= 0.5;
    ++doublings;
  }
  const Matrix one = Matrix::Identity(n, n);
  const Matrix z = a * Scalar(h_s);
  phi2 = one;
  for (int term = 15; term >= 3; --term) phi2 = one + z.lazyProduct(phi2).eval() * Scalar(1.0 / term);
  phi2 *= Scalar(0.5);
  phi1 = one + z.lazyProduct(phi2);
  phi0 = one + z.lazyProduct(phi1);
  for (int i = 0; i < doublings; ++i) {
    phi2 = ((phi1.lazyProduct(phi1)).eval() + phi2 * Scalar(2.0)) * Scalar(0.25);
    phi1 = (phi0.lazyProduct(phi1).eval() + phi1) * Scalar(0.5);
    phi0 = phi0.lazyProduct(phi0).eval();
  }
  phi1 *= Scalar(dt_s);
  phi2 *= Scalar(dt_s);
}

template <class Scalar, int N = Eigen::Dynamic>
class HeatNetwork {
 public:
  using Vector = typename Shape<Scalar, N>::Vector;
  using Matrix = typename Shape<Scalar, N>::Matrix;

  /// The set must have passed validate(); for a fixed N its node_count must be N.
  explicit HeatNetwork(const HeatSet<Scalar>& set) : n_(set.node_count), a_(Matrix::Zero(n_, n_)) {
    for (int i = 0; i < n_; ++i) capacity_J_per_K_[i] = set.nodes[i].capacity_J_per_K;
    for (int i = 0; i < set.link_count; ++i) add_link(set.links[i]);
    for (int i = 0; i < set.source_count; ++i) {
      const Source<Scalar>& s = set.sources[i];
      const Scalar gain = s.gain / capacity_J_per_K_[s.node];
      const Scalar slope = gain * s.coefficient_per_K;
      sources_[source_count_++] = {s.node, static_cast<int>(s.drive), gain - slope * 25.0, slope};
      if (!(s.coefficient_per_K == 0)) note_sloped(s.node);
    }
  }

  const Scalar& capacity_J_per_K(int node) const { return capacity_J_per_K_[node]; }
  bool curved() const { return curved_count_ > 0; }  // a link's law is no constant: a step costs three times as much

  Transition<Scalar, N> transition(double dt_s) const {
    Transition<Scalar, N> t;
    phi_functions(a_, dt_s, t.phi0, t.phi1, t.phi2);
    t.dt_s = dt_s;
    return t;
  }

  /// Temperatures one step later, degC.
  template <class Data>
  Vector step(const Transition<Scalar, N>& t, const Vector& degC, const HeatInput<Data>& input) const {
    Vector base = Vector::Zero(n_), slope = Vector::Zero(n_);  // s = base + slope * T (+ curved laws)
    gather(input, base, slope);
    Vector s = base;
    for (int k = 0; k < sloped_count_; ++k) {
      const int i = sloped_[k];
      s[i] += slope[i] * degC[i];
    }
    if (curved_count_ > 0) add_curved(degC, input, s);
    const Vector a = t.phi0.lazyProduct(degC) + t.phi1.lazyProduct(s);
    if (curved_count_ > 0) {
      Vector change = base + slope.cwiseProduct(a);
      add_curved(a, input, change);
      change -= s;
      return a + t.phi2.lazyProduct(change);
    }
    Vector next = a;
    for (int k = 0; k < sloped_count_; ++k) {
      const int i = sloped_[k];
      next += t.phi2.col(i) * (slope[i] * (a[i] - degC[i]));
    }
    return next;
  }

  /// dT/dt of one node at given temperatures: what step() integrates. Only what touches it costs.
  template <class Data>
  Scalar rate_K_per_s(int node, const Vector& degC, const HeatInput<Data>& input) const {
    Vector base = Vector::Zero(n_), slope = Vector::Zero(n_);
    gather(input, base, slope);
    base[node] += slope[node] * degC[node];
    for (int i = 0; i < curved_count_; ++i) {
      if (curved_[i].from == node || curved_[i].to == node) add_curved(curved_[i], degC, input, base);
    }
    Scalar inner = a_(node, 0) * degC[0];
    for (int i = 1; i < n_; ++i) inner += a_(node, i) * degC[i];
    return base[node] + inner;
  }

  /// dT/dt told apart by where the heat comes from: what the covariance needs.
  struct Rates {
    Vector sources_K_per_s;
    Vector inner_K_per_s, outer_K_per_s;  // links between nodes; links to boundaries (all curved laws count here)
    Vector source_slope_per_s;            // d sources / dT
  };

  template <class Data>
  Rates rates(const Vector& degC, const HeatInput<Data>& input) const {
    Vector base = Vector::Zero(n_), slope = Vector::Zero(n_);
    gather(input, base, slope);
    Rates r;
    r.outer_K_per_s = Vector::Zero(n_);
    if (curved_count_ > 0) add_curved(degC, input, r.outer_K_per_s);
    const Vector all_K_per_s = base + slope.cwiseProduct(degC) + r.outer_K_per_s + a_.lazyProduct(degC);
    for (int i = 0; i < boundary_count_; ++i) {
      const BoundaryTerm& b = boundaries_[i];
      const Scalar given = b.per_s * input.boundary_degC[b.boundary];
      base[b.node] -= given;
      r.outer_K_per_s[b.node] += given - b.per_s * degC[b.node];
    }
    r.source_slope_per_s = slope;
    r.sources_K_per_s = base + slope.cwiseProduct(degC);
    r.inner_K_per_s = all_K_per_s - r.sources_K_per_s - r.outer_K_per_s;
    return r;
  }

  /// d(dT/dt) / d(boundary temperature), 1/s; curved laws count with their plain G.
  Vector boundary_gain_per_s(Boundary boundary) const {
    Vector gain = Vector::Zero(n_);
    for (int i = 0; i < boundary_count_; ++i) {
      if (boundaries_[i].boundary == static_cast<int>(boundary)) gain[boundaries_[i].node] += boundaries_[i].per_s;
    }
    return gain;
  }

  /// Heat of one node's sources, W.
  template <class Data>
  Scalar source_W(int node, const Scalar& degC, const HeatInput<Data>& input) const {
    Scalar rate(0.0);
    for (int i = 0; i < source_count_; ++i) {
      if (sources_[i].node == node)
        rate += (sources_[i].base + sources_[i].slope * degC) * input.drive[sources_[i].drive];
    }
    return rate * capacity_J_per_K_[node];
  }

  void add_to(FlipSum& sum) const {
    sum.add(n_, source_count_, boundary_count_, curved_count_, sloped_count_, a_);
    sum.add_first(sloped_count_, sloped_).add_first(n_, capacity_J_per_K_);
    sum.add_first(source_count_, sources_).add_first(boundary_count_, boundaries_);
    for (int i = 0; i < curved_count_ && i < max_links; ++i) {
      const Link<Scalar>& link = curved_[i];
      sum.add(link.from, link.to, link.law, link.conductance_W_per_K, link.k);
    }
  }

 private:
  struct SourceTerm {
    int node, drive;
    Scalar base, slope;  // K/s per unit of the drive, and its change per degC
  };
  struct BoundaryTerm {
    int node, boundary;
    Scalar per_s;
  };

  void note_sloped(int node) {
    for (int k = 0; k < sloped_count_; ++k) {
      if (sloped_[k] == node) return;
    }
    sloped_[sloped_count_++] = node;
  }

  void add_link(const Link<Scalar>& link) {
    if (link.law != LinkLaw::constant) curved_[curved_count_++] = link;
    add_end(link.from, link.to, link.conductance_W_per_K);
    add_end(link.to, link.from, link.conductance_W_per_K);
  }

  void add_end(int node, int other, const Scalar& conductance_W_per_K) {
    if (node >= first_boundary) return;
    const Scalar per_s = conductance_W_per_K / capacity_J_per_K_[node];
    a_(node, node) -= per_s;
    if (other < first_boundary) {
      a_(node, other) += per_s;
    } else {
      boundaries_[boundary_count_++] = {node, other - first_boundary, per_s};
    }
  }

  template <class Data>
  void gather(const HeatInput<Data>& input, Vector& base, Vector& slope) const {
    for (int i = 0; i < boundary_count_; ++i) {
      base[boundaries_[i].node] += boundaries_[i].per_s * input.boundary_degC[boundaries_[i].boundary];
    }
    for (int i = 0; i < source_count_; ++i) {
      const SourceTerm& source = sources_[i];
      base[source.node] += source.base * input.drive[source.drive];
      slope[source.node] += source.slope * input.drive[source.drive];
    }
  }

  /// What the curved laws carry beyond their plain G, as K/s at both ends.
  template <class Data>
  void add_curved(const Vector& degC, const HeatInput<Data>& input, Vector& rate) const {
    for (int i = 0; i < curved_count_; ++i) add_curved(curved_[i], degC, input, rate);
  }

  template <class Data>
  void add_curved(const Link<Scalar>& link, const Vector& degC, const HeatInput<Data>& input, Vector& rate) const {
    const Scalar from = end_degC(link.from, degC, input), to = end_degC(link.to, degC, input);
    const Scalar extra_W = link.conductance_W_per_K * excess_K(link, from, to, input);
    if (link.from < first_boundary) rate[link.from] += extra_W / capacity_J_per_K_[link.from];
    if (link.to < first_boundary) rate[link.to] -= extra_W / capacity_J_per_K_[link.to];
  }

  template <class Data>
  static Scalar end_degC(int end, const Vector& degC, const HeatInput<Data>& input) {
    return end < first_boundary ? degC[end] : Scalar(input.boundary_degC[end - first_boundary]);
  }

  /// (law's factor - 1) (to - from), K.
  template <class Data>
  static Scalar excess_K(const Link<Scalar>& link, const Scalar& from, const Scalar& to, const HeatInput<Data>& input) {
    using std::exp, std::log;
    const Scalar d_K = to - from;
    switch (link.law) {
      case LinkLaw::speed:
        return link.k * d_K * input[Drive::speed_to_0_8];
      case LinkLaw::natural_convection: {
        const Scalar rounded = (d_K * d_K + 0.01) / 400.0;  // (0.1 K)^2 keeps the logarithm and its slope finite
        return (exp(link.k * log(rounded) * 0.5) - 1.0) * d_K;
      }
      case LinkLaw::radiation: {
        const Scalar a_K = from + 273.15, b_K = to + 273.15;
        return ((a_K * a_K + b_K * b_K) * (a_K + b_K) / (4.0 * 300.0 * 300.0 * 300.0) - 1.0) * d_K;
      }
      case LinkLaw::temperature: {
        const Scalar change = link.k * (from - 40.0);
        return -change / (change + 1.0) * d_K;
      }
      case LinkLaw::constant:
      case LinkLaw::count:
        break;
    }
    return Scalar(0.0);
  }

  int n_, source_count_ = 0, boundary_count_ = 0, curved_count_ = 0, sloped_count_ = 0;
  int sloped_[Shape<Scalar, N>::max];  // nodes whose heat grows with their temperature
  Matrix a_;                           // 1/s
  Scalar capacity_J_per_K_[Shape<Scalar, N>::max];
  SourceTerm sources_[max_sources];
  BoundaryTerm boundaries_[max_links];
  Link<Scalar> curved_[max_links];
};

}  // namespace thermal

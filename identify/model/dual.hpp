// SPDX-License-Identifier: MIT
// Forward dual numbers: a value and its derivatives by N parameters, carried through every operation, so that a
// simulation templated on its scalar yields exact sensitivities of the very code that it is. No heap.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace identify {

/// Two derivatives at a time, as every PC's registers hold them: left to itself the compiler pairs only some.
using TwoSlopes [[gnu::vector_size(2 * sizeof(double))]] = double;

template <int N>
struct Dual {
  static_assert(N % 2 == 0);
  static constexpr int pairs = N / 2;
  double v;
  TwoSlopes d[pairs];

  Dual() = default;
  constexpr Dual(double value) : v(value), d{} {}  // implicit: a constant has no derivative
  static Dual variable(double value, int direction) {
    Dual x(value);
    if (direction >= 0) x.d[direction / 2][direction % 2] = 1;
    return x;
  }
  double slope(int direction) const { return d[direction / 2][direction % 2]; }
  /// No longer depends on what `other` depends on.
  void forget(const Dual& other) {
    for (int i = 0; i < 2 * pairs; ++i) {
      if (other.slope(i) != 0) d[i / 2][i % 2] = 0;
    }
  }

  Dual& operator+=(const Dual& b) {
    v += b.v;
    for (int i = 0; i < pairs; ++i) d[i] += b.d[i];
    return *this;
  }
  Dual& operator-=(const Dual& b) {
    v -= b.v;
    for (int i = 0; i < pairs; ++i) d[i] -= b.d[i];
    return *this;
  }
  Dual& operator+=(double b) { return v += b, *this; }
  Dual& operator-=(double b) { return v -= b, *this; }
  Dual& operator*=(double b) {
    v *= b;
    for (int i = 0; i < pairs; ++i) d[i] *= b;
    return *this;
  }
  Dual& operator*=(const Dual& b) {
    for (int i = 0; i < pairs; ++i) d[i] = d[i] * b.v + v * b.d[i];
    v *= b.v;
    return *this;
  }
  Dual& operator/=(const Dual& b) {
    const double inverse = 1 / b.v;
    v *= inverse;
    for (int i = 0; i < pairs; ++i) d[i] = (d[i] - v * b.d[i]) * inverse;
    return *this;
  }

  friend Dual operator+(Dual a, const Dual& b) { return a += b; }
  friend Dual operator-(Dual a, const Dual& b) { return a -= b; }
  friend Dual operator*(Dual a, const Dual& b) { return a *= b; }
  friend Dual operator/(Dual a, const Dual& b) { return a /= b; }
  friend Dual operator+(Dual a, double b) { return a += b; }
  friend Dual operator+(double a, Dual b) { return b += a; }
  friend Dual operator-(Dual a, double b) { return a -= b; }
  friend Dual operator-(double a, const Dual& b) { return -b += a; }
  friend Dual operator*(Dual a, double b) { return a *= b; }
  friend Dual operator*(double a, Dual b) { return b *= a; }
  friend Dual operator/(Dual a, double b) { return a *= 1 / b; }
  friend Dual operator/(double a, const Dual& b) { return Dual(a) /= b; }
  friend Dual operator-(Dual a) {
    a.v = -a.v;
    for (int i = 0; i < pairs; ++i) a.d[i] = -a.d[i];
    return a;
  }
  /// Is it this constant, whatever the parameters?
  friend bool operator==(const Dual& a, double constant) {
    for (int i = 0; i < 2 * pairs; ++i) {
      if (a.slope(i) != 0) return false;
    }
    return a.v == constant;
  }
  friend bool operator<(const Dual& a, const Dual& b) { return a.v < b.v; }
  friend bool operator>(const Dual& a, const Dual& b) { return a.v > b.v; }

  /// f(a) from its value and its slope at a.
  static Dual chain(const Dual& a, double value, double slope) {
    Dual r;
    r.v = value;
    for (int i = 0; i < pairs; ++i) r.d[i] = slope * a.d[i];
    return r;
  }
  friend Dual exp(const Dual& a) {
    const double e = std::exp(a.v);
    return chain(a, e, e);
  }
  friend Dual log(const Dual& a) { return chain(a, std::log(a.v), 1 / a.v); }
};

inline double value_of(double x) { return x; }
template <int N>
double value_of(const Dual<N>& x) {
  return x.v;
}

}  // namespace identify

/// What Eigen asks of a scalar.
template <int N>
struct Eigen::NumTraits<identify::Dual<N>> : Eigen::NumTraits<double> {
  using Real = identify::Dual<N>;
  using NonInteger = identify::Dual<N>;
  using Nested = identify::Dual<N>;
  using Literal = double;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = N + 1,
    AddCost = N + 1,
    MulCost = 2 * N + 1
  };
};

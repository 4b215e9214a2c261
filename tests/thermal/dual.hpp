// SPDX-License-Identifier: MIT
// A small forward dual number for the tests: shows what HeatNetwork asks of a scalar, and nothing more.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace dual_test {

struct Dual {
  double v = 0, d = 0;
  Dual() = default;
  Dual(double value, double slope = 0) : v(value), d(slope) {}
  Dual& operator+=(const Dual& o) { return v += o.v, d += o.d, *this; }
  Dual& operator-=(const Dual& o) { return v -= o.v, d -= o.d, *this; }
  Dual& operator*=(const Dual& o) { return d = d * o.v + v * o.d, v *= o.v, *this; }
  Dual operator-() const { return {-v, -d}; }
};
inline Dual operator+(Dual a, const Dual& b) { return a += b; }
inline Dual operator-(Dual a, const Dual& b) { return a -= b; }
inline Dual operator*(Dual a, const Dual& b) { return a *= b; }
inline Dual operator/(const Dual& a, const Dual& b) { return {a.v / b.v, (a.d - a.v / b.v * b.d) / b.v}; }
inline bool operator==(const Dual& a, const Dual& b) { return a.v == b.v && a.d == b.d; }
inline Dual exp(const Dual& a) { return {std::exp(a.v), std::exp(a.v) * a.d}; }
inline Dual log(const Dual& a) { return {std::log(a.v), a.d / a.v}; }
inline double value_of(const Dual& a) { return a.v; }

}  // namespace dual_test

template <>
struct Eigen::NumTraits<dual_test::Dual> : Eigen::NumTraits<double> {
  using Real = dual_test::Dual;
  using NonInteger = dual_test::Dual;
  using Nested = dual_test::Dual;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = 2,
    AddCost = 2,
    MulCost = 4
  };
};

// SPDX-License-Identifier: MIT
// Runs a model over a log's bins.
//
//   dT/dt = A T + s(T, inputs),   A: the constant links, s: sources and what the other laws add
//   T(t+h) = e^(Ah) T + h phi1(Ah) s(T) + h phi2(Ah) (s(a) - s(T)),   a: the first two terms
//
// exact for constant links and held inputs (zero-order hold), second order in what depends on temperature itself (copper's
// resistance, radiation). The exponentials are formed once a run. Cost: linear in the number of bins; no heap.
#pragma once

#include <cmath>

#include "identify/bins.hpp"
#include "identify/dual.hpp"
#include "identify/model.hpp"

namespace identify {

namespace replay_detail {

using thermal::Boundary;
using thermal::Drive;
using thermal::LinkLaw;

template <class S, int n>
struct Matrix {
  S at[n][n];
};

template <class S, int n>
Matrix<S, n> product(const Matrix<S, n>& a, const Matrix<S, n>& b) {
  Matrix<S, n> c;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      S sum = a.at[i][0] * b.at[0][j];
      for (int k = 1; k < n; ++k) sum += a.at[i][k] * b.at[k][j];
      c.at[i][j] = sum;
    }
  }
  return c;
}

/// e^M, phi1(M), phi2(M): Taylor series of a matrix halved until small, then doubled back.
template <class S, int n>
void exponentials(Matrix<S, n> m, Matrix<S, n>& e, Matrix<S, n>& phi1, Matrix<S, n>& phi2) {
  double size = 0;
  for (int i = 0; i < n; ++i) {
    double row = 0;
    for (int j = 0; j < n; ++j) row += std::abs(value(m.at[i][j]));
    size = std::max(size, row);
  }
  int halvings = 0;
  while (size > 0.25 && halvings < 40) size /= 2, ++halvings;
  for (auto& row : m.at) {
    for (S& x : row) x *= std::ldexp(1.0, -halvings);
  }
  // phi2 = sum M^k/(k+2)!; phi1 = 1 + M phi2; e = 1 + M phi1. Ten terms of size 1/4: below 1e-14.
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) phi2.at[i][j] = S(0);
  }
  double factorial = 479001600;  // 12!
  for (int k = 10; k >= 0; --k) {
    phi2 = product<S, n>(m, phi2);
    for (int i = 0; i < n; ++i) phi2.at[i][i] += 1 / factorial;
    factorial /= k + 2;
  }
  phi1 = product<S, n>(m, phi2);
  for (int i = 0; i < n; ++i) phi1.at[i][i] += 1.0;
  e = product<S, n>(m, phi1);
  for (int i = 0; i < n; ++i) e.at[i][i] += 1.0;
  for (int h = 0; h < halvings; ++h) {
    const Matrix<S, n> square = product<S, n>(phi1, phi1), moved = product<S, n>(e, phi1);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        phi2.at[i][j] = (square.at[i][j] + phi2.at[i][j] * 2.0) * 0.25;
        phi1.at[i][j] = (moved.at[i][j] + phi1.at[i][j]) * 0.5;
      }
    }
    e = product<S, n>(e, e);
  }
}

/// The varying part of a link: what its law conducts beyond the constant conductance, in watts from `a` to `b`.
template <class S>
S law_excess_W(const thermal::Link<S>& link, const S& a_degC, const S& b_degC, const Bin& bin) {
  const S dT_K = a_degC - b_degC;
  switch (link.law) {
    case LinkLaw::constant: return S(0);
    case LinkLaw::speed: return link.conductance_W_per_K * link.k * bin.speed08 * dT_K;
    case LinkLaw::natural_convection: {
      // Below half a kelvin the exponent has no meaning; the law is continued linearly.
      const double sign = value(dT_K) < 0 ? -1 : 1;
      const S size = value(dT_K) * sign < 0.5 ? S(0.5) : dT_K * sign;
      using std::pow;
      return link.conductance_W_per_K * (pow(size * (1.0 / 20.0), link.k) - 1.0) * dT_K;
    }
    case LinkLaw::radiation: {
      const S x = (a_degC + 273.15) * (1.0 / 300.0), y = (b_degC + 273.15) * (1.0 / 300.0);
      return link.conductance_W_per_K * 75.0 * (x * x * x * x - y * y * y * y);  // 300 K / 4: the slope at 300 K is G
    }
    case LinkLaw::temperature:
      return link.conductance_W_per_K * (1.0 / (1.0 + link.k * (a_degC - 40.0)) - 1.0) * dT_K;
  }
  return S(0);
}

inline bool linear(LinkLaw law) { return law != LinkLaw::radiation; }

inline double step_share(double time_s, double from_s, double width_s) {
  return 1 / (1 + std::exp(-(time_s - from_s) / width_s));
}
template <int N>
Dual<N> step_share(double time_s, const Dual<N>& from_s, double width_s) {
  const double s = step_share(time_s, from_s.v, width_s);
  return Dual<N>::chain(from_s, s, -s * (1 - s) / width_s);
}

template <class S, int n, class Visit>
void run(const Model<S>& model, const Bins& log, S (&T)[n], Visit&& visit) {
  const auto& set = model.set;
  const double h = log.width_s;
  S per_capacity[n];
  Matrix<S, n> A, e, phi1, phi2;
  for (int i = 0; i < n; ++i) {
    per_capacity[i] = 1.0 / set.nodes[i].capacity_J_per_K;
    for (int j = 0; j < n; ++j) A.at[i][j] = S(0);
  }
  int to_sink[thermal::max_links], sinks = 0, curved[thermal::max_links], curves = 0;
  for (int l = 0; l < set.link_count; ++l) {
    const auto& link = set.links[l];
    if (link.law != LinkLaw::constant) curved[curves++] = l;
    if (!linear(link.law)) continue;
    const bool inner = link.to < thermal::first_boundary;
    A.at[link.from][link.from] -= link.conductance_W_per_K * per_capacity[link.from];
    if (inner) {
      A.at[link.from][link.to] += link.conductance_W_per_K * per_capacity[link.from];
      A.at[link.to][link.to] -= link.conductance_W_per_K * per_capacity[link.to];
      A.at[link.to][link.from] += link.conductance_W_per_K * per_capacity[link.to];
    } else {
      to_sink[sinks++] = l;
    }
  }
  for (auto& row : A.at) {
    for (S& x : row) x *= h;
  }
  exponentials<S, n>(A, e, phi1, phi2);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      phi1.at[i][j] *= per_capacity[j] * h;
      phi2.at[i][j] *= per_capacity[j] * h;
    }
  }

  const bool warm = [&] {  // anything in s that depends on temperature
    for (int q = 0; q < set.source_count; ++q) {
      if (value(set.sources[q].coefficient_per_K) != 0) return true;
    }
    return curves > 0 || model.cooling_changes;
  }();
  const std::size_t count = log.bins.size();
  S fixed[n], now[n], next[n], ahead[n], moved[thermal::drive_count];
  S lagged = T[set.housing.node];
  const bool lags = value(set.housing.lag_s) > 0;
  using std::exp;
  const S keep = lags ? exp(S(-h) / set.housing.lag_s) : S(0);

  for (std::size_t k = 0; k < count; ++k) {
    const Bin& bin = log.bins[k];
    const double time_s = (static_cast<double>(k) + 0.5) * h;
    if (model.delayed) {
      const double place = static_cast<double>(k) - value(model.delay_s) / h;
      const auto feature = [&](double x, int d) {
        if (x <= 0) return log.bins.front().drive[d];
        const auto i = static_cast<std::size_t>(x);
        if (i + 1 >= count) return log.bins.back().drive[d];
        return log.bins[i].drive[d] + (x - static_cast<double>(i)) * (log.bins[i + 1].drive[d] - log.bins[i].drive[d]);
      };
      for (int d = 0; d < thermal::drive_count; ++d) {
        const double slope = (feature(place + 0.5, d) - feature(place - 0.5, d)) / h;
        moved[d] = (model.delay_s - value(model.delay_s)) * -slope + feature(place, d);
      }
    }
    for (int i = 0; i < n; ++i) fixed[i] = S(0);
    S cooling_extra = S(0);
    if (model.cooling_changes) cooling_extra = (model.cooling_factor - 1.0) * step_share(time_s, model.cooling_from_s, 6.0);
    S sink[thermal::boundary_count];
    for (int b = 0; b < thermal::boundary_count; ++b) sink[b] = S(bin.boundary_degC[b]);
    if (model.drifts) {
      sink[static_cast<int>(Boundary::ambient)] += model.drift_K_per_s * time_s;
      sink[static_cast<int>(Boundary::coolant)] += model.drift_K_per_s * time_s;
    }
    for (int l = 0; l < sinks; ++l) {
      const auto& link = set.links[to_sink[l]];
      fixed[link.from] += link.conductance_W_per_K * sink[link.to - thermal::first_boundary];
    }
    // Watts into each node at temperatures T.
    const auto watts = [&](const S* at, S* out) {
      for (int i = 0; i < n; ++i) out[i] = fixed[i];
      for (int q = 0; q < set.source_count; ++q) {
        const auto& source = set.sources[q];
        const int d = static_cast<int>(source.drive);
        S heat = model.delayed ? source.gain * moved[d] : source.gain * bin.drive[d];
        if (source.drive == Drive::current_A2) {
          if (model.offset) heat += source.gain * (model.current_offset_A * (2 * bin.signed_A) + model.current_offset_A * model.current_offset_A);
          if (model.stalls) heat += source.gain * model.stall_share * bin.stalled_A2;
        }
        if (value(source.coefficient_per_K) != 0) {
          const S at25 = at[source.node] - 25.0;
          heat += heat * (source.coefficient_per_K * at25);
        }
        out[source.node] += heat;
      }
      for (int c = 0; c < curves; ++c) {
        const auto& link = set.links[curved[c]];
        const bool inner = link.to < thermal::first_boundary;
        const S flow = law_excess_W(link, at[link.from], inner ? at[link.to] : sink[link.to - thermal::first_boundary], bin);
        out[link.from] -= flow;
        if (inner) out[link.to] += flow;
      }
      if (model.cooling_changes) {
        const auto& link = set.links[model.sink_link];
        out[link.from] -= link.conductance_W_per_K * cooling_extra * (at[link.from] - sink[link.to - thermal::first_boundary]);
      }
    };
    watts(T, now);
    for (int i = 0; i < n; ++i) {
      S sum = e.at[i][0] * T[0];
      for (int j = 1; j < n; ++j) sum += e.at[i][j] * T[j];
      for (int j = 0; j < n; ++j) sum += phi1.at[i][j] * now[j];
      next[i] = sum;
    }
    if (warm) {
      watts(next, ahead);
      for (int j = 0; j < n; ++j) ahead[j] -= now[j];
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) next[i] += phi2.at[i][j] * ahead[j];
      }
    }

    const int housing = set.housing.node;
    S seen = T[housing] + (next[housing] - T[housing]) * static_cast<double>(bin.housing_at);
    if (lags) {
      // The sensor follows the mean of the bin; its own state is read at the same place of the bin.
      const S mean = (T[housing] + next[housing]) * 0.5, after = mean + (lagged - mean) * keep;
      seen = lagged + (after - lagged) * static_cast<double>(bin.housing_at);
      lagged = after;
    }
    seen += set.housing.offset_K + set.housing.gain_error * (seen - 25.0);
    S core = T[model.core] + (next[model.core] - T[model.core]) * static_cast<double>(bin.core_at);
    if (model.hot_node >= 0) {
      const S hot = T[model.hot_node] + (next[model.hot_node] - T[model.hot_node]) * static_cast<double>(bin.core_at);
      core = core * (1 - model.hot_share) + hot * model.hot_share;
    }
    visit(k, seen, core, next);
    for (int i = 0; i < n; ++i) T[i] = next[i];
  }
}

}  // namespace replay_detail

/// Replays `log` from core and housing temperatures; `visit(bin, housing reading, core reading, node temperatures)`.
template <class S, class Visit>
void replay(const Model<S>& model, const Bins& log, const S& core_degC, const S& housing_degC, Visit&& visit) {
  const auto go = [&]<int n>() {
    S T[n];
    for (int i = 0; i < n; ++i) T[i] = housing_degC;
    T[model.core] = core_degC;
    if (model.hot_node >= 0 && model.hot_node < n) T[model.hot_node] = core_degC;
    replay_detail::run<S, n>(model, log, T, visit);
  };
  switch (model.set.node_count) {
    case 2: return go.template operator()<2>();
    case 3: return go.template operator()<3>();
    default: return go.template operator()<4>();
  }
}

}  // namespace identify

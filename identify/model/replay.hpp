// SPDX-License-Identifier: MIT
// Runs a model over a log's bins, by the very step that the board runs (thermal/network.hpp): exact for constant links
// and held inputs, second order in what depends on temperature itself. With dual numbers it carries the exact
// sensitivities along. Cost: linear in the number of bins.
#pragma once

#include <array>
#include <cassert>
#include <cmath>
#include <vector>

#include "identify/log/bins.hpp"
#include "identify/model/dual.hpp"
#include "identify/model/model.hpp"
#include "thermal/network.hpp"

// With sanitizers a flattened replay takes three minutes to compile and gains nothing.
#ifdef HOTCORE_TRAP_FLOATS
#define HOTCORE_FLATTEN
#else
#define HOTCORE_FLATTEN [[gnu::flatten]]
#endif

namespace identify {

/// From where a log is replayed, or replayed again after a pause.
template <class S>
struct Initial {
  S core_degC, housing_degC;
  S mass_degC, sensed_degC;  // of a further mass, of a housing sensor that lags: where a log begins, and only there
  S own;                     // depends on this start's coordinates, and on nothing else
};

namespace replay_detail {

using thermal::Boundary;
using thermal::Drive;

/// The housing where its sensor, prompt, reads this.
template <class S>
S housing_behind(const thermal::HousingSensor<S>& sensor, const S& read_degC) {
  return (sensor.gain_error * 25.0 - sensor.offset_K + read_degC) / (sensor.gain_error + 1.0);
}

inline double rising(double time_s, double from_s, double width_s) {
  return 1 / (1 + std::exp(-(time_s - from_s) / width_s));
}
template <int N>
Dual<N> rising(double time_s, const Dual<N>& from_s, double width_s) {
  const double s = rising(time_s, from_s.v, width_s);
  return Dual<N>::chain(from_s, s, -s * (1 - s) / width_s);
}

/// A drive between bins, for clocks that are apart: the quadratic spline through the bins' values. It has a slope
/// everywhere (at a jump of it a fit would stick), and where it is not moved it changes nothing.
class Spline {
 public:
  Spline() = default;
  /// Knots c with c[i-1] + 6 c[i] + c[i+1] = 8 values, ends repeated; by elimination.
  Spline(const Bins& log, int drive) : knots_(log.bins.size()) {
    const std::size_t n = knots_.size();
    std::vector<double> next(n);
    for (std::size_t i = 0; i < n; ++i) {
      const double before = i > 0 ? next[i - 1] : 0, own = (i > 0 && i + 1 < n ? 6.0 : 7.0) - before;
      next[i] = 1 / own;
      knots_[i] = (8 * log.bins[i].input.drive[drive] - (i > 0 ? knots_[i - 1] : 0)) / own;
    }
    for (std::size_t i = n - 1; i-- > 0;) knots_[i] -= next[i] * knots_[i + 1];
  }

  struct Value {
    double value, slope;  // slope: a bin
  };
  Value at(double place) const {
    const auto last = static_cast<double>(knots_.size() - 1);
    const double nearest = std::round(place), f = place - nearest;
    const auto knot = [&](double i) { return knots_[static_cast<std::size_t>(i < 0 ? 0 : i > last ? last : i)]; };
    const double before = knot(nearest - 1), here = knot(nearest), after = knot(nearest + 1);
    return {0.5 * (0.5 - f) * (0.5 - f) * before + (0.75 - f * f) * here + 0.5 * (0.5 + f) * (0.5 + f) * after,
            -(0.5 - f) * before - 2 * f * here + (0.5 + f) * after};
  }

 private:
  std::vector<double> knots_;
};
using Splines = std::array<Spline, thermal::drive_count>;

// A conductance that changes at a moment is written as two sources, since the links of a set are constant: with
// d = share of the change in force and q = conductance * (factor - 1),
//   -q/a d (1 + a (T - 25)) + q/a d (1 + a (Ta - 25)) = -q d (T - Ta).
// The two phases' drives carry d; phase currents are not in a log.
constexpr double carrier_per_K = 0.01;
constexpr Drive carrier = Drive::phase_a_A2, against = Drive::phase_b_A2;

template <class S>
thermal::HeatSet<S> with_cooling_change(const Model<S>& model) {
  auto set = model.set;
  if (!model.cooling_changes) return set;
  const auto& link = set.links[model.sink_link];
  const S q = link.conductance_W_per_K * (model.cooling_factor - 1.0) * (1 / carrier_per_K);
  set.sources[set.source_count++] = {link.from, carrier, -q, S(carrier_per_K)};
  set.sources[set.source_count++] = {link.from, against, q, S(0)};
  return set;
}

/// The inputs of bin k as the model believes them.
template <class S>
void correct(const Model<S>& model, const Bins& log, const Splines& splines, std::size_t k, thermal::HeatInput<S>& in) {
  const Bin& bin = log.bins[k];
  const double h = log.width_s, time_s = (static_cast<double>(k) + 0.5) * h;
  for (int b = 0; b < thermal::boundary_count; ++b) in.boundary_degC[b] = S(bin.input.boundary_degC[b]);
  // Only drives that something uses: a dual number is as long as its derivatives are many.
  const double place = static_cast<double>(k) - (model.delayed ? value_of(model.delay_s) / h : 0);
  const auto take = [&](Drive d) {
    if (!model.delayed) {
      in[d] = S(bin.input[d]);
      return;
    }
    const Spline::Value there = splines[static_cast<std::size_t>(d)].at(place);
    in[d] = (model.delay_s - value_of(model.delay_s)) * (-there.slope / h) + there.value;
  };
  for (int s = 0; s < model.set.source_count; ++s) take(model.set.sources[s].drive);
  take(Drive::speed_to_0_8);
  // The current as it flowed then: to the nearest bin, where it only corrects.
  const double latest = static_cast<double>(log.bins.size() - 1), nearest = std::round(place);
  const Bin& then = log.bins[static_cast<std::size_t>(nearest < 0 ? 0 : nearest > latest ? latest : nearest)];
  if (model.offset)
    in[Drive::current_A2] +=
        model.current_offset_A * (2 * then.signed_A) + model.current_offset_A * model.current_offset_A;
  if (model.uneven_per_A2 != 0) in[Drive::current_A2] += model.uneven_per_A2 * then.uneven_A4;
  const double a2 = then.input[Drive::current_A2];
  if (model.stalls && a2 > 0) {
    // What phases that warm unequally take more goes by the square of what heats them.
    const S more = model.stall_share * (then.stalled_A2 / a2) + 1.0;
    in[Drive::current_A2] =
        more * (in[Drive::current_A2] + (more - 1.0) * (model.uneven_per_A2 + log.uneven_per_A2) * then.uneven_A4);
  }
  if (model.drifts) {
    const S drifted_K = model.drift_K_per_s * (model.drifted_s + time_s);
    in[Boundary::ambient] += drifted_K;
    in[Boundary::coolant] += drifted_K;
  }
  if (model.cooling_changes) {
    constexpr double rise_s = 6;  // short for a housing, long enough for a slope
    in[carrier] = rising(time_s, model.cooling_from_s, rise_s);
    in[against] = in[carrier] * (carrier_per_K * (in[Boundary::ambient] - 25.0) + 1.0);
  }
}

inline void forget(double&, double) {}
template <int N>
void forget(Dual<N>& x, const Dual<N>& what) {
  x.forget(what);
}

// Flattened: with every operation of the dual numbers inlined, their pairs stay in registers and the run takes a sixth
// of the time.
template <class S, int n, class Visit>
HOTCORE_FLATTEN void run(const Model<S>& model, const thermal::HeatNetwork<S, n>& network,
                         const thermal::Transition<S, n>& transition, const Bins& log, const Splines& splines,
                         const std::vector<Initial<S>>& initial, Visit&& visit) {
  using Vector = typename thermal::HeatNetwork<S, n>::Vector;
  const auto& set = model.set;
  const bool corrected = model.offset || model.delayed || model.drifts || model.stalls || model.cooling_changes ||
                         model.uneven_per_A2 != 0;
  thermal::HeatInput<S> in;
  Vector T = Vector::Constant(initial.front().mass_degC), next;
  const int housing = set.housing.node;
  const bool lags = value_of(set.housing.lag_s) > 0;
  const bool reads_straight = set.housing.gain_error == 0 && set.housing.offset_K == 0;
  S lagged(0), keep(0), mean_keep(0), left(0);
  S felt(0), keep_felt(0);  // of a winding's sensor that lags
  std::size_t begun = 0;
  // After a pause a further mass goes on from where it is; that this depends on the earlier start is left out.
  const auto begin = [&](const Initial<S>& from) {
    for (int i = 0; i < n && begun > 0; ++i) forget(T[i], from.own);
    T[housing] = from.housing_degC;
    lagged = from.sensed_degC;
    // A late sensor is where it reads, and not where the housing is, unless the pause was long enough to catch up.
    const double read = log.starts[begun].housing_degC;
    if (begun > 0 && lags && !std::isnan(read)) {
      lagged += (housing_behind(set.housing, S(read)) - lagged) * still_late(set.housing.lag_s);
    }
    T[model.core] = from.core_degC;
    if (model.hot_node >= 0) T[model.hot_node] = from.core_degC;
    felt = from.core_degC;
    ++begun;
  };
  using std::exp;
  if (lags) {
    keep = exp(-log.width_s / set.housing.lag_s);
    mean_keep = (1.0 - keep) * set.housing.lag_s / log.width_s;
  }
  if (model.winding_lags) keep_felt = exp(-log.width_s / model.winding_lag_s);

  // What copper warms by for each unit of Bin::core_ahead, at 25 degC.
  const auto& copper = set.sources[0];
  const S core_K = copper.gain / set.nodes[model.core].capacity_J_per_K;
  const S hot_K = model.hot_node < 0 ? S(0)
                                     : copper.gain * (model.hot_share / (1 - model.hot_share)) /
                                           set.nodes[model.hot_node].capacity_J_per_K;

  for (std::size_t k = 0; k < log.bins.size(); ++k) {
    const Bin& bin = log.bins[k];
    while (begun < log.starts.size() && k == log.starts[begun].bin) begin(initial[begun]);  // merged bins: several
    if (n > 2 && begun < log.starts.size() && k + log.starts[begun].paused >= log.starts[begun].bin) {
      // In a pause it follows the housing, from where that was to where it is found.
      const std::size_t paused = log.starts[begun].paused, into = k + paused - log.starts[begun].bin;
      if (into == 0) left = T[housing];
      const double share = (static_cast<double>(into) + 0.5) / static_cast<double>(paused);
      T[housing] = T[model.core] = left + (value_of(initial[begun].housing_degC) - left) * share;
    }
    if (corrected) {
      correct(model, log, splines, k, in);
      next = network.step(transition, T, in);
    } else {
      next = network.step(transition, T, bin.input);
    }
    S before = T[housing], change = next[housing] - T[housing];
    if (model.feels_winding) {
      before += model.sensor_share * (T[model.core] - T[housing]);
      change += model.sensor_share * (next[model.core] - T[model.core] - change);
    }
    const auto ran_ahead = [&](int node, const S& K_per_ahead, double by) {
      return K_per_ahead * (copper.coefficient_per_K * (T[node] - 25.0) + 1.0) * by;
    };
    S seen = before + change * static_cast<double>(bin.housing_at);
    if (model.feels_winding) seen += model.sensor_share * ran_ahead(model.core, core_K, bin.housing_ahead);
    if (lags) {
      // Behind a ramp a first-order sensor stays by slope times lag, and what it was off by before fades away; readings
      // that are spread over the bin see the mean of that.
      const S behind = change * set.housing.lag_s / log.width_s;
      const S off = lagged - before + behind;
      const double into_s = log.width_s * static_cast<double>(bin.housing_at);
      seen -= behind;
      seen += off * (bin.housing_n > 1 ? mean_keep : exp(-into_s / set.housing.lag_s));
      lagged = before + change - behind + off * keep;
    }
    if (!reads_straight) seen += set.housing.offset_K + set.housing.gain_error * (seen - 25.0);
    const auto read = [&](int node, const S& K_per_ahead) {
      S degC = T[node] + (next[node] - T[node]) * static_cast<double>(bin.core_at);
      if (bin.core_n > 0) degC += ran_ahead(node, K_per_ahead, bin.core_ahead);
      return degC;
    };
    const auto copper_of = [&](const Vector& at) {
      return model.hot_node < 0 ? S(at[model.core])
                                : at[model.core] * (1 - model.hot_share) + at[model.hot_node] * model.hot_share;
    };
    S behind_winding(0), off_winding(0);
    if (model.winding_lags) {  // as the housing's above; what ran ahead inside a bin is smoothed away
      behind_winding = (copper_of(next) - copper_of(T)) * model.winding_lag_s / log.width_s;
      off_winding = felt - copper_of(T) + behind_winding;
      felt = copper_of(next) - behind_winding + off_winding * keep_felt;
    }
    const auto winding = [&] {
      if (model.winding_lags) {
        const double at = static_cast<double>(bin.core_at);
        return copper_of(T) + (copper_of(next) - copper_of(T)) * at - behind_winding +
               off_winding * exp(-log.width_s * at / model.winding_lag_s);
      }
      S core = read(model.core, core_K);
      if (model.hot_node >= 0) core = core * (1 - model.hot_share) + read(model.hot_node, hot_K) * model.hot_share;
      return core;
    };
    visit(k, seen, winding);
    T = next;
  }
}

/// What is done once for a log, not flattened: it would only take longer to compile.
template <int n, class S, class Visit>
void prepare_and_run(const Model<S>& model, const Bins& log, const std::vector<Initial<S>>& initial, Visit&& visit) {
  const thermal::HeatNetwork<S, n> network(with_cooling_change(model));
  Splines splines;
  if (model.delayed) {
    const auto prepare = [&](Drive d) { splines[static_cast<std::size_t>(d)] = Spline(log, static_cast<int>(d)); };
    for (int s = 0; s < model.set.source_count; ++s) prepare(model.set.sources[s].drive);
    prepare(Drive::speed_to_0_8);
  }
  run(model, network, network.transition(log.width_s), log, splines, initial, visit);
}

}  // namespace replay_detail

/// Replays `log` from one state for each of its starts; `visit(bin, housing reading, winding)`, where winding() is the
/// core reading. `most_nodes`: what the model may have at most, so that no more is compiled than can happen.
template <int most_nodes, class S, class Visit>
void replay(const Model<S>& model, const Bins& log, const std::vector<Initial<S>>& initial, Visit&& visit) {
  if (model.set.node_count == 2) return replay_detail::prepare_and_run<2>(model, log, initial, visit);
  if constexpr (most_nodes >= 3) {
    if (model.set.node_count == 3) return replay_detail::prepare_and_run<3>(model, log, initial, visit);
  }
  if constexpr (most_nodes >= 4) {
    if (model.set.node_count == 4) return replay_detail::prepare_and_run<4>(model, log, initial, visit);
  }
  assert(false && "more nodes than this replay was compiled for");
}

}  // namespace identify

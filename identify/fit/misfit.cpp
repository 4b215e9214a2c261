// SPDX-License-Identifier: MIT
#include "identify/fit/misfit.hpp"

#include <algorithm>
#include <cmath>

#include "identify/fit/model_at.hpp"

namespace identify {
namespace {

template <int N>
struct Sums {
  Dual<N> H[N] = {};  // rows of products of sensitivities, to the diagonal's pair; values: with the residual
  double misfit = 0;
  int readings = 0;
  Dual<N> with_averaged[Averaged::most] = {};  // products of residual and sensitivities with what is averaged over
};

/// Adds one channel's bin k of log l to the sums; n readings, 0: none.
template <int N>
void add(Sums<N>& sums, Whitener& w, Foretold<Dual<N>>& foretold, const Dual<N>& simulated, double measured, double n,
         const Averaged& averaged, std::vector<std::vector<double>> Leeway::*channel, std::size_t l, std::size_t k) {
  if (n > 0) {
    w.reading(n);
    Dual<N> e = simulated - measured;
    foretold.whiten(w, e);
    sums.misfit += 0.5 * e.v * e.v;
    ++sums.readings;
    for (int i = 0; i < N; ++i) {
      sums.H[i].v += e.v * e.slope(i);
      for (int pair = 0; pair <= i / 2; ++pair) sums.H[i].d[pair] += e.d[pair] * e.slope(i);
    }
    for (std::size_t i = 0; i < averaged.effects.size(); ++i)
      sums.with_averaged[i] += e * (averaged.effects[i].*channel)[l][k];
  }
  w.step();
  foretold.step(w);
}

template <int N>
bool evaluate_in(const Problem& problem, const Averaged& averaged, const std::vector<Chosen>& chosen,
                 const Eigen::VectorXd& x, Misfit& out) {
  const int shared = base_count + coordinates_of(chosen);
  const int all = static_cast<int>(x.size());
  out.sum = 0;
  out.readings = 0;
  out.gradient = Eigen::VectorXd::Zero(all);
  out.information = Eigen::MatrixXd::Zero(all, all);
  Eigen::MatrixXd with_averaged = Eigen::MatrixXd::Zero(all, averaged.columns());
  Eigen::VectorXd residual_with_averaged = Eigen::VectorXd::Zero(averaged.columns());
  const std::vector<Before> of_before = before_of(chosen);
  int own = shared;
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    const Bins& log = problem.logs[l];
    const int end = own + static_cast<int>(own_count(log));
    Dual<N> local[N];
    for (int i = 0; i < shared; ++i) local[i] = Dual<N>::variable(x[i], i);
    // All starts of a log share two directions, for no reading depends on more than the last of them. What was before
    // it has others.
    const int of_start = shared + per_start_count;
    int places[N], directions = of_start;
    Dual<N> before[before_count] = {0, 0, 0};
    for (std::size_t i = 0; log.begins_warm && i < of_before.size(); ++i, ++directions) {
      places[directions] = end - before_count + of_before[i];
      before[of_before[i]] = Dual<N>::variable(x[places[directions]], directions);
    }
    const auto model = model_at<Dual<N>>(problem, chosen, local, before, l);
    std::vector<Initial<Dual<N>>> initial;
    for (std::size_t s = 0; s < log.starts.size(); ++s) {
      const int at = own + per_start_count * static_cast<int>(s);
      initial.push_back(begin_at(model, log, log.starts[s], Dual<N>::variable(x[at], shared),
                                 Dual<N>::variable(x[at + 1], shared + 1)));
    }
    Sums<N> sums;
    const auto take_sums = [&] {
      const auto place = [&](int i) { return i < shared ? i : i < of_start ? own + i - shared : places[i]; };
      for (int i = 0; i < directions; ++i) {
        out.gradient[place(i)] += sums.H[i].v;
        for (int j = 0; j <= i; ++j) {
          out.information(place(i), place(j)) += sums.H[i].slope(j);
          if (i != j) out.information(place(j), place(i)) += sums.H[i].slope(j);
        }
        for (std::size_t e = 0; e < averaged.effects.size(); ++e)
          with_averaged(place(i), averaged.column(e, l)) += sums.with_averaged[e].slope(i);
      }
      for (std::size_t e = 0; e < averaged.effects.size(); ++e)
        residual_with_averaged[averaged.column(e, l)] += sums.with_averaged[e].v;
      out.sum += sums.misfit;
      out.readings += sums.readings;
      sums = {};
      own += per_start_count;
    };
    std::size_t begun = 1;
    Whitener housing = Whitener::housing(problem.noise, log.width_s), core = Whitener::core(problem.noise, log.width_s);
    Foretold<Dual<N>> of_housing{0, 0}, of_core{0, 0};
    bool finite = true;
    // A further node brings two coordinates.
    constexpr int most_nodes = N <= 6 ? 2 : N <= 8 ? 3 : 4;
    replay<most_nodes>(model, log, initial, [&](std::size_t k, const Dual<N>& y2, const auto& winding) {
      const Bin& bin = log.bins[k];
      const Dual<N> y1 = bin.core_n > 0 ? winding() : Dual<N>(0);
      while (begun < log.starts.size() && k == log.starts[begun].bin) {
        take_sums();
        for (Foretold<Dual<N>>* p : {&of_housing, &of_core}) {
          p->wander.forget(initial[begun].own);
          p->disturbance.forget(initial[begun].own);
        }
        ++begun;
      }
      finite = finite && std::abs(y2.v) < 1e5 && std::abs(y1.v) < 1e5;
      add<N>(sums, housing, of_housing, y2, bin.housing_degC, static_cast<double>(bin.housing_n), averaged,
             &Leeway::housing_K, l, k);
      if (log.has_core)
        add<N>(sums, core, of_core, y1, bin.core_degC, static_cast<double>(bin.core_n), averaged, &Leeway::core_K, l,
               k);
    });
    if (!finite || !std::isfinite(sums.misfit)) return false;
    take_sums();
    own = end;  // of a log that was cut, past those after
  }
  if (!std::isfinite(out.sum)) return false;
  const Eigen::VectorXd explained = averaged.inverse * residual_with_averaged;
  out.sum -= 0.5 * residual_with_averaged.dot(explained);
  out.gradient -= with_averaged * explained;
  out.information -= with_averaged * averaged.inverse * with_averaged.transpose();
  out.leeway = -explained;
  return true;
}

}  // namespace

bool evaluate(const Problem& problem, const Averaged& averaged, const std::vector<Chosen>& chosen,
              const Eigen::VectorXd& x, Misfit& out) {
  const bool warm =
      std::any_of(problem.logs.begin(), problem.logs.end(), [](const Bins& log) { return log.begins_warm; });
  const int n =
      base_count + coordinates_of(chosen) + per_start_count + (warm ? static_cast<int>(before_of(chosen).size()) : 0);
  if (n <= 6) return evaluate_in<6>(problem, averaged, chosen, x, out);
  if (n <= 8) return evaluate_in<8>(problem, averaged, chosen, x, out);
  if (n <= 10) return evaluate_in<10>(problem, averaged, chosen, x, out);
  return evaluate_in<12>(problem, averaged, chosen, x, out);  // two causes have four parameters at most
}

}  // namespace identify

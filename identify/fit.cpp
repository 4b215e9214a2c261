// SPDX-License-Identifier: MIT
#include "identify/fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "identify/replay.hpp"
#include "identify/whitening.hpp"

namespace identify {
namespace {

constexpr double initial_sd_K = 3;  // the first readings tell the initial state this well
// Far beyond what a first reading is wrong by, and what a winding of class F can be above its housing.
constexpr double initial_room_K = 60, most_excess_K = 150;
// Over a housing that is warm when the log begins, a winding may be this share of its rise warmer again; R1 over R2 of
// catalogues is 0.03 to 1.4.
constexpr double warm_excess_share = 0.5;
// Before a log that begins warm its housing moved by this share of its rise within its time constant: all of it or
// none, evenly likely, the root of whose mean square this is; three times it under a burst. And an ambient may have
// drifted for as long again.
const double before_sd = 1 / std::sqrt(3.0);
constexpr double least_before[] = {-1, -3, 0}, most_before[] = {1, 3, 1};

// How large a cause is follows Student's t around nothing, the rest Gaussians: fifteen times what is typical is rare,
// and no reason to believe in two imitations of a typical size. Degrees of freedom: Lange, Little, Taylor, JASA 84
// (1989) 881.
constexpr double tail_dof = 4;

struct Coordinate {
  double start, prior, sd, low, high;
  bool of_cause = false;
};

/// Initial coordinates of a log.
Eigen::Index own_count(const Bins& log) {
  return per_start_count * static_cast<Eigen::Index>(log.starts.size()) + (log.begins_warm ? before_count : 0);
}

/// What of the causes depends on what was before a log.
std::vector<Before> before_of(const std::vector<Chosen>& chosen) {
  std::vector<Before> out;
  for (const Chosen& c : chosen) {
    if (cause_of(c).edit == Edit::mass) out.push_back(mass_before);
    if (cause_of(c).edit == Edit::sensor_lag) out.push_back(sensor_before);
    if (cause_of(c).edit == Edit::drift) out.push_back(drift_before);
  }
  return out;
}

int coordinates_of(const std::vector<Chosen>& chosen) {
  int n = 0;
  for (const Chosen& c : chosen) n += static_cast<int>(cause_of(c).parameters.size());
  return n;
}

std::vector<Coordinate> layout(const Problem& problem, const std::vector<Chosen>& chosen) {
  const Belief& b = problem.belief;
  std::vector<Coordinate> out;
  for (const double v : {b.R1_K_per_W, b.R2_K_per_W, b.C1_J_per_K, b.C2_J_per_K}) {
    const double x = std::log(v);
    out.push_back({x, x, b.log_sd, x - b.log_room, x + b.log_room});
  }
  for (const Chosen& c : chosen) {
    for (const Parameter& p : cause_of(c).parameters) {
      if (p.logarithmic) {
        const double centre = std::log(p.none);
        out.push_back({centre, centre, p.typical, std::log(p.low), std::log(p.high), true});
      } else {
        out.push_back({p.none, p.none, p.typical, p.low, p.high, true});
      }
    }
  }
  for (const Bins& log : problem.logs) {
    for (const Start& start : log.starts) {
      const double core = start.core_degC, housing = start.housing_degC;
      const double at = std::isnan(housing) ? core : housing;
      const double sink = log.bins[std::min(start.bin, log.bins.size() - 1)].input.boundary_degC[0];
      const double known = std::isnan(at) ? sink : at;
      out.push_back({known, known, initial_sd_K, known - initial_room_K, known + initial_room_K});
      const double excess = std::isnan(core) || std::isnan(housing) ? 0 : core - housing;
      const double excess_sd_K =
          std::isnan(core) ? warm_excess_share * std::max(0.0, known - sink) : problem.noise.core_white_K;
      out.push_back({excess, excess, initial_sd_K + excess_sd_K, -initial_room_K, most_excess_K});
    }
    const std::vector<Before> before = before_of(chosen);
    for (int i = 0; log.begins_warm && i < before_count; ++i) {
      const bool counts = std::find(before.begin(), before.end(), i) != before.end();
      out.push_back({0, 0, before_sd, counts ? least_before[i] : 0, counts ? most_before[i] : 0});
    }
  }
  return out;
}

/// What simulates log `l` at coordinates x of base and causes; `before`: of what was before it, where it begins warm.
template <class S>
Model<S> build(const Problem& problem, const std::vector<Chosen>& chosen, const S* x, const S* before, std::size_t l) {
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

struct Evaluation {
  double misfit = 0;
  int readings = 0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd information;
  Eigen::VectorXd leeway;  // what the residuals show of each effect averaged over, a column of Averaged each
};

template <int N>
bool evaluate(const Problem& problem, const Averaged& averaged, const std::vector<Chosen>& chosen,
              const Eigen::VectorXd& x, Evaluation& out) {
  const int shared = base_count + coordinates_of(chosen);
  const int all = static_cast<int>(x.size());
  out.misfit = 0;
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
    const auto model = build<Dual<N>>(problem, chosen, local, before, l);
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
      out.misfit += sums.misfit;
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
  if (!std::isfinite(out.misfit)) return false;
  const Eigen::VectorXd explained = averaged.inverse * residual_with_averaged;
  out.misfit -= 0.5 * residual_with_averaged.dot(explained);
  out.gradient -= with_averaged * explained;
  out.information -= with_averaged * averaged.inverse * with_averaged.transpose();
  out.leeway = -explained;
  return true;
}

bool evaluate_any(const Problem& problem, const Averaged& averaged, const std::vector<Chosen>& chosen,
                  const Eigen::VectorXd& x, Evaluation& out) {
  const bool warm =
      std::any_of(problem.logs.begin(), problem.logs.end(), [](const Bins& log) { return log.begins_warm; });
  const int n =
      base_count + coordinates_of(chosen) + per_start_count + (warm ? static_cast<int>(before_of(chosen).size()) : 0);
  if (n <= 6) return evaluate<6>(problem, averaged, chosen, x, out);
  if (n <= 8) return evaluate<8>(problem, averaged, chosen, x, out);
  if (n <= 10) return evaluate<10>(problem, averaged, chosen, x, out);
  return evaluate<12>(problem, averaged, chosen, x, out);  // two causes have four parameters at most
}

double prior_cost(const std::vector<Coordinate>& c, const Eigen::VectorXd& x) {
  double sum = 0;
  for (std::size_t i = 0; i < c.size(); ++i) {
    const double z = (x[static_cast<Eigen::Index>(i)] - c[i].prior) / c[i].sd;
    sum += c[i].of_cause ? 0.5 * (tail_dof + 1) * std::log1p(z * z / tail_dof) : 0.5 * z * z;
  }
  return sum;
}

/// What a bound holds has no part in what the others do.
void decouple(Eigen::MatrixXd& A, Eigen::Index i, double diagonal) {
  A.row(i).setZero();
  A.col(i).setZero();
  A(i, i) = diagonal;
}

/// Fit::narrowing. Where a bound holds a coordinate, nothing was learned but the bound.
double narrowing(Eigen::MatrixXd H, const std::vector<Coordinate>& c, const std::vector<bool>& held) {
  for (Eigen::Index i = 0; i < H.rows(); ++i) {
    const double sd = c[static_cast<std::size_t>(i)].sd;
    H.row(i) *= sd;
    H.col(i) *= sd;
    if (held[static_cast<std::size_t>(i)]) decouple(H, i, 1);
  }
  return H.ldlt().vectorD().array().abs().log().sum();
}

/// The misfit with its priors near x, as a parabola; `held` are the coordinates that a bound holds there.
struct Parabola {
  Eigen::VectorXd gradient;
  Eigen::MatrixXd curvature;
  std::vector<bool> held;

  Parabola(const std::vector<Coordinate>& c, const Eigen::VectorXd& x, const Evaluation& at)
      : gradient(at.gradient), curvature(at.information), held(c.size()) {
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      const Coordinate& ci = c[static_cast<std::size_t>(i)];
      const double z = (x[i] - ci.prior) / ci.sd;
      const double weight = (ci.of_cause ? (tail_dof + 1) / (tail_dof + z * z) : 1) / (ci.sd * ci.sd);
      gradient[i] += weight * (x[i] - ci.prior);
      curvature(i, i) += weight;  // where the tail bends the other way too: a step stays a step down
      held[static_cast<std::size_t>(i)] = (x[i] <= ci.low && gradient[i] > 0) || (x[i] >= ci.high && gradient[i] < 0);
    }
  }

  /// The step that undoes `slope`, shortened by Marquardt's damping.
  Eigen::VectorXd step_against(Eigen::VectorXd slope, double damping) const {
    Eigen::MatrixXd A = curvature;
    for (Eigen::Index i = 0; i < slope.size(); ++i) {
      A(i, i) *= 1 + damping;
      if (!held[static_cast<std::size_t>(i)]) continue;
      decouple(A, i, 1);
      slope[i] = 0;
    }
    return A.ldlt().solve(-slope);
  }
};

/// x and a step from it, of each coordinate two standard deviations at most and within its bounds.
Eigen::VectorXd stepped(const std::vector<Coordinate>& c, Eigen::VectorXd x, const Eigen::VectorXd& dx) {
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const Coordinate& ci = c[static_cast<std::size_t>(i)];
    x[i] = std::clamp(x[i] + std::clamp(dx[i], -2 * ci.sd, 2 * ci.sd), ci.low, ci.high);
  }
  return x;
}

/// Levenberg-Marquardt from x, `most` steps; the damping goes by what a step keeps of its promise. Valleys here are
/// long and curved: R1 C1 is known, R1 alone hardly. A step that ends on a slope is therefore bent back by what the
/// gradient there is off from what the parabola foretold, the geodesic acceleration of Transtrum and Sethna
/// (arXiv:1207.4999) taken from gradients, before it is given up for a shorter one.
Fit descend(const Problem& problem, const Averaged& averaged, const std::vector<Chosen>& chosen,
            const std::vector<Coordinate>& c, Eigen::VectorXd x, int most) {
  Fit out;
  out.chosen = chosen;
  Evaluation now, trial;
  constexpr double impossible = std::numeric_limits<double>::infinity();
  const auto cost_at = [&](const Eigen::VectorXd& at, Evaluation& e) {
    return evaluate_any(problem, averaged, chosen, at, e) ? e.misfit + prior_cost(c, at) : impossible;
  };
  Eigen::VectorXd sd(x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) sd[i] = c[static_cast<std::size_t>(i)].sd;
  x = stepped(c, x, Eigen::VectorXd::Zero(x.size()));
  double cost = cost_at(x, now), damping = 1e-3;
  if (cost == impossible) return out;
  Parabola here(c, x, now);
  for (int in_vain = 0;;) {
    // In log-likelihood, so little that it changes no decision; of a model that misses by more than noise as much more.
    const double enough = 0.005 * std::max(1.0, 2 * now.misfit / std::max(1, now.readings));
    const Eigen::VectorXd newton = here.step_against(here.gradient, 0);
    out.promise = -0.5 * here.gradient.dot(newton);  // Newton decrement: what a full step still promises
    out.settled = out.promise < enough;
    if (out.settled || in_vain == 2 || out.iterations == most) break;
    ++out.iterations;
    const double before = cost;
    bool better = false;
    for (int attempt = 0; attempt < 9 && !better; ++attempt) {
      Eigen::VectorXd next = stepped(c, x, damping < 1e-5 ? newton : here.step_against(here.gradient, damping));
      const Eigen::VectorXd moved = next - x;
      double next_cost = cost_at(next, trial);
      const bool overshot = next_cost >= cost;
      if (overshot && next_cost < impossible) {
        const Parabola there(c, next, trial);
        const Eigen::VectorXd foretold = here.gradient + here.curvature * moved;
        const Eigen::VectorXd bent = stepped(c, next, there.step_against(there.gradient - foretold, damping));
        // Where the bend is longer than the step, what it leaves out is larger still.
        if ((bent - next).cwiseQuotient(sd).norm() < moved.cwiseQuotient(sd).norm()) {
          next = bent;
          next_cost = cost_at(next, trial);
        }
      }
      better = next_cost < cost;
      if (!better) {
        damping = std::min(1e9, std::max(damping, 1e-4) * 8);
        continue;
      }
      const double promised = -here.gradient.dot(moved) - 0.5 * moved.dot(here.curvature * moved);
      const double kept = promised > 0 ? (cost - next_cost) / promised : 0;
      if (kept < 0.3)
        damping = std::max(damping, 1e-3) * 8;
      else if (kept > 0.75 && !overshot && attempt == 0)  // else the next would be as much too long
        damping *= 0.1;
      cost = next_cost;
      x = next;
      std::swap(now, trial);
    }
    here = Parabola(c, x, now);
    // Twice: at a kink, where the moment of a cooling_change falls into another bin. Once, a step may just be short.
    in_vain = before - cost < enough / 10 ? in_vain + 1 : 0;
  }
  out.narrowing = narrowing(here.curvature, c, here.held);
  for (std::size_t i = 0; i < problem.leeway.size(); ++i)
    out.uneven_per_A2 += now.leeway[averaged.column(i, 0)] * problem.leeway[i].uneven_per_A2;
  // From phases that share their heat at once to phases that share none (problem.cpp).
  out.uneven_per_A2 = std::clamp(out.uneven_per_A2, -problem.uneven_per_A2, problem.uneven_per_A2);
  out.x = x;
  out.information = here.curvature;
  out.from_data = now.information;
  out.gradient = here.gradient;
  out.cost = cost;
  out.misfit = now.misfit;
  out.readings = now.readings;
  out.at_bound = here.held;
  return out;
}

/// Where a cause starts whose parameters stand from `at` on: near nothing, and farther from it where it is nonlinear
/// in them and has more than one valley.
std::vector<std::vector<double>> starts_of(const Cause& cause, const std::vector<Coordinate>& c, std::size_t at) {
  const double nothing = c[at].start;
  std::vector<std::vector<double>> out;
  switch (cause.edit) {
    case Edit::cooling_step:  // ln of the factor, and when as a share of the log
      for (const double when : {0.15, 0.33, 0.5, 0.67, 0.85}) out.push_back({0.1, when});
      return out;
    case Edit::sensor_lag:  // s
      return {{3}, {30}, {75}};
    case Edit::winding_lag:  // s
      return {{0.5}, {5}, {15}};
    case Edit::delay:  // s
      return {{2}, {20}, {-10}};
    case Edit::sensor_share:
      return {{0.05}, {0.6}};
    case Edit::mass:
    case Edit::hot_spot:  // ln of capacity and resistance: the time constant goes by half of what the capacity goes
      for (const double shift : {0.0, -2.0, 2.0}) out.push_back({nothing + shift, c[at + 1].start - shift / 2});
      return out;
    default:
      return {{nothing + 0.1 * c[at].sd}};
  }
}

/// By how much the readings lie nearest to what this motor would show at once: with a fast winding every burst is a
/// valley of its own, and a descent ends in the next.
double likeliest_delay_s(const Problem& problem, const Fit& prompt, double low_s, double high_s) {
  constexpr double apart_s = 1;
  std::vector<Replayed> simulated;
  for (std::size_t l = 0; l < problem.logs.size(); ++l) simulated.push_back(replayed(problem, prompt, l));
  double least = 1e300, out_s = 0;
  for (double delay_s = low_s; delay_s <= high_s; delay_s += apart_s) {
    double sum = 0;
    for (std::size_t l = 0; l < problem.logs.size(); ++l) {
      const Bins& log = problem.logs[l];
      const auto last = static_cast<std::ptrdiff_t>(log.bins.size()) - 1, later = std::lround(delay_s / log.width_s);
      for (std::ptrdiff_t k = 0; k <= last; ++k) {
        const Bin& bin = log.bins[static_cast<std::size_t>(k)];
        const auto then = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k - later, 0, last));
        if (bin.housing_n > 0) sum += std::pow(bin.housing_degC - simulated[l].housing_degC[then], 2);
        if (bin.core_n > 0) sum += std::pow(bin.core_degC - simulated[l].core_degC[then], 2);
      }
    }
    if (sum < least) least = sum, out_s = delay_s;
  }
  return out_s;
}

/// Where a log's own coordinates stand.
Eigen::Index initial_of(const Problem& problem, const Fit& f, std::size_t log) {
  Eigen::Index at = f.x.size();
  for (std::size_t l = problem.logs.size(); l-- > log;) at -= own_count(problem.logs[l]);
  return at;
}

/// And what is said there of what was before it; nothing where it does not begin warm.
Eigen::Index before_of(const Problem& problem, const Fit& f, std::size_t log) {
  const Bins& bins = problem.logs[log];
  return initial_of(problem, f, log) + own_count(bins) - (bins.begins_warm ? before_count : 0);
}

std::vector<Initial<double>> initial_states(const Problem& problem, const Fit& f, std::size_t log) {
  const auto model = model_of(problem, f, log);
  std::vector<Initial<double>> out;
  Eigen::Index at = initial_of(problem, f, log);
  for (const Start& start : problem.logs[log].starts) {
    out.push_back(begin_at(model, problem.logs[log], start, f.x[at], f.x[at + 1]));
    at += per_start_count;
  }
  return out;
}

/// Into x: base and initial coordinates of the first of `warm`, each cause's of the first of them that has it. Says
/// whether one has the last cause, or there is none.
bool take(std::initializer_list<const Fit*> warm, const Problem& problem, const std::vector<Chosen>& chosen,
          Eigen::VectorXd& x) {
  if (warm.size() > 0) {
    const Fit& from = **warm.begin();
    Eigen::Index initial = 0;
    for (const Bins& log : problem.logs) initial += own_count(log);
    x.head(base_count) = from.x.head(base_count);
    x.tail(initial) = from.x.tail(initial);
  }
  bool last_is_known = true;
  Eigen::Index at = base_count;
  for (const Chosen& cause : chosen) {
    const Eigen::Index parameters = coordinates_of({cause});
    last_is_known = false;
    for (const Fit* from : warm) {
      Eigen::Index there = base_count;
      for (const Chosen& other : from->chosen) {
        if (!last_is_known && other == cause) {
          x.segment(at, parameters) = from->x.segment(there, parameters);
          last_is_known = true;
        }
        there += coordinates_of({other});
      }
    }
    at += parameters;
  }
  return last_is_known;
}

/// Two resistors that started at x and ended as `best`: the lowest of that and of two valleys known to lie beside it.
template <class Descent>
Fit out_of_poor_valleys(Fit best, Eigen::VectorXd x, int most, const Descent& descend_from) {
  const auto start_at = [&](const Eigen::VectorXd& other) {
    Fit f = descend_from(other, most);
    if (f.cost < best.cost) best = std::move(f);
  };
  // Where the winding is fast and read now and then, too small a capacity has a valley of its own.
  x[2] += std::log(4.0);
  start_at(x);
  // With the two masses exchanged the housing looks nearly the same.
  x = best.x;
  std::swap(x[2], x[3]);
  start_at(x);
  return best;
}

/// With the last cause started in each of its valleys, all else from x: a few steps tell which is worth descending
/// into.
template <class Descent>
Fit lowest_valley(const Problem& problem, const std::vector<Chosen>& chosen, const std::vector<Coordinate>& c,
                  Eigen::VectorXd x, int most, const Descent& descend_from) {
  constexpr int look = 4;
  const Cause& cause = cause_of(chosen.back());
  const Eigen::Index parameters = coordinates_of({chosen.back()}),
                     at = base_count + coordinates_of(chosen) - parameters;
  auto starts = starts_of(cause, c, static_cast<std::size_t>(at));
  if (cause.edit == Edit::delay) {
    Fit prompt;
    prompt.chosen.assign(chosen.begin(), chosen.end() - 1);
    prompt.x.resize(x.size() - 1);
    prompt.x << x.head(at), x.tail(x.size() - at - 1);
    const Coordinate& delay = c[static_cast<std::size_t>(at)];
    starts.push_back({likeliest_delay_s(problem, prompt, delay.low, delay.high)});
  }
  Fit best;
  for (const auto& start : starts) {
    for (std::size_t p = 0; p < start.size(); ++p) x[at + static_cast<Eigen::Index>(p)] = start[p];
    Fit f = descend_from(x, starts.size() > 1 ? std::min(look, most) : most);
    if (f.valid() && (!best.valid() || f.cost - f.promise < best.cost - best.promise)) best = std::move(f);
  }
  if (best.settled || !best.valid() || starts.size() == 1) return best;
  return descend_from(best.x, most);
}

double root_mean(double a, double na, double b, double nb) { return std::sqrt((a * a * na + b * b * nb) / (na + nb)); }

Error joined(const Error& a, const Error& b) {
  if (a.readings == 0) return b;
  if (b.readings == 0) return a;
  return {root_mean(a.rms_K, a.readings, b.rms_K, b.readings), std::max(a.worst_K, b.worst_K), a.readings + b.readings};
}

}  // namespace

int Fit::cause_coordinates() const { return coordinates_of(chosen); }

double Fit::surprise() const { return 2 * cost + narrowing; }

double Fit::ratio() const { return std::sqrt(2 * misfit / std::max(1, readings)); }

Eigen::MatrixXd Fit::covariance(bool bounds_hold) const {
  Eigen::MatrixXd A = information;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    if (bounds_hold && at_bound[static_cast<std::size_t>(i)]) decouple(A, i, 1e30);
  }
  return A.ldlt().solve(Eigen::MatrixXd::Identity(A.rows(), A.cols()));
}

Fit fit(const Problem& problem, const std::vector<Chosen>& chosen, std::initializer_list<const Fit*> warm, int most) {
  const auto c = layout(problem, chosen);
  const Averaged averaged(problem);
  Eigen::VectorXd x(static_cast<Eigen::Index>(c.size()));
  for (Eigen::Index i = 0; i < x.size(); ++i) x[i] = c[static_cast<std::size_t>(i)].start;
  const bool last_is_known = take(warm, problem, chosen, x);
  const auto descend_from = [&](const Eigen::VectorXd& from, int steps) {
    return descend(problem, averaged, chosen, c, from, steps);
  };
  if (last_is_known) {
    Fit best = descend_from(x, most);
    return warm.size() > 0 || !best.valid() ? best : out_of_poor_valleys(std::move(best), x, most, descend_from);
  }
  Fit best = lowest_valley(problem, chosen, c, x, most, descend_from);
  if (warm.size() > 0 || problem.belief.known) return best;
  // What two resistors alone are fitted best by may have no winding to speak of.
  x.head(base_count) << x[1] + std::log(R1_of_R2.middle), x[1], x[3] + std::log(C1_of_C2.middle), x[3];
  Fit usual = lowest_valley(problem, chosen, c, x, most, descend_from);
  return usual.cost < best.cost ? usual : best;
}

Fit as_wide_as_its_ridge(const Problem& problem, Fit f) {
  constexpr double far = std::numbers::ln2, least = 0.1;  // of a cost: less is no difference
  const auto c = layout(problem, f.chosen);
  const Averaged averaged(problem);
  const Fit here = descend(problem, averaged, f.chosen, c, f.x, 20);
  if (!here.valid()) return f;
  const auto noise2_of = [](const Fit& of) { return std::max(1.0, of.ratio() * of.ratio()); };
  const double noise2 = noise2_of(here), given = f.covariance()(0, 0) * noise2_of(f);
  const Fit as_given = f;
  f.information = here.information;
  f.from_data = here.from_data;
  double variance = f.covariance()(0, 0) * noise2;
  Eigen::VectorXd along;
  for (const double step : {-far, far}) {
    auto held = c;
    held[0].low = held[0].high = here.x[0] + step;
    Eigen::VectorXd x = here.x;
    x[0] += step;
    x[2] -= step;  // R1 C1 is known
    const Fit there = descend(problem, averaged, f.chosen, held, x, 40);
    if (!there.valid()) continue;
    const double dearer = std::max(there.cost - here.cost, least) / noise2;
    if (far * far / (2 * dearer) > variance) variance = far * far / (2 * dearer), along = (there.x - here.x) / step;
  }
  if (variance < given) return as_given;  // there is another valley near it, and a narrower one
  if (along.size() == 0) return f;
  const double more = variance / noise2 - f.covariance()(0, 0);
  for (Eigen::MatrixXd* known : {&f.information, &f.from_data}) {  // Sherman and Morrison: the inverse of a sum
    const Eigen::VectorXd of_it = *known * along;
    *known -= more / (1 + more * along.dot(of_it)) * of_it * of_it.transpose();
  }
  return f;
}

int coordinate_of(const Fit& fit, Edit edit) {
  int at = base_count;
  for (const Chosen& chosen : fit.chosen) {
    if (cause_of(chosen).edit == edit) return at;
    at += coordinates_of({chosen});
  }
  return -1;
}

Fit with_cause(Fit motor, const char* id, std::initializer_list<double> coordinates) {
  const Eigen::VectorXd x = motor.x;
  const Eigen::Index shared = base_count + motor.cause_coordinates(), initial = x.size() - shared;
  motor.chosen.push_back({cause_named(id), -1});
  motor.x.resize(x.size() + static_cast<Eigen::Index>(coordinates.size()));
  motor.x.head(shared) = x.head(shared);
  std::copy(coordinates.begin(), coordinates.end(), motor.x.begin() + shared);
  motor.x.tail(initial) = x.tail(initial);
  return motor;
}

Fit bare(const Problem& problem, const Fit& f) {
  Fit out = f;
  out.chosen.clear();
  out.x.resize(f.x.size() - f.cause_coordinates());
  out.x << f.x.head(base_count), f.x.tail(out.x.size() - base_count);
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    if (problem.logs[l].begins_warm) out.x.segment(before_of(problem, out, l), before_count).setZero();
  }
  return out;
}

double cost_of_noise(const Problem& problem) {
  double sum = 0.5 * Averaged(problem).log_determinant;
  for (const Bins& log : problem.logs) {
    Whitener housing = Whitener::housing(problem.noise, log.width_s), core = Whitener::core(problem.noise, log.width_s);
    const auto add = [&](Whitener& channel, double readings) {
      if (readings > 0) {
        channel.reading(readings);
        sum -= std::log(channel.weight);
      }
      channel.step();
    };
    for (const Bin& bin : log.bins) {
      add(housing, static_cast<double>(bin.housing_n));
      add(core, static_cast<double>(bin.core_n));
    }
  }
  return sum;
}

Fit transferred(const Problem& other, const Fit& from) {
  auto c = layout(other, from.chosen);
  Eigen::VectorXd x(static_cast<Eigen::Index>(c.size()));
  const Eigen::Index shared = base_count + from.cause_coordinates();
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    Coordinate& ci = c[static_cast<std::size_t>(i)];
    if (i < shared) ci.start = from.x[i];
    // Initial temperatures come from the first readings and nothing later: fitted to a whole log that the model cannot
    // follow, they would bend it.
    ci.prior = ci.low = ci.high = ci.start;
    x[i] = ci.start;
  }
  Fit out = descend(other, Averaged(other), from.chosen, c, x, 30);
  out.uneven_per_A2 = from.uneven_per_A2;
  return out;
}

Fit carried_on(const Problem& whole, const Problem& fitted, const Fit& f) {
  const auto c = layout(whole, f.chosen);
  Fit out = f;
  out.x.resize(static_cast<Eigen::Index>(c.size()));
  for (Eigen::Index i = 0; i < out.x.size(); ++i) out.x[i] = c[static_cast<std::size_t>(i)].start;
  const Eigen::Index shared = base_count + f.cause_coordinates();
  out.x.head(shared) = f.x.head(shared);
  for (std::size_t l = 0; l < whole.logs.size(); ++l) {
    const auto& starts = fitted.logs[l].starts;
    for (std::size_t s = 0; s < starts.size(); ++s) {
      if (s > 0 && std::isnan(starts[s].housing_degC) && std::isnan(starts[s].core_degC)) continue;
      const auto at = per_start_count * static_cast<Eigen::Index>(s);
      out.x.segment(initial_of(whole, out, l) + at, per_start_count) =
          f.x.segment(initial_of(fitted, f, l) + at, per_start_count);
    }
    if (whole.logs[l].begins_warm && fitted.logs[l].begins_warm)
      out.x.segment(before_of(whole, out, l), before_count) = f.x.segment(before_of(fitted, f, l), before_count);
  }
  return out;
}

Physical physical(const Eigen::VectorXd& x) { return {std::exp(x[0]), std::exp(x[1]), std::exp(x[2]), std::exp(x[3])}; }

double parameter_value(const Problem& problem, const Cause& cause, int p, double coordinate) {
  const Parameter& parameter = cause.parameters[static_cast<std::size_t>(p)];
  return (parameter.logarithmic ? std::exp(coordinate) : coordinate) * problem.scale(parameter.scale, cause.drive);
}

Model<double> model_of(const Problem& problem, const Fit& f, std::size_t log) {
  const double* before = problem.logs[log].begins_warm ? &f.x[before_of(problem, f, log)] : nullptr;
  auto model = build<double>(problem, f.chosen, f.x.data(), before, log);
  model.uneven_per_A2 = f.uneven_per_A2;
  return model;
}

Replayed replayed(const Problem& problem, const Fit& f, std::size_t l) {
  const Bins& log = problem.logs[l];
  const auto model = model_of(problem, f, l);
  Replayed out;
  Whitener white =
      log.has_housing ? Whitener::housing(problem.noise, log.width_s) : Whitener::core(problem.noise, log.width_s);
  Foretold<double> foretold{0, 0};
  replay<4>(model, log, initial_states(problem, f, l), [&](std::size_t k, double y2, const auto& winding) {
    const Bin& bin = log.bins[k];
    const double y1 = winding();
    out.housing_degC.push_back(y2);
    out.core_degC.push_back(y1);
    out.housing_residual_K.push_back(bin.housing_degC - y2);
    out.core_residual_K.push_back(bin.core_degC - y1);
    double w = missing;
    if (const double n = static_cast<double>(log.has_housing ? bin.housing_n : bin.core_n); n > 0) {
      white.reading(n);
      w = log.has_housing ? bin.housing_degC - y2 : bin.core_degC - y1;
      foretold.whiten(white, w);
    }
    out.whitened.push_back(w);
    white.step();
    foretold.step(white);
  });
  return out;
}

double hottest_degC(const Problem& problem, const Fit& f, std::size_t l) {
  const Bins& log = problem.logs[l];
  auto part = model_of(problem, f, l);
  const int hot = part.hot_node;
  const auto initial = initial_states(problem, f, l);
  double hottest = -1e300;
  part.hot_node = -1;  // a reading is then of one node, not of both
  for (const int node : {part.core, hot}) {
    if (node < 0) continue;
    part.core = node;
    replay<4>(part, log, initial,
              [&](std::size_t, double, const auto& winding) { hottest = std::max(hottest, winding()); });
  }
  return hottest;
}

Error error_of(const std::vector<double>& residual_K) {
  double sum = 0, worst = 0;
  int n = 0;
  for (const double r : residual_K) {
    if (std::isnan(r)) continue;
    sum += r * r;
    worst = std::max(worst, std::abs(r));
    ++n;
  }
  return n > 0 ? Error{std::sqrt(sum / n), worst, n} : Error{missing, missing, 0};
}

double Rmse::judged_K() const { return std::isnan(core_K) ? housing_K : core_K; }

Rmse rmse_of(const Problem& problem, const Fit& f, std::vector<Rmse>* each) {
  Error housing{missing, missing, 0}, core{missing, missing, 0};
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    const Replayed r = replayed(problem, f, l);
    const Error h = error_of(r.housing_residual_K), c = error_of(r.core_residual_K);
    if (each != nullptr) each->push_back({h.rms_K, c.rms_K, h.worst_K, c.worst_K});
    housing = joined(housing, h);
    core = joined(core, c);
  }
  return {housing.rms_K, core.rms_K, housing.worst_K, core.worst_K};
}

double misfit_at(const Problem& problem, const std::vector<Chosen>& chosen, const Eigen::VectorXd& x,
                 Eigen::VectorXd* gradient) {
  Evaluation e;
  if (!evaluate_any(problem, Averaged(problem), chosen, x, e)) return 1e300;
  if (gradient != nullptr) *gradient = e.gradient;
  return e.misfit;
}

}  // namespace identify

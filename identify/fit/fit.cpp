// SPDX-License-Identifier: MIT
#include "identify/fit/fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "identify/fit/misfit.hpp"
#include "identify/fit/replayed.hpp"

namespace identify {
namespace {

// How large a cause is follows Student's t around nothing, the rest Gaussians: fifteen times what is typical is rare,
// and no reason to believe in two imitations of a typical size. Degrees of freedom: Lange, Little, Taylor, JASA 84
// (1989) 881.
constexpr double tail_dof = 4;

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

/// The same of where a late sensor stands after each pause: read, instead of fitted, and to be paid for alike, or each
/// pause would be a free bend of the course.
double narrowing_by_reading(const Problem& problem, const Fit& f, const std::vector<Coordinate>& c) {
  const int lag = coordinate_of(f, Edit::sensor_lag);
  if (lag < 0) return 0;
  const double lag_s = f.x[lag] + least_lag_s,
               read_sd_K =
                   std::hypot(problem.noise.housing_white_K / std::sqrt(first_readings), problem.noise.housing_slow_K);
  double out = 0;
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    const std::vector<Start>& starts = problem.logs[l].starts;
    for (std::size_t s = 1; s < starts.size(); ++s) {
      const auto housing = static_cast<std::size_t>(own_at(problem, f.x, l)) + s * per_start_count;
      if (!std::isnan(starts[s].housing_degC))
        out += 2 * still_late(lag_s) * std::log(std::max(1.0, c[housing].sd / read_sd_K));
    }
  }
  return out;
}

/// The misfit with its priors near x, as a parabola; `held` are the coordinates that a bound holds there.
struct Parabola {
  Eigen::VectorXd gradient;
  Eigen::MatrixXd curvature;
  std::vector<bool> held;

  Parabola(const std::vector<Coordinate>& c, const Eigen::VectorXd& x, const Misfit& at)
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
  Misfit now, trial;
  constexpr double impossible = std::numeric_limits<double>::infinity();
  const auto cost_at = [&](const Eigen::VectorXd& at, Misfit& e) {
    return evaluate(problem, averaged, chosen, at, e) ? e.sum + prior_cost(c, at) : impossible;
  };
  Eigen::VectorXd sd(x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) sd[i] = c[static_cast<std::size_t>(i)].sd;
  x = stepped(c, x, Eigen::VectorXd::Zero(x.size()));
  double cost = cost_at(x, now), damping = 1e-3;
  if (cost == impossible) return out;
  Parabola here(c, x, now);
  for (int in_vain = 0;;) {
    // In log-likelihood, so little that it changes no decision; of a model that misses by more than noise as much more.
    const double enough = 0.005 * std::max(1.0, 2 * now.sum / std::max(1, now.readings));
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
  out.narrowing += narrowing_by_reading(problem, out, c);
  out.information = here.curvature;
  out.from_data = now.information;
  out.gradient = here.gradient;
  out.cost = cost;
  out.misfit = now.sum;
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
    if (problem.logs[l].begins_warm) out.x.segment(before_at(problem, out.x, l), before_count).setZero();
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
      out.x.segment(own_at(whole, out.x, l) + at, per_start_count) =
          f.x.segment(own_at(fitted, f.x, l) + at, per_start_count);
    }
    if (whole.logs[l].begins_warm && fitted.logs[l].begins_warm)
      out.x.segment(before_at(whole, out.x, l), before_count) = f.x.segment(before_at(fitted, f.x, l), before_count);
  }
  return out;
}

}  // namespace identify

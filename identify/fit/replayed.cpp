// SPDX-License-Identifier: MIT
#include "identify/fit/replayed.hpp"

#include <algorithm>
#include <cmath>

#include "identify/fit/model_at.hpp"
#include "identify/fit/whitening.hpp"

namespace identify {
namespace {

std::vector<Initial<double>> initial_states(const Problem& problem, const Fit& f, std::size_t log) {
  const auto model = model_of(problem, f, log);
  std::vector<Initial<double>> out;
  Eigen::Index at = own_at(problem, f.x, log);
  for (const Start& start : problem.logs[log].starts) {
    out.push_back(begin_at(model, problem.logs[log], start, f.x[at], f.x[at + 1]));
    at += per_start_count;
  }
  return out;
}

double root_mean(double a, double na, double b, double nb) { return std::sqrt((a * a * na + b * b * nb) / (na + nb)); }

Error joined(const Error& a, const Error& b) {
  if (a.readings == 0) return b;
  if (b.readings == 0) return a;
  return {root_mean(a.rms_K, a.readings, b.rms_K, b.readings), std::max(a.worst_K, b.worst_K), a.readings + b.readings};
}

}  // namespace

Model<double> model_of(const Problem& problem, const Fit& f, std::size_t log) {
  const double* before = problem.logs[log].begins_warm ? &f.x[before_at(problem, f.x, log)] : nullptr;
  auto model = model_at<double>(problem, f.chosen, f.x.data(), before, log);
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

Fit closest(const Problem& problem, const Fit& motor) {
  int housing = 0, core = 0;  // readings
  for (const Bins& log : problem.logs) {
    for (const Bin& bin : log.bins) housing += bin.housing_n > 0, core += bin.core_n > 0;
  }
  Problem plain = problem;
  plain.leeway.clear();
  constexpr double each_K = 1;  // a minute of readings outweighs what is believed of a motor
  plain.noise = {.housing_white_K = each_K, .housing_slow_K = 0, .core_white_K = each_K};
  if (core > 0 && housing > 0) plain.noise.core_white_K *= std::sqrt(static_cast<double>(core) / housing);
  const Fit found = fit(plain, motor.chosen, {&motor});
  if (!found.valid() || !(rmse_of(problem, found).judged_K() < rmse_of(problem, motor).judged_K())) return motor;
  Fit out = fit(problem, motor.chosen, {&found}, 0);  // there, as unsure as the noise leaves it
  out.uneven_per_A2 = found.uneven_per_A2;
  out.settled = found.settled;
  out.iterations = found.iterations;
  return out;
}

}  // namespace identify

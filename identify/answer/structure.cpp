// SPDX-License-Identifier: MIT
#include "identify/answer/structure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "identify/fit/replayed.hpp"

namespace identify {
namespace {

using thermal::Boundary, thermal::Drive;

struct Signal {
  const char* name;
  double (*of)(const Bin&);
};

bool both_ways(const Problem& problem) {
  bool plus = false, minus = false;
  for (const Bins& log : problem.logs) {
    for (const Bin& bin : log.bins) plus = plus || bin.signed_A > 0, minus = minus || bin.signed_A < 0;
  }
  return plus && minus;
}

/// A signal whose standard deviation is less than half a percent of it tells nothing apart.
constexpr double least_variance = 0.005 * 0.005;

std::vector<Signal> signals(const Problem& problem) {
  std::vector<Signal> s;
  if (problem.heated_by_power())
    s.push_back({"power", [](const Bin& b) { return b.input[Drive::power_W]; }});
  else {
    s.push_back({"current squared", [](const Bin& b) { return b.input[Drive::current_A2]; }});
    s.push_back({"size of the current", [](const Bin& b) { return b.input[Drive::current_A]; }});
    if (both_ways(problem)) s.push_back({"sign of the current", [](const Bin& b) { return b.signed_A; }});
  }
  if (problem.speed08_mean > 0) {
    s.push_back({"speed", [](const Bin& b) { return b.input[Drive::speed_rad_per_s]; }});
    s.push_back({"speed squared", [](const Bin& b) { return b.input[Drive::speed2_rad2_per_s2]; }});
  }
  s.push_back({"sink temperature", [](const Bin& b) { return b.input[Boundary::ambient]; }});
  if (problem.logs.front().has_neighbour)
    s.push_back({"neighbour's temperature", [](const Bin& b) { return b.input[Boundary::neighbour]; }});
  if (problem.logs.front().has_frame)
    s.push_back({"frame temperature", [](const Bin& b) { return b.input[Boundary::frame]; }});
  return s;
}

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  double n = 0, sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (std::isnan(a[i]) || std::isnan(b[i])) continue;
    n += 1, sa += a[i], sb += b[i], aa += a[i] * a[i], bb += b[i] * b[i], ab += a[i] * b[i];
  }
  if (n < 10) return 0;
  const double va = aa - sa * sa / n, vb = bb - sb * sb / n;
  return va > least_variance * aa && vb > least_variance * bb ? (ab - sa * sb / n) / std::sqrt(va * vb) : 0;
}

std::vector<double> smoothed(const std::vector<double>& v, double share) {
  std::vector<double> out(v.size());
  double state = v.empty() ? 0 : v.front();
  for (std::size_t i = 0; i < v.size(); ++i) out[i] = state += share * (v[i] - state);
  return out;
}

/// Upper tail of a chi-squared variable, by Wilson and Hilferty's cube root.
double chi2_tail(double x, double k) {
  const double z = (std::cbrt(x / k) - (1 - 2 / (9 * k))) / std::sqrt(2 / (9 * k));
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

double kolmogorov_tail(double x) {
  double p = 0;
  for (int j = 1; j <= 20; ++j) p += (j % 2 == 1 ? 2 : -2) * std::exp(-2.0 * j * j * x * x);
  return std::clamp(p, 0.0, 1.0);
}

/// Chance of such autocorrelations in white noise, by Ljung and Box. Of values whose mean is 0.
double ljung_box_p(const std::vector<double>& v) {
  const auto n = v.size();
  double zero = 0, q = 0;
  for (const double w : v) zero += w * w;
  const std::size_t lags = std::min<std::size_t>(40, n / 5);
  for (std::size_t j = 1; j <= lags; ++j) {
    double r = 0;
    for (std::size_t i = j; i < n; ++i) r += v[i] * v[i - j];
    r /= zero;
    q += r * r / static_cast<double>(n - j);
  }
  return chi2_tail(q * static_cast<double>(n) * static_cast<double>(n + 2), static_cast<double>(lags));
}

/// The same of the cumulated periodogram. Model errors are slow, so neighbouring values are averaged to 1024 at most.
double periodogram_p(const std::vector<double>& v) {
  const std::size_t group = (v.size() + 1023) / 1024, m = v.size() / group, half = (m - 1) / 2;
  std::vector<double> g(m, 0.0), power;
  for (std::size_t i = 0; i < m * group; ++i) g[i / group] += v[i];
  double total = 0;
  for (std::size_t f = 1; f <= half; ++f) {
    const double w = 2 * std::numbers::pi * static_cast<double>(f) / static_cast<double>(m), turn = 2 * std::cos(w);
    double s1 = 0, s2 = 0;
    for (const double x : g) {
      const double s = x + turn * s1 - s2;
      s2 = s1;
      s1 = s;
    }
    power.push_back(s1 * s1 + s2 * s2 - turn * s1 * s2);
    total += power.back();
  }
  double sum = 0, most = 0;
  for (std::size_t f = 0; f < half; ++f) {
    sum += power[f];
    most = std::max(most, std::abs(sum / total - static_cast<double>(f + 1) / static_cast<double>(half)));
  }
  return kolmogorov_tail(most * std::sqrt(static_cast<double>(half)));
}

/// What is unusual from bin `from` to `to`: the signal whose mean lies furthest from its mean in the rest of the log.
std::string unusual_in(const Bins& log, std::size_t from, std::size_t to, const std::vector<Signal>& all) {
  const auto n = log.bins.size();
  const auto bins = static_cast<double>(n), inside = static_cast<double>(to - from), outside = bins - inside;
  std::string out;
  double most = 0.3;  // standard deviations; less is no more than any stretch shows
  for (const Signal& s : all) {
    double sum_inside = 0, sum_outside = 0, square = 0;
    for (std::size_t k = 0; k < n; ++k) {
      const double v = s.of(log.bins[k]);
      (k >= from && k < to ? sum_inside : sum_outside) += v;
      square += v * v;
    }
    const double variance = square / bins - std::pow((sum_inside + sum_outside) / bins, 2);
    if (outside < 1 || inside < 1 || !(variance > least_variance * square / bins)) continue;
    const double z = (sum_inside / inside - sum_outside / outside) / std::sqrt(variance);
    if (std::abs(z) > most) most = std::abs(z), out = std::string(z > 0 ? "high " : "low ") + s.name;
  }
  if (!out.empty()) return out;
  return from < n / 10 ? "the start" : to > n * 9 / 10 ? "the end" : "none of the signals";
}

/// Appends the stretches of log `l` where the residual's running mean stays on one side, beyond `slow_K` and what white
/// noise of `white_K` a reading leaves in it.
void find_wrong(const Problem& problem, std::size_t l, const char* channel, const std::vector<double>& residual,
                double slow_K, double white_K, const std::vector<Signal>& all, std::vector<Wrong>& out) {
  const Bins& log = problem.logs[l];
  const std::size_t n = residual.size();
  std::vector<double> sum(n + 1, 0), count(n + 1, 0);
  for (std::size_t i = 0; i < n; ++i) {
    sum[i + 1] = sum[i] + (std::isnan(residual[i]) ? 0 : residual[i]);
    count[i + 1] = count[i] + (std::isnan(residual[i]) ? 0 : 1);
  }
  // Running means over 1/60 of the log but at least half a minute and some readings: finer detail is noise to the eye.
  constexpr double least_readings = 9;
  const double width = std::max(std::max(30.0, log.duration_s() / 60) / log.width_s,
                                least_readings * static_cast<double>(n) / std::max(count[n], 1.0));
  const auto half = static_cast<std::size_t>(width / 2) + 1;
  const auto readings = [&](std::size_t from, std::size_t to) { return count[to] - count[from]; };
  const auto mean = [&](std::size_t from, std::size_t to) {
    return readings(from, to) > 0 ? (sum[to] - sum[from]) / readings(from, to) : 0;
  };
  int sign = 0;
  std::size_t start = 0;
  for (std::size_t i = 0; i <= n; ++i) {
    const std::size_t from = i > half ? i - half : 0, to = std::min(n, i + half);
    const double m = i < n ? mean(from, to) : 0;
    const double noise_K = std::hypot(slow_K, 3 * white_K / std::sqrt(std::max(1.0, readings(from, to))));
    const int now = m > noise_K ? 1 : m < -noise_K ? -1 : 0;
    if (now == sign) continue;
    if (sign * mean(start, i) > slow_K)
      out.push_back({l, channel, static_cast<double>(start) * log.width_s, static_cast<double>(i) * log.width_s,
                     mean(start, i), unusual_in(log, start, i, all)});
    sign = now;
    start = i;
  }
}

}  // namespace

Whiteness whiteness(const std::vector<double>& whitened) {
  std::vector<double> v;
  for (const double w : whitened) {
    if (!std::isnan(w)) v.push_back(w);
  }
  Whiteness out;
  if (v.size() < 20) return out;
  double square = 0, mean = 0;
  for (const double w : v) square += w * w, mean += w;
  out.ratio = std::sqrt(square / static_cast<double>(v.size()));
  mean /= static_cast<double>(v.size());
  for (double& w : v) w -= mean;
  out.ljung_box_p = ljung_box_p(v);
  out.white_p = periodogram_p(v);
  return out;
}

Structure structure(const Problem& problem, const Fit& f) {
  Structure out;
  const auto all = signals(problem);
  constexpr double smoothed_s[] = {0, 30, 300};
  std::vector<double> whitened, residual, rise;
  std::vector<std::array<std::vector<double>, std::size(smoothed_s)>> values(all.size());
  const auto append = [](std::vector<double>& to, const std::vector<double>& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    const Bins& log = problem.logs[l];
    const Replayed r = replayed(problem, f, l);
    append(whitened, r.whitened);
    append(residual, log.has_housing ? r.housing_residual_K : r.core_residual_K);
    for (std::size_t k = 0; k < log.bins.size(); ++k)
      rise.push_back(r.housing_degC[k] - log.bins[k].input.boundary_degC[0]);
    for (std::size_t s = 0; s < all.size(); ++s) {
      std::vector<double> v;
      for (const Bin& b : log.bins) v.push_back(all[s].of(b));
      for (std::size_t i = 0; i < std::size(smoothed_s); ++i)
        append(values[s][i], smoothed_s[i] > 0 ? smoothed(v, log.width_s / (smoothed_s[i] + log.width_s)) : v);
    }
    const double slow_K = std::max(0.1, 3 * problem.noise.housing_slow_K);
    if (log.has_housing)
      find_wrong(problem, l, "housing", r.housing_residual_K, slow_K, problem.noise.housing_white_K, all, out.wrong);
    if (log.has_core)
      find_wrong(problem, l, "winding", r.core_residual_K, 3 * slow_K, problem.noise.core_white_K, all, out.wrong);
  }
  out.residual = whiteness(whitened);
  for (std::size_t s = 0; s < all.size(); ++s) {
    Relation best{all[s].name, 0, 0};
    for (std::size_t i = 0; i < std::size(smoothed_s); ++i) {
      const double c = correlation(residual, values[s][i]);
      if (std::abs(c) > std::abs(best.correlation)) best = {all[s].name, c, smoothed_s[i]};
    }
    out.relations.push_back(best);
  }
  out.relations.push_back({"housing above sink", correlation(residual, rise), 0});
  std::sort(out.relations.begin(), out.relations.end(),
            [](const auto& a, const auto& b) { return std::abs(a.correlation) > std::abs(b.correlation); });
  std::sort(out.wrong.begin(), out.wrong.end(), [](const Wrong& a, const Wrong& b) {
    return std::abs(a.mean_K) * (a.to_s - a.from_s) > std::abs(b.mean_K) * (b.to_s - b.from_s);
  });
  constexpr std::size_t most_told = 8;  // a person reads no more
  if (out.wrong.size() > most_told) out.wrong.resize(most_told);
  return out;
}

std::vector<Loose> directions(const Fit& f) {
  const Eigen::Index rest = f.x.size() - base_count;
  Eigen::MatrixXd F = f.from_data.topLeftCorner(base_count, base_count);
  if (rest > 0) {
    Eigen::MatrixXd D = f.from_data.bottomRightCorner(rest, rest);
    D.diagonal().array() += 1e-9;
    F -= f.from_data.topRightCorner(base_count, rest) * D.ldlt().solve(f.from_data.bottomLeftCorner(rest, base_count));
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(F);
  std::vector<Loose> out;
  for (int i = 0; i < base_count; ++i) {
    Loose loose{};
    loose.sd = 1 / std::sqrt(std::max(1e-12, solver.eigenvalues()[i]));
    for (int j = 0; j < base_count; ++j) loose.share[j] = solver.eigenvectors()(j, i);
    out.push_back(loose);
  }
  return out;
}

double sd_from_data(const Fit& f, int coordinate) {
  double variance = 0;
  for (const Loose& direction : directions(f)) variance += std::pow(direction.sd * direction.share[coordinate], 2);
  return std::sqrt(variance);
}

}  // namespace identify

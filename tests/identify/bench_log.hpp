// SPDX-License-Identifier: MIT
// Makes logs for tests, apart from all that identify does: its own equations (explicit Runge-Kutta of fourth order at
// 20 ms), its own noise on raw samples, its own profile. Written as a file, which is all the program gets.
#pragma once

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <string>

namespace tests {

/// EC 16 surrogate: 3/2 of a phase's resistance, 1/K, K/W, J/K.
struct BenchMotor {
  double ohm = 1.5 * 0.5, copper = 0.00393, R1 = 1.08, R2 = 16.3, C1 = 1.13, C2 = 18.0;
};

struct BenchOptions {
  BenchMotor motor;
  double seconds = 900, rate_Hz = 10, ambient_degC = 24, start_degC = 24;
  double white_K = 0.2, slow_K = 0.05, step_K = 0.1;  // housing sensor
  double core_every_s = 0, core_white_K = 0.2;        // 0: no winding reading
  double power_gain = 0;                              // > 0: power is logged instead of current, true heat times this
  std::uint64_t seed = 1;
  std::function<double(double, std::mt19937_64&)> current_A;      // of time; empty: random holds
  std::function<double(double, double, double)> extra_housing_W;  // (time, current, housing)
};

/// Writes the log to `path` and returns it.
inline std::string write_bench_log(const std::string& name, const BenchOptions& o) {
  const std::string path = (std::filesystem::temp_directory_path() / name).string();
  std::mt19937_64 random(o.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  std::ofstream out(path);
  out << "time_s," << (o.power_gain > 0 ? "power_W" : "current_A") << ",speed_rad_per_s,housing_degC,ambient_degC";
  if (o.core_every_s > 0) out << ",core_degC";
  out << "\n";
  double T1 = o.start_degC, T2 = o.start_degC, slow = o.slow_K * normal(random), current = 0, until = 0;
  const double dt = 0.02;
  const int per_row = static_cast<int>(std::lround(1 / (o.rate_Hz * dt)));
  const double keep = std::exp(-1 / (o.rate_Hz * 20));
  const auto rows = static_cast<long>(o.seconds * o.rate_Hz);
  const BenchMotor& m = o.motor;
  long next_core = 0;
  for (long row = 0; row < rows; ++row) {
    const double t = static_cast<double>(row) / o.rate_Hz;
    if (o.current_A)
      current = o.current_A(t, random);
    else if (t >= until) {
      current = t < 30 || t > o.seconds * 0.85
                    ? 0
                    : (uniform(random) < 0.3 ? 0 : (uniform(random) < 0.5 ? -1 : 1) * 4 * uniform(random));
      until = t < 30 ? 30 : t + 5 + 55 * uniform(random);
    }
    slow = keep * slow + std::sqrt(1 - keep * keep) * o.slow_K * normal(random);
    double housing = T2 + slow + o.white_K * normal(random);
    if (o.step_K > 0) housing = o.step_K * std::round(housing / o.step_K);
    const double amplitude = current * 2 / std::sqrt(3.0);
    const double heat25 = m.ohm * amplitude * amplitude;
    out << t << ',' << (o.power_gain > 0 ? heat25 * (1 + m.copper * (T1 - 25)) * o.power_gain : current) << ",0,"
        << housing << ',' << o.ambient_degC;
    if (o.core_every_s > 0) {
      out << ',';
      if (row >= next_core) {
        out << T1 + o.core_white_K * normal(random);
        next_core = row + std::lround(o.core_every_s * o.rate_Hz);
      }
    }
    out << '\n';
    for (int i = 0; i < per_row; ++i) {
      const auto slope = [&](double a, double b, double& da, double& db) {
        da = (heat25 * (1 + m.copper * (a - 25)) - (a - b) / m.R1) / m.C1;
        db = ((a - b) / m.R1 - (b - o.ambient_degC) / m.R2 +
              (o.extra_housing_W ? o.extra_housing_W(t, current, b) : 0)) /
             m.C2;
      };
      double a1, b1, a2, b2, a3, b3, a4, b4;
      slope(T1, T2, a1, b1);
      slope(T1 + dt / 2 * a1, T2 + dt / 2 * b1, a2, b2);
      slope(T1 + dt / 2 * a2, T2 + dt / 2 * b2, a3, b3);
      slope(T1 + dt * a3, T2 + dt * b3, a4, b4);
      T1 += dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
      T2 += dt / 6 * (b1 + 2 * b2 + 2 * b3 + b4);
    }
  }
  return path;
}

}  // namespace tests

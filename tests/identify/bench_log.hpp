// SPDX-License-Identifier: MIT
// Makes logs for tests, apart from all that identify does: its own equations (explicit Runge-Kutta of fourth order at
// 20 ms), its own noise on raw samples, its own profile. The rotor stands, direct current flows in at one phase and out
// at another. Written as a file, which is all the program gets.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <string>

namespace tests {

/// EC 16 surrogate: 3/2 of a phase's resistance, 1/K, K/W, J/K; between each two phases this share of what lies between
/// the winding and the housing.
struct BenchMotor {
  double ohm = 1.5 * 0.5, copper = 0.00393, R1 = 1.08, R2 = 16.3, C1 = 1.13, C2 = 18.0, coupling = 0.1;
};

struct BenchOptions {
  BenchMotor motor;
  double seconds = 900, rate_Hz = 10, ambient_degC = 24, start_degC = 24;
  double room_K = 0, room_period_s = 1800;            // by how much and how fast the ambient swings
  double white_K = 0.2, slow_K = 0.05, step_K = 0.1;  // housing sensor
  bool cuts_off = false;                              // what is below its step, instead of rounding it
  double sensor_share = 0;                            // of the way from housing to winding, where that sensor sits
  double core_every_s = 0, core_white_K = 0.2;        // 0: no winding reading
  double core_lag_s = 0;                              // of the sensor in the winding
  double ohm_noise_share = 0;                         // > 0: the winding tells its resistance instead, so noisy
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
  if (o.core_every_s > 0) out << (o.ohm_noise_share > 0 ? ",winding_ohm" : ",core_degC");
  out << "\n";
  using State = std::array<double, 4>;  // three phases, housing
  State T;
  T.fill(o.start_degC);
  double felt = o.start_degC, slow = o.slow_K * normal(random), current = 0, until = 0;
  const double dt = 0.02;
  const int per_row = static_cast<int>(std::lround(1 / (o.rate_Hz * dt)));
  const double keep = std::exp(-1 / (o.rate_Hz * 20));
  const auto rows = static_cast<long>(o.seconds * o.rate_Hz);
  const BenchMotor& m = o.motor;
  long next_core = 0;
  for (long row = 0; row < rows; ++row) {
    const double t = static_cast<double>(row) / o.rate_Hz;
    const double room_degC = o.ambient_degC + o.room_K * std::sin(2 * 3.14159265 * t / o.room_period_s);
    if (o.current_A)
      current = o.current_A(t, random);
    else if (t >= until) {
      current = t < 30 || t > o.seconds * 0.85
                    ? 0
                    : (uniform(random) < 0.3 ? 0 : (uniform(random) < 0.5 ? -1 : 1) * 4 * uniform(random));
      until = t < 30 ? 30 : t + 5 + 55 * uniform(random);
    }
    slow = keep * slow + std::sqrt(1 - keep * keep) * o.slow_K * normal(random);
    const double core = (T[0] + T[1] + T[2]) / 3;
    felt += (core - felt) * (o.core_lag_s > 0 ? 1 - std::exp(-1 / (o.rate_Hz * o.core_lag_s)) : 1);
    double housing = T[3] + o.sensor_share * (core - T[3]) + slow + o.white_K * normal(random);
    if (o.step_K > 0)
      housing = o.step_K * (o.cuts_off ? std::floor(housing / o.step_K) : std::round(housing / o.step_K));
    const double amplitude = current * 2 / std::sqrt(3.0);
    const double heat25 = m.ohm * amplitude * amplitude;
    const auto phase_W = [&](const State& at, int k) {
      return k == 2 ? 0 : heat25 / 2 * (1 + m.copper * (at[k] - 25));
    };
    out << t << ',' << (o.power_gain > 0 ? (phase_W(T, 0) + phase_W(T, 1)) * o.power_gain : current) << ",0," << housing
        << ',' << room_degC;
    if (o.core_every_s > 0) {
      out << ',';
      if (row >= next_core) {
        if (o.ohm_noise_share > 0)  // copper, of two phases
          out << m.ohm / 0.75 * (1 + 0.00393 * (core - 20)) * (1 + o.ohm_noise_share * normal(random));
        else
          out << felt + o.core_white_K * normal(random);
        next_core = row + std::lround(o.core_every_s * o.rate_Hz);
      }
    }
    out << '\n';
    for (int i = 0; i < per_row; ++i) {
      const auto slope = [&](const State& at) {
        State d{};
        for (int k = 0; k < 3; ++k) {
          const double out_W = (at[k] - at[3]) / (3 * m.R1);
          const double across_W = m.coupling / m.R1 * (2 * at[k] - at[(k + 1) % 3] - at[(k + 2) % 3]);
          d[k] = (phase_W(at, k) - out_W - across_W) / (m.C1 / 3);
          d[3] += out_W;
        }
        d[3] += (room_degC - at[3]) / m.R2 + (o.extra_housing_W ? o.extra_housing_W(t, current, at[3]) : 0);
        d[3] /= m.C2;
        return d;
      };
      const auto ahead = [&](const State& d, double h) {
        State at = T;
        for (int k = 0; k < 4; ++k) at[k] += h * d[k];
        return at;
      };
      const State a = slope(T), b = slope(ahead(a, dt / 2)), c = slope(ahead(b, dt / 2)), d = slope(ahead(c, dt));
      for (int k = 0; k < 4; ++k) T[k] += dt / 6 * (a[k] + 2 * b[k] + 2 * c[k] + d[k]);
    }
  }
  return path;
}

}  // namespace tests

// SPDX-License-Identifier: MIT
#include "host-sim/plant/heat.hpp"

#include <Eigen/Dense>
#include <cmath>

namespace host_sim {
namespace {

constexpr int nodes = 8;  // a b c teeth yoke housing frame rotor
enum { phase_a, teeth = 3, yoke, housing, frame, rotor };
using Matrix = Eigen::Matrix<double, nodes, nodes>;
using Vector = Eigen::Matrix<double, nodes, 1>;

void tie(Matrix& conductance, int i, int j, double W_per_K) {
  conductance(i, i) += W_per_K;
  conductance(j, j) += W_per_K;
  conductance(i, j) -= W_per_K;
  conductance(j, i) -= W_per_K;
}

/// Linear part: C dT/dt = P - G T over ambient. A missing rotor becomes a light node of its own.
void matrices(const HeatDetail& d, Matrix& conductance, Vector& capacity) {
  conductance.setZero();
  for (int k = 0; k < 3; ++k) {
    tie(conductance, k, teeth, d.phase_to_teeth_W_per_K);
    tie(conductance, k, (k + 1) % 3, d.phase_coupling_W_per_K);
  }
  tie(conductance, teeth, yoke, d.teeth_to_yoke_W_per_K);
  tie(conductance, yoke, housing, d.yoke_to_housing_W_per_K);
  tie(conductance, housing, frame, d.housing_to_frame_W_per_K);
  conductance(housing, housing) += d.housing_to_ambient_W_per_K + d.housing_to_coolant_W_per_K;
  conductance(frame, frame) += d.frame_to_ambient_W_per_K;
  const bool has_rotor = d.rotor_J_per_K > 0;
  tie(conductance, rotor, housing, has_rotor ? d.rotor_to_housing_W_per_K : d.housing_to_ambient_W_per_K);
  capacity << d.phase_J_per_K, d.phase_J_per_K, d.phase_J_per_K, d.teeth_J_per_K, d.yoke_J_per_K, d.housing_J_per_K,
      d.frame_J_per_K, has_rotor ? d.rotor_J_per_K : 1e-6 * d.housing_J_per_K;
}

constexpr int samples = 120;
using Curve = Eigen::Matrix<double, 2 * samples, 1>;

/// Step responses to 1 W of two nodes (closed form), winding above, housing below, each as share of its final rise.
Curve two_node_curve(double R1, double R2, double C1, double C2, const double* time_s) {
  // Rates: roots of s^2 - b s + c.
  const double b = 1 / (R1 * C1) + 1 / (R1 * C2) + 1 / (R2 * C2), c = 1 / (R1 * C1 * R2 * C2);
  const double root = std::sqrt(b * b - 4 * c), fast = 0.5 * (b + root), slow = c / fast;
  Curve curve;
  for (int i = 0; i < samples; ++i) {
    const double t = time_s[i], ef = std::exp(-fast * t), es = std::exp(-slow * t);
    // Housing: 0 and flat at the start; winding: 0 with slope 1/C1.
    const double h = R2 * (1 - (fast * es - slow * ef) / (fast - slow));
    const double w_final = R1 + R2;
    const double af = (slow * w_final - 1 / C1) / (fast - slow), as = -w_final - af;
    curve(i) = (w_final + af * ef + as * es) / w_final;
    curve(samples + i) = h / R2;
  }
  return curve;
}

}  // namespace

TwoResistor reduced(const HeatDetail& detail) {
  Matrix conductance;
  Vector capacity;
  matrices(detail, conductance, capacity);
  const Vector third = (Vector() << 1 / 3., 1 / 3., 1 / 3., 0, 0, 0, 0, 0).finished();
  const Eigen::LDLT<Matrix> solver(conductance);
  const Vector rise = solver.solve(third);
  TwoResistor out{};
  out.R2_K_per_W = rise(housing);
  out.R1_K_per_W = third.dot(rise) - rise(housing);

  // Phases: 1 W taken from b and c, given to a, stays in the winding.
  const Vector uneven = solver.solve((Vector() << 2 / 3., -1 / 3., -1 / 3., 0, 0, 0, 0, 0).finished());
  out.phase_coupling_W_per_K = ((2 / 3.) / uneven(phase_a) - 1 / (3 * out.R1_K_per_W)) / 3;

  // Step responses by the modes of the symmetric system C^-1/2 G C^-1/2.
  const Vector scale = capacity.cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Matrix> modes(scale.asDiagonal() * conductance * scale.asDiagonal());
  const Vector drive = modes.eigenvectors().transpose() * (scale.asDiagonal() * third);
  const double C1_guess = 3 * detail.phase_J_per_K, C2_guess = capacity.tail(nodes - 3).sum();
  const double from_s = 0.01 * out.R1_K_per_W * C1_guess, to_s = 5 * out.R2_K_per_W * C2_guess;
  double time_s[samples];
  Curve measured;
  for (int i = 0; i < samples; ++i) {
    time_s[i] = from_s * std::pow(to_s / from_s, i / (samples - 1.0));
    const Vector rates = modes.eigenvalues();
    const Vector amount = (1 - (-rates * time_s[i]).array().exp()) / rates.array() * drive.array();
    const Vector temperature = scale.asDiagonal() * (modes.eigenvectors() * amount);
    measured(i) = third.dot(temperature) / third.dot(rise);
    measured(samples + i) = temperature(housing) / rise(housing);
  }

  // Gauss-Newton in ln C1, ln C2: smooth, two unknowns, a good start; five rounds reach rounding.
  double log1 = std::log(C1_guess), log2 = std::log(C2_guess);
  for (int round = 0; round < 8; ++round) {
    const auto curve = [&](double a, double b) {
      return two_node_curve(out.R1_K_per_W, out.R2_K_per_W, std::exp(a), std::exp(b), time_s);
    };
    const Curve residual = measured - curve(log1, log2);
    Eigen::Matrix<double, 2 * samples, 2> slope;
    constexpr double nudge = 1e-5;
    slope.col(0) = (curve(log1 + nudge, log2) - curve(log1 - nudge, log2)) / (2 * nudge);
    slope.col(1) = (curve(log1, log2 + nudge) - curve(log1, log2 - nudge)) / (2 * nudge);
    const Eigen::Vector2d change = (slope.transpose() * slope).ldlt().solve(slope.transpose() * residual);
    log1 += change(0);
    log2 += change(1);
  }
  out.C1_J_per_K = std::exp(log1);
  out.C2_J_per_K = std::exp(log2);
  return out;
}

HeatDetail heat_from_sheet(const wire::Motor& sheet, const HeatOptions& o) {
  HeatDetail d{};
  const double R1 = sheet.R1_K_per_W, R2 = sheet.R2_K_per_W;
  const double inner = o.teeth_yoke_share_of_R1 + o.yoke_housing_share_of_R1;
  d.phase_to_teeth_W_per_K = 1 / (3 * R1 * (1 - inner));
  d.teeth_to_yoke_W_per_K = 1 / (R1 * o.teeth_yoke_share_of_R1);
  d.yoke_to_housing_W_per_K = 1 / (R1 * o.yoke_housing_share_of_R1);
  // Share of the heat that leaves through the frame fixes both ways in parallel.
  d.housing_to_frame_W_per_K = 1 / (R2 * o.frame_contact_share_of_R2);
  d.frame_to_ambient_W_per_K = 1 / (R2 / o.frame_share_of_cooling - R2 * o.frame_contact_share_of_R2);
  d.housing_to_ambient_W_per_K = (1 - o.frame_share_of_cooling) / R2;
  if (o.coolant_R2_K_per_W > 0) d.housing_to_coolant_W_per_K = 1 / o.coolant_R2_K_per_W - 1 / R2;
  d.rotor_to_housing_W_per_K = o.rotor_share_of_C2 > 0 ? 1 / (R2 * o.rotor_resistance_share_of_R2) : 0;
  d.phase_resistance_ohm = sheet.phase_resistance_ohm;
  d.copper_coefficient_per_K = sheet.copper_coefficient_per_K;

  const auto fill = [&](double C1, double C2) {
    d.phase_J_per_K = C1 / 3;
    d.teeth_J_per_K = C2 * o.teeth_share_of_C2;
    d.yoke_J_per_K = C2 * o.yoke_share_of_C2;
    d.frame_J_per_K = C2 * o.frame_share_of_C2;
    d.rotor_J_per_K = C2 * o.rotor_share_of_C2;
    d.housing_J_per_K = C2 * (1 - o.teeth_share_of_C2 - o.yoke_share_of_C2 - o.frame_share_of_C2 - o.rotor_share_of_C2);
  };
  // The coupling that the sheet states is what three phase nodes would show; teeth in common hide some of it.
  const double wanted_W_per_K =
      sheet.phase_coupling_W_per_K > 0 ? sheet.phase_coupling_W_per_K : o.phase_coupling_share / R1;
  d.phase_coupling_W_per_K = wanted_W_per_K - (d.phase_to_teeth_W_per_K - 1 / (3 * R1)) / 3;
  if (d.phase_coupling_W_per_K < 0) d.phase_coupling_W_per_K = 0;

  // Capacities: scaled until the reduction gives the sheet's. Each round divides the error by ten or more.
  double C1 = sheet.C1_J_per_K, C2 = sheet.C2_J_per_K;
  for (int round = 0; round < 12; ++round) {
    fill(C1, C2);
    const TwoResistor seen = reduced(d);
    C1 *= sheet.C1_J_per_K / seen.C1_J_per_K;
    C2 *= sheet.C2_J_per_K / seen.C2_J_per_K;
  }
  fill(C1, C2);
  return d;
}

wire::Motor true_sheet(const wire::Motor& sheet, const HeatDetail& detail) {
  const TwoResistor seen = reduced(detail);
  wire::Motor out = sheet;
  out.R1_K_per_W = seen.R1_K_per_W;
  out.R2_K_per_W = seen.R2_K_per_W;
  out.C1_J_per_K = seen.C1_J_per_K;
  out.C2_J_per_K = seen.C2_J_per_K;
  out.phase_coupling_W_per_K = seen.phase_coupling_W_per_K;
  return out;
}

}  // namespace host_sim

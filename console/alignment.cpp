// SPDX-License-Identifier: MIT
#include "console/alignment.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>

namespace console {
namespace {

// An answer is what the speed gains over so many rows: at 1 kHz long beside the 0.3 ms by which the observed speed lags
// (firmware/rotor.hpp at 500 Hz), short beside a push.
constexpr std::size_t rows_of_answer = 8;
constexpr double longest_row_s = 0.003;  // rows further apart have others missing between them
constexpr float still_share = 0.02f;     // of the largest speed: below it friction holds the shaft, and no answer comes
constexpr int fewest_answers = 24;       // to four unknowns
constexpr int most_pole_pairs = 50;      // firmware/axis.params
// Another number of turns has to leave half of what the believed one leaves, and so little that of a hundred numbers
// chance would find one in 30000 logs: e^-15 each.
constexpr double far_better = 0.5, beyond_chance = 15;

}  // namespace

Alignment::Found Alignment::fit(int more) const {
  float fastest_rad_per_s = 0;
  for (const Row& row : rows_) fastest_rad_per_s = std::max(fastest_rad_per_s, std::fabs(row.rad_per_s));
  const float still_rad_per_s = still_share * fastest_rad_per_s;

  // gain of speed = sin b d + cos b q (times what an ampere does) + friction against the motion + a steady load
  Eigen::Matrix4d squares = Eigen::Matrix4d::Zero();
  Eigen::Vector4d products = Eigen::Vector4d::Zero();
  double all = 0;
  int answers = 0;
  bool forth = false, back = false;
  for (std::size_t first = 0; first + rows_of_answer < rows_.size(); first += rows_of_answer) {
    Eigen::Vector4d input = Eigen::Vector4d::Zero();
    bool whole = true, moves = false;
    for (std::size_t i = first; i < first + rows_of_answer; ++i) {
      const Row &row = rows_[i], &next = rows_[i + 1];
      const double seconds = next.time_s - row.time_s, slip_rad = double{row.rotor_rad} * more;
      whole = whole && seconds > 0 && seconds < longest_row_s;
      const bool moved = std::fabs(row.rad_per_s) > still_rad_per_s;
      moves = moves || moved;
      forth = forth || (moved && row.rad_per_s > 0);
      back = back || (moved && row.rad_per_s < 0);
      // Both ends' mean: between two rows a current rises or falls.
      const double d_As = 0.5 * double{row.d_A + next.d_A} * seconds, q_As = 0.5 * double{row.q_A + next.q_A} * seconds;
      const double friction_s = moved ? std::copysign(seconds, row.rad_per_s) : 0;
      input += Eigen::Vector4d{d_As * std::cos(slip_rad) + q_As * std::sin(slip_rad),
                               q_As * std::cos(slip_rad) - d_As * std::sin(slip_rad), friction_s, seconds};
    }
    if (!whole || !moves) continue;
    const double gain_rad_per_s = rows_[first + rows_of_answer].rad_per_s - rows_[first].rad_per_s;
    squares += input * input.transpose();
    products += input * gain_rad_per_s;
    all += gain_rad_per_s * gain_rad_per_s;
    ++answers;
  }
  if (!(forth && back)) {  // friction is then one with the load
    squares.row(2).setZero();
    squares.col(2).setZero();
    squares(2, 2) = 1;
    products[2] = 0;
  }
  const Eigen::FullPivLU<Eigen::Matrix4d> solver(squares);
  if (answers < fewest_answers || !solver.isInvertible()) return {};
  const Eigen::Vector4d found = solver.solve(products);
  const double left = std::max(0.0, all - found.dot(products)), variance = left / (answers - 4);
  const double push2 = found[0] * found[0] + found[1] * found[1];
  const Eigen::Vector4d across{found[1] / push2, -found[0] / push2, 0, 0};  // by which the angle follows both
  return {std::atan2(found[0], found[1]), std::sqrt(variance * across.dot(solver.inverse() * across)), std::sqrt(push2),
          left / all, answers};
}

int Alignment::turns(int pole_pairs) const {
  const Found believed = fit(0);
  const auto left = [&](int turns) { return turns == 0 ? 1 : fit(turns - pole_pairs).left; };
  int best = pole_pairs;
  double least = believed.left * std::min(far_better, std::exp(-2 * beyond_chance / std::max(believed.answers, 1)));
  for (int turns = -most_pole_pairs; turns <= most_pole_pairs; ++turns) {
    const double its = left(turns);
    if (!(its < least)) continue;
    least = its;
    best = turns;
  }
  // Two leads the wrong way round are likelier than that and other pole pairs at once.
  return best != pole_pairs && far_better * left(-pole_pairs) < least ? -pole_pairs : best;
}

}  // namespace console

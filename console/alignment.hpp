// SPDX-License-Identifier: MIT
// Where the magnet really lies, from how a free shaft answers current in many directions.
//
// The board believes the magnet at pole pairs * encoder - offset. Where it lies b beside that, a current (d, q) pushes
// with d sin b + q cos b: what the shaft's speed gains is a straight line in both, and no other number of the motor is
// needed. With other pole pairs than believed, or an encoder that counts against the phases, b turns with the shaft, a
// whole number of times as fast; each such number is tried on the same answers. Pure: no board.
#pragma once

#include <vector>

namespace console {

class Alignment {
 public:
  /// A row of telemetry, of one axis.
  struct Row {
    double time_s;
    float d_A, q_A;   // measured, as the board believes the magnet to lie
    float rad_per_s;  // of the shaft
    float rotor_rad;  // of the shaft
  };
  struct Found {
    double ahead_rad = 0;     // what angle_offset has to grow by, electrical, -pi to pi
    double sigma_rad = 10;    // one sigma; beyond any angle while too little is known
    double rad_per_s2_A = 0;  // what an ampere does for the shaft where it pushes most
    double left = 1;          // of the answers' squares, what stays unexplained
    int answers = 0;          // that this comes from
  };

  void take(const Row& row) { rows_.push_back(row); }

  /// As pole pairs and direction are believed.
  Found found() const { return fit(0); }
  /// The electrical turns that the magnet really makes in one of the shaft, negative against the encoder:
  /// `pole_pairs`, unless another number explains the answers far better.
  int turns(int pole_pairs) const;

 private:
  /// Where the magnet makes so many electrical turns more than believed in one of the shaft.
  Found fit(int more) const;

  std::vector<Row> rows_;
};

}  // namespace console

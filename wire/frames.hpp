// SPDX-License-Identifier: MIT
// Reference frames as types: a current in the wrong frame must not compile, because on the bench it burns a bridge.
// The numbers inside carry no unit of their own; the name of the variable does (current_A, voltage_V).
#pragma once

namespace wire {

/// Phase quantities, positive into the motor.
struct Abc {
  float a, b, c;
};

/// Stationary frame, amplitude-invariant: alpha lies on phase a.
struct AlphaBeta {
  float alpha, beta;
};

/// Rotor frame, amplitude-invariant: d on the magnet, q a quarter turn ahead.
struct Dq {
  float d, q;
};

}  // namespace wire

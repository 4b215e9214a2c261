// SPDX-License-Identifier: MIT
// Wires <-> stationary frame <-> rotor frame, amplitude-invariant: a vector of length 1 is a phase amplitude of 1 and
// the power of three phases is 3/2 (vd id + vq iq). And the sine and cosine that this takes. Pure functions, same cost
// every call, ISR.
#pragma once

#include <cstdint>

#include "wire/frames.hpp"

namespace firmware {

using wire::Abc;
using wire::AlphaBeta;
using wire::Dq;

struct SinCos {
  float sin, cos;
};

/// An electrical angle as a fraction of a turn, 2^32 to the turn: it wraps by itself, multiplies by whole pole pairs
/// without loss, and takes no comparison to stay in range.
struct ElectricalAngle {
  std::uint32_t turn;
};

inline constexpr float pi = 3.14159265f;
inline constexpr float sin_cos_error = 8e-7f;  // largest error, tested: a five-hundredth of a 14-bit encoder's step

/// Sine by folding the outer half-turn onto the inner one, where an odd polynomial of seventh degree lies within 6e-7
/// (our own minimax fit over a quarter turn, weighted least squares, before rounding).
constexpr float sin(ElectricalAngle angle) {
  constexpr std::uint32_t quarter = 1u << 30, half = 1u << 31;
  const std::uint32_t folded = ((angle.turn + quarter) & half) != 0 ? half - angle.turn : angle.turn;
  const float x = static_cast<float>(static_cast<std::int32_t>(folded)) * (1.0f / quarter);  // in quarter turns, -1..1
  const float y = x * x;
  return x * (1.57079101f + y * (-0.64589285f + y * (0.0794343444f + y * -4.33309517e-3f)));
}

constexpr SinCos sin_cos(ElectricalAngle angle) { return {sin(angle), sin({angle.turn + (1u << 30)})}; }

/// What the three phases have in common (a shared amplifier error) falls out.
constexpr AlphaBeta clarke(const Abc& x) {
  constexpr float third = 1.0f / 3.0f, inverse_sqrt3 = 0.577350269f;
  return {(2.0f * x.a - (x.b + x.c)) * third, (x.b - x.c) * inverse_sqrt3};
}

constexpr Abc inverse_clarke(const AlphaBeta& x) {
  constexpr float half_sqrt3 = 0.866025404f;
  const float along = -0.5f * x.alpha, across = half_sqrt3 * x.beta;
  return {x.alpha, along + across, along - across};
}

constexpr Dq park(const AlphaBeta& x, const SinCos& rotor) {
  return {x.alpha * rotor.cos + x.beta * rotor.sin, x.beta * rotor.cos - x.alpha * rotor.sin};
}

constexpr AlphaBeta unpark(const Dq& x, const SinCos& rotor) {
  return {x.d * rotor.cos - x.q * rotor.sin, x.d * rotor.sin + x.q * rotor.cos};
}

}  // namespace firmware

// SPDX-License-Identifier: MIT
// Wires <-> stationary frame <-> rotor frame, amplitude-invariant: a vector of length 1 is a phase amplitude of 1 and
// the power of three phases is 3/2 (vd id + vq iq). And the sine and cosine that this takes. Pure functions, same cost
// every call, ISR.
#pragma once

#include "wire/frames.hpp"

namespace firmware {

using wire::Abc;
using wire::AlphaBeta;
using wire::Dq;

struct SinCos {
  float sin, cos;
};

inline constexpr float sin_cos_range_rad = 1500.0f;  // keeps the whole number of quarter turns well inside an int
inline constexpr float sin_cos_error = 2e-7f;  // largest error up to pi, tested; beyond, 1/2 ulp of the angle adds

/// Both at once, |angle| <= sin_cos_range_rad. The nearest quarter turn is taken off in two parts, the rest lies within
/// +-pi/4 and meets a polynomial (least squares at Chebyshev nodes, our own fit: errors 2e-9 and 4e-8 before rounding).
constexpr SinCos sin_cos(float angle_rad) {
  constexpr float quarters_per_rad = 0.636619772f;
  constexpr int bias = 1024;  // truncation rounds to nearest only above zero
  const int quarter = static_cast<int>(angle_rad * quarters_per_rad + (bias + 0.5f)) - bias;
  const float n = static_cast<float>(quarter);
  const float x = (angle_rad - n * 1.5703125f) - n * 4.83826794897e-4f;  // pi/2: 8 bits that multiply exactly, the rest
  const float y = x * x;
  const float s = x + x * y * (-0.16666650143f + y * (8.331955239e-3f + y * -1.949315165e-4f));
  const float c = 1.0f + y * (-0.4999989206f + y * (0.0416561616f + y * -1.3596314738e-3f));
  const float sin = (quarter & 1) != 0 ? c : s;
  const float cos = (quarter & 1) != 0 ? s : c;
  return {(quarter & 2) != 0 ? -sin : sin, ((quarter + 1) & 2) != 0 ? -cos : cos};
}

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

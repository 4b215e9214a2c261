// SPDX-License-Identifier: MIT
// Included before everything by the toolchain file: Eigen's assertions stay, but end in a trap instead of linking
// printf.
#pragma once

#define eigen_assert(condition)         \
  do {                                  \
    if (!(condition)) __builtin_trap(); \
  } while (false)

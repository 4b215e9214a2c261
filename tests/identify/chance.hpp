// SPDX-License-Identifier: MIT
// Tests on seeds that change with each commit: which seed, and how much bad luck is allowed.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

namespace tests {

/// Number in the environment variable HOTCORE_SEED (CI sets it from the commit); without it a fixed one. Seeds below
/// 1'000'000 are for tuning; these lie above.
inline std::uint64_t rotating_seed() {
  const char* text = std::getenv("HOTCORE_SEED");
  std::uint64_t mixed = 1469598103934665603ull;  // FNV-1a
  for (const char c : std::string(text != nullptr ? text : "fixed"))
    mixed = (mixed ^ static_cast<unsigned char>(c)) * 1099511628211ull;
  return 1'000'000 + mixed % 1'000'000;
}

/// Chance of at most `hits` of `trials` when each succeeds with `share`.
inline double chance_of_at_most(int hits, int trials, double share) {
  if (share >= 1) return hits >= trials ? 1 : 0;
  if (share <= 0) return 1;
  double sum = 0;
  for (int k = 0; k <= hits && k <= trials; ++k) {
    const double ways = std::lgamma(trials + 1) - std::lgamma(k + 1) - std::lgamma(trials - k + 1);
    sum += std::exp(ways + k * std::log(share) + (trials - k) * std::log(1 - share));
  }
  return sum;
}

/// False when `hits` of `trials` would be bad luck of less than one in a thousand if `share` were true: the promise is
/// then broken, whatever the seeds.
inline bool plausible(int hits, int trials, double share) { return chance_of_at_most(hits, trials, share) > 1e-3; }

}  // namespace tests

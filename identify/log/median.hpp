// SPDX-License-Identifier: MIT
// The middle one of some numbers.
#pragma once

#include <algorithm>
#include <vector>

#include "identify/log/table.hpp"

namespace identify {

/// The upper one of two middles; missing when there is none.
inline double median(std::vector<double> v) {
  if (v.empty()) return missing;
  const auto middle = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
  std::nth_element(v.begin(), middle, v.end());
  return *middle;
}

}  // namespace identify

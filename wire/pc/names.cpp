// SPDX-License-Identifier: MIT
#include "wire/pc/names.hpp"

#include <algorithm>
#include <numeric>

namespace wire::pc {
namespace {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row.back();
}

}  // namespace

std::string nearest(std::string_view given, const std::vector<std::string>& known) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(given.size() / 2, 2);
  for (const std::string& name : known) {
    // A name without its unit ("angle" for "angle_rad") is the commonest slip.
    const bool unit_left_out = !given.empty() && name.rfind(std::string(given) + "_", 0) == 0;
    const std::size_t distance = unit_left_out ? 0 : edit_distance(given.substr(0, 200), name);
    if (distance < best_distance) {
      best_distance = distance;
      best = name;
    }
  }
  return best;
}

std::string did_you_mean(std::string_view given, const std::vector<std::string>& known) {
  const std::string name = nearest(given, known);
  return name.empty() ? "" : ", did you mean '" + name + "'?";
}

}  // namespace wire::pc

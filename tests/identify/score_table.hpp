// SPDX-License-Identifier: MIT
// Figures against what was promised: shares and medians, as text and as JSON.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/identify/chance.hpp"

namespace tests {

struct Figure {
  std::string row, what;
  int hits, trials;  // of a share; a median has no hits
  double value, promised, floor;
  bool at_least;

  bool kept() const { return trials == 0 || (at_least ? value >= promised : value <= promised); }
  /// False when chance alone does not explain that the floor is missed.
  bool holds() const {
    if (hits < 0) return trials < 10 || value >= floor;
    return at_least ? tests::plausible(hits, trials, floor) : tests::plausible(trials - hits, trials, 1 - floor);
  }
};

class Table {
 public:
  void add(const std::string& row, const std::string& what, int hits, int trials, bool at_least, double promised,
           double floor) {
    figures_.push_back(
        {row, what, hits, trials, trials > 0 ? static_cast<double>(hits) / trials : 0, promised, floor, at_least});
  }
  void add_median(const std::string& row, const std::string& what, std::vector<double> values, double promised,
                  double floor) {
    std::sort(values.begin(), values.end());
    const double median = values.empty() ? 0 : values[values.size() / 2];
    figures_.push_back({row, what, -1, static_cast<int>(values.size()), median, promised, floor, true});
  }
  bool holds() const {
    return std::all_of(figures_.begin(), figures_.end(), [](const Figure& f) { return f.holds(); });
  }
  std::size_t size() const { return figures_.size(); }
  /// Figures from the from-th on.
  std::string text(std::size_t from = 0) const {
    std::string out = fmt::format("{:<18} {:<34} {:>7} {:>12} {:>9}\n", "row", "figure", "value", "of", "promised");
    for (std::size_t i = from; i < figures_.size(); ++i) {
      const Figure& f = figures_[i];
      out += fmt::format("{:<18} {:<34} {:>7.3f} {:>12} {:>2} {:<6g} {}{}\n", f.row, f.what, f.value,
                         f.hits < 0 ? fmt::format("{} logs", f.trials) : fmt::format("{}/{}", f.hits, f.trials),
                         f.at_least ? ">=" : "<=", f.promised,
                         f.trials == 0 ? "not measured"
                         : f.kept()    ? "kept"
                                       : "MISSED",
                         f.holds() ? "" : ", and BELOW ITS FLOOR");
    }
    return out;
  }
  nlohmann::ordered_json json() const {
    nlohmann::ordered_json out = nlohmann::ordered_json::array();
    for (const Figure& f : figures_) {
      out.push_back({{"row", f.row},
                     {"figure", f.what},
                     {"value", f.value},
                     {"trials", f.trials},
                     {"at_least", f.at_least},
                     {"promised", f.promised},
                     {"kept", f.kept()}});
    }
    return out;
  }

 private:
  std::vector<Figure> figures_;
};

}  // namespace tests

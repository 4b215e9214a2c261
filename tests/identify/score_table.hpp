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
  double value, promised;
  double held;  // what a check holds: the promise, or where README tells that it is not kept, what was found
  bool at_least;

  bool kept() const { return trials == 0 || (at_least ? value >= promised : value <= promised); }
  /// False when chance alone does not explain that what is held is missed.
  bool holds() const {
    if (hits < 0) return trials < 10 || value >= held;
    return at_least ? tests::plausible(hits, trials, held) : tests::plausible(trials - hits, trials, 1 - held);
  }
};

class Table {
 public:
  void add(const std::string& row, const std::string& what, int hits, int trials, bool at_least, double promised,
           double held) {
    figures_.push_back(
        {row, what, hits, trials, trials > 0 ? static_cast<double>(hits) / trials : 0, promised, held, at_least});
  }
  void add_median(const std::string& row, const std::string& what, std::vector<double> values, double promised,
                  double held) {
    std::sort(values.begin(), values.end());
    const double median = values.empty() ? 0 : values[values.size() / 2];
    figures_.push_back({row, what, -1, static_cast<int>(values.size()), median, promised, held, true});
  }
  bool holds() const {
    return std::all_of(figures_.begin(), figures_.end(), [](const Figure& f) { return f.holds(); });
  }
  /// Each share of all rows together: a few logs of a row can hardly fail, all of them can. Rows that differ scatter
  /// less than if all had their mean share (Hoeffding, Annals of Mathematical Statistics 27, 1956): chance has room
  /// enough.
  Table pooled() const {
    Table out;
    for (const Figure& f : figures_) {
      if (f.trials == 0 || f.hits < 0) continue;
      auto same =
          std::find_if(out.figures_.begin(), out.figures_.end(), [&](const auto& p) { return p.what == f.what; });
      if (same == out.figures_.end()) same = out.figures_.insert(same, {"all rows", f.what, 0, 0, 0, 0, 0, f.at_least});
      const double before = same->trials, all = before + f.trials;
      same->hits += f.hits;
      same->trials += f.trials;
      same->value = same->hits / all;
      same->promised = (before * same->promised + f.trials * f.promised) / all;
      same->held = (before * same->held + f.trials * f.held) / all;
    }
    return out;
  }
  std::size_t size() const { return figures_.size(); }
  /// Figures from the from-th on.
  std::string text(std::size_t from = 0) const {
    std::string out = fmt::format("{:<18} {:<34} {:>7} {:>12} {:>9}\n", "row", "figure", "value", "of", "promised");
    for (std::size_t i = from; i < figures_.size(); ++i) {
      const Figure& f = figures_[i];
      out += fmt::format("{:<18} {:<34} {:>7.3f} {:>12} {:>2} {:<6.3g} {}{}\n", f.row, f.what, f.value,
                         f.hits < 0 ? fmt::format("{} logs", f.trials) : fmt::format("{}/{}", f.hits, f.trials),
                         f.at_least ? ">=" : "<=", f.promised,
                         f.trials == 0 ? "not measured"
                         : f.kept()    ? "kept"
                                       : "MISSED",
                         f.holds() ? "" : fmt::format(", and {:.3g} NOT HELD", f.held));
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

// SPDX-License-Identifier: MIT
// Both axes as they are now, for eyes: a table of values and two curves that move, redrawn in place on a terminal.
#pragma once

#include <string>
#include <vector>

#include "console/console.hpp"
#include "console/plot.hpp"

namespace console {

/// "off", "ready", "running", "tripped".
std::string mode_text(std::uint8_t mode);
/// One state as JSON: time, bus and an array of axes.
Json json_of(const wire::State& state, double time_s);

class Live {
 public:
  /// `axes`: which ones are shown. Draws only on a terminal; elsewhere it prints a table row now and then.
  explicit Live(std::uint8_t mask);
  /// Redraws at most 20 times a second of `time_s`; elsewhere a row at most twice a second.
  void show(const wire::State& state, double time_s);
  /// A row more of each curve and what a terminal of that size then shows; only a very low one cuts it.
  std::string screen(const wire::State& state, double time_s, TerminalSize size, bool colours);

 private:
  struct Trail {
    std::vector<float> core_degC, housing_degC, iq_A, allowance_A;
    Scale heat{"degC", 10}, current{"A", 1};
  };
  std::string table(const wire::State& state, double time_s) const;

  std::uint8_t mask_;
  bool terminal_;
  int lines_ = 0;  // drawn last time
  double drawn_s_ = -1e9;
  std::vector<Trail> trails_;
};

}  // namespace console

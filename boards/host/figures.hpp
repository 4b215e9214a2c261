// SPDX-License-Identifier: MIT
// The curves and tables of Urata et al., IROS 2008, computed anew with the corrected equations (thermal/README.md).
#pragma once

#include <string>
#include <vector>

#include "wire/motor.hpp"

namespace boards::host {

/// A curve over the times of paper_times_s.
struct PaperCurve {
  std::string label;
  std::vector<double> values;
};

/// A row of the index table. Indices (6) in sqrt(s) and (7), dimensionless.
struct IndexRow {
  const char* motor;
  const char* status;
  double R1_K_per_W, R2_K_per_W, tau_winding_s, tau_motor_s;
  double short_term, forced_cooling;
};

/// A board as the paper lists it; NaN where no figure is known to us.
struct BoardRow {
  const char* board;
  int axes;
  double supply_V, continuous_A, peak_A, peak_s, pole_s;
};

struct PaperFigures {
  std::vector<PaperCurve> overload;  // Fig 1: I / I_N that brings the winding to its limit in t
  std::vector<PaperCurve> housing;   // Fig 2: housing temperature at that moment, degC
  std::vector<PaperCurve> amperes;   // Fig 6: direct current of the motor and of the driver, A
  std::vector<BoardRow> boards;      // Tables I and II
  std::vector<IndexRow> indices;     // the index table
};

extern const std::vector<double> paper_times_s;

PaperFigures paper_figures(const std::string& motor_folder);

std::string figures_text(const PaperFigures& figures);
std::string figures_json(const PaperFigures& figures);
/// fig1.svg, fig2.svg, fig6.svg, index.svg and figures.txt below `folder`; returns their paths.
std::vector<std::string> draw_figures(const PaperFigures& figures, const std::string& folder);

}  // namespace boards::host

// SPDX-License-Identifier: MIT
// The paper's curves against reference values computed beforehand with another program (numpy, same corrected
// equations): cold start, 25 degC around, 155 degC limit, copper coefficient in load and rating.
#include "boards/host/figures.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace {

using boards::host::PaperCurve;
using boards::host::PaperFigures;

constexpr double within = 0.01;

struct Reference {
  const char* label;
  std::vector<double> values;
};

void expect_curves(const std::vector<PaperCurve>& curves, const std::vector<Reference>& references) {
  ASSERT_GE(curves.size(), references.size());
  for (std::size_t c = 0; c < references.size(); ++c) {
    EXPECT_EQ(curves[c].label.rfind(references[c].label, 0), 0u) << curves[c].label;
    ASSERT_EQ(curves[c].values.size(), references[c].values.size());
    for (std::size_t i = 0; i < references[c].values.size(); ++i) {
      EXPECT_NEAR(curves[c].values[i], references[c].values[i], within * references[c].values[i])
          << references[c].label << " at " << boards::host::paper_times_s[i] << " s";
    }
  }
}

const PaperFigures& paper() {
  static const PaperFigures figures = boards::host::paper_figures(HOTCORE_SOURCE_DIR "/boards/motors");
  return figures;
}

TEST(Figures, Fig1) {
  expect_curves(paper().overload, {{"200 W", {30.94, 18.23, 10.68, 7.29, 5.75, 4.74, 3.36, 2.24, 1.43, 1.09}},
                                   {"EC 16", {15.76, 9.42, 5.77, 4.26, 3.52, 2.77, 1.90, 1.33, 1.04, 1.00}},
                                   {"200 W, water", {30.94, 18.23, 10.68, 7.29, 5.81, 5.23, 5.01, 5.00, 5.00, 5.00}}});
}

TEST(Figures, Fig2) {
  expect_curves(paper().housing, {{"200 W", {25.2, 25.6, 26.9, 31.3, 48.2, 80.4, 117.1, 138.0, 147.9, 150.8}},
                                  {"EC 16", {25.3, 26.0, 28.4, 36.4, 62.4, 97.0, 127.3, 141.1, 146.3, 146.9}},
                                  {"200 W, water", {25.2, 25.6, 26.9, 30.9, 43.7, 59.5, 65.6, 65.7, 65.7, 65.7}}});
}

TEST(Figures, Fig6) {
  std::vector<double> small_A = {15.76, 9.42, 5.77, 4.26, 3.52, 2.77, 1.90, 1.33, 1.04, 1.00};  // Fig 1
  for (double& value : small_A) value *= 2.22;                                                  // its rating, A
  expect_curves(paper().amperes, {{"EC 16", small_A}, {"driver", {239, 138, 76, 44, 24.3, 14.5, 8.8, 6.5, 6.0, 6.0}}});
}

TEST(Figures, TheDriversPoleCarriesSixAmperesForEverAndTwentyForFifteenSeconds) {
  const boards::host::BoardRow& board = paper().boards[0];
  EXPECT_NEAR(board.continuous_A * board.continuous_A,
              board.peak_A * board.peak_A * (1 - std::exp(-board.peak_s / board.pole_s)), 0.1);
}

TEST(Figures, IndicesRunFromThreeToTwentyAsThePaperSays) {
  double low = 1e9, high = 0;
  for (const auto& row : paper().indices) low = std::min(low, row.short_term), high = std::max(high, row.short_term);
  EXPECT_NEAR(low, 3.09, 0.02);
  EXPECT_NEAR(high, 19.2, 0.1);
  EXPECT_NEAR(paper().indices[0].short_term, 8.76, 0.01);
  EXPECT_NEAR(paper().indices[0].forced_cooling, 6.03, 0.01);
  EXPECT_NEAR(paper().indices[1].forced_cooling, 4.01, 0.01);
}

TEST(Figures, TextAndJsonHoldEveryFigure) {
  const std::string text = boards::host::figures_text(paper()), json = boards::host::figures_json(paper());
  for (const char* part : {"Fig 1", "Fig 2", "Fig 6", "Tables I and II", "Index table", "surrogate"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part;
  }
  for (const char* part : {"fig1_current_ratio", "fig2_housing_degC", "fig6_direct_A", "boards", "indices"}) {
    EXPECT_NE(json.find(part), std::string::npos) << part;
  }
}

}  // namespace

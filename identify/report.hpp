// SPDX-License-Identifier: MIT
// The answer, before it is written as text, JSON or a page. Everything the three show comes from here.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "identify/fit.hpp"
#include "identify/structure.hpp"

namespace identify {

struct ParameterLine {
  std::string name, unit;
  double value = 0, std_error = 0;
  bool determined = false;  // by this data and not only by the sheet
  bool at_bound = false;
};

struct Rmse {
  double housing_K = 0, core_K = 0;  // NaN: not measured
  double housing_worst_K = 0, core_worst_K = 0;
};

struct Rival {
  std::string id;
  double delta_bic = 0;
};

struct CauseLine {
  std::string id, name, signature;
  double delta_bic = 0;  // how much worse the answer is without it
  std::vector<ParameterLine> parameters;
  std::vector<Rival> rivals;
};

struct Variant {
  std::string what;
  Rmse rmse;
};

struct Rung {  // one candidate of the ladder
  std::string id, name;
  double delta_bic;  // gain over the baseline
  bool chosen, tied;
};

struct Interval {
  double low, high;
};

struct HeldOut {
  std::string how;
  Rmse before, after;
  bool winding = false;                         // whose rms the intervals are of; else the housing's
  int blocks = 0;                               // of a minute
  std::optional<Interval> before_95, after_95;  // bootstrap over blocks, 95 of 100; none when the blocks are too few
  std::vector<Rmse> each_before;                // per log, when whole logs were held out
  std::vector<std::string> names;
};

struct ProfileStep {
  double seconds, current_A, speed_rad_per_s;
};

struct Experiment {
  std::vector<std::string> separates;
  std::vector<ProfileStep> profile;
  std::string why;
};

/// What a board would do on a motor like the extended model: before with the two-resistor fit, after with the
/// extension.
struct Gain {
  double overshoot_before_K = 0, overshoot_after_K = 0;       // of the winding, in a push that outlasts its budget
  double burst_s_before = 0, burst_s_after = 0;               // that the board promises for the burst, from rest
  double continuous_A_before = 0, continuous_A_after = 0;     // that it promises for an hour
  double burst_A = 0, speed_rad_per_s = 0, ambient_degC = 0;  // of that push; amperes as in the log
};

/// Needs the intervals to be there.
std::string interval_words(const HeldOut& held_out);

/// The gain in words, for text and page.
struct GainLine {
  std::string what, before, after;
};
std::string gain_conditions(const Gain& gain);
std::vector<GainLine> gain_lines(const Gain& gain);

struct LogPlot {
  std::string name;
  std::vector<double> time_s, heat, measured_housing, simulated_housing, measured_core, simulated_core,
      extended_housing, extended_core, residual_housing, residual_core;
  std::string heat_label;
};

struct Report {
  std::string verdict;  // adequate, explained, partly_explained, ambiguous, unknown_cause, insufficient
  std::string sentence;
  std::string motor;
  std::vector<std::string> notes;   // on the data: masked, assumed, repaired
  std::vector<std::string> checks;  // gradient, residual, identifiability: passed or not, in words
  bool converged = false;
  std::vector<ParameterLine> baseline;
  Rmse baseline_rmse, extended_rmse;
  Structure structure;
  std::vector<Variant> variants;
  std::vector<std::string> loose;  // directions that this data does not determine, in words
  std::string core_refusal;        // empty: a core temperature may be stated
  std::vector<CauseLine> causes;
  std::vector<std::vector<std::string>> tied;  // ids of the sets that are as good, the best first
  std::vector<Rung> ladder;
  std::optional<HeldOut> held_out;
  std::optional<Gain> gain;
  std::optional<Experiment> experiment;
  std::string model_toml;     // the parameter set (--write-model)
  std::string baseline_toml;  // the two-resistor model as fitted, as a set (--write-baseline)
  std::string model_file;
  std::vector<std::string> reasoning;  // --explain
  std::vector<LogPlot> plots;
  double fit_ms = 0;
  int iterations = 0;
};

std::string as_text(const Report& report, bool explain);
std::string as_json(const Report& report);
std::string as_html(const Report& report);

}  // namespace identify

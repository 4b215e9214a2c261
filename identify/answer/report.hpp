// SPDX-License-Identifier: MIT
// The answer, before it is written as text, JSON or a page. Everything the three show comes from here.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "identify/answer/structure.hpp"
#include "identify/fit/replayed.hpp"
#include "identify/search/search.hpp"

namespace identify {

struct ParameterLine {
  std::string name, unit;
  double value = 0, std_error = 0;
  bool determined = false;  // by this data and not only by the sheet
  bool at_bound = false;
};

// Evidence is twice a logarithm (search.hpp); the JSON calls it delta_bic, as its contract does.
struct Rival {
  std::string id;
  double behind = 0;  // evidence that its set lacks to the best
};

struct CauseLine {
  std::string id, name, signature;
  std::string easily_taken_for, experiment;  // what the table of causes says of it
  double evidence = 0;                       // over the set without it
  std::vector<ParameterLine> parameters;
  std::vector<Rival> rivals;  // in its place in the next best sets
};

struct Variant {
  std::string what;
  Rmse rmse;
};

struct Rung {  // one candidate of the ladder
  std::string id, name;
  double evidence;  // over the baseline, alone
  bool chosen, tied;
};

struct Interval {
  double low, high;
};

struct HeldOutScore {
  std::string how;
  Rmse before, after;
  std::vector<std::string> nearest;             // where no set explains all: the one that `after` is of
  std::string like;                             // that set in words
  bool winding = false;                         // the intervals are of the winding's rms; else of the housing's
  int blocks = 0;                               // of a minute
  std::optional<Interval> before_95, after_95;  // bootstrap over blocks, 95 of 100; none when the blocks are too few
  std::string against;                          // how it speaks against the answer; empty: it does not
  std::vector<Rmse> each_before;                // per log, when several were held out
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

/// What a board would do on a motor as the model written for it: before with the two-resistor fit, after with that.
struct Gain {
  std::string like;                                           // the causes in that model
  double overshoot_before_K = 0, overshoot_after_K = 0;       // of the winding, in a push that outlasts its budget
  double burst_s_before = 0, burst_s_after = 0;               // that the board promises for the burst, from rest
  double continuous_A_before = 0, continuous_A_after = 0;     // that it promises for an hour
  double burst_A = 0, speed_rad_per_s = 0, ambient_degC = 0;  // of that push; amperes as in the log
};

/// What text and page say alike.
inline constexpr const char* gauge_words =
    "all temperatures stay the same when heat, 1/R and C are multiplied by one number: a wrong current gain cannot be "
    "seen";
std::string cause_heading(Verdict verdict);                // "Behaves like"
std::string nearest_words(const HeldOutScore& held_out);   // which has a nearest set
std::string interval_words(const HeldOutScore& held_out);  // which has intervals
const char* where_title(Verdict verdict);
std::string whiteness_words(const Whiteness& of_residual);

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
  Verdict verdict = Verdict::insufficient;
  std::string sentence;
  std::string motor;
  std::vector<std::string> notes;   // on the data: masked, assumed, repaired
  std::vector<std::string> checks;  // gradient, residual, identifiability: passed or not, in words
  bool converged = false;
  bool needs_leeway = false;  // two resistors leave more than noise, and no more beside what no motor is without
  std::vector<ParameterLine> baseline;
  Rmse baseline_rmse, extended_rmse;
  Structure structure;
  std::vector<Variant> variants;
  std::vector<std::string> loose;  // directions that this data does not determine, in words
  std::string core_refusal;        // empty: a core temperature may be stated
  std::vector<CauseLine> causes;
  std::vector<ParameterLine> extended;         // R1, R2, C1, C2 beside the causes
  std::vector<std::vector<std::string>> tied;  // ids of the sets named or tied, the best first; else empty
  std::vector<Rung> ladder;
  std::optional<HeldOutScore> held_out;
  std::optional<Gain> gain;
  std::optional<Experiment> experiment;
  std::string no_experiment;  // why there is none
  std::string no_model;       // why no board gets a set of this; empty: the two below are there
  std::string model_toml;     // the parameter set (--write-model)
  std::string baseline_toml;  // the two-resistor model as fitted, as a set (--write-baseline)
  std::string model_file;
  std::vector<std::string> reasoning;  // --explain
  std::vector<LogPlot> plots;
};

std::string as_text(const Report& report, bool explain);
std::string as_json(const Report& report);
std::string as_html(const Report& report);

}  // namespace identify

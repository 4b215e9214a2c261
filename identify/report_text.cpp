// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "identify/report.hpp"
#include "identify/search.hpp"

namespace identify {
namespace {

std::string line_of(const ParameterLine& p) {
  return fmt::format("  {:<12} {:>10.4g} {:<10} +- {:<9.2g} {}\n", p.name, p.value, p.unit, p.std_error,
                     p.at_bound     ? "AT ITS BOUND"
                     : p.determined ? ""
                                    : "not determined by this data: the sheet's word");
}

std::string rmse(const Rmse& r) {
  std::string out;
  if (!std::isnan(r.housing_K))
    out += fmt::format("housing {:.2f} K rms, {:.1f} K worst", r.housing_K, r.housing_worst_K);
  if (!std::isnan(r.core_K))
    out += fmt::format("{}winding {:.2f} K rms, {:.1f} K worst", out.empty() ? "" : "; ", r.core_K, r.core_worst_K);
  return out;
}

}  // namespace

std::string interval_words(const HeldOut& h) {
  return fmt::format("95 of 100 draws of {} blocks of a minute: {} {:.2f} to {:.2f} K before, {:.2f} to {:.2f} K after",
                     h.blocks, h.winding ? "winding" : "housing", h.before_95->low, h.before_95->high, h.after_95->low,
                     h.after_95->high);
}

std::string gain_conditions(const Gain& g) {
  return fmt::format(
      "the board with the two-resistor model and with the extended one, if the motor is as the extended one says; a "
      "push "
      "of {:.2f} A from rest at {:.0f} degC, {:.0f} rad/s",
      g.burst_A, g.ambient_degC, g.speed_rad_per_s);
}

std::vector<GainLine> gain_lines(const Gain& g) {
  const auto seconds = [](double s) { return std::isfinite(s) ? fmt::format("{:.1f} s", s) : std::string("no end"); };
  return {{"the winding passes its limit by", fmt::format("{:.1f} K", g.overshoot_before_K),
           fmt::format("{:.1f} K", g.overshoot_after_K)},
          {"the push is promised for", seconds(g.burst_s_before), seconds(g.burst_s_after)},
          {"for an hour is promised", fmt::format("{:.2f} A", g.continuous_A_before),
           fmt::format("{:.2f} A", g.continuous_A_after)}};
}

std::string as_text(const Report& r, bool explain) {
  std::string s = r.sentence + "\n\n";
  s += fmt::format("Verdict: {}      Motor: {}\n", r.verdict, r.motor);
  for (const std::string& note : r.notes) s += "  note: " + note + "\n";

  s += "\nTwo-resistor model, fitted\n";
  for (const ParameterLine& p : r.baseline) s += line_of(p);
  s += "  all temperatures stay the same when heat, 1/R and C are multiplied by one number: a wrong current gain "
       "cannot be seen\n";
  s += "  misses by: " + rmse(r.baseline_rmse) + "\n";
  for (const std::string& check : r.checks) s += "  " + check + "\n";
  for (const std::string& loose : r.loose) s += "    " + loose + "\n";
  if (!r.core_refusal.empty()) s += "  " + r.core_refusal + "\n";

  if (!r.variants.empty()) {
    s += "\nThe same with\n";
    for (const Variant& v : r.variants) s += fmt::format("  {:<55} {}\n", v.what, rmse(v.rmse));
    if (r.variants.size() == 2) {
      const Rmse &with = r.variants[0].rmse, &without = r.variants[1].rmse;
      const double a = std::isnan(with.core_K) ? with.housing_K : with.core_K,
                   b = std::isnan(without.core_K) ? without.housing_K : without.core_K;
      if (a > 1.15 * b) {
        s += "  The coefficient of copper, which is certain, makes the fit WORSE: without it two errors cancel.\n"
             "  Some heat does not follow the current, or the cooling is not constant.\n";
      }
    }
  }

  s += fmt::format(
      "\nWhere it is wrong (residual {:.2f} times the noise; chance of so unwhite a residual from a right model: "
      "{:.2g}, {:.2g})\n",
      r.structure.housing.ratio, r.structure.housing.white_p, r.structure.housing.ljung_box_p);
  if (r.structure.wrong.empty()) s += "  no stretch stands out\n";
  for (const Wrong& w : r.structure.wrong) {
    s += fmt::format("  {}{:.0f}..{:.0f} s: {} is {:.2f} K {} than simulated; goes with {}\n",
                     r.plots.size() > 1 ? r.plots[static_cast<std::size_t>(w.log)].name + " " : "", w.from_s, w.to_s,
                     w.channel, std::abs(w.mean_K), w.mean_K > 0 ? "hotter" : "cooler", w.goes_with);
  }
  s += "  residual goes with:";
  for (std::size_t i = 0; i < std::min<std::size_t>(4, r.structure.relations.size()); ++i) {
    const Relation& relation = r.structure.relations[i];
    s += fmt::format(" {} {:+.2f}{}", relation.signal, relation.correlation,
                     relation.smoothed_s > 0 ? fmt::format(" (over {:.0f} s)", relation.smoothed_s) : "");
    if (i + 1 < std::min<std::size_t>(4, r.structure.relations.size())) s += ",";
  }
  s += "\n";

  if (!r.ladder.empty()) {
    s += fmt::format("\nCandidates (evidence gained over the two-resistor model; {:g} are asked for)\n",
                     Margins{}.detect);
    for (const Rung& rung : r.ladder) {
      s += fmt::format("  {} {:<22} {:>9.1f}  {}\n",
                       rung.chosen ? "=>"
                       : rung.tied ? " ~"
                                   : "  ",
                       rung.id, rung.delta_bic, rung.name);
    }
  }
  for (const CauseLine& c : r.causes) {
    s += fmt::format("\n{}: {}\n  {}\n  evidence {:.1f}; seen by: {}\n",
                     r.verdict == "ambiguous" ? "May behave like" : "Behaves like", c.id, c.name, c.delta_bic,
                     c.signature);
    for (const ParameterLine& p : c.parameters) s += line_of(p);
    for (const Rival& rival : c.rivals) s += fmt::format("  rival: {} ({:+.1f})\n", rival.id, rival.delta_bic);
  }
  if (!r.causes.empty()) s += "\nWith it the model misses by: " + rmse(r.extended_rmse) + "\n";
  if (r.held_out) {
    s += fmt::format("\nOn data it has not seen ({})\n  before: {}\n", r.held_out->how, rmse(r.held_out->before));
    for (std::size_t i = 0; i < r.held_out->each_before.size() && r.held_out->each_before.size() > 1; ++i) {
      s += fmt::format("    {}: {}\n", r.held_out->names[i], rmse(r.held_out->each_before[i]));
    }
    if (!r.causes.empty()) s += "  after:  " + rmse(r.held_out->after) + "\n";
    if (r.held_out->before_95) s += "  " + interval_words(*r.held_out) + "\n";
  }
  if (r.gain) {
    s += "\nWhat it is worth: " + gain_conditions(*r.gain) + "\n";
    for (const GainLine& line : gain_lines(*r.gain))
      s += fmt::format("  {:<52} {} -> {}\n", line.what, line.before, line.after);
  }
  if (r.experiment) {
    s += "\nExperiment that would tell\n  " + r.experiment->why + "\n";
    for (const ProfileStep& p : r.experiment->profile)
      s += fmt::format("  {:>6.0f} s  {:>7.2f} A  {:>8.1f} rad/s\n", p.seconds, p.current_A, p.speed_rad_per_s);
  }
  if (explain) {
    s += "\nHow this was found\n";
    for (std::size_t i = 0; i < r.reasoning.size(); ++i) s += fmt::format("  {}. {}\n", i + 1, r.reasoning[i]);
  }
  if (!r.model_file.empty()) s += "\nModel written to " + r.model_file + "\n";
  return s;
}

}  // namespace identify

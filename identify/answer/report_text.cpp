// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "identify/answer/report.hpp"
#include "identify/search/search.hpp"

namespace identify {
namespace {

std::string line_of(const ParameterLine& p) {
  const std::string value = fmt::format("  {:<12} {:>10.4g} {:<10} ", p.name, p.value, p.unit);
  if (p.at_bound) return value + "AT ITS BOUND\n";
  return value + fmt::format("+- {:<9.2g} {}\n", p.std_error, p.determined ? "" : "not determined by this data");
}

std::string rmse(const Rmse& r) {
  std::string out;
  if (!std::isnan(r.housing_K))
    out += fmt::format("housing {:.2f} K rms, {:.1f} K worst", r.housing_K, r.housing_worst_K);
  if (!std::isnan(r.core_K))
    out += fmt::format("{}winding {:.2f} K rms, {:.1f} K worst", out.empty() ? "" : "; ", r.core_K, r.core_worst_K);
  return out.empty() ? "no figure" : out;
}

std::string two_resistors(const Report& r) {
  std::string s = "\nTwo-resistor model, fitted\n";
  for (const ParameterLine& p : r.baseline) s += line_of(p);
  s += fmt::format("  {}\n  misses by: {}\n", gauge_words, rmse(r.baseline_rmse));
  for (const std::string& check : r.checks) s += "  " + check + "\n";
  for (const std::string& loose : r.loose) s += "    " + loose + "\n";
  if (!r.core_refusal.empty()) s += "  " + r.core_refusal + "\n";
  return s;
}

std::string variants(const Report& r) {
  constexpr double worse = 1.15;  // clearly, of an rms
  if (r.variants.empty()) return "";
  std::string s = "\nThe same with\n";
  for (const Variant& v : r.variants) s += fmt::format("  {:<55} {}\n", v.what, rmse(v.rmse));
  if (r.variants.size() == 2) {
    if (r.variants[0].rmse.judged_K() > worse * r.variants[1].rmse.judged_K()) {
      s += "  The coefficient of copper, which is certain, makes the fit WORSE: without it two errors cancel.\n"
           "  Some heat does not follow the current, or the cooling is not constant.\n";
    }
  }
  return s;
}

std::string where(const Report& r) {
  std::string s = std::string("\n") + where_title(r.verdict) + "\n  " + whiteness_words(r.structure.residual) + "\n";
  if (r.structure.wrong.empty()) s += "  no stretch stands out\n";
  for (const Wrong& w : r.structure.wrong) {
    s += fmt::format("  {}{:.0f}..{:.0f} s: {} is {:.2f} K {} than simulated; goes with {}\n",
                     r.plots.size() > 1 ? r.plots[w.log].name + " " : "", w.from_s, w.to_s, w.channel,
                     std::abs(w.mean_K), w.mean_K > 0 ? "hotter" : "cooler", w.goes_with);
  }
  std::string strongest;
  for (std::size_t i = 0; i < std::min<std::size_t>(4, r.structure.relations.size()); ++i) {
    const Relation& relation = r.structure.relations[i];
    strongest += fmt::format("{} {} {:+.2f}{}", i > 0 ? "," : "", relation.signal, relation.correlation,
                             relation.smoothed_s > 0 ? fmt::format(" (over {:.0f} s)", relation.smoothed_s) : "");
  }
  return s + "  residual correlates with:" + strongest + "\n";
}

std::string candidates(const Report& r) {
  if (r.ladder.empty()) return "";
  std::string s = fmt::format("\nCandidates, each alone (evidence over the two-resistor model; {:g} are asked for)\n",
                              Margins{}.detect);
  for (const Rung& rung : r.ladder) {
    s += fmt::format("  {} {:<22} {:>9.1f}  {}\n",
                     rung.chosen ? "=>"
                     : rung.tied ? " ~"
                                 : "  ",
                     rung.id, rung.evidence, rung.name);
  }
  return s;
}

std::string named(const Report& r) {
  std::string s;
  for (const CauseLine& c : r.causes) {
    s += fmt::format("\n{}: {}\n  {}\n  evidence over the model without it: {:.1f}\n  shows as: {}\n",
                     cause_heading(r.verdict), c.id, c.name, c.evidence, c.signature);
    for (const ParameterLine& p : c.parameters) s += line_of(p);
    for (const Rival& rival : c.rivals) s += fmt::format("  rival: {} ({:.1f} behind)\n", rival.id, rival.behind);
    s += fmt::format("  easily taken for: {}; told from them by: {}\n", c.easily_taken_for, c.experiment);
  }
  if (r.causes.empty()) return s;
  s += fmt::format("\nWith {} the model misses by: {}\n", r.causes.size() > 1 ? "them" : "it", rmse(r.extended_rmse));
  for (const ParameterLine& p : r.extended) s += line_of(p);
  return s;
}

std::string unseen(const Report& r) {
  if (!r.held_out) return "";
  const HeldOutScore& h = *r.held_out;
  std::string s = fmt::format("\nOn data it has not seen ({})\n  before: {}\n", h.how, rmse(h.before));
  for (std::size_t i = 0; i < h.each_before.size(); ++i)
    s += fmt::format("    {}: {}\n", h.names[i], rmse(h.each_before[i]));
  if (!r.causes.empty()) s += "  after:  " + rmse(h.after) + "\n";
  if (!h.nearest.empty()) s += fmt::format("  {}: {}\n", nearest_words(h), rmse(h.after));
  if (h.before_95) s += "  " + interval_words(h) + "\n";
  return s;
}

std::string worth(const Report& r) {
  if (!r.gain) return "";
  std::string s = "\nWhat it is worth: " + gain_conditions(*r.gain) + "\n";
  for (const GainLine& line : gain_lines(*r.gain))
    s += fmt::format("  {:<52} {} -> {}\n", line.what, line.before, line.after);
  return s;
}

std::string advised(const Report& r) {
  if (!r.experiment) return "";
  std::string s = "\nExperiment that would tell\n  " + r.experiment->why + "\n";
  for (const ProfileStep& p : r.experiment->profile)
    s += fmt::format("  {:>6.0f} s  {:>7.2f} A  {:>8.1f} rad/s\n", p.seconds, p.current_A, p.speed_rad_per_s);
  return s;
}

}  // namespace

std::string cause_heading(Verdict verdict) {
  return verdict == Verdict::ambiguous          ? "May behave like"
         : verdict == Verdict::partly_explained ? "Behaves mostly like"
                                                : "Behaves like";
}

std::string nearest_words(const HeldOutScore& h) {
  return fmt::format("by the nearest set, {}, which is not believed", h.like);
}

std::string interval_words(const HeldOutScore& h) {
  return fmt::format(
      "95 % interval of the {}'s rms, from redrawing {} blocks of a minute: {:.2f} to {:.2f} K before, {:.2f} to "
      "{:.2f} K after",
      h.winding ? "winding" : "housing", h.blocks, h.before_95->low, h.before_95->high, h.after_95->low,
      h.after_95->high);
}

const char* where_title(Verdict verdict) {
  return verdict == Verdict::adequate ? "Where it misses most, no more than chance does" : "Where it is wrong";
}

std::string whiteness_words(const Whiteness& w) {
  const auto chance = [](double p) { return p < 1e-300 ? std::string("less than 1e-300") : fmt::format("{:.2g}", p); };
  if (w.ratio == 0) return "too few readings to tell whether the residual is noise";
  return fmt::format(
      "the residual is {:.2f} times the noise; a right model leaves one so unlike white noise with a chance of {} "
      "(cumulated periodogram) or {} (Ljung-Box)",
      w.ratio, chance(w.white_p), chance(w.ljung_box_p));
}

std::string gain_conditions(const Gain& g) {
  return fmt::format(
      "a board that runs the two-resistor model, and one that runs the model with {}, on a motor that is as the "
      "latter says; the push is {:.2f} A from rest, at {:.0f} rad/s, in {:.0f} degC",
      g.like, g.burst_A, g.speed_rad_per_s, g.ambient_degC);
}

std::vector<GainLine> gain_lines(const Gain& g) {
  const auto seconds = [](double s) { return std::isfinite(s) ? fmt::format("{:.1f} s", s) : std::string("no end"); };
  // Enamel is gone long before: how much more says nothing.
  const auto over = [](double K) { return K > 200 ? std::string("more than 200 K") : fmt::format("{:.1f} K", K); };
  return {{"the winding passes its limit by", over(g.overshoot_before_K), over(g.overshoot_after_K)},
          {"the push is promised for", seconds(g.burst_s_before), seconds(g.burst_s_after)},
          {"the current promised for an hour is", fmt::format("{:.2f} A", g.continuous_A_before),
           fmt::format("{:.2f} A", g.continuous_A_after)}};
}

std::string as_text(const Report& r, bool explain) {
  std::string s = fmt::format("{}\n\nVerdict: {}      Motor: {}\n", r.sentence, word(r.verdict), r.motor);
  for (const std::string& note : r.notes) s += "  note: " + note + "\n";
  s += two_resistors(r) + variants(r) + where(r) + candidates(r) + named(r) + unseen(r) + worth(r) + advised(r);
  if (explain) {
    s += "\nHow this was found\n";
    for (std::size_t i = 0; i < r.reasoning.size(); ++i) s += fmt::format("  {}. {}\n", i + 1, r.reasoning[i]);
  }
  if (!r.model_file.empty()) s += "\nModel written to " + r.model_file + "\n";
  return s;
}

}  // namespace identify

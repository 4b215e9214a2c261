// SPDX-License-Identifier: MIT
// The page: what a person should see first stands first (the sentence, the picture), and numbers follow. One file, no
// script, nothing fetched.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "identify/answer/report.hpp"
#include "identify/search/search.hpp"
#include "wire/pc/plot.hpp"

namespace identify {
namespace {

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    out += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : c == '"' ? "&quot;" : std::string(1, c);
  }
  return out;
}

/// gnuplot writes <svg ...> after an XML prologue that has no place inside a page, and fixed ids (clip paths, symbols)
/// that would collide between two pictures of one page.
std::string inlined(const std::string& svg, std::size_t number) {
  const std::size_t at = svg.find("<svg");
  std::string out = at == std::string::npos ? "" : svg.substr(at);
  const std::string tag = fmt::format("plot{}_", number);
  for (const char* where : {"id=\"", "id='", "url(#", "href=\"#", "href='#"}) {
    const std::string key = where;
    for (std::size_t p = out.find(key); p != std::string::npos; p = out.find(key, p + key.size() + tag.size()))
      out.insert(p + key.size(), tag);
  }
  return out;
}

std::string picture(const Report& r, std::size_t l) {
  const LogPlot& p = r.plots[l];
  const bool extended = !p.extended_housing.empty();
  const bool winding = count_told(p.measured_core) > 0, housing = count_told(p.measured_housing) > 0;
  const bool sparse = count_told(p.measured_core) * 4 < p.measured_core.size();
  wire::pc::Picture out;
  out.title = p.name;
  out.x_label = "time, s";
  wire::pc::Panel temperatures{"temperature, °C", {}};
  wire::pc::Panel residual{"residual, K", {}};
  // The longest label sets the width of the key.
  const std::string before = extended ? ", two resistors" : "", of_two = extended ? before : " simulated";
  if (winding) {
    temperatures.curves.push_back({"winding measured", p.time_s, p.measured_core, "#d55e00", false, sparse});
    residual.curves.push_back({"winding" + before, p.time_s, p.residual_core, "#e69f00", extended, sparse});
  }
  if (winding || r.core_refusal.empty())
    temperatures.curves.push_back({"winding" + of_two, p.time_s, p.simulated_core, "#e69f00", true});
  if (housing) {
    temperatures.curves.push_back({"housing measured", p.time_s, p.measured_housing, "#0072b2"});
    residual.curves.push_back({"housing" + before, p.time_s, p.residual_housing, "#56b4e9", extended});
  }
  temperatures.curves.push_back({"housing" + of_two, p.time_s, p.simulated_housing, "#56b4e9", true});
  if (extended) {
    if (winding || r.core_refusal.empty())
      temperatures.curves.push_back({"winding, extended", p.time_s, p.extended_core, "#009e73"});
    temperatures.curves.push_back({"housing, extended", p.time_s, p.extended_housing, "#404040", true});
    const auto left = [](std::vector<double> measured, const std::vector<double>& simulated) {
      for (std::size_t k = 0; k < measured.size(); ++k) measured[k] -= simulated[k];
      return measured;
    };
    if (winding)
      residual.curves.push_back(
          {"winding, extended", p.time_s, left(p.measured_core, p.extended_core), "#009e73", false, sparse});
    if (housing)
      residual.curves.push_back(
          {"housing, extended", p.time_s, left(p.measured_housing, p.extended_housing), "#404040"});
  }
  residual.levels.push_back({0, ""});
  for (const Wrong& w : r.structure.wrong) {
    if (w.log != l) continue;
    if ((w.channel == "winding") != winding) continue;  // one channel's stretches: two layers of tint hide each other
    // A label is as wide as a tenth of the picture: on a narrower stretch it would run into its neighbour.
    const bool wide = w.to_s - w.from_s > 0.09 * p.time_s.back();
    residual.stretches.push_back(
        {w.from_s, w.to_s, wide ? fmt::format("{:+.1f} K", w.mean_K) : "", w.mean_K > 0 ? "#f4d9d0" : "#d0e0f0"});
    temperatures.stretches.push_back({w.from_s, w.to_s, "", w.mean_K > 0 ? "#f4d9d0" : "#d0e0f0"});
  }
  if (!residual.stretches.empty())
    out.note = fmt::format("tinted: stretches where the two-resistor simulation of the {} is off; ",
                           winding ? "winding" : "housing");
  out.note += "residual = measured - simulated";
  out.panels = {temperatures, residual, {p.heat_label, {{"", p.time_s, p.heat, "#404040"}}}};
  return wire::pc::svg(out);
}

std::string row(const std::vector<std::string>& cells, const char* tag = "td") {
  std::string s = "<tr>";
  for (const std::string& c : cells) s += fmt::format("<{}>{}</{}>", tag, c, tag);
  return s + "</tr>\n";
}

/// A sentence of the text report, which has neither capital nor full stop.
std::string paragraph(std::string text) {
  if (!text.empty() && text[0] >= 'a' && text[0] <= 'z') text[0] = static_cast<char>(text[0] - 'a' + 'A');
  return "<p>" + escaped(text) + ".</p>\n";
}

std::string k(double v) { return std::isnan(v) ? "–" : fmt::format("{:.2f}", v); }

std::string parameter_rows(const std::vector<ParameterLine>& lines) {
  std::string s;
  for (const ParameterLine& p : lines) {
    s += row({escaped(p.name),
              fmt::format("{:.4g}", p.value) + (p.at_bound ? "" : fmt::format(" ± {:.2g}", p.std_error)),
              escaped(p.unit),
              p.at_bound     ? "at its bound"
              : p.determined ? "determined"
                             : "<em>not determined by this data</em>"});
  }
  return s;
}

std::string candidates(const Report& r) {
  if (r.ladder.empty()) return "";
  double most = 10;  // a ladder of nothing has short bars
  for (const Rung& rung : r.ladder) most = std::max(most, rung.evidence);
  std::string s = fmt::format(
      "<h2>Candidates</h2><p>Evidence of each alone over the two-resistor model; {:g} are asked for before anything is "
      "named, and a lead of {:g} ({:g} without a motor sheet, and of pairs) before one is named.</p><table "
      "class=ladder>\n",
      Margins{}.detect, Margins{}.tie_alone, Margins{}.tie);
  for (const Rung& rung : r.ladder) {
    // Evidence spans decades: the bar is its square root.
    const double width = 100 * std::sqrt(std::max(0.0, rung.evidence) / most);
    s += fmt::format(
        "<tr class='{}'><td>{}</td><td><div style='width:{:.1f}%'></div></td><td>{:.1f}</td><td>{}</td></tr>\n",
        rung.chosen ? "chosen"
        : rung.tied ? "tied"
                    : "",
        escaped(rung.id), width, rung.evidence, escaped(rung.name));
  }
  return s + "</table>\n";
}

std::string named(const Report& r) {
  std::string s;
  for (const CauseLine& c : r.causes) {
    std::string rivals;
    for (const Rival& rival : c.rivals)
      rivals += fmt::format("{} {} ({:.1f} behind)", rivals.empty() ? "Next best in its place:" : ",", rival.id,
                            rival.behind);
    s += fmt::format(
             "<h2>{}: {}</h2><p>{}. Evidence over the model without it: {:.1f}. {}</p><p>Shows as: {}.</p><table>",
             cause_heading(r.verdict), escaped(c.id), escaped(c.name), c.evidence, rivals, escaped(c.signature)) +
         parameter_rows(c.parameters) +
         fmt::format("</table><p>Easily taken for: {}; told from them by: {}.</p>\n", escaped(c.easily_taken_for),
                     escaped(c.experiment));
  }
  if (!r.extended.empty()) s += "<h2>The rest of that model</h2><table>" + parameter_rows(r.extended) + "</table>\n";
  return s;
}

std::string errors(const Report& r) {
  std::string s = "<h2>Errors</h2><table>" +
                  row({"", "housing rms, K", "winding rms, K", "housing worst, K", "winding worst, K"}, "th");
  const auto line = [&](const std::string& what, const Rmse& e) {
    s += row({escaped(what), k(e.housing_K), k(e.core_K), k(e.housing_worst_K), k(e.core_worst_K)});
  };
  if (r.variants.empty()) line("two-resistor model, fitted", r.baseline_rmse);
  for (const Variant& v : r.variants) line("two-resistor model, " + v.what, v.rmse);
  if (!r.causes.empty()) line("extended model, fitted", r.extended_rmse);
  if (r.held_out) {
    for (std::size_t i = 0; i < r.held_out->each_before.size(); ++i)
      line("not seen: " + r.held_out->names[i], r.held_out->each_before[i]);
    line("not seen (" + r.held_out->how + ")", r.held_out->before);
    if (!r.causes.empty()) line("the same, extended model", r.held_out->after);
    if (!r.held_out->nearest.empty()) line("the same " + nearest_words(*r.held_out), r.held_out->after);
  }
  s += "</table>\n";
  if (r.held_out && r.held_out->before_95) s += paragraph(interval_words(*r.held_out));
  return s;
}

std::string worth(const Report& r) {
  if (!r.gain) return "";
  std::string s = "<h2>What it is worth</h2>" + paragraph(gain_conditions(*r.gain)) + "<table>" +
                  row({"", "two resistors", "extended"}, "th");
  for (const GainLine& line : gain_lines(*r.gain)) s += row({line.what, line.before, line.after});
  return s + "</table>\n";
}

std::string where(const Report& r) {
  std::string s =
      std::string("<h2>") + where_title(r.verdict) + "</h2><table>" + row({"when", "what", "by", "goes with"}, "th");
  for (const Wrong& w : r.structure.wrong) {
    s += row({(r.plots.size() > 1 ? escaped(r.plots[w.log].name) + ", " : "") +
                  fmt::format("{:.0f}–{:.0f} s", w.from_s, w.to_s),
              w.channel,
              fmt::format("{:.2f} K {}", std::abs(w.mean_K),
                          w.mean_K > 0 ? "hotter than simulated" : "cooler than simulated"),
              escaped(w.goes_with)});
  }
  s += "</table>\n" + paragraph(whiteness_words(r.structure.residual)) + "<table>" +
       row({"residual correlates with", "correlation", "smoothed over"}, "th");
  for (const Relation& c : r.structure.relations)
    s += row({escaped(c.signal), fmt::format("{:+.2f}", c.correlation),
              c.smoothed_s > 0 ? fmt::format("{:.0f} s", c.smoothed_s) : "–"});
  return s + "</table>\n";
}

std::string two_resistors(const Report& r) {
  std::string s = "<h2>Two-resistor model</h2><table>" + parameter_rows(r.baseline) + "</table>\n<ul>";
  for (const std::string& check : r.checks) s += "<li>" + escaped(check) + "</li>";
  for (const std::string& loose : r.loose) s += "<li class=warn>" + escaped(loose) + "</li>";
  return s + "<li>" + gauge_words + "</li></ul>\n";
}

std::string advised(const Report& r) {
  if (!r.experiment) return "";
  std::string s = "<h2>Experiment that would tell</h2>" + paragraph(r.experiment->why) + "<table>" +
                  row({"seconds", "current, A", "speed, rad/s"}, "th");
  for (const ProfileStep& p : r.experiment->profile)
    s += row({fmt::format("{:.0f}", p.seconds), fmt::format("{:.2f}", p.current_A),
              fmt::format("{:.1f}", p.speed_rad_per_s)});
  return s + "</table>\n";
}

std::string listed(const char* heading, const char* tag, const std::vector<std::string>& sentences) {
  if (sentences.empty()) return "";
  std::string s = fmt::format("<h2>{}</h2><{}>", heading, tag);
  for (const std::string& sentence : sentences) s += "<li>" + escaped(sentence) + "</li>";
  return s + fmt::format("</{}>\n", tag);
}

constexpr const char* style =
    "body{font:15px/1.45 Helvetica,Arial,sans-serif;max-width:1000px;margin:2em auto;padding:0 1em;color:#222}"
    "h1{font-size:1.35em;line-height:1.3}"
    "h2{font-size:1.1em;margin-top:1.8em;border-bottom:1px solid #ddd}"
    ".verdict{display:inline-block;padding:.15em .7em;border-radius:1em;color:#fff;background:#666}"
    ".adequate,.explained{background:#009e73}"
    ".partly_explained,.ambiguous{background:#c98a00}"
    ".unknown_cause,.insufficient{background:#b03020}"
    "table{border-collapse:collapse}"
    "td,th{padding:.2em .8em .2em 0;text-align:left;vertical-align:top}"
    "th{color:#666;font-weight:normal}"
    ".ladder td:nth-child(2){width:300px}"
    ".ladder div{background:#b8c8d8;height:.9em}"
    ".chosen div{background:#009e73}"
    ".tied div{background:#e69f00}"
    ".chosen td:first-child{font-weight:bold}"
    "svg{max-width:100%;height:auto}"
    ".warn{color:#a03010}";

}  // namespace

std::string as_html(const Report& r) {
  std::string s =
      "<!DOCTYPE html>\n<html lang=en><head><meta charset=utf-8><title>identify: " + std::string(word(r.verdict)) +
      "</title><style>" + style + "</style></head><body>\n";
  s += fmt::format("<h1>{}</h1>\n<p><span class='verdict {}'>{}</span> &nbsp; motor: {}</p>\n", escaped(r.sentence),
                   word(r.verdict), word(r.verdict), escaped(r.motor));
  if (!r.core_refusal.empty()) s += "<p class=warn>" + escaped(r.core_refusal) + "</p>\n";
  for (std::size_t l = 0; l < r.plots.size(); ++l) s += inlined(picture(r, l), l) + "\n";
  s += candidates(r) + named(r) + errors(r) + worth(r) + where(r) + two_resistors(r) + advised(r);
  s += listed("How this was found", "ol", r.reasoning) + listed("On the data", "ul", r.notes);
  return s + "</body></html>\n";
}

}  // namespace identify

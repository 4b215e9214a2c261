// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "identify/answer/report.hpp"

namespace identify {
namespace {

using nlohmann::ordered_json;

ordered_json words(const std::string& s) { return s.empty() ? ordered_json(nullptr) : ordered_json(s); }

ordered_json number(double v) { return std::isfinite(v) ? ordered_json(v) : ordered_json(nullptr); }

ordered_json parameters(const std::vector<ParameterLine>& lines) {
  ordered_json out = ordered_json::array();
  for (const ParameterLine& p : lines) {
    out.push_back({{"name", p.name},
                   {"value", number(p.value)},
                   {"unit", p.unit},
                   {"std_error", number(p.std_error)},
                   {"determined", p.determined},
                   {"at_bound", p.at_bound}});
  }
  return out;
}

ordered_json rms(const Rmse& r) { return {{"housing", number(r.housing_K)}, {"core", number(r.core_K)}}; }

double worst(const Rmse& r) {
  return std::isnan(r.core_worst_K) ? r.housing_worst_K
                                    : std::max(r.core_worst_K, std::isnan(r.housing_worst_K) ? 0 : r.housing_worst_K);
}

}  // namespace

std::string as_json(const Report& r) {
  ordered_json out;
  out["format"] = 1;
  out["verdict"] = word(r.verdict);
  out["sentence"] = r.sentence;
  out["motor"] = r.motor;
  out["notes"] = r.notes;
  ordered_json& base = out["baseline"];
  base["parameters"] = parameters(r.baseline);
  base["rmse_K"] = rms(r.baseline_rmse);
  base["worst_K"] = number(worst(r.baseline_rmse));
  base["adequacy"] = {{"ratio", number(r.structure.residual.ratio)},
                      {"white_p", number(r.structure.residual.white_p)},
                      {"ljung_box_p", number(r.structure.residual.ljung_box_p)}};
  base["where"] = ordered_json::array();
  for (const Wrong& w : r.structure.wrong) {
    base["where"].push_back({{"log", w.log},
                             {"channel", w.channel},
                             {"from_s", w.from_s},
                             {"to_s", w.to_s},
                             {"mean_K", w.mean_K},
                             {"goes_with", w.goes_with}});
  }
  base["correlations"] = ordered_json::array();
  for (const Relation& c : r.structure.relations) {
    base["correlations"].push_back(
        {{"signal", c.signal}, {"correlation", number(c.correlation)}, {"smoothed_s", c.smoothed_s}});
  }
  base["converged"] = r.converged;
  base["checks"] = r.checks;
  base["not_determined"] = r.loose;
  base["core_refused"] = words(r.core_refusal);
  base["variants"] = ordered_json::array();
  for (const Variant& v : r.variants) base["variants"].push_back({{"what", v.what}, {"rmse_K", rms(v.rmse)}});
  base["gauge"] = "temperatures do not change under (heat, R, C) -> (g heat, R/g, g C)";
  out["causes"] = ordered_json::array();
  for (const CauseLine& c : r.causes) {
    ordered_json rivals = ordered_json::array();
    for (const Rival& rival : c.rivals) rivals.push_back({{"id", rival.id}, {"delta_bic", number(rival.behind)}});
    out["causes"].push_back({{"id", c.id},
                             {"name", c.name},
                             {"delta_bic", number(c.evidence)},
                             {"parameters", parameters(c.parameters)},
                             {"rivals", rivals}});
  }
  out["tied"] = r.tied;
  out["rmse_with_causes_K"] = r.causes.empty() ? ordered_json(nullptr) : rms(r.extended_rmse);
  out["parameters_with_causes"] = parameters(r.extended);
  out["candidates"] = ordered_json::array();
  for (const Rung& rung : r.ladder) {
    out["candidates"].push_back(
        {{"id", rung.id}, {"gain_bic", number(rung.evidence)}, {"chosen", rung.chosen}, {"tied", rung.tied}});
  }
  out["held_out"] = nullptr;
  if (r.held_out) {
    const HeldOutScore& h = *r.held_out;
    out["held_out"] = {{"how", h.how},
                       {"rmse_before_K", rms(h.before)},
                       {"rmse_after_K", rms(h.after)},
                       {"nearest", h.nearest},
                       {"worst_before_K", number(worst(h.before))},
                       {"worst_after_K", number(worst(h.after))},
                       {"against", words(h.against)}};
    if (h.before_95) {
      const auto pair = [](const Interval& i) { return ordered_json::array({number(i.low), number(i.high)}); };
      out["held_out"]["interval_95_K"] = {{"of", h.winding ? "core" : "housing"},
                                          {"before", pair(*h.before_95)},
                                          {"after", pair(*h.after_95)},
                                          {"blocks", h.blocks}};
    }
  }
  out["gain"] = nullptr;
  if (r.gain) {
    out["gain"] = {{"overshoot_before_K", number(r.gain->overshoot_before_K)},
                   {"overshoot_after_K", number(r.gain->overshoot_after_K)},
                   {"burst_s_before", number(r.gain->burst_s_before)},
                   {"burst_s_after", number(r.gain->burst_s_after)},
                   {"continuous_A_before", number(r.gain->continuous_A_before)},
                   {"continuous_A_after", number(r.gain->continuous_A_after)},
                   {"how", gain_conditions(*r.gain)}};
  }
  out["experiment"] = nullptr;
  if (r.experiment) {
    ordered_json profile = ordered_json::array();
    for (const ProfileStep& p : r.experiment->profile) {
      profile.push_back({{"seconds", p.seconds}, {"current_A", p.current_A}, {"speed_rad_per_s", p.speed_rad_per_s}});
    }
    out["experiment"] = {{"separates", r.experiment->separates}, {"profile", profile}, {"why", r.experiment->why}};
  }
  out["model_file"] = words(r.model_file);
  out["no_experiment"] = words(r.no_experiment);
  out["no_model"] = words(r.no_model);
  out["reasoning"] = r.reasoning;
  // A path or a column's name need not be UTF-8.
  return out.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace identify

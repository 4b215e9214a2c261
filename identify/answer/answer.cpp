// SPDX-License-Identifier: MIT
#include "identify/answer/answer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "identify/answer/baseline.hpp"
#include "identify/fit/leeway.hpp"
#include "identify/log/masks.hpp"

namespace identify {
namespace {

bool holds(const std::vector<std::string>& ids, const std::string& id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

/// Every cause once, best first, though a cause of one log was tried in each of them.
std::vector<Rung> ladder_of(const Found& found) {
  std::vector<Rung> out;
  std::set<std::string> seen;
  for (const Candidate& c : found.singles) {
    const std::string id = ids_of(c.fit.chosen).front();
    if (!seen.insert(id).second) continue;
    const bool chosen = names_causes(found.verdict) && !found.tied.empty() && holds(found.tied.front(), id);
    const bool tied =
        found.verdict == Verdict::ambiguous &&
        std::any_of(found.tied.begin(), found.tied.end(), [&](const auto& ids) { return holds(ids, id); });
    const double shown = std::abs(c.evidence) < 0.05 ? 0 : c.evidence;  // what rounds to nothing has no sign
    out.push_back({id, cause_of(c.fit.chosen.front()).name, shown, chosen, tied && !chosen});
  }
  return out;
}

/// What stands in a cause's place in the next best sets, and how far behind: all that tie, and the nearest three that
/// are behind by what another log might bring.
std::vector<Rival> rivals_of(const std::string& id, const Found& found) {
  constexpr std::size_t most = 3;
  constexpr double near = 100;
  std::vector<Rival> out;
  for (const Candidate& c : found.sets) {
    const auto theirs = ids_of(c.fit.chosen);
    if (holds(theirs, id) || (!c.tied && (out.size() >= most || found.chosen.evidence - c.evidence > near))) continue;
    for (const std::string& other : theirs) {
      const bool known = std::any_of(out.begin(), out.end(), [&](const Rival& r) { return r.id == other; });
      if (!known && !holds(found.tied.front(), other)) out.push_back({other, found.chosen.evidence - c.evidence});
    }
  }
  return out;
}

/// A set that was found, by its ids.
std::string in_words(const Found& found, const std::vector<std::string>& ids) {
  for (const Candidate& c : found.sets) {
    if ((c.chosen || c.tied) && ids_of(c.fit.chosen) == ids) return listed(names_of(c.fit.chosen), " and ");
  }
  return listed(ids, " and ");
}

/// A room whose temperature was typed in, and warms, looks like a mass, a drift or another cooling.
void note_still_ambient(const std::vector<Log>& logs, Report& report) {
  const auto moves = [](const Log& log) {
    double low = 1e300, high = -1e300;
    for (const double x : log.of(sink_of(log))) {
      if (!std::isnan(x)) low = std::min(low, x), high = std::max(high, x);
    }
    return high > low;
  };
  const bool recorded =
      std::any_of(logs.begin(), logs.end(), [](const Log& log) { return log.has(sink_of(log)) && !log.sink_typed; });
  if (recorded && std::none_of(logs.begin(), logs.end(), moves))
    report.notes.push_back(
        "The recorded ambient never moves; a room that warms unmeasured looks like a third mass, a drift or a "
        "change of cooling.");
}

/// What the columns of the heat may leave out: pulses between the samples of a loop, all that is less than a step, or
/// what a supply's power is more than heat.
void note_what_heat_leaves_out(const std::vector<Log>& logs, Report& report) {
  const Log& log = logs.front();
  const Role heat = heat_of(log);
  const bool phases = log.has(Role::phase_a);
  if (heat == Role::iq || phases)
    report.notes.push_back(fmt::format(
        "{} not tell the ripple of the pulses, which heats as well and grows with voltage and speed; of a motor of "
        "small inductance it may be all that is missing. Record an rms current beside it (current_A).",
        phases ? "Currents sampled in the phases may" : "iq_A does"));
  if (heat == Role::power)
    report.notes.push_back("power_W must be what heats the winding; a supply's power is what the shaft does as well.");
  constexpr double coarse = 0.02;  // of the most: a tenth of it is then off by up to a fifth in its square
  const double step = step_of(log.of(heat));
  if (step > coarse * largest_magnitude(log.of(heat)))
    report.notes.push_back(fmt::format(
        "{} moves in steps of {:g}; what flows below is lost, and heats. Record it finer.", own_name(heat), step));
}

/// What the logs do not hold, and the causes that could not be tried without it; empty when there are none.
std::string not_tried(const Problem& problem, const std::vector<Log>& logs) {
  const auto lacking = [&](Role role) {
    return std::none_of(logs.begin(), logs.end(), [&](const Log& log) { return log.has(role); });
  };
  const bool moves = problem.speed08_mean > 0;
  const struct {
    bool so;
    const char* what;
    std::vector<Needs> needs;
  } gaps[] = {
      {lacking(Role::speed), "speed_rad_per_s is missing", {Needs::speed}},
      {!lacking(Role::speed) && !moves, "speed_rad_per_s never moves", {Needs::speed}},
      {lacking(Role::frame), "frame_degC is missing", {Needs::frame}},
      {lacking(Role::neighbour), "neighbour_housing_degC is missing", {Needs::neighbour}},
      // What needs a speed, and cannot be tried although it moves, needs a current as well.
      {problem.heated_by_power(),
       "power_W tells no current",
       {moves ? Needs::speed : Needs::current, Needs::current, Needs::several_currents, Needs::copper}},
  };
  std::string out;
  for (const auto& gap : gaps) {
    std::vector<std::string> ids;
    for (const Cause& cause : causes()) {
      const bool concerned = std::count(gap.needs.begin(), gap.needs.end(), cause.needs) > 0;
      if (gap.so && concerned && !problem.possible(cause)) ids.emplace_back(cause.id);
    }
    if (!ids.empty()) out += fmt::format("{}{} ({})", out.empty() ? "" : "; ", gap.what, listed(ids, ", "));
  }
  return out.empty() ? out : "Not tried, since a column does not tell: " + out + ".";
}

std::string sentence(const Found& found, const Report& r) {
  const Rmse& e = r.baseline_rmse;
  // Readings of the winding may be too noisy to show what the housing's do.
  constexpr double visible = 1.1;  // by a tenth
  const double times_core = e.core_K / r.extended_rmse.core_K, times_housing = e.housing_K / r.extended_rmse.housing_K;
  const bool hides = (names_causes(found.verdict) || found.verdict == Verdict::ambiguous) && times_core < visible &&
                     times_housing > times_core;
  const bool core = !std::isnan(e.core_K) && !hides;
  const Noise& n = found.noise;
  const double after_K = core ? r.extended_rmse.core_K : r.extended_rmse.housing_K;
  // Of a winding seldom read it was taken from one cause's residuals; a set that misses by less shows less.
  const double noise_K = std::min(
      after_K, core ? std::hypot(n.core_white_K, n.core_slow_K) : std::hypot(n.housing_white_K, n.housing_slow_K));
  // A model that is wrong shows more noise than there is.
  const bool right = found.verdict == Verdict::adequate || names_causes(found.verdict);
  const bool counts = right && noise_K > 0.3 * after_K;  // a tenth of the squares that are missed, and more
  const std::string by = fmt::format("misses the {}{} by {:.2f} K rms", core ? "winding" : "housing",
                                     counts ? fmt::format(", whose readings are noisy by {:.1f} K,", noise_K) : "",
                                     core ? e.core_K : e.housing_K);
  const std::string miss = "the two-resistor model " + by;
  const std::string miss_and_after = fmt::format("{}, the extended one by {:.2f} K", miss, after_K);
  switch (found.verdict) {
    case Verdict::adequate:
      return fmt::format("The two-resistor model is adequate: it {}, no more than {}.", by,
                         r.needs_leeway ? fmt::format("the noise and {} explain", leeway_words) : "the noise explains");
    case Verdict::explained:
      return fmt::format("The motor behaves like {}: {}.", in_words(found, found.tied.front()), miss_and_after);
    case Verdict::partly_explained:
      return fmt::format("The motor behaves mostly like {}: {}; a slow disturbance of {:.2f} K remains.",
                         in_words(found, found.tied.front()), miss_and_after, found.remains_K);
    case Verdict::ambiguous: {
      std::string sets;
      for (std::size_t i = 0; i < std::min<std::size_t>(4, found.tied.size()); ++i)
        sets += (i > 0 ? ", or " : "") + in_words(found, found.tied[i]);
      std::vector<std::string> shared = found.tied.front();
      for (const auto& ids : found.tied)
        std::erase_if(shared, [&](const auto& id) { return std::find(ids.begin(), ids.end(), id) == ids.end(); });
      shared.erase(std::unique(shared.begin(), shared.end()), shared.end());
      if (found.tied.size() > 4) sets += fmt::format(", or {} more", found.tied.size() - 4);
      if (!shared.empty()) sets += "; all of them with " + listed(shared, " and ");
      if (found.remains_K > 0)
        sets += fmt::format("; the first leaves {:.2f} K, and a slow disturbance of {:.2f} K remains", after_K,
                            found.remains_K);
      return fmt::format("Something is missing ({}), and these cannot be told apart with this data: {}.", miss, sets);
    }
    case Verdict::unknown_cause:
      if (found.doubted)
        return fmt::format(
            "Something is wrong ({}): {} would explain it, and so would a slow disturbance without a name.", miss,
            listed(names_of(found.sets.front().fit.chosen), " and "));
      return fmt::format("Something is wrong ({}), and none of the known causes explains it{}.", miss,
                         after_K < (core ? e.core_K : e.housing_K)
                             ? fmt::format("; the nearest, {}, leaves {:.2f} K",
                                           listed(names_of(found.chosen.fit.chosen), " and "), after_K)
                             : "");
    case Verdict::insufficient:
      return "";  // no_verdict
  }
  return "";
}

/// Where no ambient was recorded, how warm the room was is a rival of what may be nothing else.
void tell_that_a_room_is_assumed(const Problem& problem, const Found& found, Report& report) {
  const auto assumed = [](const Bins& log) { return log.sink_assumed; };
  if (found.verdict == Verdict::adequate || std::none_of(problem.logs.begin(), problem.logs.end(), assumed)) return;
  const std::string advice =
      "No ambient was recorded: a room that is not as warm as what the log begins at looks like constant heat or an "
      "offset, one that changes like a drift, a third mass or another cooling; if you know it say --ambient DEGC.";
  const bool alike = std::any_of(found.tied.begin(), found.tied.end(), [](const auto& ids) {
    return std::any_of(ids.begin(), ids.end(), [](const std::string& id) {
      return id == "constant_heat" || id == "sensor_offset" || id == "ambient_drift" || id == "third_mass" ||
             id == "cooling_change";
    });
  });
  if (alike)
    report.sentence += " " + advice;
  else
    report.notes.push_back(advice);
}

}  // namespace

std::string listed(const std::vector<std::string>& ids, const char* between) {
  return fmt::format("{}", fmt::join(ids, between));
}

std::vector<ParameterLine> cause_lines(const Problem& problem, const Fit& f, std::size_t which) {
  // Half of the variance that was believed: the data then say as much as the prior does.
  const double determined_share = 1 / std::sqrt(2.0);
  std::vector<ParameterLine> out;
  const Eigen::VectorXd sd = std::max(1.0, f.ratio()) * f.std_errors();
  Eigen::Index at = base_count;
  for (std::size_t c = 0; c < f.chosen.size(); ++c) {
    const Cause& cause = cause_of(f.chosen[c]);
    for (std::size_t p = 0; p < cause.parameters.size(); ++p, ++at) {
      if (c != which) continue;
      const Parameter& parameter = cause.parameters[p];
      ParameterLine line;
      line.name = parameter.name;
      line.unit = stated_unit(problem, parameter.unit, parameter.scale);
      line.value = parameter_value(problem, cause, static_cast<int>(p), f.x[at]);
      const double slope = parameter.logarithmic ? line.value : problem.scale(parameter.scale, cause.drive);
      const double of_fit = std::abs(slope) * sd[at];
      line.std_error = parameter.scale == Scale::duration ? of_fit : stated_error(line.value, of_fit);
      line.at_bound = f.at_bound[static_cast<std::size_t>(at)];
      line.determined = !line.at_bound && sd[at] < determined_share * parameter.typical;
      out.push_back(line);
    }
  }
  return out;
}

std::vector<std::string> noise_words(const Problem& problem) {
  const Noise& n = problem.noise;
  std::vector<std::string> out;
  if (std::any_of(problem.logs.begin(), problem.logs.end(), [](const Bins& log) { return log.has_housing; }))
    out.push_back(n.idle_s > 60
                      ? fmt::format("Noise of a housing reading: {:.3f} K white, {:.3f} K slow, from {:.0f} s of rest.",
                                    n.housing_white_K, n.housing_slow_K, n.idle_s)
                      : fmt::format("Noise of a housing reading: {:.3f} K white from its differences; {:.3f} K slow, "
                                    "mostly assumed, for lack of rest.",
                                    n.housing_white_K, n.housing_slow_K));
  if (problem.any_core())
    out.push_back(n.core_slow_K > 0
                      ? fmt::format("Noise of a winding reading: {:.2f} K white from its differences.", n.core_white_K)
                      : fmt::format("Noise of a winding reading: {:.2f} K, assumed until a model shows it, since they "
                                    "are far apart.",
                                    n.core_white_K));
  return out;
}

void tell(const Problem& problem, const Found& found, const std::vector<Log>& logs, Report& report) {
  report.verdict = found.verdict;
  if (names_causes(found.verdict) || found.verdict == Verdict::ambiguous) report.tied = found.tied;
  report.reasoning.insert(report.reasoning.end(), found.steps.begin(), found.steps.end());
  report.ladder = ladder_of(found);
  if (found.doubted) {
    for (const Chosen& chosen : found.sets.front().fit.chosen)
      report.notes.push_back(fmt::format("What would tell whether it is {}: {}.", names_of({chosen}).front(),
                                         cause_of(chosen).experiment));
  }
  if (found.verdict != Verdict::adequate) {
    note_still_ambient(logs, report);
    note_what_heat_leaves_out(logs, report);
  }
  const std::string untried = not_tried(problem, logs);
  if (!untried.empty()) (found.verdict == Verdict::unknown_cause ? report.notes : report.reasoning).push_back(untried);
  if (!names_causes(found.verdict) && found.verdict != Verdict::ambiguous) return;
  const Fit& f = found.chosen.fit;
  for (std::size_t i = 0; i < f.chosen.size(); ++i) {
    const Cause& cause = cause_of(f.chosen[i]);
    CauseLine line;
    line.id = cause.id;
    line.name = cause.name;
    // Of two logs the other may as well be the one with the fan, and the factor its inverse.
    if (f.chosen[i].log >= 0)
      line.name += "; here: " + problem.logs[static_cast<std::size_t>(f.chosen[i].log)].name +
                   (problem.logs.size() == 2 ? " against the other" : "");
    line.signature = cause.signature;
    line.easily_taken_for = cause.rivals;
    line.experiment = cause.experiment;
    line.evidence = found.own_evidence[i];
    line.parameters = cause_lines(problem, f, i);
    line.rivals = rivals_of(cause.id, found);
    report.causes.push_back(std::move(line));
  }
}

void say(const Problem& problem, const Found& found, Report& report) {
  report.sentence = sentence(found, report);
  tell_that_a_room_is_assumed(problem, found, report);
}

std::string no_verdict(const Report& report, std::size_t logs, bool misses) {
  const Rmse& e = report.baseline_rmse;
  const bool core = !std::isnan(e.core_K);
  const double miss_K = core ? e.core_K : e.housing_K;
  if (!misses || std::isnan(miss_K))
    return fmt::format("{} cannot tell what the simulation gets wrong.", logs > 1 ? "These logs" : "This log");
  return fmt::format(
      "The two-resistor model misses the {} by {:.2f} K rms, more than the noise explains; why, {} cannot tell.",
      core ? "winding" : "housing", miss_K, logs > 1 ? "these logs" : "this log");
}

void shorten_names(std::vector<LogPlot>& plots) {
  const auto last = [](const std::string& path, long parts) {
    std::size_t cut = path.size();
    while (parts-- > 0 && cut != std::string::npos && cut > 0) cut = path.rfind('/', cut - 1);
    return cut == std::string::npos ? path : path.substr(cut + 1);
  };
  std::vector<std::string> paths;
  for (const LogPlot& plot : plots) paths.push_back(plot.name);
  for (LogPlot& plot : plots) {
    const std::string path = plot.name;
    const auto as_short = [&](long parts) {
      return std::any_of(paths.begin(), paths.end(), [&](const std::string& other) {
        return other != path && last(other, parts) == last(path, parts);
      });
    };
    long parts = 1;
    while (parts <= std::count(path.begin(), path.end(), '/') && as_short(parts)) ++parts;
    plot.name = last(path, parts);
  }
}

}  // namespace identify

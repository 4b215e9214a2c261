// SPDX-License-Identifier: MIT
#include "identify/answer/baseline.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "identify/fit/leeway.hpp"
#include "identify/fit/replayed.hpp"
#include "identify/search/problem_of.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

constexpr const char* base_names[] = {"R1", "R2", "C1", "C2"};
constexpr const char* base_units[] = {"K/W", "K/W", "J/K", "J/K"};
constexpr Scale base_scales[] = {Scale::core_resistance, Scale::sink_resistance, Scale::core_capacity,
                                 Scale::housing_capacity};
// A parameter known worse than this (as a factor of e^0.35, about 40 %) is the sheet's word and not the data's.
constexpr double determined_sd = 0.35;

std::string in_words(const Loose& loose) {
  std::string product;
  for (int j = 0; j < base_count; ++j) {
    if (std::abs(loose.share[j]) < 0.2) continue;
    product += fmt::format("{}{}^{:.1f}", product.empty() ? "" : " ", base_names[j], loose.share[j]);
  }
  return loose.sd > 3 ? fmt::format("{} is free: the data says nothing about it", product)
                      : fmt::format("{} is known only to a factor of {:.1f}", product, std::exp(loose.sd));
}

}  // namespace

void add_plots(const Problem& problem, const Fit& f, const std::string& remark, Report& report) {
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    const Bins& log = problem.logs[l];
    const Replayed r = replayed(problem, f, l);
    LogPlot plot;
    plot.name = log.name + remark;
    plot.heat_label = problem.heated_by_power() ? "power, W" : log.torque_for_A ? "torque, N m" : "current, A";
    for (std::size_t k = 0; k < log.bins.size(); ++k) {
      const Bin& b = log.bins[k];
      plot.time_s.push_back((static_cast<double>(k) + 0.5) * log.width_s);
      plot.heat.push_back(problem.heated_by_power() ? b.input[thermal::Drive::power_W]
                                                    : std::sqrt(b.input[thermal::Drive::current_A2]));
      plot.measured_housing.push_back(b.housing_degC);
      plot.measured_core.push_back(b.core_degC);
    }
    plot.simulated_housing = r.housing_degC;
    plot.simulated_core = r.core_degC;
    plot.residual_housing = r.housing_residual_K;
    plot.residual_core = r.core_residual_K;
    report.plots.push_back(std::move(plot));
  }
}

void add_extended(const Problem& problem, const Fit& f, Report& report, std::size_t first) {
  for (std::size_t l = 0; l < problem.logs.size(); ++l) {
    Replayed r = replayed(problem, f, l);
    report.plots[first + l].extended_housing = std::move(r.housing_degC);
    report.plots[first + l].extended_core = std::move(r.core_degC);
  }
}

double stated_error(double value, double std_error) {
  // Whole boards whose winding is read all the time: R1 and C1 came out 1.2 and 1.4 percent too small (gain --clean
  // --thermocouple, seeds 5101 to 5106, both excitations) with errors of 0.2 to 0.6; teeth are no node of the model.
  constexpr double form_share = 0.015;
  return std::hypot(std_error, form_share * value);
}

std::string stated_unit(const Problem& problem, const char* unit, Scale scale) {
  if (problem.belief.known || problem.heated_by_power()) return unit;
  switch (scale) {
    case Scale::core_resistance:
    case Scale::sink_resistance:
      return fmt::format("{} x ohm", unit);
    case Scale::heat:
    case Scale::heat_per_drive:
    case Scale::sink_conductance:
    case Scale::core_capacity:
    case Scale::housing_capacity:
      return fmt::format("{} / ohm", unit);
    case Scale::one:
    case Scale::rms_current:
    case Scale::duration:
    case Scale::speed08:
      break;
  }
  return unit;
}

std::vector<ParameterLine> base_lines(const Problem& problem, const Fit& f, double inflation) {
  std::vector<ParameterLine> out;
  const Eigen::VectorXd sd = f.std_errors();
  for (int i = 0; i < base_count; ++i) {
    ParameterLine line{base_names[i],
                       stated_unit(problem, base_units[i], base_scales[i]),
                       std::exp(f.x[i]),
                       0,
                       false,
                       f.at_bound[static_cast<std::size_t>(i)]};
    const double of_log = sd[i] * inflation;
    line.std_error = stated_error(line.value, line.value * std::min(of_log, 10.0));
    line.determined = sd_from_data(f, i) * inflation < determined_sd && of_log < determined_sd;
    out.push_back(line);
  }
  return out;
}

std::string core_refusal(const Problem& problem, const Fit& f) {
  if (problem.any_core()) return "";
  if (problem.belief.copper_per_K == 0) {
    return "The winding temperature cannot be found from the housing alone when the heat does not depend on the "
           "winding: the housing fixes only R2, R1 C1 + R2 (C1 + C2) and R1 C1 R2 C2, three numbers for four unknowns. "
           "No winding temperature is stated; record core_degC now and then.";
  }
  const double sd = sd_from_data(f, 0);
  if (sd < 1) return "";
  return fmt::format(
      "This log does not determine R1 (known to a factor of {:.0f}): no winding temperature is stated; record "
      "core_degC now and then, or load the motor until it is hot.",
      std::exp(std::min(sd, 6.0)));
}

Fit fit_baseline(const Problem& problem) {
  Fit f = fit(problem, {});
  if (!f.valid()) {
    wire::pc::refuse_data(fmt::format(
        "{}: no motor{} could be so heated and stay so cool; check the units of current and "
        "time, {}.",
        problem.logs.front().name, problem.belief.known ? " near this sheet" : "",
        problem.belief.known ? "whether columns are swapped, and --motor" : "and whether columns are swapped"));
  }
  return f;
}

void judge_baseline(const Problem& problem, const Fit& f, double judged_ratio, const std::vector<Log>& logs,
                    const std::optional<wire::pc::MotorFile>& motor, Report& report) {
  report.motor = problem.belief.known ? problem.belief.motor : "unknown";
  for (const Bins& log : problem.logs) {
    for (const std::string& note : log.notes) {
      const bool of_all = std::all_of(problem.logs.begin(), problem.logs.end(), [&](const Bins& other) {
        return std::find(other.notes.begin(), other.notes.end(), note) != other.notes.end();
      });
      if (!of_all)
        report.notes.push_back(log.name + ": " + note);
      else if (&log == &problem.logs.front())
        report.notes.push_back(note);
    }
  }
  if (!problem.belief.known) {
    report.notes.push_back(
        problem.heated_by_power()
            ? "No motor file was given: the starting values come from the data, and priors are a factor of ten wide."
            : "No motor file was given: the winding's resistance is taken as 1 ohm (it stands for 3/4 of the "
              "resistance between two terminals, 3/2 of a phase's) and its coefficient as copper's; R1 and R2 come out "
              "multiplied by the true one in ohm, C1 and C2 divided by it. Priors are a factor of ten wide.");
  }
  report.structure = structure(problem, f);
  report.baseline_rmse = rmse_of(problem, f);
  const double inflation = std::max(1.0, report.structure.residual.ratio);
  report.baseline = base_lines(problem, f, inflation);
  report.core_refusal = core_refusal(problem, f);
  const auto loose = directions(f);
  const bool bounded =
      std::any_of(report.baseline.begin(), report.baseline.end(), [](const auto& l) { return l.at_bound; });
  bool identifiable = true;
  for (const Loose& direction : loose) {
    if (direction.sd * inflation < determined_sd) continue;
    identifiable = false;
    Loose inflated = direction;
    inflated.sd *= inflation;
    report.loose.push_back(in_words(inflated));
  }
  // A right model leaves 1; the noise that is believed may be too small by some. Chosen.
  constexpr double noise_alone = 1.3;
  const double left = report.structure.residual.ratio;
  const auto right = [](double ratio) { return ratio < noise_alone; };
  report.needs_leeway = !right(left) && judged_ratio > 0 && right(judged_ratio);
  const bool residual = right(left) || report.needs_leeway;
  report.converged = f.settled && residual && identifiable && !bounded;
  report.checks = {fmt::format("gradient: {} after {} iterations", f.settled ? "at rest" : "NOT at rest", f.iterations),
                   fmt::format("residual: {:.2f} times the noise{}", left,
                               report.needs_leeway ? fmt::format(", {:.2f} beside {}", judged_ratio, leeway_words)
                               : residual          ? ""
                                                   : ", so the model is not right yet"),
                   identifiable && bounded ? "identifiability: a parameter stands at its bound; this is another motor"
                   : identifiable          ? "identifiability: all four parameters are determined by this data"
                                  : fmt::format("identifiability: {} of 4 directions are not determined by this data",
                                                report.loose.size())};

  // Is copper's coefficient a gain at all? Where it is not, two errors cancel, and neither is small.
  if (!problem.heated_by_power() && problem.belief.copper_per_K > 0) {
    report.variants.push_back(
        {fmt::format("resistance grows with temperature ({:.5f} per K)", problem.belief.copper_per_K),
         report.baseline_rmse});
    Problem constant = problem_of(logs, motor, 0.0);
    constant.leeway = ordinary_leeway(constant, f);
    report.variants.push_back({"resistance constant", rmse_of(constant, closest(constant, fit(constant, {}, {&f})))});
  }
  add_plots(problem, f, "", report);
}

void compare_with_sheet(const Problem& problem, const std::vector<ParameterLine>& lines, bool extended,
                        Report& report) {
  constexpr double much = 4;  // shipped motors had 1.8 times their sheet's R1; R2 and C2 are the mount's as well
  const auto far = [&](const ParameterLine& line, double sheet) {
    return problem.belief.known && line.determined && std::abs(std::log(line.value / sheet)) > std::log(much);
  };
  const std::pair<std::size_t, double> compared[] = {{0, problem.belief.R1_K_per_W}, {2, problem.belief.C1_J_per_K}};
  for (const auto& [i, sheet] : compared) {
    const ParameterLine &line = lines[i], &bent = report.baseline[i];
    if (far(line, sheet) && !line.at_bound)
      report.notes.push_back(fmt::format("{} comes out {:.2g} times the sheet's; see whether {} is this motor.",
                                         line.name, line.value / sheet, problem.belief.motor));
    else if (extended && far(bent, sheet))
      report.notes.push_back(
          fmt::format("Two resistors alone take {} for {:.2g} times the sheet's: they are bent by what "
                      "is missing, and no motor to compare a board's gain with.",
                      bent.name, bent.value / sheet));
  }
  // A mount cools, and adds mass: no one does the opposite of both.
  const double R2 = lines[1].value / problem.belief.R2_K_per_W, C2 = lines[3].value / problem.belief.C2_J_per_K;
  if (far(lines[1], problem.belief.R2_K_per_W) && far(lines[3], problem.belief.C2_J_per_K) && R2 > 1 && C2 < 1)
    report.notes.push_back(
        fmt::format("R2 comes out {:.2g} times the sheet's and C2 {:.2g} times, as of a smaller motor, or of a current "
                    "that is read {:.2g} times too small; see the current's unit, and whether {} is this motor.",
                    R2, C2, std::pow(R2 / C2, 0.25), problem.belief.motor));
  // A large flange takes four fifths of it away (a maker's word, recalled), and the sheet may be off as R1's are.
  constexpr double coolest = 1 / (5 * 1.8);
  if (far(lines[1], problem.belief.R2_K_per_W) && R2 < coolest)
    report.notes.push_back(fmt::format(
        "R2 comes out {:.2g} times the sheet's, less than a flange leaves of it: see whether the sensor sits "
        "on the motor, and not on its controller or on what cools it.",
        R2));
}

}  // namespace identify

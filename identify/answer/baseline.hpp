// SPDX-License-Identifier: MIT
// The two-resistor model alone: fitted, judged, and said in words. What the search for causes starts from.
#pragma once

#include <optional>

#include "identify/answer/report.hpp"
#include "wire/pc/motor_file.hpp"

namespace identify {

/// Two resistors fitted by themselves. Throws UserError (unusable) where no such motor can be.
Fit fit_baseline(const Problem& problem);

/// Fills the baseline part of the report (parameters, errors, structure, identifiability, variants, plots) from `fit`.
/// `judged_ratio`: of what the search saw it leave to the noise, beside what no motor is without; 0: no search.
void judge_baseline(const Problem& problem, const Fit& fit, double judged_ratio, const std::vector<Log>& logs,
                    const std::optional<wire::pc::MotorFile>& motor, Report& report);

/// Appends what was measured and what this fit simulates, log by log.
void add_plots(const Problem& problem, const Fit& fit, const std::string& remark, Report& report);

/// The same for the extended model, into plots that are there already, from the first-th on.
void add_extended(const Problem& problem, const Fit& fit, Report& report, std::size_t first);

/// Standard error to state of a parameter, from that of its fit: no motor is a network of a few nodes.
double stated_error(double value, double std_error);

/// Unit of a parameter that goes by `scale`: without a sheet the resistance is taken as 1 ohm, and heat comes out
/// divided by the true one.
std::string stated_unit(const Problem& problem, const char* unit, Scale scale);

/// R1, R2, C1 and C2. `inflation`: of the standard errors, where the model leaves more than noise.
std::vector<ParameterLine> base_lines(const Problem& problem, const Fit& fit, double inflation);

/// Notes an R1 or a C1 far off the sheet. Two resistors that miss much may exchange their masses: `lines` are of the
/// model found where one explains (`extended`), and theirs are then said beside it.
void compare_with_sheet(const Problem& problem, const std::vector<ParameterLine>& lines, bool extended, Report& report);

/// Why no winding temperature may be stated, empty when it may.
std::string core_refusal(const Problem& problem, const Fit& fit);

}  // namespace identify

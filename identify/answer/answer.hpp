// SPDX-License-Identifier: MIT
// What was found, as a report tells it: sentence, ladder, causes with their rivals, and what to bear in mind.
#pragma once

#include "identify/answer/report.hpp"

namespace identify {

std::string listed(const std::vector<std::string>& ids, const char* between);

std::vector<std::string> noise_words(const Problem& problem);

/// The parameters of the which-th chosen cause, in its units.
std::vector<ParameterLine> cause_lines(const Problem& problem, const Fit& fit, std::size_t which);

/// Into the report: verdict, reasoning, ladder, causes, and notes on what the logs leave out.
void tell(const Problem& problem, const Found& found, const std::vector<Log>& logs, Report& report);

/// And the sentence, which needs the errors and causes that stand there.
void say(const Problem& problem, const Found& found, Report& report);

/// The sentence where there is no verdict, without the reason; `misses`: two resistors do, more than noise explains.
std::string no_verdict(const Report& report, std::size_t logs, bool misses);

/// Each log by its file alone, and by as many of the folders above it as tell it from the others.
void shorten_names(std::vector<LogPlot>& plots);

}  // namespace identify

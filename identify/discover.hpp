// SPDX-License-Identifier: MIT
// From logs to a report: fit, judge, name, extend, measure the gain.
#pragma once

#include "identify/baseline.hpp"
#include "identify/search.hpp"

namespace identify {

/// The search, and again with a more doubtful housing where the winding's readings contradict the model it chose. A
/// motor is more than two nodes: thousands of housing readings would otherwise overrule, by that error of the model,
/// the few of the winding, and a push burns a winding whose capacity is wrong. Raises problem.noise.housing_slow_K.
Search concluded(Problem& problem, const Margins& margins = {}, const std::vector<std::string>& without = {});

/// The parameters of the which-th chosen cause, in its units.
std::vector<ParameterLine> cause_lines(const Problem& problem, const Fit& fit, std::size_t which);

Report discover(const std::vector<Log>& logs, const std::optional<wire::pc::MotorFile>& motor,
                const HoldOut& hold_out = {});

}  // namespace identify

// SPDX-License-Identifier: MIT
// From logs to a report: fit, judge, name, extend, measure the gain.
#pragma once

#include "identify/baseline.hpp"
#include "identify/doing.hpp"

namespace identify {

/// The parameters of the which-th chosen cause, in its units.
std::vector<ParameterLine> cause_lines(const Problem& problem, const Fit& fit, std::size_t which);

Report discover(const std::vector<Log>& logs, const std::optional<wire::pc::MotorFile>& motor,
                const HoldOut& hold_out = {}, const Tell& doing = tell_nobody);

}  // namespace identify

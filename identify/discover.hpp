// SPDX-License-Identifier: MIT
// From logs to a report: fit, judge, name, extend, measure the gain.
#pragma once

#include <optional>

#include "identify/answer/held_out.hpp"
#include "identify/search/doing.hpp"
#include "wire/pc/motor_file.hpp"

namespace identify {

/// All that `identify` says of logs that are fitted together; `hold_out`: what is scored and not fitted. Throws
/// wire::pc::UserError (unusable) where the logs cannot be read together, or one has too few rows.
Report discover(const std::vector<Log>& logs, const std::optional<wire::pc::MotorFile>& motor,
                const HoldOut& hold_out = {}, const Tell& doing = tell_nobody);

}  // namespace identify

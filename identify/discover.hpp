// SPDX-License-Identifier: MIT
// From logs to a report: fit, judge, name, extend, measure the gain.
#pragma once

#include "identify/baseline.hpp"

namespace identify {

Report discover(const std::vector<Log>& logs, const std::optional<wire::pc::MotorFile>& motor,
                const HoldOut& hold_out = {});

}  // namespace identify

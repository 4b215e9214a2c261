// SPDX-License-Identifier: MIT
// A recording that was interrupted: what flowed meanwhile is not known, so what follows is a log of its own.
#pragma once

#include <vector>

#include "identify/log.hpp"

namespace identify {

/// The parts of a log between its pauses, each with time from 0, or the log itself where there is none. A pause is
/// where nothing tells the heat input: no rows, empty cells, or a current that is noisy elsewhere and stands still.
std::vector<Log> parts_between_pauses(Log log);

}  // namespace identify

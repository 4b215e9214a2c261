// SPDX-License-Identifier: MIT
// Why a log gets no verdict: one plain sentence each, empty where there is no reason.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "identify/search/search.hpp"
#include "wire/pc/motor_file.hpp"

namespace identify {

/// Why a log cannot bear a verdict; empty when it can.
std::string too_poor(const Problem& problem, const std::vector<Log>& logs);

/// Shorter than the housing's time constant, or too short or of too even a load for what was found? Empty when not.
std::string too_short(const Problem& problem, const Found& found);

/// What is wrong with the recording rather than with the motor, seen only after the search; empty when nothing is.
std::string suspicion(const Problem& problem, const Found& found, const std::vector<Log>& logs,
                      const std::optional<wire::pc::MotorFile>& motor);

/// Does a winding that is too heavy stand for another mass, the housing or none of this motor's? Empty when not. Asked
/// last: degrees of another size and a load that is not what flowed make a winding heavy too.
std::string masses_in_each_others_place(const Problem& problem, const Found& found, const std::vector<Log>& logs,
                                        const std::optional<wire::pc::MotorFile>& motor);

}  // namespace identify

// SPDX-License-Identifier: MIT
// How often the answers to logs are what was hidden in them: identify --score.
#pragma once

#include <functional>
#include <optional>

#include "identify/answer/report.hpp"
#include "wire/pc/motor_file.hpp"

namespace identify {

using ReadLogs = std::function<std::vector<Log>(const std::string& path)>;

/// Answers each log by itself, and only then opens its truth (host-sim record --hide writes it: { "causes": [ { "id":
/// ... } ] }): prints one line a log, then how often each outcome came, and what was taken for what. Throws
/// wire::pc::UserError where truths are missing.
void score_logs(const std::vector<std::string>& logs, const std::vector<std::string>& truths, const ReadLogs& read,
                const std::optional<wire::pc::MotorFile>& motor);

}  // namespace identify

// SPDX-License-Identifier: MIT
// What a test gives identify: bench logs as it reads them, and the sheet of the motor that they are of.
#pragma once

#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "identify/log/log.hpp"
#include "identify/log/table.hpp"
#include "tests/identify/bench_log.hpp"
#include "wire/pc/motor_file.hpp"

namespace tests {

/// The EC 16 that a BenchMotor is, if nothing else is said.
inline wire::pc::MotorFile ec_16() { return wire::pc::read_motor("ec-16-40w", HOTCORE_SOURCE_DIR "/boards/motors"); }

inline std::vector<identify::Log> read_log(const std::string& path) {
  return identify::logs_of(identify::read_table(path), {}, std::nullopt);
}

inline std::vector<identify::Log> bench_logs(std::initializer_list<BenchOptions> each) {
  std::vector<identify::Log> out;
  for (const BenchOptions& options : each) out.push_back(read_log(write_bench_log("bench.csv", options)).front());
  return out;
}

}  // namespace tests

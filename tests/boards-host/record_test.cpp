// SPDX-License-Identifier: MIT
#include "boards/host/record.hpp"

#include <gtest/gtest.h>

namespace {

using boards::host::record;
using boards::host::RecordOptions;

RecordOptions options_of(const std::string& excitation, std::uint64_t seed, std::uint64_t hide) {
  return {.excitation = excitation,
          .minutes = 0.2,
          .seed = seed,
          .hide = hide,
          .motor_folder = HOTCORE_SOURCE_DIR "/boards/motors",
          .scene_folder = HOTCORE_SOURCE_DIR "/host-sim/scenes"};
}

TEST(Record, AHiddenMotorIsTheSameWhateverIsRecordedOfIt) {
  const auto duty = record(options_of("duty", 1, 7)), designed = record(options_of("designed", 2, 7));
  EXPECT_EQ(duty.truth_json, designed.truth_json);
  EXPECT_NE(duty.truth_json.find("\"unit\": \"typical sizes\""), std::string::npos) << duty.truth_json;
  EXPECT_NE(duty.log_csv, designed.log_csv);
  EXPECT_NE(duty.truth_json, record(options_of("duty", 1, 8)).truth_json);
}

}  // namespace

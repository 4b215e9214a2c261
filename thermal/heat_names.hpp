// SPDX-License-Identifier: MIT
// The words of a heat set in files: one name for each drive, boundary and law, in the order of their enums.
#pragma once

#include <iterator>

#include "thermal/heat_set.hpp"

namespace thermal {

inline constexpr const char* drive_names[] = {"one",
                                              "phase_a_A2",
                                              "phase_b_A2",
                                              "phase_c_A2",
                                              "current_A2",
                                              "current_A",
                                              "speed_rad_per_s",
                                              "speed2_rad2_per_s2",
                                              "speed3_rad3_per_s3",
                                              "current2_speed2",
                                              "current_speed",
                                              "enabled",
                                              "power_W",
                                              "speed_to_0_8"};
static_assert(std::size(drive_names) == drive_count);
inline constexpr const char* boundary_names[] = {"ambient", "coolant", "frame", "neighbour"};
static_assert(std::size(boundary_names) == boundary_count);
inline constexpr const char* law_names[] = {"constant", "speed", "natural_convection", "radiation", "temperature"};
static_assert(std::size(law_names) == static_cast<std::size_t>(LinkLaw::count));

}  // namespace thermal

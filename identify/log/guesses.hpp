// SPDX-License-Identifier: MIT
// What a column may be that nobody mapped, by its name, and what to say of it.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "identify/log/column_map.hpp"

namespace identify {

/// Effective values: "motor_rms_current", "I [Arms]".
bool named_rms(const std::string& name);
/// The unit to be said with them, as ":1.2247A": sinusoidal currents heat by 3/2 of their rms squared what current_A
/// heats; their amplitude is the root of two of it.
const char* rms_unit(Role role);
/// Turns of the field, not of the shaft.
bool named_electrical(const std::string& name);

/// Columns that nothing needs, and that would tell more.
void note_unused_columns(const Table& table, const std::map<Role, Source>& found, std::vector<std::string>& notes);

/// Columns that were mapped, and whose names speak against it.
void note_doubtful_columns(const Table& table, const std::map<Role, Source>& found, std::vector<std::string>& notes);

/// All that is missing at once, each with the column that its name speaks for, and with what else is of use. Throws
/// UserError (unusable) if anything is; `by_row`: no clock is needed; `map`: one that came along and fits, if any.
void refuse_without_columns(const Table& table, const std::map<Role, Source>& found, bool by_row,
                            const std::string& map);

}  // namespace identify

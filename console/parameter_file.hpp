// SPDX-License-Identifier: MIT
// Parameters of a board as a file that people read and edit (TOML): [board] says whose they are, [axis0], [axis1] and
// [common] hold "name_unit = value"; what is an axis' own means both axes in [common]. NaN (unset) is written as nan.
#pragma once

#include <string>
#include <vector>

#include "console/session.hpp"

namespace console {

/// The whole file for the values in force.
std::string parameter_file(const Session& session, const std::vector<Target>& targets,
                           const std::vector<float>& values);

struct ParameterFile {
  std::string board;  // "h8-15d 3A00C5": whose it says it is; empty where [board] does not say
  std::vector<Assignment> assignments;
};

/// What a file assigns, checked against what the board declares: a name that it does not have, a value outside its
/// range or no number is refused with the file, the name and what would be right (UserError, usage). Nothing is sent.
ParameterFile read_parameter_file(const std::string& path, const Dictionary& dictionary);

/// Throws UserError (usage) unless the value fits the range that the board declares.
void check(const Assignment& assignment, const std::string& where);

/// Throws UserError (usage) where a parameter of an axis has two values, of which either may be meant.
void check_each_once(const std::vector<Assignment>& assignments, const std::string& where);

/// CRC-32 over ids, axes and values: two boards with the same hash run the same parameters.
std::uint32_t hash_of(const std::vector<Target>& targets, const std::vector<float>& values);

}  // namespace console

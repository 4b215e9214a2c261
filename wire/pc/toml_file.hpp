// SPDX-License-Identifier: MIT
// Finding and parsing the small TOML files that people write: motors, scenes.
#pragma once

#include <toml++/toml.h>

#include <string>
#include <vector>

namespace wire::pc {

/// Names (without ending) of the TOML files in a folder, sorted.
std::vector<std::string> toml_names(const std::string& folder);

/// `which` is a path ending in .toml or the name of a file in `folder`; `kind` ("motor") is for the sentence.
/// Throws UserError (usage) when there is no such file, naming the nearest.
std::string find_toml(const std::string& kind, const std::string& which, const std::string& folder);

/// A file of another kind ("heat model", "motor", "scene", "parameter file") is refused with what takes it: UserError
/// (usage).
void need_kind(const std::string& kind, const std::string& path, const toml::table& file);

/// Throws UserError (usage) where there is no such file, and with file and line for broken TOML.
toml::table parse_toml(const std::string& path);

}  // namespace wire::pc

// SPDX-License-Identifier: MIT
#include "wire/pc/toml_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "wire/pc/names.hpp"
#include "wire/pc/user_error.hpp"

namespace wire::pc {

namespace fs = std::filesystem;

std::vector<std::string> toml_names(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder, none)) {
    if (entry.path().extension() == ".toml") names.push_back(entry.path().stem().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

std::string find_toml(const std::string& kind, const std::string& which, const std::string& folder) {
  if (which.size() > 5 && which.substr(which.size() - 5) == ".toml") {
    if (fs::is_regular_file(which)) return which;
    refuse(fmt::format("{}: there is no such {} file; check the path.", which, kind));
  }
  const std::string path = folder + "/" + which + ".toml";
  if (which.find('/') == std::string::npos && fs::is_regular_file(path)) return path;
  const std::vector<std::string> known = toml_names(folder);
  const std::string hint = did_you_mean(which, known);
  refuse(
      fmt::format("Unknown {} '{}'{} There are: {}.", kind, which, hint.empty() ? "." : hint, fmt::join(known, ", ")));
}

toml::table parse_toml(const std::string& path) {
  try {
    return toml::parse_file(path);
  } catch (const toml::parse_error& error) {
    refuse(fmt::format("{}: line {}: {}; mend the file.", path, error.source().begin.line, error.description()));
  }
}

}  // namespace wire::pc

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
  std::error_code none;
  // What lies in the working folder may be anything.
  const std::vector<std::string> known = folder == "." ? std::vector<std::string>{} : toml_names(folder);
  const std::string named = known.empty() ? "" : fmt::format(", or one of: {}", fmt::join(known, ", "));
  const std::string where = known.empty() && folder != "." ? " in " + folder : "";
  if (which.size() > 5 && which.substr(which.size() - 5) == ".toml") {
    if (fs::is_regular_file(which, none)) return which;
    refuse(fmt::format("{}: there is no such {} file; check the path.", which, kind));
  }
  const std::string path = folder + "/" + which + ".toml";
  const bool is_path = which.find('/') != std::string::npos;
  if (!is_path && fs::is_regular_file(path, none)) return path;  // beside a folder of the same name, which runs leave
  if (fs::is_directory(which, none)) refuse(fmt::format("{}: this is a folder; give a .toml file{}.", which, named));
  if (fs::exists(which, none))
    refuse(fmt::format("{}: this is no {} file, those end in .toml; give one{}.", which, kind, named));
  const std::string hint = did_you_mean(which, known);
  if (is_path || known.empty())
    refuse(fmt::format("{}: there is no such {}{}; give a .toml file{}.", which, kind, where, named));
  refuse(
      fmt::format("Unknown {} '{}'{} There are: {}.", kind, which, hint.empty() ? "." : hint, fmt::join(known, ", ")));
}

void need_kind(const std::string& kind, const std::string& path, const toml::table& file) {
  struct Known {
    const char *kind, *key, *advice;
  };
  constexpr Known all[] = {
      {"heat model", "node", "'host-sim run SCENE --set trust=identified --set model={}' takes it"},
      {"motor", "terminal_resistance_ohm",
       "'--motor {0}' of identify and of host-sim record, '--set motor={0}' of "
       "host-sim run take it"},
      {"scene", "demand", "'host-sim run {}' takes it"},
      {"parameter file", "axis0", "'hotcore restore {}' takes it"}};
  for (const Known& other : all) {
    if (kind == other.kind || !file.contains(other.key)) continue;
    refuse(fmt::format("{}: this is a {} and no {}; {}.", path, other.kind, kind,
                       fmt::format(fmt::runtime(other.advice), path)));
  }
}

toml::table parse_toml(const std::string& path) {
  std::error_code none;
  if (!fs::exists(path, none)) refuse(path + ": there is no such file; check the path.");
  if (fs::is_directory(path, none)) refuse(path + ": this is a folder; name a file in it.");
  try {
    return toml::parse_file(path);
  } catch (const toml::parse_error& error) {
    refuse(fmt::format("{}: line {}: {}; mend the file.", path, error.source().begin.line, error.description()));
  }
}

}  // namespace wire::pc

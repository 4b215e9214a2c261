// SPDX-License-Identifier: MIT
// Map files (identify/maps/*.toml).
#include <fmt/format.h>
#include <toml++/toml.h>

#include <cmath>
#include <filesystem>

#include "identify/log.hpp"
#include "wire/pc/names.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {

using wire::pc::Exit;
using wire::pc::UserError;

ColumnMap read_map(const std::string& path) {
  if (!std::filesystem::is_regular_file(path)) {
    throw UserError(Exit::usage, path + ": there is no such map file; the ones that come along are in identify/maps.");
  }
  toml::table file;
  try {
    file = toml::parse_file(path);
  } catch (const toml::parse_error& error) {
    throw UserError(Exit::usage, fmt::format("{}, line {}: {}; repair the map.", path, error.source().begin.line,
                                             error.description()));
  }
  for (const auto& [key, unused] : file) {
    if (key.str() != "columns" && key.str() != "note" && key.str() != "period_s") {
      throw UserError(Exit::usage,
                      fmt::format("{}: unknown key '{}'{} (a map holds [columns], note and period_s).", path, key.str(),
                                  wire::pc::did_you_mean(key.str(), {"columns", "note", "period_s"})));
    }
  }
  ColumnMap map;
  map.note = file["note"].value_or(std::string());
  if (file.contains("period_s")) {
    map.period_s = file["period_s"].value_or(missing);
    if (!(map.period_s > 0) || std::isinf(map.period_s))
      throw UserError(Exit::usage, path + ": period_s: write the seconds from row to row, such as 0.5.");
  }
  const toml::table* columns = file["columns"].as_table();
  if (columns == nullptr)
    throw UserError(Exit::usage, path + ": [columns] is missing; write lines such as housing_degC = \"T_body\".");
  for (const auto& [role, value] : *columns) {
    const std::string name(role.str());
    std::string text;
    if (const auto* plain = value.as_string()) text = plain->get();
    if (const auto* table = value.as_table()) {
      for (const auto& [key, unused] : *table) {
        if (key.str() != "column" && key.str() != "unit") {
          throw UserError(Exit::usage,
                          fmt::format("{}: {}: unknown key '{}'; known are column and unit.", path, name, key.str()));
        }
      }
      text = (*table)["column"].value_or(std::string());
      if (const auto unit = (*table)["unit"].value<std::string>()) text += ":" + *unit;
    }
    if (text.empty())
      throw UserError(Exit::usage,
                      fmt::format("{}: {}: write \"column\" or {{ column = \"...\", unit = \"rpm\" }}.", path, name));
    add_column(map, name + "=" + text, path + ": ");
  }
  return map;
}

}  // namespace identify

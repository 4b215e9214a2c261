// SPDX-License-Identifier: MIT
#include "boards/host/heat_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "thermal/core_estimator.hpp"
#include "thermal/heat_names.hpp"
#include "thermal/validate.hpp"
#include "wire/pc/names.hpp"
#include "wire/pc/toml_file.hpp"
#include "wire/pc/user_error.hpp"

namespace boards::host {
namespace {

using wire::pc::refuse;

void known_keys(const std::string& place, const toml::table& table, const std::vector<std::string>& known) {
  for (const auto& [key, node] : table) {
    const std::string name{key.str()};
    bool found = false;
    for (const std::string& k : known) found = found || k == name;
    if (!found) refuse(fmt::format("{}: unknown key '{}'{}", place, name, wire::pc::did_you_mean(name, known)));
  }
}

double number(const std::string& place, const toml::table& table, const char* key, double otherwise) {
  const double value = table[key].value_or(otherwise);
  if (std::isnan(value)) refuse(fmt::format("{}: '{}' is missing or not a number.", place, key));
  return value;
}

template <std::size_t N>
int named(const std::string& place, const toml::table& table, const char* key, const char* const (&names)[N]) {
  const std::string text = table[key].value_or(std::string());
  for (std::size_t i = 0; i < N; ++i) {
    if (text == names[i]) return static_cast<int>(i);
  }
  refuse(fmt::format("{}: {} = '{}' is not known{}", place, key, text,
                     wire::pc::did_you_mean(text, {std::begin(names), std::end(names)})));
}

/// A node number, or the name of a boundary.
std::int8_t end_of(const std::string& place, const toml::table& table, const char* key) {
  if (const auto node = table[key].value<int>())
    return static_cast<std::int8_t>(std::clamp(*node, -1, thermal::first_boundary - 1));
  return thermal::boundary_end(static_cast<thermal::Boundary>(named(place, table, key, thermal::boundary_names)));
}

constexpr double required = std::numeric_limits<double>::quiet_NaN();

/// Calls `take(place, table)` for each table of a list, at most `most` times.
template <class Take>
int each(const std::string& path, const toml::table& file, const char* name, int most, Take take) {
  const toml::array* list = file[name].as_array();
  if (list == nullptr)
    refuse(fmt::format("{}: there is no [[{}]]; let identify --write-model write the file.", path, name));
  if (static_cast<int>(list->size()) > most)
    refuse(fmt::format("{}: more than {} [[{}]] do not fit the board.", path, most, name));
  int count = 0;
  for (const toml::node& node : *list) {
    const std::string place = fmt::format("{}: {} {}", path, name, count);
    if (!node.is_table()) refuse(place + " must be a table.");
    take(place, *node.as_table(), count++);
  }
  return count;
}

}  // namespace

HeatModel read_heat_model(const std::string& path) {
  const std::string found = wire::pc::find_toml("heat model", path, ".");
  const toml::table file = wire::pc::parse_toml(found);
  wire::pc::need_kind("heat model", found, file);
  known_keys(path, file, {"format", "motor", "node", "link", "source", "housing_sensor", "trust", "recording"});
  if (file["format"].value_or(0) != 1) refuse(path + ": format must be 1; write the model again with this identify.");

  thermal::HeatSet<double> set{};
  set.node_count =
      each(path, file, "node", thermal::max_nodes, [&](const std::string& place, const toml::table& t, int i) {
        known_keys(place, t, {"capacity_J_per_K", "max_degC"});
        set.nodes[i] = {number(place, t, "capacity_J_per_K", required),
                        static_cast<float>(number(place, t, "max_degC", std::numeric_limits<double>::infinity()))};
      });
  set.link_count =
      each(path, file, "link", thermal::max_links, [&](const std::string& place, const toml::table& t, int i) {
        known_keys(place, t, {"from", "to", "law", "conductance_W_per_K", "k"});
        set.links[i] = {end_of(place, t, "from"), end_of(place, t, "to"),
                        static_cast<thermal::LinkLaw>(named(place, t, "law", thermal::law_names)),
                        number(place, t, "conductance_W_per_K", required), number(place, t, "k", 0)};
      });
  set.source_count =
      each(path, file, "source", thermal::max_sources, [&](const std::string& place, const toml::table& t, int i) {
        known_keys(place, t, {"node", "drive", "gain", "coefficient_per_K"});
        set.sources[i] = {static_cast<std::int8_t>(number(place, t, "node", required)),
                          static_cast<thermal::Drive>(named(place, t, "drive", thermal::drive_names)),
                          number(place, t, "gain", required), number(place, t, "coefficient_per_K", 0)};
      });
  const toml::table empty;
  const toml::table& sensor = file["housing_sensor"].is_table() ? *file["housing_sensor"].as_table() : empty;
  known_keys(path + ": housing_sensor", sensor, {"node", "lag_s", "offset_K", "gain_error"});
  set.housing = {static_cast<std::int8_t>(number(path + ": housing_sensor", sensor, "node", required)),
                 number(path, sensor, "lag_s", 0), number(path, sensor, "offset_K", 0),
                 number(path, sensor, "gain_error", 0)};

  // Enamelled wire ends with class 240 (IEC 60317-46).
  constexpr float most_degC = 250;
  int limited = 0;
  for (int i = 0; i < set.node_count; ++i) {
    const float limit_degC = set.nodes[i].max_degC;
    limited += std::isfinite(limit_degC);
    if (std::isfinite(limit_degC) && !(limit_degC <= most_degC))
      refuse(fmt::format("{}: node {}: max_degC = {:g} is no limit of a winding; give {:g} or less.", path, i,
                         limit_degC, most_degC));
  }
  if (limited == 0) refuse(path + ": no node has a max_degC, so nothing would be protected; give the windings theirs.");
  const thermal::SetCheck check = thermal::validate(set, thermal::estimator_dt_s);
  if (!check.ok()) {
    refuse(
        fmt::format("{}: the network cannot be used (problem {} at entry {}); see SetProblem in thermal/validate.hpp.",
                    path, static_cast<int>(check.problem), check.index));
  }

  // A board measures no power: such a winding would stay cold whatever flows, and nothing would be limited.
  const bool heated = std::any_of(set.sources, set.sources + set.source_count,
                                  [](const thermal::Source<double>& s) { return thermal::is_current_square(s.drive); });
  if (!heated)
    refuse(path + ": no current heats it, and a board measures no power; record the current and identify again.");

  HeatModel model{file["motor"].value_or(std::string()), set, {}};
  if (const toml::table* trust = file["trust"].as_table()) {
    const std::string place = path + ": trust";
    known_keys(place, *trust, {"power", "inner_resistance", "cooling", "correlation"});
    const auto within = [&](const char* key, double least, double otherwise) {
      const double value = number(place, *trust, key, otherwise);
      if (!(value >= least && value <= 1))
        refuse(fmt::format("{}: {} = {} is not between {:g} and 1.", place, key, value, least));
      return static_cast<float>(value);
    };
    const auto share = [&](const char* key) { return within(key, 0, required); };
    model.trust = thermal::Trust{share("power"), share("inner_resistance"), share("cooling"),
                                 within("correlation", -1, static_cast<double>(thermal::Trust{}.correlation))};
  }
  return model;
}

}  // namespace boards::host

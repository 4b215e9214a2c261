// SPDX-License-Identifier: MIT
#include "boards/host/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>

#include "wire/pc/names.hpp"
#include "wire/pc/toml_file.hpp"
#include "wire/pc/user_error.hpp"

namespace boards::host {
namespace {

namespace fs = std::filesystem;
using wire::pc::did_you_mean;
using wire::pc::refuse;

constexpr std::pair<const char*, Limiter> limiter_names[] = {{"governor", Limiter::governor},
                                                             {"rated", Limiter::rated},
                                                             {"housing", Limiter::housing},
                                                             {"hard_cut", Limiter::hard_cut},
                                                             {"oracle", Limiter::oracle}};

/// Where a key of a table goes: a text, or a number with the range it must lie in.
struct Number {
  double* value;
  double low, high;
};
struct Slots {
  std::map<std::string, std::string*> texts;
  std::map<std::string, Number> numbers;
  std::vector<std::string> others;  // tables and lists, read elsewhere
};

void put_number(const std::string& place, const std::string& key, const Number& slot, double value) {
  if (!std::isgreaterequal(value, slot.low) || !std::islessequal(value, slot.high)) {  // quiet for NaN
    refuse(fmt::format("{}: {} = {} is out of range; give {} to {}.", place, key, value, slot.low, slot.high));
  }
  *slot.value = value;
}

void read_table(const std::string& place, const toml::table& table, const Slots& slots) {
  for (const auto& [toml_key, node] : table) {
    const std::string key{toml_key.str()};
    if (const auto text = slots.texts.find(key); text != slots.texts.end()) {
      const auto value = node.value<std::string>();
      if (!value) refuse(fmt::format("{}: '{}' must be a text in quotes.", place, key));
      *text->second = *value;
    } else if (const auto number = slots.numbers.find(key); number != slots.numbers.end()) {
      const auto value = node.value<double>();
      if (!value) refuse(fmt::format("{}: '{}' must be a number.", place, key));
      put_number(place, key, number->second, *value);
    } else if (std::find(slots.others.begin(), slots.others.end(), key) == slots.others.end()) {
      std::vector<std::string> known = slots.others;
      for (const auto& [name, slot] : slots.texts) known.push_back(name);
      for (const auto& [name, slot] : slots.numbers) known.push_back(name);
      const std::string hint = did_you_mean(key, known);
      refuse(fmt::format("{}: unknown key '{}'{}", place, key,
                         hint.empty() ? fmt::format("; known keys: {}.", fmt::join(known, ", ")) : hint));
    }
  }
}

/// What stands there as a table or a list, null if nothing does: of another kind it would be read as nothing.
template <class Kind>
const Kind* kept_as(const std::string& path, const toml::table& table, const char* key, const char* how) {
  const toml::node* node = table.get(key);
  if (node == nullptr) return nullptr;
  if (const Kind* kind = node->as<Kind>()) return kind;
  refuse(fmt::format("{}: '{}' must be written as {}.", path, key, how));
}

void need_whole(const std::string& place, const char* key, double value) {
  if (value != std::floor(value)) refuse(fmt::format("{}: {} = {} must be a whole number.", place, key, value));
}

// Bounds are what the numerics were tried with, not what is wise: a day, the boiling point of solder, a large robot.
constexpr double day_s = 86400, highest_degC = 300, most_A = 200;

struct Reader {
  Scene scene;
  double seed = 1, supply_sinks = 1;

  Slots top() {
    Scene& s = scene;
    return {{{"title", &s.title},
             {"note", &s.note},
             {"motor", &s.motor},
             {"board", &s.board},
             {"trust", &s.trust},
             {"model", &s.model}},
            {{"seconds", {&s.seconds, 1e-3, day_s}},
             {"log_Hz", {&s.log_Hz, 0.1, 20000}},
             {"seed", {&seed, 0, 4294967295.0}},
             {"ambient_degC", {&s.ambient_degC, -40, 100}},
             {"start_degC", {&s.start_degC, -40, highest_degC}},
             {"housing_limit_degC", {&s.housing_limit_degC, 0, highest_degC}},
             {"coolant_K_per_W", {&s.coolant_K_per_W, 0, 100}},
             {"supply_V", {&s.supply_V, 5, 100}},
             {"supply_sinks", {&supply_sinks, 0, 1}}},
            {"limiters", "demand", "shaft"}};
  }

  Slots shaft(std::string* kind) {
    Shaft& s = scene.shaft;
    return {{{"kind", kind}},
            {{"angle_rad", {&s.angle_rad, -10, 10}},
             {"load_inertia_kg_m2", {&s.load_inertia_kg_m2, 0, 1}},
             {"speed_rad_per_s", {&s.speed_rad_per_s, -5000, 5000}},
             {"speed_amplitude_rad_per_s", {&s.speed_amplitude_rad_per_s, 0, 5000}},
             {"frequency_Hz", {&s.frequency_Hz, 0, 100}}},
            {"landings_s"}};
  }

  void read_shaft(const std::string& place, const toml::table& table) {
    std::string kind = "locked";
    read_table(place, table, shaft(&kind));
    if (const auto* list = kept_as<toml::array>(place, table, "landings_s", "a list, [0.6, 1.2]")) {
      for (const toml::node& node : *list) {
        const auto value = node.value<double>();
        if (!value) refuse(place + ": landings_s must be numbers.");
        scene.shaft.landings_s.push_back(*value);
      }
    }
    if (kind == "locked")
      scene.shaft.kind = Shaft::Kind::locked;
    else if (kind == "free")
      scene.shaft.kind = Shaft::Kind::free;
    else if (kind == "imposed")
      scene.shaft.kind = Shaft::Kind::imposed;
    else
      refuse(fmt::format("{}: kind = '{}' is not one of locked, free, imposed.", place, kind));
  }

  void read_demands(const std::string& path, const toml::array& list) {
    for (const toml::node& node : list) {
      const std::string place = fmt::format("{}: demand {}", path, scene.demands.size() + 1);
      if (!node.is_table()) refuse(place + " must be a [[demand]] table.");
      Demand d;
      double axis = 0;
      read_table(place, *node.as_table(),
                 {{},
                  {{"axis", {&axis, 0, 1}},
                   {"from_s", {&d.from_s, 0, day_s}},
                   {"to_s", {&d.to_s, 0, day_s}},
                   {"current_A", {&d.current_A, -most_A, most_A}},
                   {"ripple_ratio", {&d.ripple_ratio, 0, 10}},
                   {"frequency_Hz", {&d.frequency_Hz, 0, 1000}}},
                  {}});
      need_whole(place, "axis", axis);
      d.axis = static_cast<int>(axis);
      if (!(d.to_s > d.from_s)) refuse(place + ": to_s must lie after from_s.");
      scene.demands.push_back(d);
    }
  }

  void read_limiters(const std::string& path, const toml::array& list) {
    scene.limiters.clear();
    for (const toml::node& node : list) {
      const std::string wanted = node.value<std::string>().value_or("");
      const auto found = std::find_if(std::begin(limiter_names), std::end(limiter_names),
                                      [&](const auto& entry) { return wanted == entry.first; });
      if (found == std::end(limiter_names)) {
        refuse(fmt::format("{}: limiter '{}' is not one of governor, rated, housing, hard_cut, oracle.", path, wanted));
      }
      scene.limiters.push_back(found->second);
    }
    if (scene.limiters.empty()) refuse(path + ": limiters is empty; name at least governor.");
  }

  void apply(const std::string& override_text) {
    const auto equals = override_text.find('=');
    if (equals == std::string::npos) refuse(fmt::format("--set {}: write it as key=value.", override_text));
    std::string key = override_text.substr(0, equals);
    const std::string value = override_text.substr(equals + 1);
    std::string kind;
    Slots slots = top();
    if (key.rfind("shaft.", 0) == 0) {
      key = key.substr(6);
      slots = shaft(&kind);
      slots.texts.clear();
    }
    if (slots.texts.count(key) != 0) {
      *slots.texts[key] = value;
      return;
    }
    const auto number = slots.numbers.find(key);
    if (number == slots.numbers.end()) {
      std::vector<std::string> known;
      for (const auto& [name, slot] : slots.texts) known.push_back(name);
      for (const auto& [name, slot] : slots.numbers) known.push_back(name);
      const std::string hint = did_you_mean(key, known);
      refuse(fmt::format("--set {}: unknown key{}", override_text,
                         hint.empty() ? fmt::format("; known: {}, shaft.*.", fmt::join(known, ", ")) : hint));
    }
    char* end = nullptr;
    const double parsed = std::strtod(value.c_str(), &end);
    if (value.empty() || *end != '\0') refuse(fmt::format("--set {}: '{}' is not a number.", override_text, value));
    put_number("--set", key, number->second, parsed);
  }
};

/// The program at a time; before it begins, at rest.
ProgramStep at(const Scene& scene, double time_s) {
  const double place = time_s * scene.program_Hz;
  if (place < 0) return {0, scene.program.front().speed_rad_per_s};
  const std::size_t i = std::min(static_cast<std::size_t>(place), scene.program.size() - 1);
  const ProgramStep &from = scene.program[i], &to = scene.program[std::min(i + 1, scene.program.size() - 1)];
  const double share = std::min(place - static_cast<double>(i), 1.0);
  return {from.current_A + share * (to.current_A - from.current_A),
          from.speed_rad_per_s + share * (to.speed_rad_per_s - from.speed_rad_per_s)};
}

void expect_one_of(const char* key, const std::string& value, const std::vector<std::string>& known) {
  if (std::find(known.begin(), known.end(), value) != known.end()) return;
  refuse(fmt::format("{} = '{}' is not one of {}.", key, value, fmt::join(known, ", ")));
}

}  // namespace

const char* name_of(Limiter limiter) {
  for (const auto& [name, value] : limiter_names) {
    if (value == limiter) return name;
  }
  return "";
}

std::vector<std::string> scene_names(const std::string& folder) { return wire::pc::toml_names(folder); }

Scene read_scene(const std::string& which, const std::string& folder, const std::vector<std::string>& overrides) {
  const std::string path = wire::pc::find_toml("scene", which, folder);
  const toml::table table = wire::pc::parse_toml(path);
  wire::pc::need_kind("scene", path, table);
  Reader reader;
  reader.scene.id = fs::path(path).stem().string();
  reader.scene.title = reader.scene.id;
  read_table(path, table, reader.top());
  if (const auto* list = kept_as<toml::array>(path, table, "limiters", "a list, [\"governor\"]"))
    reader.read_limiters(path, *list);
  if (const auto* list = kept_as<toml::array>(path, table, "demand", "[[demand]], once for each"))
    reader.read_demands(path, *list);
  if (const auto* shaft = kept_as<toml::table>(path, table, "shaft", "[shaft]"))
    reader.read_shaft(path + ": shaft", *shaft);
  for (const std::string& text : overrides) reader.apply(text);
  need_whole(path, "seed", reader.seed);
  expect_one_of("board", reader.scene.board, {"h8-15d", "h8-17.5d"});
  expect_one_of("trust", reader.scene.trust, {"exact", "identified", "sheet"});
  reader.scene.supply_sinks = reader.supply_sinks != 0;
  reader.scene.seed = static_cast<unsigned>(reader.seed);
  return reader.scene;
}

double demand_A(const Scene& scene, int axis, double time_s) {
  if (!scene.program.empty()) return axis == 0 ? at(scene, time_s).current_A : 0;
  for (const Demand& d : scene.demands) {
    if (d.axis != axis || time_s < d.from_s || time_s >= d.to_s) continue;
    return d.current_A * (1 + d.ripple_ratio * std::sin(2 * std::numbers::pi * d.frequency_Hz * time_s));
  }
  return 0;
}

double imposed_speed_rad_per_s(const Shaft& shaft, double time_s) {
  return shaft.speed_rad_per_s +
         shaft.speed_amplitude_rad_per_s * std::sin(2 * std::numbers::pi * shaft.frequency_Hz * time_s);
}

double imposed_speed_rad_per_s(const Scene& scene, double time_s) {
  return scene.program.empty() ? imposed_speed_rad_per_s(scene.shaft, time_s) : at(scene, time_s).speed_rad_per_s;
}

}  // namespace boards::host

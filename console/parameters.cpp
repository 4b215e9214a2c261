// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <memory>

#include "console/commands.hpp"
#include "console/parameter_file.hpp"
#include "wire/pc/files.hpp"

namespace console {
namespace {

/// What the board holds: every parameter and its value in force.
struct Held {
  std::vector<Target> targets;
  std::vector<float> values;
};

Held all_of(Console& console) {
  Held held{console.session().parameters().all(), {}};
  held.values = console.session().get(held.targets);
  return held;
}

void get(Console& console, const std::vector<std::string>& names, bool names_only) {
  Session& session = console.session();
  const Dictionary& dictionary = session.parameters();
  if (names_only) {
    const auto known = dictionary.names();
    return console.say(fmt::format("{}\n", fmt::join(known, "\n")), known);
  }
  std::vector<Target> targets;
  for (const std::string& name : names) {
    for (const Target& target : dictionary.named(name)) targets.push_back(target);
  }
  if (names.empty()) targets = dictionary.all();
  const std::vector<float> values = session.get(targets);
  std::string text;
  Json json = Json::object();
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const Description& what = *targets[i].what;
    text += fmt::format("{:<32} {:>11}   {:<20} {}\n", full_name(targets[i]), shown(values[i]),
                        fmt::format("{:g} to {:g}", what.min, what.max), what.doc);
    json[full_name(targets[i])] = {
        {"value", number(values[i])},       {"unit", what.unit}, {"min", what.min}, {"max", what.max},
        {"default", number(what.fallback)}, {"doc", what.doc}};
  }
  console.say(text, json);
}

/// "name=value", for one axis or both.
void parse(const std::string& text, const Dictionary& dictionary, std::vector<Assignment>& assignments) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0)
    refuse(fmt::format("'{}' sets nothing; write name=value, such as current_limit_A=12.", text));
  const std::string name = text.substr(0, equals), value_text = text.substr(equals + 1);
  float value = 0;
  const char* end = value_text.data() + value_text.size();
  const auto [read, error] = std::from_chars(value_text.data(), end, value);
  if (error != std::errc() || read != end || !std::isfinite(value))
    refuse(fmt::format("{}: '{}' is not a number; write it without its unit.", name, value_text));
  for (const Target& target : dictionary.named(name)) {
    assignments.push_back({target, value});
    check(assignments.back(), "");
  }
}

/// Puts a change in force and says what it changed, after `note`.
void apply(Console& console, const std::vector<Assignment>& assignments, bool save, const std::string& note = "") {
  Session& session = console.session();
  std::vector<Target> targets;
  for (const Assignment& assignment : assignments) targets.push_back(assignment.target);
  const std::vector<float> before = session.get(targets);
  session.set(assignments);
  const std::vector<float> after = session.get(targets);
  std::string text;
  Json changes = Json::object();
  for (std::size_t i = 0; i < targets.size(); ++i) {
    if (before[i] == after[i] || (std::isnan(before[i]) && std::isnan(after[i]))) continue;
    text += fmt::format("{:<32} {:>11} -> {}\n", full_name(targets[i]), shown(before[i]), shown(after[i]));
    changes[full_name(targets[i])] = {{"before", number(before[i])}, {"after", number(after[i])}};
  }
  if (text.empty()) text = "Nothing changed: the board had these values already.\n";
  if (save) session.save();
  text += save ? "Saved.\n" : "In force until the next reset; 'hotcore save' keeps it.\n";
  Json json = {{"changed", changes}, {"saved", save}};
  if (!note.empty()) json["note"] = note;
  console.say(note + (note.empty() ? "" : "\n") + text, json);
}

void set(Console& console, const std::vector<std::string>& texts, bool save) {
  std::vector<Assignment> assignments;
  for (const std::string& text : texts) parse(text, console.session().parameters(), assignments);
  check_each_once(assignments, "");
  apply(console, assignments, save);
}

void save(Console& console) {
  console.session().save();
  console.say("Saved: these parameters survive a reset.\n", {{"saved", true}});
}

void diff(Console& console, const std::string& path) {
  const Held held = all_of(console);
  std::vector<float> other(held.targets.size(), std::nanf(""));
  std::vector<bool> compared(held.targets.size(), path.empty());
  for (std::size_t i = 0; i < held.targets.size() && path.empty(); ++i) other[i] = held.targets[i].what->fallback;
  if (!path.empty()) {
    const ParameterFile file = read_parameter_file(path, console.session().parameters());
    for (const Assignment& a : file.assignments) {
      for (std::size_t i = 0; i < held.targets.size(); ++i) {
        if (held.targets[i].what != a.target.what || held.targets[i].axis != a.target.axis) continue;
        other[i] = a.value;
        compared[i] = true;
      }
    }
  }
  const std::string against = path.empty() ? "default" : path;
  std::string text;
  Json json = Json::object();
  for (std::size_t i = 0; i < held.targets.size(); ++i) {
    const bool same = held.values[i] == other[i] || (std::isnan(held.values[i]) && std::isnan(other[i]));
    if (same && compared[i]) continue;
    const std::string there = !compared[i] ? "not in the file" : shown(other[i]);
    text += fmt::format("{:<32} {:>11}   {}\n", full_name(held.targets[i]), shown(held.values[i]), there);
    Json& entry = json[full_name(held.targets[i])] = {{"board", number(held.values[i])}};
    if (compared[i]) entry["other"] = number(other[i]);  // null is unset; what the file does not have has no "other"
  }
  text = text.empty() ? fmt::format("No difference to {}.\n", path.empty() ? "the defaults" : path)
                      : fmt::format("{:<32} {:>11}   {}\n", "", "board", against) + text;
  console.say(text, {{"against", against}, {"differences", json}});
}

void backup(Console& console, const std::string& path, bool force) {
  wire::pc::need_new_file(path, force);
  const Held held = all_of(console);
  wire::pc::write_whole(path, parameter_file(console.session(), held.targets, held.values));
  console.say(fmt::format("Written: {} ({} parameters in force).\n", path, held.targets.size()),
              {{"written", path}, {"parameters", held.targets.size()}});
}

void restore(Console& console, const std::string& path, bool save) {
  const ParameterFile file = read_parameter_file(path, console.session().parameters());
  const std::string& here = console.session().name();
  // Allowed, since boards are replaced and copied.
  const std::string note =
      file.board.empty() || file.board == here
          ? ""
          : fmt::format("{} is of {}, this is {}: if other motors hang on it, set their motor and angle_offset_rad.",
                        path, file.board, here);
  apply(console, file.assignments, save, note);
}

}  // namespace

void add_parameters(CLI::App& app, Console& console) {
  struct Arguments {
    std::vector<std::string> names;
    std::string path;
    bool save = false, names_only = false, force = false;
  };
  auto a = std::make_shared<Arguments>();

  CLI::App* command = app.add_subcommand("get", "parameters with value, range and meaning");
  command->add_option("NAME", a->names,
                      "axis0.current_limit_A, current_limit_A (both axes), bus* (all that begin so); none: all");
  command->add_flag("--names", a->names_only, "only the names, one a line");
  command->callback([&console, a] { get(console, a->names, a->names_only); });

  command = app.add_subcommand("set", "change parameters, all of them or none");
  command->add_option("NAME=VALUE", a->names, "such as axis0.current_limit_A=12; without axis0. both axes")->required();
  command->add_flag("--save", a->save, "and keep them over a reset");
  command->callback([&console, a] { set(console, a->names, a->save); });

  app.add_subcommand("save", "keep the parameters in force over a reset")->callback([&console] { save(console); });

  command = app.add_subcommand("diff", "parameters that differ from the defaults, or from a file");
  command->add_option("FILE", a->path, "as 'backup' writes it");
  command->callback([&console, a] { diff(console, a->path); });

  command = app.add_subcommand("backup", "write all parameters into a file");
  command->add_option("FILE", a->path, "a new .toml file")->required();
  command->add_flag("--force", a->force, "write over a file that is there");
  command->callback([&console, a] { backup(console, a->path, a->force); });

  command = app.add_subcommand("restore", "put a file's parameters in force, all of them or none");
  command->add_option("FILE", a->path, "as 'backup' writes it")->required();
  command->add_flag("--save", a->save, "and keep them over a reset");
  command->callback([&console, a] { restore(console, a->path, a->save); });
}

}  // namespace console

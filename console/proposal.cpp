// SPDX-License-Identifier: MIT
#include "console/proposal.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <iostream>

#include "console/parameter_file.hpp"

namespace console {
namespace {

bool agreed(Console& console, const Consent& consent) {
  if (consent.yes) return true;
  if (console.options.json || isatty(STDIN_FILENO) == 0) return false;
  interrupted();  // from here on Ctrl-C is noted and does not end the prompt
  put("Put these in force? [y/N] ");
  std::string answer;
  std::getline(std::cin, answer);
  std::cin.clear();  // Ctrl-C or Ctrl-D ended it, and the prompt may ask again
  std::clearerr(stdin);
  stop_if_interrupted("Stopped; nothing was written.");
  return answer == "y" || answer == "Y" || answer == "yes";
}

}  // namespace

Values values_of(Session& session, int axis) {
  std::vector<Target> mine;
  for (const Target& target : session.parameters().all()) {
    if (target.axis == axis) mine.push_back(target);
  }
  const std::vector<float> numbers = session.get(mine);
  Values values;
  for (std::size_t i = 0; i < mine.size(); ++i) values[full_name(*mine[i].what)] = numbers[i];
  return values;
}

void add_consent(CLI::App& command, Consent& consent) {
  command.add_flag("--yes", consent.yes, "write it without asking");
  command.add_flag("--save", consent.save, "and keep it over a reset");
}

Outcome put_in_force(Console& console, int axis, const Values& before, const Values& proposed, const std::string& whose,
                     const Consent& consent) {
  Session& session = console.session();
  std::string text;
  Json changes = Json::object();
  std::vector<Assignment> assignments;
  for (const auto& [name, value] : proposed) {
    const auto old = before.find(name);
    if (old == before.end() || old->second == value || (std::isnan(old->second) && std::isnan(value))) continue;
    const Target target = session.parameters().named(fmt::format("axis{}.{}", axis, name)).front();
    assignments.push_back({target, value});
    text += fmt::format("  {:<32} {:>11} -> {}\n", full_name(target), shown(old->second), shown(value));
    changes[full_name(target)] = {{"before", number(old->second)}, {"found", number(value)}};
  }
  for (const Assignment& assignment : assignments) check(assignment, whose);
  if (!console.options.json) put(text);
  const bool held = assignments.empty(), written = !held && agreed(console, consent);
  const bool saved = consent.save && (held || written);
  if (written) session.set(assignments);
  if (saved) session.save();
  const char* said = held && saved ? "The board had these values already; saved.\n"
                     : held        ? "Nothing to write: the board has these values already.\n"
                     : saved       ? "In force and saved.\n"
                     : written     ? "In force until the next reset; 'hotcore save' keeps it.\n"
                                   : "Nothing was written; --yes writes without asking.\n";
  return {said, {{"changes", changes}, {"written", written}, {"saved", saved}}};
}

}  // namespace console

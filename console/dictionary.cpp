// SPDX-License-Identifier: MIT
#include "console/dictionary.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "wire/pc/names.hpp"
#include "wire/pc/user_error.hpp"

namespace console {

std::string full_name(const Description& what) {
  if (what.unit.empty() || what.unit == "count") return what.name;
  std::string unit = what.unit;
  if (unit.rfind("1/", 0) == 0)
    unit.replace(0, 2, "per_");
  else if (const std::size_t slash = unit.find('/'); slash != std::string::npos)
    unit.replace(slash, 1, "_per_");
  return what.name + "_" + unit;
}

std::string full_name(const Target& target) {
  if (target.axis == wire::no_axis) return full_name(*target.what);
  return fmt::format("axis{}.{}", target.axis, full_name(*target.what));
}

std::vector<Target> Dictionary::all() const {
  std::vector<Target> targets;
  for (int axis = 0; axis < wire::axis_count; ++axis) {
    for (const Description& entry : entries_) {
      if (entry.per_axis) targets.push_back({&entry, static_cast<std::uint8_t>(axis)});
    }
  }
  for (const Description& entry : entries_) {
    if (!entry.per_axis) targets.push_back({&entry, wire::no_axis});
  }
  return targets;
}

std::vector<std::string> Dictionary::names() const {
  std::vector<std::string> names;
  for (const Description& entry : entries_) names.push_back(full_name(entry));
  for (const Target& target : all()) {
    if (target.axis != wire::no_axis) names.push_back(full_name(target));
  }
  return names;
}

std::vector<Target> Dictionary::named(const std::string& name, const std::string& where) const {
  const bool open = !name.empty() && name.back() == '*';
  const std::string start = open ? name.substr(0, name.size() - 1) : name;
  const auto fits = [&](const std::string& full) { return open ? full.rfind(start, 0) == 0 : full == name; };
  std::vector<Target> found;
  for (const Target& target : all()) {
    if (fits(full_name(target)) || fits(full_name(*target.what))) found.push_back(target);
  }
  if (found.empty()) {
    const auto known = names();
    const auto begun = std::find_if(known.begin(), known.end(), [&](const std::string& full) {
      return !start.empty() && full.rfind(start, 0) == 0;
    });
    const std::string hint =
        begun != known.end() ? fmt::format(", did you mean '{}'?", *begun) : wire::pc::did_you_mean(name, known);
    wire::pc::refuse(fmt::format("{}he board has no {} '{}'{} 'hotcore {}' lists them.",
                                 where.empty() ? "T" : where + ": t", kind_, name, hint.empty() ? ";" : hint,
                                 kind_ == "signal" ? "signals" : "get"));
  }
  return found;
}

std::string Dictionary::told(std::uint16_t id, std::uint8_t axis) const {
  for (const Description& entry : entries_) {
    if (entry.id != id) continue;
    const Target target{&entry, entry.per_axis ? axis : wire::no_axis};
    return fmt::format("{} ({:g} to {:g}{})", full_name(target), entry.min, entry.max,
                       entry.unit.empty() ? "" : " " + entry.unit);
  }
  return fmt::format("number {:#06x}", id);
}

}  // namespace console

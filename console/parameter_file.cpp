// SPDX-License-Identifier: MIT
#include "console/parameter_file.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <cmath>
#include <filesystem>

#include "wire/crc.hpp"
#include "wire/pc/toml_file.hpp"
#include "wire/pc/user_error.hpp"

namespace console {
namespace {

using wire::pc::refuse;

constexpr const char* common = "common";

std::string section_of(std::uint8_t axis) { return axis == wire::no_axis ? common : fmt::format("axis{}", axis); }

}  // namespace

std::string parameter_file(const Session& session, const std::vector<Target>& targets,
                           const std::vector<float>& values) {
  const wire::Hello& hello = session.hello();
  std::string text = fmt::format(
      "# Parameters of a hotcore board. 'hotcore restore THIS_FILE' puts them in force, 'hotcore diff THIS_FILE' "
      "compares.\n"
      "[board]\nname = \"{}\"\nserial = \"{}\"\nfirmware = \"{}\"\ndictionary = \"{:08x}\"\nparameters = \"{:08x}\"\n",
      hello.board, hello.serial, hello.firmware, hello.dictionary_hash, hash_of(targets, values));
  std::string section;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    if (section_of(targets[i].axis) != section) {
      section = section_of(targets[i].axis);
      text += fmt::format("\n[{}]\n", section);
    }
    const Description& what = *targets[i].what;
    // Nine digits bring a float back bit by bit; fmt's shortest form does too.
    const std::string value = std::isnan(values[i]) ? "nan" : fmt::format("{}", values[i]);
    text += fmt::format("{:<32} # {:g} to {:g}: {}\n", fmt::format("{} = {}", full_name(what), value), what.min,
                        what.max, what.doc);
  }
  return text;
}

ParameterFile read_parameter_file(const std::string& path, const Dictionary& dictionary) {
  if (!std::filesystem::is_regular_file(path))
    refuse(path + ": there is no such file; check the path, or write one with 'hotcore backup'.");
  const toml::table file = wire::pc::parse_toml(path);
  wire::pc::need_kind("parameter file", path, file);
  const auto name = file["board"]["name"].value<std::string>(), serial = file["board"]["serial"].value<std::string>();
  ParameterFile read{name && serial ? *name + " " + *serial : "", {}};
  std::vector<Assignment>& assignments = read.assignments;
  for (const auto& [section_key, section] : file) {
    const std::string title(section_key.str());
    if (title == "board") continue;
    if (!section.is_table()) {
      refuse(fmt::format("{}: '{}' stands outside [axis0], [axis1] and [common]; move it there.", path, title));
    }
    for (const auto& [key, node] : *section.as_table()) {
      const std::string full = title == common ? std::string(key.str()) : title + "." + std::string(key.str());
      const auto value = node.value<double>();
      if (!value) refuse(fmt::format("{}: {} is no number; repair it.", path, full));
      for (const Target& target : dictionary.named(full, path)) {
        assignments.push_back({target, static_cast<float>(*value)});
        if (!std::isnan(*value)) check(assignments.back(), path + ": ");
      }
    }
  }
  check_each_once(assignments, path + ": ");
  if (assignments.empty()) refuse(path + ": no parameter in it; 'hotcore backup FILE' writes such a file.");
  return read;
}

void check(const Assignment& assignment, const std::string& where) {
  const Description& what = *assignment.target.what;
  const float value = assignment.value;
  if (!(value >= what.min && value <= what.max)) {
    refuse(fmt::format("{}{} = {:g} is out of range; it may be {:g} to {:g}{}.", where, full_name(assignment.target),
                       value, what.min, what.max, what.unit.empty() || what.unit == "count" ? "" : " " + what.unit));
  }
  if (what.whole_number && value != std::floor(value)) {
    refuse(fmt::format("{}{} = {:g} must be a whole number.", where, full_name(assignment.target), value));
  }
}

void check_each_once(const std::vector<Assignment>& assignments, const std::string& where) {
  for (std::size_t i = 0; i < assignments.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const Target &one = assignments[i].target, &other = assignments[k].target;
      if (one.what == other.what && one.axis == other.axis)
        refuse(fmt::format("{}{} is given twice; give it one value.", where, full_name(one)));
    }
  }
}

std::uint32_t hash_of(const std::vector<Target>& targets, const std::vector<float>& values) {
  std::uint32_t crc = 0xFFFF'FFFFu;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const wire::Assignment entry{{targets[i].what->id, targets[i].axis}, values[i]};
    std::uint8_t bytes[sizeof entry];
    std::memcpy(bytes, &entry, sizeof entry);
    crc = wire::crc32(bytes, sizeof bytes, crc);
  }
  return ~crc;
}

}  // namespace console

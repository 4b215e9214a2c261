// SPDX-License-Identifier: MIT
// What a board is told of its motor: a sheet, or what identify found.
#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <optional>

#include "console/commands.hpp"
#include "console/heat_experiment.hpp"
#include "console/proposal.hpp"
#include "wire/pc/motor_file.hpp"

namespace console {
namespace {

struct MotorArguments {
  std::string axis = "0", file;
  double supply_V = 0;
  std::optional<double> angle_offset_rad;
  Consent consent;
};

/// Another motor hangs on the axis: its sheet, and nothing of what was found of the one before.
void take_sheet(Console& console, const MotorArguments& a) {
  const wire::pc::MotorFile motor = wire::pc::read_motor(a.file, console.options.motor_folder);
  Session& session = console.session();
  const int axis = a.axis == "1" ? 1 : 0;
  const wire::Hello& board = session.hello();
  const wire::BusWindow bus = wire::bus_window(static_cast<float>(a.supply_V), board.bus_min_V, board.bus_max_V);
  if (!(bus.low_end_V < bus.low_start_V && bus.high_start_V < bus.high_end_V))
    refuse(
        fmt::format("--supply {:g}: this board opens its bridges below {:g} and above {:g} V, and its currents come "
                    "down before that; a supply has to be further from both.",
                    a.supply_V, board.bus_min_V, board.bus_max_V));
  const Values before = values_of(session, axis);
  Values defaults;
  for (const Description& what : session.parameters().entries()) {
    if (what.per_axis) defaults[full_name(what)] = what.fallback;
  }
  Values proposed = parameters_of_sheet(motor.motor, bus, defaults);
  if (a.angle_offset_rad)
    proposed["angle_offset_rad"] = static_cast<float>(*a.angle_offset_rad);
  else if (const auto at = before.find("angle_offset_rad"); at != before.end() && std::isnan(at->second))
    refuse(
        fmt::format("axis{}.angle_offset_rad is unset: say what the encoder reads when the magnet lies on phase a, "
                    "--angle-offset RAD (electrical), or 0 and then let 'hotcore align' find it.",
                    axis));
  for (const auto& [name, value] : proposed) {
    if (!before.contains(name))
      refuse(fmt::format("This board's firmware knows no {}; use the hotcore of its version.", name));
  }
  Outcome outcome = put_in_force(console, axis, before, proposed, a.file + ": ", a.consent);
  outcome.json["motor"] = motor.name;
  outcome.json["source"] = motor.source;
  console.say(fmt::format("{}: {}. {}", motor.name, motor.source, outcome.text), outcome.json);
}

/// The board takes what identify found elsewhere, from a log of any origin.
void take_model(Console& console, const MotorArguments& a) {
  const int axis = a.axis == "1" ? 1 : 0;
  const Values before = values_of(console.session(), axis);
  std::string why;
  const Values found = parameters_of_model(a.file, before, why);
  if (found.empty())
    refuse_data(
        fmt::format("{}: it has {}, which this board's parameters cannot express; run it with host-sim "
                    "(--set model=FILE).",
                    a.file, why));
  const Outcome outcome = put_in_force(console, axis, before, found, "identify found ", a.consent);
  console.say(outcome.text, outcome.json);
}

}  // namespace

void add_motor(CLI::App& app, Console& console) {
  const auto command = [&](const char* name, const char* does, const char* file,
                           void (*take)(Console&, const MotorArguments&)) {
    auto a = std::make_shared<MotorArguments>();
    CLI::App* made = app.add_subcommand(name, does);
    made->add_option("FILE", a->file, file)->required();
    made->add_option("--axis", a->axis, "0 or 1")->capture_default_str()->check(CLI::IsMember({"0", "1"}));
    add_consent(*made, a->consent);
    made->callback([&console, a, take] { take(console, *a); });
    return std::pair{made, a};
  };
  command("model", "put a model of 'identify --write-model' in force", "the model", take_model);
  const auto [sheet, a] = command("motor", "tell an axis the sheet of its motor, and forget another's",
                                  "a motor sheet (.toml), or the name of one in boards/motors", take_sheet);
  sheet->add_option("--supply", a->supply_V, "what feeds the board, V")->required()->check(between(1, 1000));
  sheet
      ->add_option("--angle-offset", a->angle_offset_rad,
                   "what the encoder reads when the magnet lies on phase a, electrical, rad; else it stays as it is")
      ->check(between(-3.1416, 3.1416));
}

}  // namespace console

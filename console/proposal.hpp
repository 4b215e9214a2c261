// SPDX-License-Identifier: MIT
// Values that are proposed to an axis: shown beside what it has, agreed to, put in force.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "console/console.hpp"
#include "console/motor_sheet.hpp"

namespace console {

/// What the axis has in force.
Values values_of(Session& session, int axis);

struct Consent {
  bool yes = false, save = false;
};
/// --yes and --save.
void add_consent(CLI::App& command, Consent& consent);

struct Outcome {
  std::string text;
  Json json;
};

/// Shows what would change and, after a yes, writes it. `whose` begins the sentence that refuses a value out of the
/// board's range: "identify found ".
Outcome put_in_force(Console& console, int axis, const Values& before, const Values& proposed, const std::string& whose,
                     const Consent& consent);

}  // namespace console

// SPDX-License-Identifier: MIT
#include "console/commands.hpp"

namespace console {
void add_identify(CLI::App&, Console&) {}
}  // namespace console

// SPDX-License-Identifier: MIT
// How a PC program begins and ends: it reads its words, works, and says in one sentence why it cannot.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "wire/pc/user_error.hpp"

namespace wire::pc {

/// `work` gives the exit code; what else ends a program is shown in its --help.
template <class Work>
int run_program(CLI::App& app, int argc, char** argv, Work work) {
  try {
    app.parse(argc, argv);
    return work();
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : static_cast<int>(Exit::usage);
  } catch (const UserError& error) {
    fmt::print(stderr, "{}\n", error.what());
    return error.exit_code();
  }
}

}  // namespace wire::pc

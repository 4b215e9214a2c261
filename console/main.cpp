// SPDX-License-Identifier: MIT
// The program hotcore: the console at the PC's end of the cable.
#include <cstdlib>

#include "console/commands.hpp"
#include "console/link/sim.hpp"

namespace {

std::unique_ptr<console::link::Transport> simulated(const console::Options& options) {
  console::link::SimulatedBoard board;
  board.motor = options.motor;
  board.motor_folder = options.motor_folder;
  if (!options.serial.empty()) board.serial = options.serial;
  board.real_time = std::getenv("HOTCORE_SIM_FAST") == nullptr;  // tests do not wait for the world
  return console::link::simulated_board(board);
}

}  // namespace

int main(int argc, char** argv) {
  console::Console console(simulated);
  console.options.motor_folder = HOTCORE_MOTOR_FOLDER;
  bool talk = false;
  const int code = console::run_line(console, [&](CLI::App& app) {
    app.parse(argc, argv);
    talk = app.get_subcommands().empty();
  });
  return talk ? console::prompt(console) : code;
}

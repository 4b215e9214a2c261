// SPDX-License-Identifier: MIT
// The commands, grouped by what a person is about. Each adds itself to a command line; the prompt builds the same one.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

#include "console/console.hpp"

namespace console {

void add_boards(CLI::App& app, Console& console);      // list, udev                                     boards.cpp
void add_parameters(CLI::App& app, Console& console);  // get, set, save, diff, backup, restore          parameters.cpp
void add_motion(CLI::App& app, Console& console);      // arm, mode, run, stop, calibrate, fault, ask    motion.cpp
void add_records(CLI::App& app, Console& console);     // signals, watch, log, capture                   records.cpp
void add_identify(CLI::App& app, Console& console);    // identify                                   identification.cpp
void add_align(CLI::App& app, Console& console);       // align                                           align.cpp
void add_motor(CLI::App& app, Console& console);       // motor, model                                   motor.cpp

/// For options: a number outside, NaN too, is refused with the range.
CLI::Validator between(double least, double most);
inline constexpr double longest_s = 1e9;  // of what a person lets run, 30 years

/// All of them.
void add_commands(CLI::App& app, Console& console);

/// Parses and obeys one command line; every failure becomes a sentence and an exit code, which is returned.
int run_line(Console& console, const std::function<void(CLI::App&)>& parse);

/// Reads commands from a person (or a pipe) until the end of input; returns the exit code of the last one.
int prompt(Console& console);

/// Words that may stand where `word` is being typed in `line`: commands, parameters, signals.
std::vector<std::string> completions(Console& console, const std::string& line, const std::string& word);

}  // namespace console

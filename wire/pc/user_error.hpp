// SPDX-License-Identifier: MIT
// How a PC program says no: one plain sentence (what, where, what to do next) and a documented exit code.
#pragma once

#include <stdexcept>
#include <string>

namespace wire::pc {

enum class Exit : int {
  answered = 0,       // an answer was given
  usage = 2,          // the command line, a parameter file or a motor file is wrong
  unusable = 3,       // the data cannot be used
  no_board = 4,       // no board, or more than one, fits
  no_permission = 5,  // the system does not let this user reach the board
  busy = 6,           // another program holds the board
  gone = 7,           // the board went away or stopped answering in the middle
  refused = 8,        // the board understood and said no
  wrong_version = 9,  // board and program speak different versions
  interrupted = 130,  // Ctrl-C; whatever was armed is disarmed (128 + SIGINT, as shells have it)
};

class UserError : public std::runtime_error {
 public:
  UserError(Exit exit, const std::string& sentence) : std::runtime_error(sentence), exit_(exit) {}
  int exit_code() const { return static_cast<int>(exit_); }

 private:
  Exit exit_;
};

/// Of an option or a file that a person wrote.
[[noreturn]] inline void refuse(const std::string& sentence) { throw UserError(Exit::usage, sentence); }

/// Of what was measured.
[[noreturn]] inline void refuse_data(const std::string& sentence) { throw UserError(Exit::unusable, sentence); }

}  // namespace wire::pc

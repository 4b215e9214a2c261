// SPDX-License-Identifier: MIT
// What every command shares: the board that was chosen, text or JSON, Ctrl-C.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "console/link/sim.hpp"
#include "console/link/usb.hpp"
#include "console/session.hpp"

namespace console {

using Json = nlohmann::ordered_json;
using wire::pc::Exit;
using wire::pc::refuse;
using wire::pc::refuse_data;
using wire::pc::UserError;

struct Options {
  std::string serial;
  std::string motor = link::SimulatedBoard{}.motor, motor_folder;
  bool sim = false, json = false;
};

class Console {
 public:
  /// `simulated` opens the board of --sim: the program knows one, the console's library none.
  explicit Console(std::function<std::unique_ptr<link::Transport>(const Options&)> simulated)
      : simulated_(std::move(simulated)) {}

  Options options;

  /// The conversation with the chosen board, begun when first asked for. Throws UserError (usage) where it is with
  /// another board than the options choose by now.
  Session& session();
  /// Ends it: the next session() looks for the board anew.
  void hang_up() { session_.reset(); }
  link::Usb& usb();

  /// The answer of a command: text, or JSON in one line.
  void say(const std::string& text, const Json& json) const;
  /// Something for a person only: on standard error, not with --json.
  void tell(const std::string& text) const;

 private:
  std::function<std::unique_ptr<link::Transport>(const Options&)> simulated_;
  std::optional<link::Usb> usb_;
  std::optional<Session> session_;
  Options opened_;  // what the session was begun with
};

/// Writes to standard output, now. Throws UserError (usage) when it takes no more, as a full disk; a reader who left
/// (| head) counts as Ctrl-C.
void put(const std::string& text);

/// Ctrl-C, a hang-up, a kill or a reader who left was seen. From the first call on they are only noted; commands look
/// here.
bool interrupted();
/// Forgets it: the prompt goes on after an interrupted command.
void forget_interrupt();
/// Throws UserError (interrupted) if it was seen; `state` says how things were left.
void stop_if_interrupted(const std::string& state);

/// JSON as it is written; what is no UTF-8, as a file's name may be, is replaced.
std::string one_line(const Json& json);
/// A number for a person: six digits at most, "unset" for NaN.
std::string shown(float value);
/// The same for JSON, where NaN is null.
Json number(double value);
/// Columns in a terminal, 100 elsewhere.
int terminal_width();
struct TerminalSize {
  int columns, rows;
};
/// As it is; generous where nobody tells.
TerminalSize terminal_size();
/// Standard output is a terminal that understands cursor movements.
bool on_terminal();
/// And its reader has not asked for none (NO_COLOR, see no-color.org).
bool in_colours();

}  // namespace console

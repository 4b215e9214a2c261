// SPDX-License-Identifier: MIT
#include "console/console.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdlib>

namespace console {
namespace {

volatile std::sig_atomic_t seen_signal = 0;

void note(int signal) { seen_signal = signal; }

bool install() {
  struct sigaction action {};
  action.sa_handler = note;  // no SA_RESTART: whatever waits returns
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) sigaction(signal, &action, nullptr);
  return true;
}

}  // namespace

Session& Console::session() {
  if (!session_) {
    session_.emplace(options.sim ? simulated_(options) : usb().open(options.serial));
    opened_ = options;
  }
  const bool same_place = !options.sim || (opened_.sim && options.motor == opened_.motor);
  const bool same_serial =
      options.serial == opened_.serial || std::string(session_->hello().serial).rfind(options.serial, 0) == 0;
  if (!same_place || !same_serial)
    refuse(fmt::format("This prompt talks to {}; end it, and say --serial, --sim or --motor where hotcore is started.",
                       session_->name()));
  return *session_;
}

link::Usb& Console::usb() {
  if (!usb_) usb_.emplace();
  return *usb_;
}

void Console::say(const std::string& text, const Json& json) const { put(options.json ? one_line(json) + "\n" : text); }

void Console::tell(const std::string& text) const {
  if (!options.json) std::fputs((text + "\n").c_str(), stderr);
}

bool interrupted() {
  static const bool installed = install();
  return installed && seen_signal != 0;
}

void forget_interrupt() { seen_signal = 0; }

void stop_if_interrupted(const std::string& state) {
  if (interrupted()) throw UserError(Exit::interrupted, state);
}

void put(const std::string& text) {
  const bool all = std::fputs(text.c_str(), stdout) >= 0 && std::fflush(stdout) == 0;
  if (all || errno == EPIPE) return;  // of which SIGPIPE has told
  refuse("standard output: cannot be written; the answer is not complete.");
}

std::string one_line(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

std::string shown(float value) { return std::isnan(value) ? "unset" : fmt::format("{:.6g}", value); }

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

TerminalSize terminal_size() {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 && size.ws_row > 0)
    return {size.ws_col, size.ws_row};
  return {100, 1000};
}

int terminal_width() {
  const int columns = terminal_size().columns;
  return columns >= 40 ? columns : 100;
}

bool on_terminal() {
  const char* kind = std::getenv("TERM");
  return isatty(STDOUT_FILENO) == 1 && kind != nullptr && std::string(kind) != "dumb";
}

bool in_colours() {
  const char* none = std::getenv("NO_COLOR");
  return on_terminal() && (none == nullptr || *none == '\0');
}

}  // namespace console

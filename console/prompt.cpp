// SPDX-License-Identifier: MIT
#include <editline/readline.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <iostream>

#include "console/commands.hpp"

namespace console {
namespace {

Console* completing = nullptr;  // libedit's callbacks take no context

/// Asked again and again for the next word.
char* next_word(const char* word, int state) {
  static std::vector<std::string> words;
  if (state == 0) {
    words = completions(*completing, std::string(rl_line_buffer).substr(0, static_cast<std::size_t>(rl_point)), word);
    std::reverse(words.begin(), words.end());
  }
  if (words.empty()) return nullptr;
  char* copy = strdup(words.back().c_str());
  words.pop_back();
  return copy;
}

char** complete(const char* word, int, int) {
  rl_attempted_completion_over = 1;  // no file names
  return rl_completion_matches(word, next_word);
}

/// False at the end of input.
bool read_line(std::string& line) {
  if (isatty(STDIN_FILENO) == 0) return static_cast<bool>(std::getline(std::cin, line));
  char* typed = readline("hotcore> ");
  if (typed == nullptr) return false;
  line = typed;
  if (!line.empty()) add_history(typed);
  std::free(typed);
  return true;
}

}  // namespace

std::vector<std::string> completions(Console& console, const std::string& line, const std::string& word) {
  std::vector<std::string> known;
  const std::string before = line.substr(0, line.size() - std::min(line.size(), word.size()));
  const std::size_t first = before.find_first_not_of(' ');
  const std::string command = first == std::string::npos ? "" : before.substr(first, before.find(' ', first) - first);
  CLI::App app;
  add_commands(app, console);
  if (command.empty()) {
    for (const CLI::App* one : app.get_subcommands({})) known.push_back(one->get_name());
    known.push_back("quit");
  } else if (word.rfind('-', 0) == 0) {
    for (const CLI::App* one : app.get_subcommands({})) {
      if (one->get_name() != command) continue;
      for (const CLI::Option* option : one->get_options()) {
        if (!option->get_lnames().empty()) known.push_back("--" + option->get_lnames().front());
      }
    }
  } else if (command == "mode") {
    known = {"current", "torque"};
  } else {
    try {
      if (command == "watch" || command == "log" || command == "capture")
        known = console.session().signals().names();
      else if (command == "get" || command == "set")
        known = console.session().parameters().names();
      if (command == "set") {
        for (std::string& name : known) name += "=";
      }
    } catch (const UserError&) {
      return {};  // no board, no names; the command itself will say so
    }
  }
  std::erase_if(known, [&](const std::string& name) { return name.rfind(word, 0) != 0; });
  return known;
}

int prompt(Console& console) {
  completing = &console;
  rl_readline_name = "hotcore";
  rl_attempted_completion_function = complete;
  rl_completer_word_break_characters = const_cast<char*>(" \t");
  int code = 0;
  if (isatty(STDIN_FILENO) != 0) {
    code = run_line(console, [&](CLI::App&) {
      console.tell(fmt::format("Connected to {}. TAB completes, 'help' lists the commands, Ctrl-D ends.",
                               console.session().name()));
    });
    if (code != 0) return code;
  }
  const Options usual = console.options;
  for (std::string line; read_line(line);) {
    line.erase(line.find_last_not_of(" \t\r") + 1);  // TAB leaves a blank behind what it completed
    line.erase(0, line.find_first_not_of(" \t"));
    if (line.empty() || line.front() == '#') continue;
    if (line == "quit" || line == "exit") break;
    if (line == "help") line = "--help";
    forget_interrupt();
    code = run_line(console, [&](CLI::App& app) { app.parse(line); });
    console.options = usual;  // also for what TAB completes next
  }
  return code;
}

}  // namespace console

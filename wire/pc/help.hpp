// SPDX-License-Identifier: MIT
// How the PC programs show their options: in a hundred columns, what an option takes and its default, and no more.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "wire/pc/commit.hpp"
#include "wire/pc/names.hpp"

namespace wire::pc {

class Help : public CLI::Formatter {
 public:
  static constexpr std::size_t columns = 100;

  std::string make_option_opts(const CLI::Option* option) const override {
    if (option->get_positional()) return option->get_expected_max() > 1 ? " ..." : "";
    if (option->get_type_size() == 0) return "";
    const std::string type = option->get_type_name();  // "TEXT:{0,1,both}": followed by what checks it
    const std::string checks = type.find(':') == std::string::npos ? "" : type.substr(type.find(':') + 1);
    const std::string takes = checks.rfind('{', 0) == 0 ? checks : plain(type.substr(0, type.find(':')));
    std::string notes = option->get_default_str();
    if (checks.find(" to ") != std::string::npos) notes += (notes.empty() ? "" : "; ") + checks;
    return " " + takes + (notes.empty() ? "" : " (" + notes + ")");
  }
  std::string make_option_desc(const CLI::Option* option) const override {
    return wrapped(option->get_description(), columns - get_column_width());
  }
  std::string make_footer(const CLI::App* app) const override {
    const std::string text = app->get_footer();
    return text.empty() ? "" : wrapped(text, columns) + "\n";
  }

 private:
  static std::string plain(const std::string& type) {
    return type == "TEXT" ? "WORD" : type == "FLOAT" ? "X" : type == "INT" || type == "UINT" ? "N" : type;
  }
  static std::string wrapped(const std::string& text, std::size_t width) {
    std::string out;
    std::size_t line = 0, gap = 0;  // where the line begins; its last gap, 0: none
    for (const char c : text) {
      if (c == '\n') line = out.size() + 1, gap = 0;
      if (c == ' ') gap = out.size();
      out += c;
      if (out.size() - line > width && gap > line) {
        out[gap] = '\n';
        line = gap + 1;
        gap = 0;
      }
    }
    return out;
  }
};

/// A number within these; CLI::Range lets what is no number through.
inline CLI::Validator between(double low, double high) {
  return CLI::Validator(
      [low, high](std::string& word) {
        double x = 0;
        if (CLI::detail::lexical_cast(word, x) && x >= low && x <= high) return std::string();
        return fmt::format("{} is not in {:g} to {:g}", word, low, high);
      },
      "FLOAT");
}

/// Of a mistake on the command line: ", did you mean --motor?" where an option is nearly one that there is, or nothing.
inline std::string nearest_option(const CLI::App& app) {
  std::vector<std::string> known;
  const auto add = [&](const CLI::App& of) {
    for (const CLI::Option* option : of.get_options())
      known.insert(known.end(), option->get_lnames().begin(), option->get_lnames().end());
  };
  add(app);
  for (const CLI::App* command : app.get_subcommands([](const CLI::App* c) { return c->parsed(); })) add(*command);
  for (const std::string& word : app.remaining(true)) {
    if (word.rfind("--", 0) != 0) continue;
    const std::string name = nearest(word.substr(2, word.find('=') - 2), known);
    if (!name.empty()) return ", did you mean --" + name + "?";
  }
  return "";
}

/// Of a mistake on the command line: "foo: there is no such command" and the nearest that there is, where none is said.
inline std::string unknown_command(const CLI::App& app) {
  std::vector<std::string> known;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (command->parsed()) return "";
    known.push_back(command->get_name());
  }
  for (const std::string& word : app.remaining()) {
    if (known.empty() || word.rfind('-', 0) == 0) continue;
    const std::string hint = did_you_mean(word, known);
    return word + ": there is no such command" + (hint.empty() ? ";" : hint);
  }
  return "";
}

/// Of seeds and counts: below it each is a whole number of its own in what a check reads.
inline constexpr double most_seed = 1e15;

/// How a program shows its options, says which one it is, and answers a mistake.
inline void use_help(CLI::App& app, const std::string& program) {
  app.name(program);
  app.formatter(std::make_shared<Help>());
  app.set_version_flag("--version", fmt::format("{}, commit {}", program, commit), "tell the commit it was built from");
  app.failure_message([call = program + " --help"](const CLI::App* of, const CLI::Error& error) {
    const std::string command = unknown_command(*of);
    if (!command.empty()) return command + " " + call + " lists what there is.\n";
    const std::string hint = nearest_option(*of);
    return error.what() + (hint.empty() ? ";" : hint) + " " + call + " lists what there is.\n";
  });
}

}  // namespace wire::pc

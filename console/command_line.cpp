// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include "console/commands.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/names.hpp"

namespace console {
namespace {

constexpr const char* examples =
    "hotcore: talk to a driver board on USB\n"
    "\n"
    "Examples\n"
    "  hotcore list                                  boards that are plugged in\n"
    "  hotcore watch                                 live values and curves of both axes\n"
    "  hotcore ask \"20A 0.3s, 6A 5s\"                 could the winding stand this now?\n"
    "  hotcore run \"5A 1s, 0A 0.5s\" --axis 1         arm, play a course of current, disarm\n"
    "  hotcore --sim run \"20A 20ms, -20A 40ms, 20A 20ms\" --times 40   shaken until heat limits it\n"
    "  hotcore set axis0.current_limit_A=12 --save   ranges and meanings: hotcore get\n"
    "  hotcore motor ec-16-40w --supply 48           tell axis 0 the sheet of its motor\n"
    "  hotcore align                                 find its angle_offset; the shaft turns\n"
    "  hotcore backup mine.toml                      all parameters into a file\n"
    "  hotcore log --out run.csv --seconds 60        a log that identify reads as it is\n"
    "  hotcore fault                                 what happened, the evidence, what to do\n"
    "  hotcore                                       a prompt with completion\n"
    "  hotcore --sim watch                           the same on a simulated board, without any hardware\n";

constexpr const char* exit_codes =
    "Exit codes: 0 done; 2 command line or file wrong; 3 data unusable; 4 no board, or several fit; 5 no permission "
    "(see hotcore udev); 6 busy; 7 the board went away; 8 the board refused; 9 versions differ; 130 Ctrl-C, "
    "disarmed.\n";

void add_options(CLI::App& app, Console& console) {
  app.add_option("--serial", console.options.serial, "the board whose serial begins so");
  app.add_flag("--sim", console.options.sim,
               "a simulated board in this process (HOTCORE_SIM_FAST=1: faster than real time)");
  app.add_option("--motor", console.options.motor, "the motors of that board: a .toml file, or a name in boards/motors")
      ->capture_default_str()
      ->type_name("MOTOR");
  app.add_flag("--json", console.options.json, "answer in JSON, one object a line");
}

/// Words that nobody asked for: the first is a command that is none, or too much.
std::string unexpected(const CLI::App& app) {
  const std::vector<std::string> left = app.remaining(true);
  const std::string word = left.empty() ? "" : left.front();
  if (!app.get_subcommands().empty() || word.rfind('-', 0) == 0)
    return fmt::format("'{}' was not expected ('hotcore --help' shows how).", word);
  std::vector<std::string> known;
  for (const CLI::App* command : app.get_subcommands({})) known.push_back(command->get_name());
  const std::string hint = wire::pc::did_you_mean(word, known);
  return fmt::format("There is no command '{}'{} 'hotcore --help' lists them.", word, hint.empty() ? ";" : hint);
}

}  // namespace

CLI::Validator between(double least, double most) {
  return CLI::Validator(
      [=](std::string& text) {
        double value = 0;
        if (!CLI::detail::lexical_cast(text, value)) return fmt::format("'{}' is not a number", text);
        if (value >= least && value <= most) return std::string();
        return fmt::format("{} is out of range; it may be {:g} to {:g}", text, least, most);
      },
      most < longest_s ? fmt::format("{:g} to {:g}", least, most) : "");
}

void add_commands(CLI::App& app, Console& console) {
  app.fallthrough();  // options of the program may stand behind the command
  add_boards(app, console);
  add_parameters(app, console);
  add_motion(app, console);
  add_records(app, console);
  add_identify(app, console);
  add_motor(app, console);
  add_align(app, console);
}

int run_line(Console& console, const std::function<void(CLI::App&)>& parse) {
  CLI::App app{examples};
  wire::pc::use_help(app, "hotcore");
  app.footer(exit_codes);
  add_options(app, console);
  add_commands(app, console);
  int code = 0;
  const auto failed = [&](const std::string& sentence, int exit_code) {
    code = exit_code;
    // Not by what throws: standard output or error may be the reason.
    if (console.options.json)
      std::fputs((one_line({{"error", sentence}, {"exit_code", exit_code}}) + "\n").c_str(), stdout);
    std::fflush(stdout);  // a program that reads answer by answer waits for it
    std::fputs((sentence + "\n").c_str(), stderr);
  };
  try {
    parse(app);
  } catch (const CLI::ExtrasError&) {
    failed(unexpected(app), static_cast<int>(Exit::usage));
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help
    failed(std::string(error.what()) + " ('hotcore --help' shows how).", static_cast<int>(Exit::usage));
  } catch (const UserError& error) {
    if (error.exit_code() == static_cast<int>(Exit::gone)) console.hang_up();
    failed(error.what(), error.exit_code());
  } catch (const std::exception& error) {
    failed(fmt::format("hotcore stopped: {}. This is a fault of the program; please report the command.", error.what()),
           static_cast<int>(Exit::unusable));
  }
  return code;
}

}  // namespace console

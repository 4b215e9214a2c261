// SPDX-License-Identifier: MIT
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <optional>

#include "console/commands.hpp"
#include "console/drive.hpp"
#include "console/heat_experiment.hpp"
#include "console/parameter_file.hpp"
#include "console/recorder.hpp"
#include "wire/pc/files.hpp"

namespace console {
namespace {

/// The program identify: beside this one, or wherever the shell finds it.
std::string identify_program() {
  std::error_code error;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", error);
  const auto beside = self.parent_path() / "identify";
  return !error && access(beside.c_str(), X_OK) == 0 ? beside.string() : "identify";
}

/// Runs it without a shell, for a program that reads JSON from us with its text on standard error. Throws UserError
/// (unusable) when it left no answer in the file `json`; it has said why.
void run_identify(std::vector<std::string> arguments, const std::string& json, bool quiet) {
  std::filesystem::remove(json);  // of an earlier run
  arguments.insert(arguments.begin(), identify_program());
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    if (quiet) dup2(STDERR_FILENO, STDOUT_FILENO);
    execvp(argv[0], argv.data());
    _exit(127);
  }
  int status = 0;
  while (child > 0 && waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  stop_if_interrupted("Stopped while identify worked; nothing was written, the log is kept.");
  if (child > 0 && WIFSIGNALED(status))
    refuse_data(fmt::format("identify was killed by signal {}; the log is kept, run it by hand.", WTERMSIG(status)));
  const int code = child > 0 ? WEXITSTATUS(status) : 127;
  if (code == 127) refuse_data("The program identify was not found; build it or put it beside hotcore.");
  if (code != 0 && !std::filesystem::exists(json))
    refuse_data("identify could not use the log; its sentence stands above, the log is kept.");
}

Values values_of(Session& session, int axis) {
  std::vector<Target> mine;
  for (const Target& target : session.parameters().all()) {
    if (target.axis == axis) mine.push_back(target);
  }
  const std::vector<float> numbers = session.get(mine);
  Values values;
  for (std::size_t i = 0; i < mine.size(); ++i) values[full_name(*mine[i].what)] = numbers[i];
  return values;
}

struct Arguments {
  std::string axis = "0", out = "out/identify";
  double minutes = 20;
  std::optional<double> ambient_degC;
  bool yes = false, save = false, force = false;
};

/// Drives the designed course and logs it.
Driven record(Console& console, int axis, const std::vector<Piece>& course, const std::string& log) {
  Session& session = console.session();
  const auto mask = static_cast<std::uint8_t>(1 << axis);
  Recorder recorder(session, log, fmt::format("axis {}, designed course for identification", axis),
                    usual_signals(session.signals(), axis), 10);
  double length_s = 0, told_s = -1e9;
  for (const Piece& piece : course) length_s += double{piece.seconds};
  Driven driven;
  try {
    {
      Armed armed(session, mask);
      const auto look = [&](const wire::State& state, double time_s) {
        if (time_s - told_s < length_s / 10) return;
        told_s = time_s;
        console.tell(fmt::format("  {:3.0f} %   core {:.1f} degC, {:.1f} A of {:.1f} A allowed",
                                 100 * time_s / length_s, state.axis[axis].core_degC,
                                 std::hypot(state.axis[axis].id_A, state.axis[axis].iq_A),
                                 state.axis[axis].allowance_A));
      };
      driven = drive(session, mask, course, Along::d, look)[static_cast<std::size_t>(axis)];
    }
    recorder.finish();
  } catch (const UserError& error) {
    recorder.file().end(error);
  }
  return driven;
}

bool agreed(Console& console, const Arguments& a) {
  if (a.yes) return true;
  if (console.options.json || isatty(STDIN_FILENO) == 0) return false;
  fmt::print("Put these in force? [y/N] ");
  std::fflush(stdout);
  std::string answer;
  std::getline(std::cin, answer);
  std::cin.clear();  // Ctrl-C ended it, and the prompt may ask again
  stop_if_interrupted("Stopped; nothing was written.");
  return answer == "y" || answer == "yes";
}

void identify(Console& console, const Arguments& a) {
  const std::string log = a.out + "/log.csv", sheet = a.out + "/motor.toml", json = a.out + "/answer.json",
                    model = a.out + "/model.toml";
  std::error_code told_below;
  std::filesystem::create_directories(a.out, told_below);
  wire::pc::need_new_file(log, a.force);
  Session& session = console.session();
  const int axis = a.axis == "1" ? 1 : 0;
  need_mode(console, static_cast<std::uint8_t>(1 << axis), wire::ControlMode::current);
  const Values before = values_of(session, axis);
  const double rated_A = continuous_A(before);
  wire::pc::write_whole(sheet, sheet_of(before, fmt::format("axis {} of {}", axis, session.name())));

  console.tell(fmt::format(
      "Heating axis {} for {:g} min with up to {:.1f} A along the magnet, which makes no torque; the shaft "
      "must be free to stand still. Ctrl-C disarms.{}",
      axis, a.minutes, 2.5 * rated_A,
      a.ambient_degC ? "" : " Without --ambient DEGC the room is taken to be as warm as the motor is now."));
  const Driven driven = record(console, axis, designed_course(rated_A, a.minutes), log);
  console.tell(fmt::format("The winding reached {:.1f} degC (estimated). Asking identify.", driven.peak_degC));
  std::filesystem::remove(model);  // of an earlier run
  std::vector<std::string> words = {
      log, "--motor", sheet, "--json", json, "--write-model", model, "--html", a.out + "/report.html"};
  if (a.ambient_degC) words.insert(words.end(), {"--ambient", fmt::format("{}", *a.ambient_degC)});
  run_identify(words, json, console.options.json);

  std::ifstream in(json);
  const auto answer = nlohmann::json::parse(in, nullptr, false);
  if (!answer.is_object()) refuse_data(json + ": identify left no answer there; run it on the log by hand.");
  const std::string sentence = answer.value("sentence", std::string());
  const Offer offered = offer(answer, model, before, a.ambient_degC.has_value());
  std::string text = sentence + "\n";
  Json changes = Json::object();
  std::vector<Assignment> assignments;
  for (const auto& [name, value] : offered.values) {
    const auto old = before.find(name);
    if (old == before.end() || old->second == value) continue;
    const Target target = session.parameters().named(fmt::format("axis{}.{}", axis, name)).front();
    assignments.push_back({target, value});
    text += fmt::format("  {:<32} {:>11} -> {}\n", full_name(target), shown(old->second), shown(value));
    changes[full_name(target)] = {{"before", number(old->second)}, {"found", number(value)}};
  }
  Json result = {{"sentence", sentence},
                 {"verdict", answer.value("verdict", std::string())},
                 {"changes", changes},
                 {"log", log},
                 {"model", std::filesystem::exists(model) ? Json(model) : Json()},
                 {"report", a.out + "/report.html"},
                 {"written", false},
                 {"saved", false}};
  text += fmt::format("Log, model and report: {}\n", a.out);
  result["note"] = offered.note;
  if (offered.values.empty()) {
    text += fmt::format("Nothing was written: {}.\n", offered.note);
    return console.say(text, result);
  }
  text += offered.note + ".\n";
  for (const Assignment& assignment : assignments) check(assignment, "identify found ");
  if (!console.options.json) fmt::print("{}", text);
  if (!assignments.empty() && agreed(console, a)) {
    session.set(assignments);
    if (a.save) session.save();
    result["written"] = true;
    result["saved"] = a.save;
    text = a.save ? "In force and saved.\n" : "In force until the next reset; 'hotcore save' keeps it.\n";
  } else {
    text = assignments.empty() ? "Nothing to write: the board has these values already.\n"
                               : "Nothing was written; --yes writes without asking.\n";
  }
  console.say(text, result);
}

}  // namespace

void add_identify(CLI::App& app, Console& console) {
  auto a = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("identify", "heat an axis under protection, find its thermal model, write it back");
  command->add_option("--axis", a->axis, "0 or 1")->capture_default_str()->check(CLI::IsMember({"0", "1"}));
  command->add_option("--minutes", a->minutes, "length of the course")
      ->capture_default_str()
      ->check(between(1.0, 240.0));
  command
      ->add_option("--ambient", a->ambient_degC, "how warm the room is, degC; else what the motor begins at is taken")
      ->check(between(-40, 55));
  command->add_option("--out", a->out, "folder for log, model and report")->capture_default_str();
  command->add_flag("--yes", a->yes, "write what was found without asking");
  command->add_flag("--save", a->save, "and keep it over a reset");
  command->add_flag("--force", a->force, "write over the log that is in the folder");
  command->callback([&console, a] { identify(console, *a); });
}

}  // namespace console

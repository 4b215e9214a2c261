// SPDX-License-Identifier: MIT
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numeric>
#include <optional>

#include "console/commands.hpp"
#include "console/drive.hpp"
#include "console/heat_experiment.hpp"
#include "console/proposal.hpp"
#include "console/recorder.hpp"
#include "console/winding_log.hpp"
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
  if (code == 127)
    refuse_data("The program identify was not found; put it beside hotcore or run it by hand, the log is kept.");
  if (code != 0 && !std::filesystem::exists(json))
    refuse_data("identify could not use the log; its sentence stands above, the log is kept.");
}

struct Arguments {
  std::string axis = "0", out = "out/identify";
  double minutes = 20, leads_ohm = 0.01;
  std::optional<double> ambient_degC;
  bool turning = false, force = false;
  Consent consent;
};

// Electrical: 19 turns a second, so that phases share the heat of any winding (heat.params: R1 C1 is at least 0.5 s).
constexpr float turning_rad_per_s = 120;

/// Drives the designed course and logs it.
Driven record(Console& console, int axis, const Values& before, const Arguments& a, const std::string& log) {
  Session& session = console.session();
  const auto mask = static_cast<std::uint8_t>(1 << axis);
  const double whole_A = course_A(before);
  std::vector<Piece> course = designed_course(whole_A, a.minutes);
  const std::vector<Piece> cold = cold_course(before), rest = {{0, 2}};
  const auto length_s = [](const std::vector<Piece>& pieces) {
    return std::accumulate(pieces.begin(), pieces.end(), 0.0,
                           [](double s, const Piece& piece) { return s + double{piece.seconds}; });
  };
  const double whole_s = length_s(course) + (a.turning ? length_s(cold) + length_s(rest) : 0);
  double played_s = 0, told_s = -1e9;
  const auto look = [&](const wire::State& state, double time_s) {
    const double at_s = played_s + time_s;
    if (at_s - told_s < whole_s / 10) return;
    told_s = at_s;
    console.tell(fmt::format("  {:3.0f} %   core {:.1f} degC, {:.1f} A of {:.1f} A allowed", 100 * at_s / whole_s,
                             state.axis[axis].core_degC, std::hypot(state.axis[axis].id_A, state.axis[axis].iq_A),
                             state.axis[axis].allowance_A));
  };
  const auto play = [&](const std::vector<Piece>& pieces, float electrical_rad_per_s) {
    const Driven driven = drive(session, mask, pieces, Along::d, look,
                                electrical_rad_per_s / before.at("pole_pairs"))[static_cast<std::size_t>(axis)];
    played_s += length_s(pieces);
    return driven;
  };

  const std::string what = fmt::format("axis {}, designed course for identification", axis);
  WindingLog winding(
      Ohmmeter(static_cast<float>(probe_share * whole_A), static_cast<float>(larger_share * whole_A), a.leads_ohm));
  Recorder recorder =
      a.turning
          ? Recorder(
                session, log, what, WindingLog::signals(session, axis), WindingLog::telemetry_Hz, {"winding_ohm"},
                [&](double time_s, const std::vector<float>& row, LogFile& file) { winding.take(time_s, row, file); })
          : Recorder(session, log, what, usual_signals(session.signals(), axis), WindingLog::log_Hz);
  Driven driven;
  try {
    {
      Armed armed(session, mask);
      if (a.turning) {
        play(cold, turning_rad_per_s);
        // At rest, as the log has to begin.
        play(rest, 0);
        if (!winding.begin())
          console.tell(
              fmt::format("The winding cannot be read: {:.1f} and {:.1f} A did not flow, or --leads is too much; is "
                          "the current limited?",
                          probe_share * whole_A, larger_share * whole_A));
        play({course.front()}, 0);
        course.erase(course.begin());
      }
      driven = play(course, a.turning ? turning_rad_per_s : 0);
      armed.disarm();
    }
    recorder.finish();
  } catch (const UserError& error) {
    recorder.file().end(error);
  }
  return driven;
}

void identify(Console& console, const Arguments& a) {
  const std::string log = a.out + "/log.csv", sheet = a.out + "/motor.toml", json = a.out + "/answer.json",
                    model = a.out + "/model.toml";
  wire::pc::need_folder(a.out);
  wire::pc::need_new_file(log, a.force);
  Session& session = console.session();
  const int axis = a.axis == "1" ? 1 : 0;
  need_mode(console, static_cast<std::uint8_t>(1 << axis), wire::ControlMode::current);
  const Values before = values_of(session, axis);
  const double whole_A = course_A(before);
  wire::pc::write_whole(sheet, sheet_of(before, fmt::format("axis {} of {}", axis, session.name())));

  console.tell(fmt::format(
      "Heating axis {} for {:g} min with up to {:.1f} A along the magnet, which makes no torque; the shaft "
      "{}. Ctrl-C disarms.{}",
      axis, a.minutes, 2.5 * whole_A, a.turning ? "must be free, it turns slowly" : "must be free to stand still",
      a.ambient_degC ? "" : " Without --ambient DEGC the room is taken to be as warm as the motor is now."));
  const Driven driven = record(console, axis, before, a, log);
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
  Json result = {{"sentence", sentence},
                 {"verdict", answer.value("verdict", std::string())},
                 {"log", log},
                 {"model", std::filesystem::exists(model) ? Json(model) : Json()},
                 {"report", a.out + "/report.html"},
                 {"note", offered.note}};
  const std::string text = fmt::format("{}\nLog, model and report: {}\n", sentence, a.out);
  if (offered.values.empty()) {
    result.update({{"changes", Json::object()}, {"written", false}, {"saved", false}});
    return console.say(fmt::format("{}Nothing was written: {}.\n", text, offered.note), result);
  }
  if (!console.options.json) put(text + offered.note + ".\n");
  const Outcome outcome = put_in_force(console, axis, before, offered.values, "identify found ", a.consent);
  result.update(outcome.json);
  console.say(outcome.text, result);
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
  command->add_flag("--turning", a->turning, "let the free shaft turn slowly, so that R1 and C1 are found as they are");
  command->add_option("--leads", a->leads_ohm, "ohm in series with a phase, the board's switch and shunt included")
      ->capture_default_str()
      ->check(between(0, 1));
  command->add_option("--out", a->out, "folder for log, model and report")->capture_default_str();
  add_consent(*command, a->consent);
  command->add_flag("--force", a->force, "write over the log that is in the folder");
  command->callback([&console, a] { identify(console, *a); });
}

}  // namespace console

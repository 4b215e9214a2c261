// SPDX-License-Identifier: MIT
// The program host-sim: plays scenes on simulated boards, draws the paper's figures, records logs.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#ifdef HOTCORE_TRAP_FLOATS
#include <cfenv>
#endif

#include "boards/host/figures.hpp"
#include "boards/host/record.hpp"
#include "boards/host/run_scene.hpp"
#include "boards/host/scene.hpp"
#include "boards/host/trace.hpp"
#include "wire/pc/files.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/motor_file.hpp"
#include "wire/pc/program.hpp"

namespace {

using namespace boards::host;

const std::string root = HOTCORE_SOURCE_DIR;
const std::string motor_folder = root + "/boards/motors", scene_folder = root + "/host-sim/scenes";

constexpr const char* examples =
    "Examples:\n"
    "  host-sim run jump                         the scene, its log and its picture below ./out/jump\n"
    "  host-sim run stall --set shaft.angle_rad=0.5 --set seed=7\n"
    "  host-sim run jump --set trust=sheet       what not knowing the motor costs\n"
    "  host-sim figures                          Figs 1, 2, 6 and the tables of Urata et al. 2008\n"
    "  host-sim record duty --hide seed=7        a 20 min log of a motor that is not what its sheet says\n"
    "  host-sim run get-up --hide seed=7 --set trust=identified --set model=model.toml   identify's model\n"
    "  host-sim record profile --profile answer.json --hide seed=7   what identify advised for it\n"
    "  host-sim list                             scenes and motors\n"
    "Exit codes: 0 done, 2 the command line or a file is wrong.\n";

/// Shows how far a run is once it lasts longer than a second: in place on a terminal, else a line each quarter.
class Progress {
 public:
  explicit Progress(const std::string& what) : what_(what) {}
  ~Progress() {
    if (shown_ && terminal_) std::fputs("\r\033[K", stderr);
  }
  void operator()(double share) {
    if (std::chrono::steady_clock::now() - start_ < std::chrono::seconds(1)) return;
    const int quarter = static_cast<int>(4 * share);
    if (!terminal_ && quarter <= quarter_) return;
    quarter_ = quarter;
    fmt::print(stderr, "{}  {} {:3.0f} %{}", terminal_ ? "\r" : "", what_, 100 * share, terminal_ ? "" : "\n");
    std::fflush(stderr);
    shown_ = true;
  }

 private:
  std::string what_;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  const bool terminal_ = isatty(STDERR_FILENO) != 0;
  int quarter_ = 0;
  bool shown_ = false;
};

std::optional<std::uint64_t> seed_of(const std::string& hide) {
  if (hide.empty()) return {};
  const std::string digits = hide.rfind("seed=", 0) == 0 ? hide.substr(5) : "";
  if (digits.empty() || digits.size() > 18 || digits.find_first_not_of("0123456789") != std::string::npos) {
    wire::pc::refuse(fmt::format("--hide {}: write it as seed=N with a whole number N.", hide));
  }
  return std::stoull(digits);
}

void run(const std::string& name, const std::vector<std::string>& overrides, const std::optional<std::uint64_t>& hide,
         const std::string& out, bool json) {
  const Scene scene = read_scene(name, scene_folder, overrides);
  RunOptions options{.motor_folder = motor_folder};
  if (hide) {
    const HiddenMotor motor = hidden_motor(*hide, scene.motor, motor_folder);
    options.plant_motor = motor.motor;
    options.hidden = motor.hidden;
  }
  const std::string folder = out + "/" + scene.id;
  wire::pc::need_folder(folder);
  Result result;
  {
    Progress progress(scene.id);
    options.progress = [&](double share) { progress(share); };
    result = run_scene(scene, options);
  }
  write_files(result, folder);
  if (json)
    fmt::print("{}", summary_json(result));
  else
    fmt::print("{}  picture: {}/{}.svg, logs: {}/*.csv\n", summary_text(result), folder, scene.id, folder);
}

void figures(const std::string& out, bool json) {
  const PaperFigures paper = paper_figures(motor_folder);
  const std::vector<std::string> paths = draw_figures(paper, out + "/figures");
  fmt::print("{}",
             json ? figures_json(paper) : figures_text(paper) + fmt::format("Written: {}\n", fmt::join(paths, " ")));
}

void record_log(RecordOptions options, const std::string& out, bool json) {
  wire::pc::need_folder(out);
  Recording recording;
  {
    Progress progress("recording");
    options.progress = [&](double share) { progress(share); };
    recording = record(options);
  }
  const std::string log = out + "/log.csv", truth = out + "/truth.json";
  wire::pc::write_whole(log, recording.log_csv);
  wire::pc::write_whole(truth, recording.truth_json);
  if (json) {
    fmt::print("{{\"log\": \"{}\", \"truth\": \"{}\", \"hottest_core_degC\": {:.1f}, \"winding_max_degC\": {:g}}}\n",
               log, truth, recording.hottest_true_degC, recording.winding_max_degC);
  } else {
    fmt::print("Recorded (simulated): {}; the hottest winding was {:.1f} degC of {:g} allowed.{}\n", log,
               recording.hottest_true_degC, recording.winding_max_degC,
               options.hide ? " What is hidden: " + truth : "");
  }
}

void list(bool json) {
  nlohmann::ordered_json all;
  std::string text = fmt::format("Scenes ({}):\n", scene_folder);
  for (const std::string& name : scene_names(scene_folder)) {
    const std::string title = read_scene(name, scene_folder, {}).title;
    text += fmt::format("  {:<16}{}\n", name, title);
    all["scenes"].push_back({{"name", name}, {"title", title}});
  }
  text += fmt::format("Motors ({}):\n", motor_folder);
  for (const std::string& name : wire::pc::motor_names(motor_folder)) {
    const wire::pc::MotorFile file = wire::pc::read_motor(name, motor_folder);
    text += fmt::format("  {:<24}{}{}\n", name, file.name, file.surrogate ? " (surrogate)" : "");
    all["motors"].push_back({{"name", name}, {"title", file.name}, {"surrogate", file.surrogate}});
  }
  fmt::print("{}", json ? all.dump() + "\n" : text);
}

}  // namespace

int main(int argc, char** argv) {
#ifdef HOTCORE_TRAP_FLOATS
  feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
#endif
  CLI::App app{fmt::format("{}\nSimulated boards with the firmware that would be flashed.\n", examples)};
  wire::pc::use_help(app, "host-sim");
  app.require_subcommand(1);
  std::string scene, hide, out = "out";
  std::vector<std::string> overrides;
  bool json = false;

  CLI::App* run_command = app.add_subcommand("run", "play a scene");
  run_command->add_option("scene", scene, "a name (see list) or a .toml file")->required();
  run_command->add_option("--set", overrides, "key=value of the scene, e.g. seconds=5 or shaft.angle_rad=0.5")
      ->take_all()
      ->type_name("KEY=VALUE");
  run_command
      ->add_option("--hide", hide, "the motor that record --hide seed=N records; the firmware believes its sheet")
      ->type_name("seed=N");
  run_command->add_option("--out", out, "folder for logs and picture")->capture_default_str()->type_name("FOLDER");
  run_command->add_flag("--json", json, "the summary as JSON on standard output");

  CLI::App* list_command = app.add_subcommand("list", "scenes and motors");
  list_command->add_flag("--json", json, "as JSON on standard output");

  CLI::App* figures_command = app.add_subcommand("figures", "the paper's figures and tables, computed anew");
  figures_command->add_option("--out", out, "folder for the pictures")->capture_default_str()->type_name("FOLDER");
  figures_command->add_flag("--json", json, "the numbers as JSON on standard output");

  RecordOptions recording{.motor_folder = motor_folder, .scene_folder = scene_folder};
  CLI::App* record_command = app.add_subcommand("record", "record a log, with an effect hidden in the motor if wanted");
  record_command->add_option("excitation", recording.excitation, "duty, designed, step, profile, or a scene")
      ->required();
  record_command->add_option("--profile", recording.profile, "identify's answer (--json) whose experiment is played")
      ->type_name("FILE");
  record_command->add_option("--motor", recording.motor, "a name (see list) or a .toml file")
      ->capture_default_str()
      ->type_name("MOTOR");
  record_command->add_option("--minutes", recording.minutes, "length of the log, 0.1 to 1440")
      ->capture_default_str()
      ->check(wire::pc::between(0.1, 1440.0))
      ->type_name("MINUTES");
  record_command->add_option("--seed", recording.seed, "of excitation and noise")
      ->capture_default_str()
      ->check(wire::pc::between(0, wire::pc::most_seed))
      ->type_name("N");
  record_command
      ->add_option("--hide", hide,
                   "hide an effect drawn from seed N, and take the motor off its sheet. Never drawn, since they cannot "
                   "show on a bench with one motor and one clock: current_offset (learnt at rest), neighbour_heat, "
                   "frame_conduction, clock_delay")
      ->type_name("seed=N");
  record_command->add_flag("--thermocouple", recording.thermocouple, "a winding temperature in every line");
  record_command->add_option("--out", out, "folder for log.csv and truth.json")
      ->capture_default_str()
      ->type_name("FOLDER");
  record_command->add_flag("--json", json, "what was recorded as JSON on standard output");

  record_command->footer(
      "Examples:\n"
      "  host-sim record duty                                    20 min as a robot's axis would have it\n"
      "  host-sim record duty --hide seed=7 --out out/7          of a motor that is not what its sheet says\n"
      "  host-sim record designed --hide seed=7 --thermocouple   a course that tells more, winding read always\n"
      "  host-sim record profile --profile answer.json --hide seed=7   what identify advised");

  return wire::pc::run_program(app, argc, argv, [&] {
    if (*run_command) run(scene, overrides, seed_of(hide), out, json);
    if (*list_command) list(json);
    if (*record_command) {
      recording.hide = seed_of(hide);
      record_log(recording, out, json);
    }
    if (*figures_command) figures(out, json);
    return 0;
  });
}

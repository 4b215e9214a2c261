// SPDX-License-Identifier: MIT
#include "boards/host/record.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "boards/host/run_scene.hpp"
#include "host-sim/plant/hidden_causes.hpp"
#include "wire/pc/motor_file.hpp"
#include "wire/pc/names.hpp"
#include "wire/pc/user_error.hpp"

namespace boards::host {
namespace {

constexpr double program_Hz = 20, log_Hz = 10;
constexpr double start_degC = 25;
// How far a real motor may be off its sheet (a shipped actuator product scales sheet R1 by 1.6 to 1.8).
constexpr double least_factor = 0.6, largest_factor = 1.8;
constexpr double least_error_K = 3, largest_error_K = 10;  // of an estimator that does not know the effect,
constexpr double sized_on_minutes = 20;                    // on a robot's duty, whatever is recorded afterwards
// Resistance as a thermometer: a reading now and then, when the motor happens to stand still.
constexpr double ohmmeter_K = 2, ohmmeter_every_s = 30;
constexpr double thermocouple_K = 0.2;  // white, of a fine wire with a 16-bit converter
// Each log begins at rest: the board learns its current sensors' offset, and a person sees what is soaked.
constexpr double rest_first_s = 10;
// A motor that is not known yet is kept this far below its limit: a design value of ours, not proven for the worst
// draw; every recording states how hot the winding really became.
constexpr double unknown_motor_margin_K = 40;

/// Effects that cannot show on a bench with one loaded motor and this firmware: the offset is learnt away, the other
/// motor and the frame are cold, and the clocks of one board do not differ.
bool shows_on_a_bench(const std::string& id) {
  return id != "current_offset" && id != "neighbour_heat" && id != "frame_conduction" && id != "clock_delay";
}

/// The scene that is recorded, without its program: a named one, or an empty one for a made excitation.
Scene scene_of(const RecordOptions& options) {
  Scene scene;
  std::vector<std::string> known = {"duty", "designed", "step", "profile"};
  if (std::find(known.begin(), known.end(), options.excitation) != known.end()) {
    scene.motor = options.motor;
    return scene;
  }
  const std::vector<std::string> scenes = scene_names(options.scene_folder);
  known.insert(known.end(), scenes.begin(), scenes.end());
  const bool file = options.excitation.ends_with(".toml");
  if (!file && std::find(scenes.begin(), scenes.end(), options.excitation) == scenes.end()) {
    const std::string hint = wire::pc::did_you_mean(options.excitation, known);
    wire::pc::refuse(fmt::format("There is nothing called '{}' to record{} There are: {}.", options.excitation,
                                 hint.empty() ? "." : hint, fmt::join(known, ", ")));
  }
  scene = read_scene(options.excitation, options.scene_folder, {});
  if (scene.shaft.kind == Shaft::Kind::free) {
    wire::pc::refuse(
        "A scene with a free shaft cannot be repeated; record duty, designed, step, profile, or a scene with "
        "an imposed speed or a locked rotor.");
  }
  return scene;
}

/// The experiment that identify advises, from its answer. Currents are direct ones, as in the log.
std::vector<host_sim::Demand> advised(const std::string& path) {
  using wire::pc::Exit, wire::pc::UserError;
  if (path.empty()) wire::pc::refuse("record profile needs --profile FILE; identify --json writes such a file.");
  std::ifstream in(path);
  if (!in) wire::pc::refuse(fmt::format("--profile {}: there is no such file; identify --json writes one.", path));
  const nlohmann::json answer = nlohmann::json::parse(in, nullptr, false);
  const bool advice = answer.is_object() && answer.contains("experiment") && answer["experiment"].is_object() &&
                      answer["experiment"].contains("profile") && answer["experiment"]["profile"].is_array();
  if (!advice) {
    wire::pc::refuse(fmt::format("--profile {}: no experiment in it; identify advises one where causes tie.", path));
  }
  std::vector<host_sim::Demand> demands;
  for (const nlohmann::json& step : answer["experiment"]["profile"]) {
    const auto number = [&](const char* key) {
      const bool there = step.is_object() && step.contains(key) && step[key].is_number();
      if (!there) wire::pc::refuse(fmt::format("--profile {}: a step without the number '{}'.", path, key));
      return step[key].get<double>();
    };
    host_sim::Demand demand;
    demand.current_A = number("current_A") / wire::direct_per_amplitude;
    demand.speed_rad_per_s = number("speed_rad_per_s");
    const double seconds = number("seconds");
    if (!(seconds >= 0 && seconds <= 86400))
      wire::pc::refuse(fmt::format("--profile {}: a step of {:g} s; 0 to 86400 are possible.", path, seconds));
    demands.insert(demands.end(), static_cast<std::size_t>(seconds * program_Hz), demand);
  }
  if (demands.empty()) wire::pc::refuse(fmt::format("--profile {}: the experiment has no step.", path));
  return demands;
}

/// A log begins at rest.
std::vector<host_sim::Demand> rested(std::vector<host_sim::Demand> demands) {
  for (std::size_t i = 0; i < std::min(demands.size(), static_cast<std::size_t>(rest_first_s * program_Hz)); ++i)
    demands[i].current_A = demands[i].speed_rad_per_s = 0;
  return demands;
}

std::vector<host_sim::Demand> made(host_sim::Excitation kind, const wire::Motor& sheet, double supply_V, double minutes,
                                   std::uint64_t seed) {
  return rested(host_sim::make_excitation(kind, sheet, host_sim::full_speed_rad_per_s(sheet, supply_V), minutes * 60,
                                          program_Hz, seed));
}

std::vector<host_sim::Demand> demands_of(const RecordOptions& options, const Scene& scene, const wire::Motor& sheet) {
  using host_sim::Excitation;
  const std::pair<const char*, Excitation> kinds[] = {
      {"duty", Excitation::robot_duty}, {"designed", Excitation::designed}, {"step", Excitation::one_step}};
  for (const auto& [name, kind] : kinds) {
    if (options.excitation == name) return made(kind, sheet, scene.supply_V, options.minutes, options.seed);
  }
  if (options.excitation == "profile") return rested(advised(options.profile));
  // A scene, again and again.
  std::vector<host_sim::Demand> demands(static_cast<std::size_t>(options.minutes * 60 * program_Hz));
  for (std::size_t i = 0; i < demands.size(); ++i) {
    const double time_s = std::fmod(static_cast<double>(i) / program_Hz, scene.seconds);
    demands[i].current_A = demand_A(scene, 0, time_s);
    demands[i].speed_rad_per_s = imposed_speed_rad_per_s(scene.shaft, time_s);
  }
  return rested(std::move(demands));
}

}  // namespace

HiddenMotor hidden_motor(std::uint64_t seed, const std::string& motor, const std::string& motor_folder) {
  const wire::Motor sheet = wire::pc::read_motor(motor, motor_folder).motor;
  const double supply_V = Scene{}.supply_V;
  const auto demands = made(host_sim::Excitation::robot_duty, sheet, supply_V, sized_on_minutes, seed);
  host_sim::Random random(seed);
  const auto factor = [&] { return std::exp(random.uniform(std::log(least_factor), std::log(largest_factor))); };
  HiddenMotor truth{sheet, {}, {}};
  truth.motor.R1_K_per_W *= factor();
  truth.motor.R2_K_per_W *= factor();
  truth.motor.C1_J_per_K *= factor();
  truth.motor.C2_J_per_K *= factor();

  std::vector<const host_sim::HiddenCause*> causes;
  for (const host_sim::HiddenCause& cause : host_sim::hidden_causes()) {
    if (cause.in_catalogue && shows_on_a_bench(cause.id)) causes.push_back(&cause);
  }
  const host_sim::HiddenCause& cause = *causes[random.next() % causes.size()];
  host_sim::ThermalDesign design;
  design.sheet = truth.motor;
  const double target_K = random.uniform(least_error_K, largest_error_K);
  const host_sim::DrawnEffect drawn = host_sim::draw_effect(
      cause, design, demands, program_Hz, host_sim::full_speed_rad_per_s(sheet, supply_V), target_K, random.next());
  truth.hidden = drawn.hidden;
  const nlohmann::ordered_json json = {{"format", 1},
                                       {"causes",
                                        {{{"id", cause.id},
                                          {"amount", drawn.amount},
                                          {"unit", "typical sizes"},
                                          {"error_before_refit_K", drawn.error_K}}}},
                                       {"motor",
                                        {{"R1_K_per_W", truth.motor.R1_K_per_W},
                                         {"R2_K_per_W", truth.motor.R2_K_per_W},
                                         {"C1_J_per_K", truth.motor.C1_J_per_K},
                                         {"C2_J_per_K", truth.motor.C2_J_per_K}}}};
  truth.truth_json = json.dump(2) + "\n";
  return truth;
}

Recording record(const RecordOptions& options) {
  Scene scene = scene_of(options);
  const wire::pc::MotorFile file = wire::pc::read_motor(scene.motor, options.motor_folder);
  const std::vector<host_sim::Demand> demands = demands_of(options, scene, file.motor);

  scene.id = "record";
  scene.seconds = static_cast<double>(demands.size()) / program_Hz;
  scene.log_Hz = log_Hz;
  scene.seed = static_cast<unsigned>(options.seed);
  scene.start_degC = start_degC;
  scene.shaft.kind = Shaft::Kind::imposed;
  scene.limiters = {Limiter::governor};
  scene.program_Hz = program_Hz;
  for (const host_sim::Demand& demand : demands) scene.program.push_back({demand.current_A, demand.speed_rad_per_s});

  RunOptions run{.motor_folder = options.motor_folder, .progress = options.progress};
  std::string truth_json = "{\n  \"format\": 1,\n  \"causes\": []\n}\n";
  if (options.hide) {
    const HiddenMotor truth = hidden_motor(*options.hide, scene.motor, options.motor_folder);
    run.plant_motor = truth.motor;
    run.hidden = truth.hidden;
    run.hidden.cooling_change_s *= scene.seconds / (sized_on_minutes * 60);  // within this log as well
    run.winding_margin_K = unknown_motor_margin_K;
    scene.trust = "sheet";
    truth_json = truth.truth_json;
  }
  const Result result = run_scene(scene, run);
  const Trace& trace = result.traces.at(0);

  host_sim::Random noise(options.seed ^ 0x6f686d6d);
  std::string csv = fmt::format("# recorded by host-sim (SIMULATED): {}, motor {}{}, seed {}\n", options.excitation,
                                file.name, file.surrogate ? " (surrogate)" : "", options.seed);
  csv += fmt::format(
      "# current_A: direct current through two terminals that heats alike, PWM ripple included; iq_A: its "
      "amplitude without the ripple; core_degC: {}\n"
      "# current, speed and bus: means over the interval that begins at time_s\n",
      options.thermocouple ? "thermocouple, +-0.2 K" : "from winding resistance, +-2 K, every 30 s");
  csv += "time_s,current_A,iq_A,speed_rad_per_s,bus_V,bus_A,housing_degC,ambient_degC,core_degC\n";
  double due_s = 0;
  for (std::size_t i = 1; i < trace.rows.size(); ++i) {
    // A row of the trace holds means over the interval that ends with it: they belong to the temperatures before.
    const Row &row = trace.rows[i - 1], &next = trace.rows[i];
    csv += fmt::format("{:.2f},{:.5g},{:.5g},{:.6g},{:.4f},{:.4g},{:.2f},{:.2f},", row.time_s, next.current_A,
                       next.iq_A, next.speed_rad_per_s, next.bus_V, next.bus_A, row.housing_degC, row.ambient_degC);
    if (options.thermocouple)
      csv += fmt::format("{:.2f}", row.true_winding_degC + thermocouple_K * noise.gauss());
    else if (row.time_s >= due_s)
      csv += fmt::format("{:.2f}", row.true_winding_degC + ohmmeter_K * noise.gauss()), due_s += ohmmeter_every_s;
    csv += '\n';
  }
  return {csv, truth_json, trace.hottest_true_degC, result.winding_max_degC};
}

}  // namespace boards::host

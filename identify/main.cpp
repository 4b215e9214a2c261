// SPDX-License-Identifier: MIT
// The program `identify`: a measured log in, what the simulation gets wrong out.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "identify/discover.hpp"
#include "identify/score_logs.hpp"
#include "identify/search/doing.hpp"
#include "wire/pc/files.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/program.hpp"

namespace {

using identify::Log, identify::Verdict;
using wire::pc::Exit;
using wire::pc::refuse;
using wire::pc::refuse_data;

constexpr const char* examples = R"(identify: what does the thermal simulation of this motor get wrong?

Examples
  identify walk.csv --motor ec-16-40w                     fit, judge, explain one log
  identify run1.csv run3.csv --hold-out fan.csv           fit two logs, score on a third
  identify bench.csv --map identify/maps/paderborn.toml --html report.html
  identify bench.csv --column housing_degC=T_case:degF --json -
  identify measures.csv --map identify/maps/paderborn_sessions.toml      no time column; many logs
  identify walk.csv --motor ec-16-40w --explain           how the answer was found as well
  identify walk.csv --motor ec-16-40w --write-model model.toml     what a board should run
  identify a.csv b.csv --score a.json b.json              how often right, where truths are known
)";

struct Arguments {
  std::vector<std::string> logs, columns, truths;
  std::string motor, map, rows, hold_out, json, html, write_model, write_baseline;
  std::optional<double> period_s, ambient_degC;
  bool explain = false, averaged = false;
  int draws = identify::HoldOut{}.draws;
};

/// `--column A=B C=D` is how people write it; to the parser what follows the first is a log.
void take_columns_from_logs(Arguments& a) {
  std::erase_if(a.logs, [&](const std::string& word) {
    const bool column = word.find('=') != std::string::npos && !std::filesystem::exists(word);
    if (column) a.columns.push_back(word);
    return column;
  });
  if (a.logs.empty()) refuse("No log is named; give the path of a CSV file.");
}

std::vector<Log> read(const std::string& path, const identify::ColumnMap& map,
                      const std::optional<wire::pc::MotorFile>& motor) {
  return identify::logs_of(identify::read_table(path), map, motor ? std::optional(motor->motor) : std::nullopt);
}

/// However they are written.
bool same_file(const std::string& a, const std::string& b) {
  std::error_code none;
  return a == b || std::filesystem::equivalent(a, b, none);
}

identify::HoldOut hold_out(const std::string& what, std::vector<std::string>& paths, const identify::ColumnMap& map,
                           const std::optional<wire::pc::MotorFile>& motor) {
  identify::HoldOut out;
  if (what.empty()) return out;
  char* end = nullptr;
  double fraction = std::strtod(what.c_str(), &end);
  const bool percent = std::string_view(end) == "%";
  if (percent) fraction /= 100;
  if (percent || *end == '\0') {
    if (!(fraction > 0 && fraction < 0.9))
      refuse("--hold-out " + what + ": a fraction lies between 0 and 0.9, or 0% and 90%.");
    out.fraction = fraction;
    return out;
  }
  std::erase_if(paths, [&](const std::string& path) { return same_file(path, what); });
  if (paths.empty()) refuse("--hold-out " + what + ": no log is left to fit; give another one.");
  out.logs = read(what, map, motor);
  return out;
}

void show(const std::string& text) {
  if (std::fputs(text.c_str(), stdout) < 0 || std::fflush(stdout) != 0)
    refuse("standard output: cannot be written; the answer is not complete.");
}

/// Asked before the search, which may take minutes: each has a folder, and none stands in another's place.
void need_places_to_write(const Arguments& a) {
  std::vector<std::string> taken = a.logs;
  taken.insert(taken.end(), {a.hold_out, a.map, a.motor});
  std::vector<std::string> written = {a.html, a.write_model, a.write_baseline};
  if (a.json != "-") written.push_back(a.json);
  for (const std::string& path : written) {
    if (path.empty()) continue;
    if (path == "-") refuse("-: only --json writes to standard output; name a file.");
    const auto folder = std::filesystem::path(path).parent_path();
    if (!folder.empty() && !std::filesystem::is_directory(folder))
      refuse(fmt::format("{}: there is no folder {}; make it, or choose another place.", path, folder.string()));
    if (std::any_of(taken.begin(), taken.end(), [&](const auto& other) { return same_file(path, other); }))
      refuse(path + ": would be written over what is read or written as well; choose another name.");
    taken.push_back(path);
  }
}

int answer(Arguments a) {
  take_columns_from_logs(a);
  need_places_to_write(a);
  std::optional<wire::pc::MotorFile> motor;
  if (!a.motor.empty()) {
    const char* folder = std::getenv("HOTCORE_MOTORS");
    motor = wire::pc::read_motor(a.motor, folder != nullptr ? folder : HOTCORE_MOTOR_FOLDER);
  }
  identify::ColumnMap map;
  if (!a.map.empty()) map = identify::read_map(a.map);
  identify::ColumnMap said;
  for (const std::string& column : a.columns) identify::add_column(said, column);
  for (const auto& [role, source] : said.columns) map.columns[role] = source;
  map.rows = a.rows;
  map.folder = HOTCORE_MAP_FOLDER;
  if (a.period_s) map.period_s = *a.period_s;
  if (a.ambient_degC) map.ambient_degC = *a.ambient_degC;
  map.averaged = map.averaged || a.averaged;
  if (!a.truths.empty()) {
    identify::score_logs(
        a.logs, a.truths, [&](const std::string& path) { return read(path, map, motor); }, motor);
    return 0;
  }
  std::optional<identify::Doing> doing(std::in_place);
  (*doing)("reading");
  identify::HoldOut held = hold_out(a.hold_out, a.logs, map, motor);
  held.draws = a.draws;
  std::vector<Log> logs;
  for (const std::string& path : a.logs) {
    if (std::count_if(a.logs.begin(), a.logs.end(), [&](const auto& other) { return same_file(path, other); }) > 1)
      refuse(path + ": this log is named twice and would count twice; name it once.");
    for (Log& log : read(path, map, motor)) logs.push_back(std::move(log));
  }
  identify::Report report = identify::discover(logs, motor, held, [&](const std::string& what) { (*doing)(what); });
  if (!map.note.empty()) report.notes.push_back(map.note);
  const bool writes = report.no_model.empty();
  if (writes) report.model_file = a.write_model;
  (*doing)("writing the answer");
  if (!a.html.empty()) wire::pc::write_whole(a.html, as_html(report));
  if (writes && !a.write_model.empty()) wire::pc::write_whole(a.write_model, report.model_toml);
  if (writes && !a.write_baseline.empty()) wire::pc::write_whole(a.write_baseline, report.baseline_toml);
  doing.reset();
  if (a.json == "-") {
    show(as_json(report));
  } else {
    if (!a.json.empty()) wire::pc::write_whole(a.json, as_json(report));
    show(as_text(report, a.explain) + (a.html.empty() ? "" : "\nReport with pictures: " + a.html + "\n"));
  }
  const std::string& asked = a.write_model.empty() ? a.write_baseline : a.write_model;
  if (!writes && !asked.empty()) refuse_data(asked + ": not written: " + report.no_model + ".");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{examples};
  wire::pc::use_help(app, "identify");
  Arguments a;
  app.add_option("LOG", a.logs, "CSV logs of one motor, fitted together")->required();
  app.add_option(
         "--motor", a.motor,
         "motor file (.toml), or the name of one in boards/motors (or in the folder that HOTCORE_MOTORS names); "
         "without it the answer is less certain")
      ->type_name("MOTOR");
  app.add_option("--map", a.map, "TOML file that says which column is what, and the period of rows without a time")
      ->type_name("FILE");
  app.add_option("--column", a.columns,
                 "role=name or role=name:unit, e.g. speed_rad_per_s=n:rpm, or core_degC=T:0.01degC where a 1 is 0.01 "
                 "degC (may be "
                 "repeated; see below)")
      ->allow_extra_args(false)
      ->type_name("ROLE=NAME");
  app.add_option("--rows", a.rows,
                 "only the rows in which a column says this, e.g. motor=left, of a log of several motors")
      ->type_name("NAME=VALUE");
  app.add_option("--period", a.period_s, "seconds from row to row, of logs without a time column")
      ->check(wire::pc::between(1e-6, 86400.0))
      ->type_name("S");
  app.add_option("--ambient", a.ambient_degC,
                 "how warm the room was, of logs without ambient_degC; else what a log begins at is taken for it")
      ->check(wire::pc::between(-60.0, 100.0))
      ->type_name("DEGC");
  app.add_flag("--averaged", a.averaged,
               "a row tells all that flowed since the row before it, a current's rms or a power's mean, and not what "
               "flows at its moment; laws of speed are then hard to tell apart");
  app.add_flag("--explain", a.explain, "tell the chain of reasoning as well");
  app.add_option("--hold-out", a.hold_out,
                 "a log, or the last part of each log as a fraction (0.25 or 25%), that is scored and not fitted")
      ->type_name("WHAT");
  app.add_option("--bootstrap", a.draws,
                 "with --hold-out: how often the held-out error is redrawn for its interval, 100000 times at most; "
                 "below 100: no interval")
      ->capture_default_str()
      ->check(CLI::Range(0, 100000))
      ->needs("--hold-out")
      ->type_name("N");
  app.add_option("--json", a.json, "write the answer as JSON; - for standard output, and nothing else there")
      ->type_name("FILE");
  app.add_option("--html", a.html, "write a page with pictures")->type_name("FILE");
  app.add_option("--write-model", a.write_model,
                 "write the model found as a heat-network parameter set (TOML) that the board runs")
      ->type_name("FILE");
  app.add_option("--write-baseline", a.write_baseline,
                 "the same of the two-resistor model as fitted, to compare on the board with what was found")
      ->type_name("FILE");
  auto* score = app.add_option("--score", a.truths,
                               "truth files, one a log in the same order: answer each log by itself and print how "
                               "often that was right, and what was taken for what; goes with no option that writes or "
                               "holds out")
                    ->type_name("FILE ...");
  for (const char* other : {"--hold-out", "--json", "--html", "--write-model", "--write-baseline", "--explain"})
    score->excludes(other);
  app.footer(
      "What a column may be (--column ROLE=NAME or ROLE=NAME:UNIT, with the UNIT where a NAME ends like one, as in "
      "housing_degC=T:1:degC; a column called like its role, current_mA for current_A too, needs no "
      "word, and a unit in a NAME, as in 'Time (ms)', is used where none is said):\n" +
      identify::roles_and_units() +
      "\n\n"
      "current_A: the direct current that heats alike through two terminals. Of sinusoidal phase currents it is "
      "sqrt(3)/2 of their amplitude, 1.22 times their rms. iq_A, id_A: amplitudes. phase_a_A, phase_b_A, "
      "phase_c_A: what flows there at the moment of the row; where there is no current_A it is taken from them. "
      "power_W: what heats the winding; "
      "taken before any current. torque_Nm: the motor's own, before any gear, where nothing else tells the heat. "
      "winding_ohm: read as core_degC if the log begins at rest at room temperature.\n\n"
      "Exit codes: 0 an answer was given, whatever the verdict; 2 the command line or a file named in it is wrong; 3 "
      "the logs cannot be used, or not for the model that was to be written. With 2 and 3 one sentence on standard "
      "error says why.");
  try {
    return wire::pc::run_program(app, argc, argv, [&] { return answer(a); });
  } catch (const std::exception& error) {
    fmt::print(stderr, "identify stopped: {}. This is a fault of the program; please report it with the log.\n",
               error.what());
    return static_cast<int>(Exit::unusable);
  }
}

// SPDX-License-Identifier: MIT
// Prints what the plant costs: CPU nanoseconds per axis and PWM period in both bridges, and per long log of heat alone.
// A program, not a test: figures of a clock prove nothing in a test run. --json: one object a line.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <ctime>

#include "host-sim/plant/thermal_bench.hpp"
#include "tests/host-sim/plant_fixtures.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/program.hpp"

namespace {

double cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

int measure(bool json) {
  for (const char* id : {"ec-16-40w", "ec-powermax-30-24v"}) {
    for (const bool switched : {false, true}) {
      host_sim::BenchDesign design = plant_tests::bench_design(plant_tests::sheet(id));
      design.bridge.switched = switched;
      host_sim::Bench bench(design, 1);
      // A slowly turning vector; duties from a table, so that only the plant is measured.
      std::array<hal::Duty, 400> table;
      for (std::size_t q = 0; q < table.size(); ++q) {
        const auto ratio = [&](double shift) {
          return static_cast<float>(0.5 + 0.03 * std::sin(2 * host_sim::pi * (static_cast<double>(q) / 400 - shift)));
        };
        table[q] = {{ratio(0), ratio(1 / 3.), ratio(2 / 3.)}, true};
      }
      for (int i = 0; i < 2; ++i) bench.load(i).inertia_kg_m2 = 1e-6;
      const int periods = switched ? 20000 : 400000;
      const double start_s = cpu_s();
      for (int n = 0; n < periods; ++n) {
        const hal::Duty& duty = table[static_cast<std::size_t>(n) % table.size()];
        bench.advance_period({duty, duty});
      }
      const double took_s = cpu_s() - start_s;
      std::printf(
          json ? "{\"motor\":\"%s\",\"bridge\":\"%s\",\"ns_per_axis_and_period\":%.0f,\"simulated_s_per_cpu_s\":%.1f}\n"
               : "%-20s %-8s bridge: %6.0f ns per axis and period, %6.1f simulated seconds per CPU second (two axes)\n",
          id, switched ? "switched" : "averaged", took_s / periods / 2 * 1e9, bench.time_s() / took_s);
    }
    host_sim::ThermalDesign design;
    design.sheet = plant_tests::sheet(id);
    const auto demands = host_sim::make_excitation(host_sim::Excitation::robot_duty, design.sheet, 2000, 1200, 20, 1);
    const double start_s = cpu_s();
    for (int n = 0; n < 20; ++n) host_sim::record(design, demands, 20, 10, 1);
    std::printf(json ? "{\"motor\":\"%s\",\"heat_alone_20_min_ms\":%.1f}\n"
                     : "%-20s heat alone, 20 min at 20 Hz, logged at 10 Hz: %.1f ms\n",
                id, (cpu_s() - start_s) / 20 * 1e3);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "What the simulated plant costs, in CPU time\n"
      "\n"
      "Examples\n"
      "  plant_speed                  each motor and how it is driven\n"
      "  plant_speed --json\n"
      "Exit codes: 0 done, 2 the command line is wrong.\n"};
  wire::pc::use_help(app, "plant_speed");
  bool json = false;
  app.add_flag("--json", json, "one object a line");
  return wire::pc::run_program(app, argc, argv, [&] { return measure(json); });
}

// SPDX-License-Identifier: MIT
// Prints how long the four-parameter fit, every cause alone, and the whole search with all pairs take on one core (CPU
// time, after the logs are read; constant heat is hidden, so that the search goes to its end), and the search on all of
// them: the time that passes, and what the first thread works of that, being in every part of it (the rest it waits for
// the others, or for other programs): a benchmark, not a test.
//   build/host/bin/fit_speed [--json] [--short]    short: not the ten hours, which take a minute
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <ctime>
#include <nlohmann/json.hpp>

#include "identify/fit/parallel.hpp"
#include "identify/log/table.hpp"
#include "identify/search/problem_of.hpp"
#include "identify/search/search.hpp"
#include "tests/identify/bench_log.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/motor_file.hpp"
#include "wire/pc/program.hpp"

namespace {

double now_ms(clockid_t clock = CLOCK_PROCESS_CPUTIME_ID) {
  timespec t;
  clock_gettime(clock, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

void measure(const char* what, double seconds, double rate_Hz, double core_every_s, bool json) {
  tests::BenchOptions options;
  options.seconds = seconds;
  options.rate_Hz = rate_Hz;
  options.core_every_s = core_every_s;
  const auto motor = wire::pc::read_motor("ec-16-40w", HOTCORE_SOURCE_DIR "/boards/motors");
  options.extra_housing_W = [](double, double, double) { return 0.3; };
  const auto table = identify::read_table(tests::write_bench_log("hotcore_speed.csv", options));
  const double t0 = now_ms();
  const auto logs = identify::logs_of(table, {}, motor.motor);
  const auto problem = identify::problem_of(logs, motor);
  const double t1 = now_ms();
  const identify::Fit f = identify::fit(problem, {});
  const double t2 = now_ms();
  for (std::size_t c = 0; c < identify::causes().size(); ++c) {
    const identify::Chosen alone{static_cast<int>(c), -1};
    if (problem.possible(identify::causes()[c])) (void)identify::fit(problem, {alone}, {&f});
  }
  const double t3 = now_ms();
  const unsigned threads = identify::most_threads.exchange(1);
  const std::string verdict = identify::word(identify::search(problem).verdict);
  const double t4 = now_ms();
  identify::most_threads = threads;
  const double start_ms = now_ms(CLOCK_MONOTONIC), first_ms = now_ms(CLOCK_THREAD_CPUTIME_ID);
  (void)identify::search(problem);
  const double passed_ms = now_ms(CLOCK_MONOTONIC) - start_ms, worked_ms = now_ms(CLOCK_THREAD_CPUTIME_ID) - first_ms;
  if (json) {
    fmt::print("{}\n", nlohmann::ordered_json{{"log", what},
                                              {"fit_ms", t2 - t1},
                                              {"binning_ms", t1 - t0},
                                              {"singles_ms", t3 - t2},
                                              {"search_ms", t4 - t3},
                                              {"search_parallel_ms", passed_ms},
                                              {"search_parallel_first_thread_ms", worked_ms},
                                              {"threads", threads},
                                              {"verdict", verdict},
                                              {"rows", table.rows()},
                                              {"bins", problem.logs[0].bins.size()},
                                              {"iterations", f.iterations},
                                              {"settled", f.settled}}
                           .dump());
    return;
  }
  fmt::print(
      "{}: fit {:.1f} ms, binning {:.1f} ms ({} rows, {} bins of {:.1f} s, {} iterations, {}); all causes alone {:.0f} "
      "ms, the search with pairs {:.0f} ms, on {} cores {:.0f} ms, {:.0f} at work ({})\n",
      what, t2 - t1, t1 - t0, table.rows(), problem.logs[0].bins.size(), problem.logs[0].width_s, f.iterations,
      f.settled ? "settled" : "NOT settled", t3 - t2, t4 - t3, threads, passed_ms, worked_ms, verdict);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "How long identify's fits and its search take\n"
      "\n"
      "Examples\n"
      "  fit_speed                    20 min at 10 Hz and 10 h at 2 Hz\n"
      "  fit_speed --short --json     the former alone\n"
      "Exit codes: 0 done, 2 the command line is wrong.\n"};
  wire::pc::use_help(app, "fit_speed");
  bool json = false, brief = false;
  app.add_flag("--json", json, "one object a line");
  app.add_flag("--short", brief, "not the ten hours, which take a minute");
  return wire::pc::run_program(app, argc, argv, [&] {
    measure("20 min at 10 Hz, housing and sparse winding", 1200, 10, 30, json);
    if (!brief) measure("10 h at 2 Hz, housing and sparse winding", 36000, 2, 30, json);
    return 0;
  });
}

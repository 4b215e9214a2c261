// SPDX-License-Identifier: MIT
// How many boards one thread serves: each is the firmware with its USB stack and link (simple motors), each gets
// setpoints and gives states 200 times a second. Prints the share of one CPU that it takes, board and PC together (a
// simulated second costs so many CPU seconds), and the round trip of setpoint and state as a histogram in the boards'
// own time.
//
//   many_boards [BOARDS] [SECONDS] [--json]
#include <fmt/format.h>

#include <ctime>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "console/link/board.hpp"
#include "console/link/messages.hpp"
#include "console/link/sim.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/program.hpp"

namespace {

using console::link::Board;
using console::link::bytes_of;

double cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

std::unique_ptr<Board> simulated(int number) {
  console::link::SimulatedBoard options;
  options.serial = fmt::format("SIM{:02}", number);
  options.real_time = false;
  options.full_motors = false;
  options.motor_folder = HOTCORE_SOURCE_DIR "/boards/motors";
  return std::make_unique<Board>(console::link::simulated_board(options));
}

/// One exchange; the board's time that it took, or a negative number if no state came within 100 ms.
double exchange(Board& board, const wire::Setpoints& setpoints) {
  const double sent_s = board.now_s();
  if (!board.write(wire::Kind::setpoint, bytes_of(setpoints))) return -1;
  while (board.now_s() < sent_s + 0.1) {
    board.wait(1);
    while (const wire::Frame* frame = board.read()) {
      if (console::link::state_in(*frame)) return board.now_s() - sent_s;
    }
  }
  return -1;
}

int measure(int count, double seconds, bool json) {
  std::vector<std::unique_ptr<Board>> boards;
  for (int i = 0; i < count; ++i) boards.push_back(simulated(i));
  const wire::Axes both{3};
  for (const auto& board : boards) {
    board->write(wire::Kind::arm, bytes_of(both));
    board->wait(5);
  }

  std::map<int, int> by_periods;  // of 50 us
  int lost = 0;
  const double cpu_start_s = cpu_s();
  for (int tick = 0; tick < static_cast<int>(200 * seconds); ++tick) {
    for (const auto& board : boards) {
      const double due_s = board->now_s() + 0.005;
      const float iq_A = tick / 100 % 2 == 0 ? 1.0f : -1.0f;
      const double took_s = exchange(*board, {3, {}, 0, {0, 0}, {iq_A, iq_A}});
      took_s < 0 ? ++lost : ++by_periods[static_cast<int>(took_s * 20000 + 0.5)];
      while (board->now_s() < due_s - 1e-6) board->wait(std::max(1, static_cast<int>((due_s - board->now_s()) * 1e3)));
    }
  }
  const double share = (cpu_s() - cpu_start_s) / seconds;
  int exchanges = 0;
  Board& one = *boards.front();
  const double start_s = one.now_s();
  while (one.now_s() < start_s + 1.0) exchanges += exchange(one, {3, {}, 0, {0, 0}, {0, 0}}) >= 0;

  if (json) {
    nlohmann::ordered_json histogram;
    for (const auto& [periods, n] : by_periods) histogram[fmt::format("{:.2f}", periods * 0.05)] = n;
    fmt::print("{}\n", nlohmann::ordered_json{{"boards", count},
                                              {"cpu_share", share},
                                              {"lost", lost},
                                              {"round_trip_ms", histogram},
                                              {"exchanges_per_s_of_one", exchanges}}
                           .dump());
    return lost == 0 ? 0 : 1;
  }
  fmt::print(
      "{} boards, 200 setpoints and states a second each: {:.0f} % of one CPU ({:.2f} % a board), {} exchanges lost\n",
      count, 100 * share, 100 * share / count, lost);
  int total = 0;
  for (const auto& [periods, n] : by_periods) total += n;
  for (const auto& [periods, n] : by_periods)
    fmt::print("  {:5.2f} ms {:8d} {}\n", periods * 0.05, n,
               std::string(static_cast<std::size_t>(1 + 60 * n / total), '#'));
  fmt::print("One board as fast as it goes: {} exchanges a second\n", exchanges);
  return lost == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "How many boards one thread serves, each with the firmware, its USB stack and simple motors\n"
      "\n"
      "Examples\n"
      "  many_boards                  64 boards for 5 s of their time\n"
      "  many_boards 8 60 --json\n"
      "Exit codes: 0 done, 1 an exchange was lost, 2 the command line is wrong.\n"};
  wire::pc::use_help(app, "many_boards");
  int count = 64;
  double seconds = 5;
  bool json = false;
  app.add_option("boards", count, "1 to 1000; 64 unless said")->check(wire::pc::between(1, 1000));
  app.add_option("seconds", seconds, "0.01 to 3600; 5 unless said")->check(wire::pc::between(0.01, 3600));
  app.add_flag("--json", json, "the figures as JSON");
  return wire::pc::run_program(app, argc, argv, [&] { return measure(count, seconds, json); });
}

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
#include <string_view>
#include <vector>

#include "console/link/board.hpp"
#include "console/link/messages.hpp"
#include "console/link/sim.hpp"

namespace {

using console::link::Board;

double cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

std::unique_ptr<Board> simulated(int number) {
  console::link::SimulatedBoard options;
  options.serial = fmt::format("SIM{:02}", number);
  options.real_time = false;
  options.full_motors = false;
  options.motor_folder = HOTCORE_SOURCE_DIR "/boards/motors";
  return std::make_unique<Board>(console::link::simulated_board(options));
}

template <class Message>
std::span<const std::uint8_t> bytes_of(const Message& message) {
  return {reinterpret_cast<const std::uint8_t*>(&message), sizeof message};
}

/// One exchange; the board's time that it took, or a negative number if no state came within 100 ms.
double exchange(Board& board, const wire::Setpoints& setpoints) {
  const double sent_s = board.now_s();
  if (!board.write(static_cast<std::uint8_t>(wire::Kind::setpoint), bytes_of(setpoints))) return -1;
  while (board.now_s() < sent_s + 0.1) {
    board.wait(1);
    while (const wire::Frame* frame = board.read()) {
      if (console::link::state_in(*frame)) return board.now_s() - sent_s;
    }
  }
  return -1;
}

}  // namespace

int main(int argc, char** argv) {
  const bool json = argc > 1 && std::string_view(argv[argc - 1]) == "--json";
  argc -= json ? 1 : 0;
  const int count = argc > 1 ? std::atoi(argv[1]) : 64;
  const double seconds = argc > 2 ? std::atof(argv[2]) : 5.0;
  if (count < 1 || count > 1000 || !(seconds > 0 && seconds <= 3600)) {
    fmt::print(stderr, "many_boards [BOARDS] [SECONDS] [--json]: 1 to 1000 boards, at most 3600 seconds.\n");
    return 2;
  }
  std::vector<std::unique_ptr<Board>> boards;
  for (int i = 0; i < count; ++i) boards.push_back(simulated(i));
  const wire::Axes both{3};
  for (const auto& board : boards) {
    board->write(static_cast<std::uint8_t>(wire::Kind::arm), bytes_of(both));
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

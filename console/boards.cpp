// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include "console/commands.hpp"

namespace console {
namespace {

void list(Console& console) {
  std::vector<link::Found> boards;
  if (console.options.sim) {
    const wire::Hello& hello = console.session().hello();
    boards.push_back({hello.serial, hello.board, "simulated in this process"});
  } else {
    boards = console.usb().list();
  }
  Json all = Json::array();
  std::string text =
      boards.empty() ? "No board is plugged in.\n" : fmt::format("{:<28} {:<16} {}\n", "serial", "board", "where");
  for (const link::Found& board : boards) {
    Json entry = {{"serial", board.serial}, {"board", board.product}, {"place", board.place}};
    if (!board.sentence.empty()) entry["trouble"] = board.sentence;
    all.push_back(entry);
    text += board.sentence.empty()
                ? fmt::format("{:<28} {:<16} {}\n", board.serial, board.product, board.place)
                : fmt::format("{:<28} {}\n", board.serial.empty() ? "?" : board.serial, board.sentence);
  }
  console.say(text, all);
}

void udev(Console& console) {
  const std::string rule = link::udev_rule(), path = "/etc/udev/rules.d/70-hotcore.rules";
  const std::string steps = fmt::format(
      "hotcore udev | sudo tee {} && sudo udevadm control --reload && sudo udevadm trigger --subsystem-match=usb",
      path);
  console.say("# install it with:  " + steps + "\n" + rule, {{"path", path}, {"rule", rule}, {"install", steps}});
}

}  // namespace

void add_boards(CLI::App& app, Console& console) {
  app.add_subcommand("list", "boards that are plugged in")->callback([&] { list(console); });
  app.add_subcommand("udev", "print the rule that lets users open a board, and how to install it")->callback([&] {
    udev(console);
  });
}

}  // namespace console

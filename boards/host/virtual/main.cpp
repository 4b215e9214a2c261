// SPDX-License-Identifier: MIT
// The program virtual-board: the host build of the firmware in real time, as a USB device that a kernel can attach.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <vector>

#include "boards/host/usbip/server.hpp"
#include "boards/host/virtual/virtual_board.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/motor_file.hpp"
#include "wire/pc/program.hpp"

namespace {

using boards::host::Handshake;
namespace usb = boards::usb;

/// The cable between a host's transactions and the board's bus.
class Cable final : public usb::Device {
 public:
  explicit Cable(boards::host::VirtualBoard& board) : board_(board) {}
  void plug(bool in) override { in ? board_.bus().plug() : board_.bus().unplug(); }
  bool attached() const override { return board_.bus().present(); }
  void bus_reset() override { board_.bus().reset(); }
  usb::Answer setup(unsigned address, const std::array<std::uint8_t, 8>& request) override {
    return {kind(board_.bus().setup(static_cast<std::uint8_t>(address), request.data()))};
  }
  usb::Answer out(unsigned address, int endpoint, bool data1, std::span<const std::uint8_t> bytes) override {
    return {
        kind(board_.bus().out(static_cast<std::uint8_t>(address), static_cast<std::uint8_t>(endpoint), data1, bytes))};
  }
  usb::Answer in(unsigned address, int endpoint) override {
    boards::host::UsbBus<boards::host::VirtualBoard::Device>::Packet packet;
    const Handshake said = board_.bus().in(static_cast<std::uint8_t>(address),
                                           static_cast<std::uint8_t>(endpoint | hal::endpoint_in), packet);
    const auto* first = packet.data.data();
    return {kind(said), packet.data1, {first, first + packet.bytes}};
  }
  void run(double seconds) override {
    owed_s_ += seconds;
    const int periods = static_cast<int>(owed_s_ / board_.period_s());
    board_.advance(periods);
    owed_s_ -= periods * board_.period_s();
  }
  void power_cycle() override { board_.power_cycle(); }

 private:
  static usb::Answer::Kind kind(Handshake h) {
    return h == Handshake::ack     ? usb::Answer::ack
           : h == Handshake::nak   ? usb::Answer::nak
           : h == Handshake::stall ? usb::Answer::stall
                                   : usb::Answer::none;
  }
  boards::host::VirtualBoard& board_;
  double owed_s_ = 0;
};

/// --chip: the program beside this one, which links Unicorn and is no part of the product.
int become_chip(char** arguments) {
  const std::string other = std::filesystem::read_symlink("/proc/self/exe").parent_path() / "virtual-chip";
  std::vector<char*> rest{const_cast<char*>("virtual-chip")};
  for (char** a = arguments + 1; *a; ++a) {
    if (std::string(*a) != "--chip") rest.push_back(*a);
  }
  rest.push_back(nullptr);
  execv(other.c_str(), rest.data());
  fmt::print(stderr, "{} is missing: build it with cmake --build --preset host --target virtual-chip.\n", other);
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Examples:\n"
      "  virtual-board                 a board on USB/IP port 3240, until Ctrl-C\n"
      "  virtual-board --chip          the flash image on the chip model instead of the host build\n"
      "  virtual-board --port 0        any port that is free (it is printed)\n"
      "  virtual-board --json          serial, bus_id, host, port, attach in one line, once it serves\n"
      "  kill -HUP PID                 its power goes and comes back\n"
      "Exit codes: 0 done, 2 the command line or a file is wrong, 6 the port is taken.\n"
      "A board that isn't there, as a USB device that a kernel can attach.\n"};
  wire::pc::use_help(app, "virtual-board");
  std::string motor = "ec-16-40w", serial = "SIM0";
  std::uint16_t port = usb::usbip_port;
  bool chip = false, json = false;
  app.add_flag("--chip", chip, "the flash image on the chip model (virtual-chip --help)");
  app.add_option("--motor", motor, "on both axes; its parameters are set and saved")->capture_default_str();
  app.add_option("--serial", serial, "serial number")->capture_default_str()->check([](const std::string& s) {
    constexpr std::size_t most = sizeof wire::Hello::serial - 1;
    return s.size() <= most ? "" : fmt::format("{} characters; at most {} fit", s.size(), most);
  });
  app.add_option("--port", port, "TCP port on loopback")->capture_default_str()->check(wire::pc::between(0, 65535));
  app.add_flag("--json", json, "say where it is served in one line of JSON");
  if (std::find(argv, argv + argc, std::string("--chip")) != argv + argc) return become_chip(argv);
  return wire::pc::run_program(app, argc, argv, [&] {
    boards::host::VirtualBoardOptions options;
    options.motor = wire::pc::read_motor(motor, std::string(HOTCORE_SOURCE_DIR) + "/boards/motors").motor;
    options.serial = serial;
    options.full_motors = true;
    boards::host::VirtualBoard board(options);
    Cable cable(board);
    return usb::serve_until_interrupted(cable, port, json);
  });
}

// SPDX-License-Identifier: MIT
// The program virtual-chip: the flash image on the chip model, served over USB/IP through the registers of OTG_FS. It
// links Unicorn (GPL-2) and is no part of the product.
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "boards/host/chip/cable.hpp"
#include "boards/host/chip/play.hpp"
#include "boards/host/usbip/server.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/program.hpp"

namespace {

const std::string root = HOTCORE_SOURCE_DIR;

int run(const std::string& scene, const std::string& elf, std::uint16_t port, bool json) {
  using namespace boards;
  const auto pcb = board_of(host::read_scene(scene, root + "/host-sim/scenes", {}), elf, root + "/boards/motors");
  pcb->power_on();
  Cable cable(*pcb);
  const int code = usb::serve_until_interrupted(cable, port, json);
  if (pcb->chip.troubles().count() == 0) return code;
  fmt::print(stderr, "{}", pcb->chip.report_text());
  return 3;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Examples:\n"
      "  virtual-chip                  the board on USB/IP port 3240, until Ctrl-C\n"
      "  virtual-chip --port 0         any port that is free (it is printed)\n"
      "  kill -HUP PID                 its power goes and comes back\n"
      "Exit codes: 0 done, 2 the command line or a file is wrong, 3 the firmware made a mistake (it is\n"
      "printed), 4 the image has no USB, 6 the port is taken.\n"
      "The flash image of the H8-15D on a model of its chip, as a USB device that a kernel can attach.\n"};
  wire::pc::use_help(app, "virtual-chip");
  std::string elf = root + "/build/h8-15d/bin/h8-15d.elf", scene = "jump";
  std::uint16_t port = boards::usb::usbip_port;
  bool json = false;
  app.add_option("--scene", scene, "motors, shafts and supply of this scene of host-sim")->capture_default_str();
  app.add_option("--image", elf, "the flash image")->capture_default_str();
  app.add_option("--port", port, "TCP port on loopback")->capture_default_str()->check(wire::pc::between(0, 65535));
  app.add_flag("--json", json, "say where it is served in one line of JSON");
  try {
    return wire::pc::run_program(app, argc, argv, [&] { return run(scene, elf, port, json); });
  } catch (const std::runtime_error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
}

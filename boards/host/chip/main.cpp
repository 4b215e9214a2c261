// SPDX-License-Identifier: MIT
// The program chip: plays a scene on the flash image, executed by the chip model. It links Unicorn (GPL-2) and is no
// part of the product.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "boards/host/chip/play.hpp"
#include "wire/pc/files.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/program.hpp"

namespace {

const std::string root = HOTCORE_SOURCE_DIR;

constexpr const char* examples =
    "Examples:\n"
    "  chip jump                             the scene on the flash image; log and picture: out/chip/jump\n"
    "  chip stall --set seconds=5 --json\n"
    "  chip jump --image build/h8-15d/bin/h8-15d.elf\n"
    "Exit codes: 0 done, 2 the command line or a file is wrong, 3 the firmware made a mistake, which is\n"
    "printed.\n";

int run(const std::string& name, const std::vector<std::string>& overrides, const std::string& elf,
        const std::string& out, bool json) {
  using namespace boards;
  const host::Scene scene = host::read_scene(name, root + "/host-sim/scenes", overrides);
  const std::string folder = out + "/" + scene.id;
  wire::pc::need_folder(folder);
  const bool show = isatty(STDERR_FILENO) != 0;
  const ChipPlay play = play_on_chip(scene, elf, root + "/boards/motors", [&](double share) {
    if (show) fmt::print(stderr, "\r  {} on the chip model {:3.0f} %", scene.id, 100 * share);
  });
  if (show) fmt::print(stderr, "\r\033[K");
  write_files(play.result, folder);
  const double speed = play.result.simulated_s / play.wall_s;
  if (json) {
    nlohmann::json j = nlohmann::json::parse(summary_json(play.result));
    j["chip"] = {{"mistakes", play.mistake_count},
                 {"resets", play.resets},
                 {"of_real_time", speed},
                 {"fast_lane_worst_instructions", play.lane_worst[0]},
                 {"main_loop_worst_instructions", play.lane_worst[1]},
                 {"asleep_share_at_one_cycle_per_instruction", play.asleep_share}};
    fmt::print("{}\n", j.dump(2));
  } else {
    fmt::print("{}", summary_text(play.result));
    fmt::print(
        "Fast lane {:.0f} instructions (worst {:.0f}), main loop worst {:.0f} between two sleeps, asleep {:.0f} % at "
        "one cycle an "
        "instruction.\n",
        play.lane_mean[0], play.lane_worst[0], play.lane_worst[1], 100 * play.asleep_share);
    fmt::print(
        "{:.1f} s simulated in {:.1f} s: {:.2f} of real time. Resets: {}. Mistakes of the firmware: {}.\n  picture: "
        "{}/{}.svg\n",
        play.result.simulated_s, play.wall_s, speed, play.resets, play.mistake_count, folder, scene.id);
  }
  if (play.mistake_count == 0) return 0;
  fmt::print(stderr, "{}", play.mistakes);
  return 3;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{fmt::format(
      "{}\nThe flash image of the H8-15D, executed instruction by instruction on a model of its chip.\n", examples)};
  wire::pc::use_help(app, "chip");
  std::string scene, elf = root + "/build/h8-15d/bin/h8-15d.elf", out = "out/chip";
  std::vector<std::string> overrides;
  bool json = false;
  app.add_option("scene", scene, "a scene of host-sim (host-sim list) or a .toml file")->required();
  app.add_option("--set", overrides, "key=value of the scene")->take_all();
  app.add_option("--image", elf, "the flash image")->capture_default_str();
  app.add_option("--out", out, "folder for logs and picture")->capture_default_str();
  app.add_flag("--json", json, "the summary as JSON on standard output");
  try {
    return wire::pc::run_program(app, argc, argv, [&] { return run(scene, overrides, elf, out, json); });
  } catch (const std::runtime_error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
}

// SPDX-License-Identifier: MIT
// F19 on the flash image: flips one bit anywhere in its RAM, stack included, at a random instant, executed on the chip
// model while a host speaks over USB. The core is stopped between two blocks of instructions wherever it is: asleep, in
// a tick, in the middle of the slow lane. Each flip is a forked trial beside one that nothing happens to; then the host
// falls silent (tests/boards-host/flip_campaign.hpp).
//
// A trial is short. Windings begin near their limit, so that a wrong current shows soon; a trial whose estimate has
// become colder, against its winding, than without the flip, goes on until it shows or is made good; one whose memory
// and motors are again as without the flip ends at once. After a reset the host is silent, and the estimate that was
// kept must be no colder than F19 allows a winding to be hotter. Setpoints age in 20 ms here and fade in 20.
//
// Not seen: flips in registers and in what a board does once in its life (a save, a commit, a supply that falls), and a
// flip that waits for longer than a trial.
#include <fmt/format.h>
#include <sys/wait.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>

#include "boards/h8-15d/board.hpp"
#include "boards/host/chip/cable.hpp"
#include "boards/host/usbip/transfers.hpp"
#include "tests/boards-host/flip_campaign.hpp"
#include "wire/framer.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/program.hpp"
#include "wire/protocol.hpp"

namespace {

using namespace faults;
using boards::usb::Transfer;
using host_sim::Random;
using host_sim::chip::Chip;
using host_sim::chip::Core;
using host_sim::chip::Time;
using host_sim::chip::to_s;

constexpr float timeout_s = 0.02f, ramp_s = 0.02f;
constexpr double silent_s = 0.05;               // both, 5 ms of F21 and a slow tick
constexpr double last_s = 0.05;                 // in which torque is compared
constexpr double after_trip_s = 0.03;           // an open bridge only cools
constexpr double after_reset_s = 0.08;          // the image is up, and its estimate has stepped
constexpr double flip_within_s = 0.01;          // a period of the slow lane: any of its instants
constexpr double look_s = 0.01;                 // between two looks at the memory
constexpr double colder_K = 1, longest_s = 4;   // colder by more: it goes on, but not for ever
constexpr double too_cold_K = 3;                // after a reset: as F19
constexpr unsigned cycles_per_instruction = 2;  // wait states and bus are not modelled; 1 is the least

constexpr const char* examples =
    "F19: what becomes of single flipped bits in the memory of the flash image, on the chip model\n"
    "\n"
    "Examples\n"
    "  image_flips                    3000 flips on three motors: a quarter of an hour\n"
    "  image_flips --part stage_ link_ --flips 500 --list      only there, and each flip that did harm\n"
    "  image_flips --part core_.degC_ --inside CoreEstimator   in the middle of the slow lane\n"
    "Exit codes: 0 done, 1 fewer than --check asks for are detected or harmless, 2 the command line is\n"
    "wrong.\n";

/// The image on its board, and a robot's computer on its USB cable.
class Robot {
 public:
  /// `on_index`: at power-on, then somebody turns the shaft; else the Hall switches alone say where it stands.
  Robot(const Scenery& scenery, bool on_index, const std::string& image)
      : pcb(plant(scenery.design), scenery.seed),
        design(scenery.design),
        arms(scenery.arms),
        cable_(pcb),
        host_(cable_) {
    pcb.flash_image(image);
    firmware::AxisSet set{
        firmware::parameters_from(design.known, h8_15d::rating, {static_cast<float>(design.scene.supply_V), 0.0f}),
        firmware::heat_parameters_from(design.known, design.estimator.trust)};
    set.drive.setpoint_timeout_s = timeout_s;
    set.drive.ramp_s = ramp_s;
    pcb.flash_parameters({set, set});
    const auto degC = static_cast<float>(design.scene.start_degC);
    thermal::HeatMemory warm{4, {degC, degC, degC, degC}, {1, 1, 1, 1}, static_cast<float>(design.scene.ambient_degC)};
    pcb.flash_journal({{{warm, {}}, {warm, {}}}, 0.0f});
    pcb.chip.core().set_cycles_per_instruction(cycles_per_instruction);
    for (int a = 0; a < axes; ++a) pcb.bench.load(a) = boards::host::load_of(design.scene.shaft);
    if (!on_index) turn_shaft();
    pcb.power_on(static_cast<std::uint32_t>(scenery.seed));
    cable_.plug(true);
    if (!host_.enumerate() || host_.control(0x00, 9, 1, 0, 0).outcome != boards::usb::Outcome::done)
      throw std::runtime_error("the image is no USB device");
    if (on_index) turn_shaft();
    begin_s_ = to_s(pcb.chip.now());
    for (int ms = 0; ms < settled_ms || (arms && !armed()); ++ms) {
      if (ms == 1000) throw std::runtime_error("the image would not arm:\n" + pcb.chip.report_text());
      if (arms && ms % 20 == 0) send(wire::Kind::arm, wire::Axes{3});
      this->ms([] {});
    }
    asks_ = true;
  }

  double time_s() const { return to_s(pcb.chip.now()) - begin_s_; }

  /// One millisecond, in steps of a packet or two; `each` after each.
  template <class Each>
  void ms(const Each& each) {
    if (design.scene.shaft.kind == boards::host::Shaft::Kind::imposed) {
      for (int a = 0; a < axes; ++a)
        pcb.bench.load(a).speed_rad_per_s = boards::host::imposed_speed_rad_per_s(design.scene, time_s());
    }
    if (host_alive) speak();
    const double until_s = time_s() + 1e-3;
    std::vector<Transfer> finished;
    while (time_s() < until_s) {
      host_.turn(finished);
      for (const Transfer& t : finished) hear(t);
      finished.clear();
      each();
    }
  }

  const wire::AxisReport& said(int axis) const { return heard_.axis[axis]; }
  std::uint8_t* ram() { return pcb.chip.core().ram(); }
  std::uint32_t ram_bytes() const { return pcb.chip.symbol("bss_end") - Core::ram_base; }
  h8_15d::Door door() {  // as it stands there, whatever flipped
    h8_15d::Door d;
    std::memcpy(static_cast<void*>(&d), ram() + (pcb.chip.symbol("door") - Core::ram_base), sizeof d);
    return d;
  }
  /// How much colder the estimate is than the winding.
  double cold_by_K(int axis) {
    const float(&core_degC)[3] = door().axis[axis].core_degC;
    const double by_K =
        pcb.bench.truth(axis).hottest_degC - static_cast<double>(std::max({core_degC[0], core_degC[1], core_degC[2]}));
    return std::isfinite(by_K) ? by_K : 1e9;
  }

  boards::Pcb pcb;
  const Design design;
  const bool arms;
  bool host_alive = true;

 private:
  static constexpr int settled_ms = 50;
  static host_sim::BenchDesign plant(const Design& d) {
    host_sim::BenchDesign plant = boards::host::bench_of(d.scene, d.truth);
    plant.sensors = boards::h8_15d_sensors();
    return plant;
  }
  void turn_shaft() {
    for (int a = 0; a < axes; ++a) pcb.bench.motor(a).place(design.scene.shaft.angle_rad / design.truth.pole_pairs, 0);
  }
  bool armed() const {
    const auto is = [this](int a) { return said(a).mode == 1 || said(a).mode == 2; };  // ready, running
    return is(0) && is(1);
  }
  template <class Payload>
  void send(wire::Kind kind, const Payload& payload) {
    Transfer out;
    out.endpoint = 1;
    out.bytes.resize(wire::max_encoded);
    out.bytes.resize(wire::encode(
        {static_cast<std::uint8_t>(kind), ++sequence_, sizeof payload, reinterpret_cast<const std::uint8_t*>(&payload)},
        out.bytes.data(), out.bytes.size()));
    host_.submit(std::move(out));
    ++sending_;
  }
  void speak() {
    if (!listening_) {
      Transfer in;
      in.endpoint = 1;
      in.in = true;
      in.wanted = 512;
      host_.submit(std::move(in));
      listening_ = true;
    }
    if (sending_ > 2) return;  // the board does not take them
    wire::Setpoints wish{3, {}, 0, {0, 0}, {0, 0}};
    for (int a = 0; asks_ && a < axes; ++a)
      wish.q[a] = static_cast<float>(boards::host::demand_A(design.scene, a, time_s()));
    send(wire::Kind::setpoint, wish);
  }
  void hear(const Transfer& t) {
    if (!t.in) {
      --sending_;
      return;
    }
    listening_ = false;
    for (const std::uint8_t byte : t.bytes) {
      if (!reader_.take(byte)) continue;
      const wire::Frame& f = reader_.frame();
      if (f.kind == wire::reply_to(wire::Kind::setpoint) && f.bytes >= sizeof heard_)
        std::memcpy(static_cast<void*>(&heard_), f.payload, sizeof heard_);
    }
  }

  boards::Cable cable_;
  boards::usb::Transfers host_;
  wire::FrameReader reader_;
  wire::State heard_{};
  std::uint8_t sequence_ = 0;
  int sending_ = 0;
  bool listening_ = false, asks_ = false;
  double begin_s_ = 0;
};

/// What lies where in the RAM, by the image's symbol table (boards/h8-15d/parts.cpp). In the table the members of both
/// axes are one, others go by what they belong to.
std::vector<Part> parts_of(Robot& robot) {
  const Chip& chip = robot.pcb.chip;
  const std::string mark = "part ", axis = "driver_.axes_[";
  const auto offset = [&chip](const char* symbol) { return chip.symbol(symbol) - Core::ram_base; };
  std::map<std::size_t, std::string> begins;
  for (const auto& [name, value] : chip.symbols()) {
    if (name.starts_with(mark)) begins[offset("application_storage") + value] = name.substr(mark.size());
  }
  if (begins.empty()) throw std::runtime_error("the image does not name its parts");
  begins[0] = "stack, never reached";
  begins[robot.door().stack_left_bytes] = "stack";
  begins[offset("stack_top")] = "toolchain";
  begins[offset("door")] = "door";
  begins[offset("door") + sizeof(h8_15d::Door)] = "toolchain";
  std::vector<Part> parts;
  for (auto one = begins.begin(); one != begins.end(); ++one) {
    const auto next = std::next(one);
    const std::string& full = one->second;
    const bool of_axis = full.starts_with(axis);
    const std::string member = of_axis ? full.substr(axis.size() + 3) : full;
    parts.push_back({(of_axis ? "axis " : "") + member.substr(0, member.find('.')), full, one->first,
                     (next == begins.end() ? robot.ram_bytes() : next->first) - one->first});
  }
  parts.push_back({"all", "all", 0, robot.ram_bytes()});
  return parts;
}

/// Of memory, motors and time. Below the stack pointer nothing is in use.
std::uint64_t print_of(Robot& robot) {
  std::uint64_t sum = 0xCBF29CE484222325;  // FNV-1a, by words
  const auto add = [&sum](const void* from, std::size_t bytes) {
    for (std::size_t at = 0; at + 4 <= bytes; at += 4) {
      std::uint32_t word;
      std::memcpy(&word, static_cast<const char*>(from) + at, 4);
      sum = (sum ^ word) * 0x100000001B3;
    }
  };
  const std::uint32_t used_from = robot.pcb.chip.core().stack_pointer() - Core::ram_base;
  if (used_from > robot.ram_bytes()) return 0;
  add(robot.ram() + used_from, robot.ram_bytes() - used_from);
  const Time now = robot.pcb.chip.now();
  add(&now, sizeof now);
  for (int a = 0; a < axes; ++a) {
    const host_sim::AxisTruth truth = robot.pcb.bench.truth(a);
    add(truth.current_A.data(), sizeof truth.current_A);
    add(truth.phase_degC.data(), sizeof truth.phase_degC);
    add(&truth.angle_rad, sizeof truth.angle_rad);
  }
  return sum;
}

/// What was seen without a flip, and at each look the print and how cold the estimates were; crosses a pipe.
struct Calm {
  struct Look {
    std::uint64_t print;
    double cold_K[axes];
  };
  Seen seen;
  std::array<Look, 20> looks;
  std::size_t count = 0;
};

/// One trial; the process that plays it ends with it.
class Trial {
  static constexpr Time step = host_sim::chip::ticks_per_s / 1'000'000;  // of waiting for a function

 public:
  Trial(Robot& robot, const Seen* calm)
      : robot_(robot),
        chip_(robot.pcb.chip),
        judge_(robot.design, robot.arms, calm),
        resets_(chip_.resets()),
        from_s_(robot.time_s()),
        seen_s_(from_s_) {}

  Calm without_a_flip(double seconds) {
    Calm calm;
    to_s_ = from_s_ + seconds;
    while (look()) {
      if (calm.count < calm.looks.size()) calm.looks[calm.count++] = now();
    }
    calm.seen = silent();
    return calm;
  }

  /// `inside`: as soon then as the core is in a function whose name holds this.
  Seen with(const Flip& flip, double after_s, const std::string& inside, double seconds, const Calm& calm) {
    to_s_ = from_s_ + seconds;
    flip_at(chip_.now() + host_sim::chip::from_s(after_s), flip, inside);
    for (std::size_t n = 0; look(); ++n) {
      const Calm::Look here = now(), &there = calm.looks[std::min(n, calm.count - 1)];
      if (n < calm.count && flipped_ && here.print == there.print) {
        Seen same = calm.seen;
        same.same = true;
        return same;
      }
      const bool colder = here.cold_K[0] > there.cold_K[0] + colder_K || here.cold_K[1] > there.cold_K[1] + colder_K;
      if (colder && !reset_ && !judge_.told())
        to_s_ = std::min(std::max(to_s_, robot_.time_s() + 1.5 * look_s), from_s_ + longest_s);
    }
    return silent();
  }

 private:
  void flip_at(Time when, const Flip& flip, const std::string& inside) {
    chip_.at(when, [this, &flip, &inside] {
      if (chip_.function_at(chip_.pc()).find(inside) == std::string::npos)
        return flip_at(chip_.now() + step, flip, inside);
      flip_s_ = robot_.time_s();
      flipped_ = true;
      robot_.ram()[flip.byte] ^= static_cast<std::uint8_t>(1u << flip.bit);
    });
  }
  /// Runs until the next look. False: the host's time is over.
  bool look() {
    const double next_s = robot_.time_s() + look_s - 0.5e-3;
    while (robot_.time_s() < next_s) {
      if (robot_.time_s() >= to_s_) return false;
      robot_.ms([this] { see(); });
    }
    return true;
  }
  Calm::Look now() { return {print_of(robot_), {robot_.cold_by_K(0), robot_.cold_by_K(1)}}; }

  void see() {
    const double now_s = robot_.time_s(), dt_s = now_s - seen_s_;
    seen_s_ = now_s;
    for (int a = 0; a < axes; ++a) {
      const wire::AxisReport& said = robot_.said(a);
      const bool on = !robot_.pcb.gates_open(a);
      view_[a] = {robot_.pcb.bench.truth(a), on, on != robot_.arms, said.mode == 3, said.limit != 0,
                  said.estimate_flags};
      if (view_[a].tripped) to_s_ = std::min(to_s_, now_s + after_trip_s);
    }
    if (!reset_ && chip_.resets() != resets_) {
      reset_ = true;
      robot_.host_alive = false;
      to_s_ = now_s + after_reset_s;
    }
    judge_.see(view_, robot_.pcb.bench.power_stage_degC(), now_s, now_s - flip_s_, dt_s, robot_.host_alive,
               now_s > to_s_ - last_s);
  }

  Seen silent() {
    std::string mistake;
    for (int a = 0; reset_ && a < axes; ++a) {
      if (robot_.cold_by_K(a) > too_cold_K)
        mistake = fmt::format("axis {}: {:.1f} K too cold after a reset", a, robot_.cold_by_K(a));
    }
    robot_.host_alive = false;
    const double until_s = robot_.time_s() + silent_s;
    while (robot_.time_s() < until_s) robot_.ms([this] { see(); });
    if (chip_.troubles().mention("both switches")) mistake = "a bridge is shorted";
    Seen seen = judge_.ended(view_);
    seen.watchdog = reset_;
    mistake.copy(seen.mistake, sizeof seen.mistake - 1);
    return seen;
  }

  Robot& robot_;
  Chip& chip_;
  FlipJudge judge_;
  AxisView view_[axes];
  int resets_;
  bool reset_ = false, flipped_ = false;
  double from_s_, seen_s_, to_s_ = 0, flip_s_ = 1e9;
};

class Image : public Victim {
 public:
  Image(const Scenery& scenery, Random& random, double seconds, const std::string& inside, const std::string& image)
      : random_(scenery.seed),
        robot_(scenery, scenery.scene != stall || random.next() % 2 == 0, image),
        seconds_(seconds),
        inside_(inside) {
    const double instant_s = robot_.time_s() + scenery.design.fault_s;
    while (robot_.time_s() < instant_s) robot_.ms([] {});
  }

  std::vector<Part> parts() const override { return parts_of(robot_); }

  Verdict trial(const Flip* flip) override {
    int status = 0;
    if (flip == nullptr) {
      const auto play = [&] { return Trial(robot_, nullptr).without_a_flip(seconds_); };
      if (!play_forked<Calm>(play, calm_, status) || calm_.seen.told_s >= 0)
        throw std::runtime_error("without a flip: trips");
      return verdict_of(calm_.seen, calm_.seen);
    }
    const double after_s = random_.uniform(0, flip_within_s);
    Seen seen;
    const auto play = [&] { return Trial(robot_, &calm_.seen).with(*flip, after_s, inside_, seconds_, calm_); };
    if (!play_forked<Seen>(play, seen, status))
      return {Became::harmful, fmt::format("the model crashes, signal {}", WIFSIGNALED(status) ? WTERMSIG(status) : 0)};
    return verdict_of(seen, calm_.seen);
  }

 private:
  Random random_;
  mutable Robot robot_;  // who looks into its memory changes nothing
  double seconds_;
  std::string inside_;
  Calm calm_;
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{examples};
  wire::pc::use_help(app, "image_flips");
  Options options{.flips = 3000, .at_once = 40, .seconds = 0.12};
  options.add_to(app);
  std::string inside, image = HOTCORE_SOURCE_DIR "/build/h8-15d/bin/h8-15d.elf";
  app.add_option("--inside", inside, "only while the core is in a function whose name holds this");
  app.add_option("--image", image, "the flash image")->capture_default_str();
  return wire::pc::run_program(app, argc, argv, [&] {
    if (!std::filesystem::exists(image)) {
      fmt::print("skipped: no flash image; cmake --preset h8-15d && cmake --build --preset h8-15d\n");
      return std::getenv("HOTCORE_ALL") != nullptr ? 1 : 0;
    }
    return run_campaign(options, [&](const Scenery& scenery, Random& random) {
      return std::make_unique<Image>(scenery, random, options.seconds, inside, image);
    });
  });
}

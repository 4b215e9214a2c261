// SPDX-License-Identifier: MIT
// F19 on the flash image: flips one bit anywhere in its RAM, stack included, at a random instant, executed on the chip
// model while both axes work near their limits and a host speaks over USB. The core is stopped between two blocks of
// instructions wherever it is: asleep, in a tick, in the middle of the slow lane. Each flip is a forked trial beside
// one that nothing happens to; then the host falls silent (tests/boards-host/flip_judge.hpp: what may become of it).
//
// A trial is short. Windings begin near their limit, so that a wrong current shows soon; a trial whose estimate has
// become colder than its winding, beside the run without a flip, goes on until it shows or is made good; one whose
// memory and motors are again as in that run ends at once. After a reset the host is silent, and the estimate that was
// kept must be no colder than the winding. Setpoints here age in 20 ms and fade in 20: what a host that falls silent
// waits for is the same code.
#include <fmt/format.h>
#include <sys/wait.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <memory>
#include <optional>

#include "boards/h8-15d/board.hpp"
#include "boards/host/chip/cable.hpp"
#include "boards/host/usbip/transfers.hpp"
#include "tests/boards-host/flip_judge.hpp"
#include "wire/pc/help.hpp"
#include "wire/pc/program.hpp"
#include "wire/protocol.hpp"

namespace {

using namespace faults;
using host_sim::Random;
using host_sim::chip::Core;
using host_sim::chip::Time;
using host_sim::chip::to_s;

constexpr float timeout_s = 0.02f, ramp_s = 0.02f;
constexpr double silent_s = 0.05;               // time-out, ramp, 5 ms of F21 and a slow tick
constexpr double last_s = 0.05;                 // in which torque is compared
constexpr double after_trip_s = 0.03;           // an open bridge only cools
constexpr double after_reset_s = 0.08;          // the image is up, and its estimate has stepped
constexpr double flip_within_s = 0.01;          // a period of the slow lane: any of its instants
constexpr double look_s = 0.01;                 // between two looks at the memory
constexpr double colder_K = 1, longest_s = 4;   // colder than the winding by more: goes on so long at most
constexpr double too_cold_K = 3;                // after a reset: what F19 allows a winding
constexpr unsigned cycles_per_instruction = 2;  // wait states are not modelled; so the lanes take twice the time

/// The image on its board, and a robot's computer on its USB cable.
struct ChipStand {
  /// `on_index`: at power-on, then somebody turns the shaft; else where it stands is known by the Hall switches alone.
  ChipStand(const Design& its_design, bool on_index, const std::string& elf, std::uint64_t seed)
      : design(its_design), pcb(plant(design), seed), cable(pcb), host(cable) {
    pcb.flash_image(elf);
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
    const auto turn = [&] {
      for (int a = 0; a < axes; ++a)
        pcb.bench.motor(a).place(design.scene.shaft.angle_rad / design.truth.pole_pairs, 0);
    };
    if (!on_index) turn();
    pcb.power_on(static_cast<std::uint32_t>(seed));
    cable.plug(true);
    if (!host.enumerate() || host.control(0x00, 9, 1, 0, 0).outcome != boards::usb::Outcome::done)
      throw std::runtime_error("the image is no USB device");
    if (on_index) turn();
    begin_s = to_s(pcb.chip.now());
  }

  double time_s() const { return to_s(pcb.chip.now()) - begin_s; }

  /// One millisecond, in steps of a packet or two; `each` after each.
  template <class Each>
  void ms(const Each& each) {
    if (design.scene.shaft.kind == boards::host::Shaft::Kind::imposed) {
      for (int a = 0; a < axes; ++a)
        pcb.bench.load(a).speed_rad_per_s = boards::host::imposed_speed_rad_per_s(design.scene, time_s());
    }
    if (host_alive) speak();
    const double until_s = time_s() + 1e-3;
    std::vector<boards::usb::Transfer> finished;
    while (time_s() < until_s) {
      host.turn(finished);
      for (const boards::usb::Transfer& t : finished) hear(t);
      finished.clear();
      each();
    }
  }

  bool arm() {
    for (int k = 0; k < 1000; ++k) {
      if (k % 20 == 0) send(wire::Kind::arm, wire::Axes{3});
      ms([] {});
      if (armed(0) && armed(1)) return asks = true;
    }
    return false;
  }

  bool armed(int axis) const { return heard.axis[axis].mode == 1 || heard.axis[axis].mode == 2; }
  std::uint8_t* ram() { return pcb.chip.core().ram(); }
  std::uint32_t ram_end() const { return pcb.chip.symbol("bss_end"); }
  h8_15d::Door door() {
    h8_15d::Door d;
    std::memcpy(static_cast<void*>(&d), ram() + (pcb.chip.symbol("door") - Core::ram_base), sizeof d);
    return d;
  }
  /// How much colder the estimate is than the winding.
  double cold_by_K(int axis) {
    const float(&core)[3] = door().axis[axis].core_degC;
    const double hottest = static_cast<double>(std::max({core[0], core[1], core[2]}));
    const double by_K = pcb.bench.truth(axis).hottest_degC - hottest;
    return std::isfinite(by_K) ? by_K : 1e9;
  }

  Design design;
  boards::Pcb pcb;
  boards::Cable cable;
  boards::usb::Transfers host;
  bool host_alive = true, asks = false;
  double begin_s = 0;
  wire::State heard{};

 private:
  static host_sim::BenchDesign plant(const Design& d) {
    host_sim::BenchDesign plant = boards::host::bench_of(d.scene, d.truth);
    plant.sensors = boards::h8_15d_sensors();
    return plant;
  }
  template <class Payload>
  void send(wire::Kind kind, const Payload& payload) {
    boards::usb::Transfer out;
    out.endpoint = 1;
    out.bytes.resize(wire::max_encoded);
    out.bytes.resize(wire::encode(
        {static_cast<std::uint8_t>(kind), ++sequence_, sizeof payload, reinterpret_cast<const std::uint8_t*>(&payload)},
        out.bytes.data(), out.bytes.size()));
    host.submit(std::move(out));
    ++sending_;
  }
  void speak() {
    if (!listening_) {
      boards::usb::Transfer in;
      in.endpoint = 1;
      in.in = true;
      in.wanted = 512;
      host.submit(in);
      listening_ = true;
    }
    if (sending_ > 2) return;
    wire::Setpoints wish{3, {}, 0, {0, 0}, {0, 0}};
    for (int a = 0; asks && a < axes; ++a)
      wish.q[a] = static_cast<float>(boards::host::demand_A(design.scene, a, time_s()));
    send(wire::Kind::setpoint, wish);
  }
  void hear(const boards::usb::Transfer& t) {
    if (!t.in) {
      --sending_;
      return;
    }
    listening_ = false;
    for (const std::uint8_t byte : t.bytes) {
      if (!reader_.take(byte)) continue;
      const wire::Frame& f = reader_.frame();
      if (f.kind == wire::reply_to(wire::Kind::setpoint) && f.bytes >= sizeof heard)
        std::memcpy(static_cast<void*>(&heard), f.payload, sizeof heard);
    }
  }

  wire::FrameReader reader_;
  std::uint8_t sequence_ = 0;
  int sending_ = 0;
  bool listening_ = false;
};

struct Flip {
  std::uint32_t address;
  unsigned bit;
  double after_s;
};

/// What lies where in the RAM, by the image's symbol table (boards/h8-15d/parts.cpp).
class Parts {
 public:
  Parts(const host_sim::chip::Chip& chip, std::uint32_t stack_left_bytes) {
    const std::string mark = "part ";
    std::uint32_t application = 0;
    for (const auto& [name, address] : chip.symbols()) {
      if (name.find("application_storage") != std::string::npos) application = address;
    }
    for (const auto& [name, offset] : chip.symbols()) {
      if (name.starts_with(mark)) begins_[application + offset] = name.substr(mark.size());
    }
    if (begins_.empty()) throw std::runtime_error("the image does not name its parts; build it anew");
    begins_[Core::ram_base] = "stack, never reached";
    begins_[Core::ram_base + stack_left_bytes] = "stack";
    begins_[chip.symbol("stack_top")] = "library";
    begins_[chip.symbol("door")] = "door";
    begins_[chip.symbol("door") + sizeof(h8_15d::Door)] = "library";
    begins_[chip.symbol("bss_end")] = "nothing";
  }

  std::string full_name(std::uint32_t address) const {
    const auto part = std::prev(begins_.upper_bound(address));
    return fmt::format("{} + {}", part->second, address - part->first);
  }
  /// As the table has it: members of both axes as one, others by what they belong to.
  std::string short_name(std::uint32_t address) const {
    return shortened(std::prev(begins_.upper_bound(address))->second);
  }
  std::uint32_t bytes(const std::string& short_name) const {
    std::uint32_t sum = 0;
    for (auto part = begins_.begin(); std::next(part) != begins_.end(); ++part) {
      if (shortened(part->second) == short_name) sum += std::next(part)->first - part->first;
    }
    return sum;
  }
  /// The n-th byte of all that have this name.
  std::uint32_t address(const std::string& short_name, std::uint32_t n) const {
    for (auto part = begins_.begin(); std::next(part) != begins_.end(); ++part) {
      const std::uint32_t bytes = std::next(part)->first - part->first;
      if (shortened(part->second) != short_name) continue;
      if (n < bytes) return part->first + n;
      n -= bytes;
    }
    return 0;
  }

 private:
  static std::string shortened(const std::string& name) {
    const std::string axis = "driver_.axes_[";
    if (name.starts_with(axis)) return "axis " + name.substr(axis.size() + 3);
    return name.substr(0, name.find('.'));
  }
  std::map<std::uint32_t, std::string> begins_;
};

/// What the run without a flip looked like: at each look the memory that is in use, and the motors.
struct Calm {
  struct Look {
    std::uint64_t print;
    double cold_K[axes];
  };
  Seen seen;
  Look looks[100];
  std::size_t count = 0;
};

/// Of memory, motors and time. Below the stack pointer nothing is in use.
std::uint64_t print_of(ChipStand& s) {
  std::uint64_t sum = 0xCBF29CE484222325;  // FNV-1a, by words
  const auto add = [&sum](const void* from, std::size_t bytes) {
    for (std::size_t at = 0; at + 4 <= bytes; at += 4) {
      std::uint32_t word;
      std::memcpy(&word, static_cast<const char*>(from) + at, 4);
      sum = (sum ^ word) * 0x100000001B3;
    }
  };
  const std::uint32_t from = s.pcb.chip.core().stack_pointer(), end = s.ram_end();
  if (from < Core::ram_base || from > end) return 0;
  add(s.ram() + (from - Core::ram_base), end - from);
  const Time now = s.pcb.chip.now();
  add(&now, sizeof now);
  for (int a = 0; a < axes; ++a) {
    const host_sim::AxisTruth truth = s.pcb.bench.truth(a);
    add(truth.current_A.data(), sizeof truth.current_A);
    add(truth.phase_degC.data(), sizeof truth.phase_degC);
    add(&truth.angle_rad, sizeof truth.angle_rad);
  }
  return sum;
}

/// Runs on for `seconds`, then without a host. Without a flip it fills `calm`.
Seen watched(ChipStand& s, double seconds, const Flip* flip, Calm& calm) {
  FlipJudge judge(s.design, s.asks, flip == nullptr ? nullptr : &calm.seen);
  host_sim::chip::Chip& chip = s.pcb.chip;
  const double from_s = s.time_s();
  const int resets = chip.resets();
  bool flipped = false;
  if (flip != nullptr) {
    chip.at(chip.now() + host_sim::chip::from_s(flip->after_s), [&] {
      s.ram()[flip->address - Core::ram_base] ^= static_cast<std::uint8_t>(1u << flip->bit);
      flipped = true;
    });
  }
  const double flip_s = from_s + (flip != nullptr ? flip->after_s : 0);
  AxisView now[axes];
  double seen_s = from_s, to_s = from_s + seconds, off_s = 0;
  bool reset = false;
  const auto look = [&] {
    const double dt_s = s.time_s() - seen_s;
    seen_s = s.time_s();
    bool off = true, tripped = false;
    for (int a = 0; a < axes; ++a) {
      const wire::AxisReport& said = s.heard.axis[a];
      const bool on = !s.pcb.gates_open(a);
      now[a] = {s.pcb.bench.truth(a), on, on != s.asks, said.mode == 3, said.limit != 0, said.estimate_flags};
      off = off && !on;
      tripped = tripped || now[a].tripped;
    }
    off_s = off ? off_s + dt_s : 0;
    if (s.host_alive && !reset && (chip.resets() != resets || chip.core().locked_up())) {
      reset = true;
      to_s = s.time_s() + after_reset_s;
    }
    if (tripped) to_s = std::min(to_s, s.time_s() + after_trip_s);
    judge.see(now, s.pcb.bench.power_stage_degC(), s.time_s(), s.time_s() - flip_s, dt_s, s.host_alive && !reset,
              s.time_s() > to_s - last_s);
  };
  std::size_t looks = 0;
  double next_s = from_s + look_s;
  while (s.time_s() < to_s) {
    s.host_alive = !reset;
    s.ms(look);
    if (s.time_s() < next_s) continue;
    next_s += look_s;
    Calm::Look found = {print_of(s), {s.cold_by_K(0), s.cold_by_K(1)}};
    if (flip == nullptr) {
      if (looks < std::size(calm.looks)) calm.looks[calm.count = looks++] = found;
      continue;
    }
    const Calm::Look& then = calm.looks[std::min(looks++, calm.count)];
    if (flipped && looks <= calm.count && found.print == then.print) {
      Seen same = calm.seen;
      same.same = true;
      return same;
    }
    const bool colder = found.cold_K[0] > then.cold_K[0] + colder_K || found.cold_K[1] > then.cold_K[1] + colder_K;
    if (colder && !reset && !judge.told())
      to_s = std::min(std::max(to_s, s.time_s() + 1.5 * look_s), from_s + longest_s);
  }
  std::string mistake;
  if (reset) {
    for (int a = 0; a < axes; ++a) {
      if (s.cold_by_K(a) > too_cold_K)
        mistake = fmt::format("axis {}: {:.1f} K too cold after a reset", a, s.cold_by_K(a));
    }
  }
  s.host_alive = false;
  const double silent_from_s = s.time_s();
  off_s = 0;
  while (s.time_s() < silent_from_s + silent_s) s.ms(look);
  Seen seen = judge.ended(now, {!s.pcb.gates_open(0), !s.pcb.gates_open(1)});
  seen.watchdog = reset;
  for (const host_sim::chip::Trouble& t : chip.troubles().list()) {
    if (t.what.find("both switches") != std::string::npos) mistake = t.what;
  }
  std::snprintf(seen.mistake, sizeof seen.mistake, "%s", mistake.c_str());
  return seen;
}

Verdict trial(ChipStand& stand, double seconds, const Flip& flip, Calm& calm) {
  Seen seen;
  int status = 0;
  if (!play_forked<Seen>([&] { return watched(stand, seconds, &flip, calm); }, seen, status))
    return {Became::harmful, fmt::format("the model crashes, signal {}", WIFSIGNALED(status) ? WTERMSIG(status) : 0)};
  return verdict_of(seen, calm.seen);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"F19: what becomes of single flipped bits in the RAM of the flash image"};
  int flips = 1000, motor_count = 3, at_once = 40;
  double seconds = 0.12;
  std::uint64_t seed = 1000;
  std::string elf = HOTCORE_SOURCE_DIR "/build/h8-15d/bin/h8-15d.elf";
  app.add_option("--flips", flips);
  app.add_option("--seconds", seconds);
  app.add_option("--seed", seed);
  app.add_option("--motors", motor_count);
  app.add_option("--image", elf);
  bool list = false;
  std::vector<std::string> only;
  app.add_flag("--list", list);
  app.add_option("--part", only);
  return wire::pc::run_program(app, argc, argv, [&] {
    Random random(seed);
    std::map<std::string, std::pair<std::size_t, Tally>> by_part;
    Tally sum;
    std::size_t size = 0;
    for (int n = 0; n < flips;) {
      const Scenes scene = std::array{push, stall, walk, stall}[random.next() % 4];
      const char* const motor = motors[random.next() % static_cast<unsigned>(motor_count)];
      Design design = design_of(motor, scene, 1e6, random);
      tell_the_truth(design);
      if (design.scene.demands.size() < axes) {
        design.scene.demands.push_back(design.scene.demands[0]);
        design.scene.demands[1].axis = 1;
      }
      const bool on_index = scene != stall || random.next() % 2 == 0;
      ChipStand stand(design, on_index, elf, random.next());
      if (!stand.arm()) throw std::runtime_error("the image would not arm:\n" + stand.pcb.chip.report_text());
      const double instant_s = stand.time_s() + design.fault_s;
      while (stand.time_s() < instant_s) stand.ms([] {});
      Calm calm;
      const auto without = [&] {
        Calm found;
        found.seen = watched(stand, seconds, nullptr, found);
        return found;
      };
      int status = 0;
      if (!play_forked<Calm>(without, calm, status)) throw std::runtime_error("without a flip: crashes");
      const Verdict healthy = verdict_of(calm.seen, calm.seen);
      if (healthy.became != Became::no_effect)
        throw std::runtime_error(fmt::format("without a flip: {} {} {}", motor, name_of(scene), healthy.why));
      const Parts parts(stand.pcb.chip, stand.door().stack_left_bytes);
      const std::uint32_t all = stand.ram_end() - Core::ram_base;
      for (int k = 0; k < at_once && n < flips; ++k, ++n) {
        Flip flip = {Core::ram_base + static_cast<std::uint32_t>(random.next() % all),
                     static_cast<unsigned>(random.next() % 8), random.uniform(0, flip_within_s)};
        if (!only.empty()) {
          const std::string& one = only[random.next() % only.size()];
          const std::uint32_t bytes = parts.bytes(one);
          if (bytes == 0) wire::pc::refuse("--part: there is no " + one + "; the table of all flips has them.");
          flip.address = parts.address(one, static_cast<std::uint32_t>(random.next() % bytes));
        }
        const Verdict verdict = trial(stand, seconds, flip, calm);
        const std::string part = parts.short_name(flip.address);
        auto& [bytes, tally] = by_part[part];
        bytes = parts.bytes(part);
        tally.add(verdict);
        sum.add(verdict);
        if (list && verdict.became == Became::harmful)
          fmt::print(stderr, "{}, {}: {} bit {} at {:.6f} s: {}{}\n", motor, name_of(scene),
                     parts.full_name(flip.address), flip.bit, flip.after_s, verdict.why,
                     verdict.told_s >= 0 ? fmt::format(", told after {:.3f} s", verdict.told_s) : "");
      }
      size = all;
    }
    fmt::print("{}", head_line());
    for (const auto& [name, found] : by_part) fmt::print("{}", line(name, found.first, found.second));
    print_sum(sum, size);
    return 0;
  });
}

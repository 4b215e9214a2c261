// SPDX-License-Identifier: MIT
// The console on the flash image: its commands where a board has Hall switches, an index and a flash of its own.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "console/commands.hpp"
#include "tests/chip/plugged.hpp"

namespace image_tests {
namespace {

using host_sim::Channel;
using host_sim::FaultKind;

/// The cable as the console sees it, at the board's own time.
class Transport : public console::link::Transport {
 public:
  explicit Transport(Plugged& plugged) : plugged_(plugged) { listen(); }
  bool write(std::span<const std::uint8_t> bytes) override {
    if (sending_) return false;
    plugged_.host.submit(bulk(false, {bytes.begin(), bytes.end()}, 0, out));
    sending_ = true;
    return true;
  }
  std::size_t read(std::span<std::uint8_t> room) override {
    const std::size_t bytes = std::min(room.size(), arrived_.size());
    std::copy_n(arrived_.begin(), bytes, room.begin());
    arrived_.erase(arrived_.begin(), arrived_.begin() + static_cast<std::ptrdiff_t>(bytes));
    return bytes;
  }
  void wait(int milliseconds) override {
    const double until_s = now_s() + 1e-3 * milliseconds;
    std::vector<Transfer> finished;
    do {
      plugged_.host.turn(finished);
    } while (finished.empty() && now_s() < until_s);
    for (const Transfer& t : finished) {
      if (!t.in) {
        sending_ = false;
        continue;
      }
      arrived_.insert(arrived_.end(), t.bytes.begin(), t.bytes.end());
      listen();
    }
  }
  double now_s() const override { return plugged_.host.time_s(); }
  bool gone() const override { return false; }

 private:
  static constexpr std::uint32_t out = 1, in = 2;
  void listen() { plugged_.host.submit(bulk(true, {}, 512, in)); }

  Plugged& plugged_;
  bool sending_ = false;
  std::deque<std::uint8_t> arrived_;
};

/// Shafts that turn freely and have not met their index; the board believes it where the magnet is `told_rad` off.
struct Fresh : Plugged {
  explicit Fresh(float told_rad, bool reversed = false) : Plugged(free_shafts()) {
    firmware::AxisSet setup[2];
    setup_of(free_shafts(), setup);
    for (auto& s : setup) s.drive.angle_offset_rad = told_rad;
    pcb->flash_parameters(setup);
    if (reversed) pcb->bench.faults().add({.channel = Channel::encoder, .kind = FaultKind::gain, .value = -1});
    pcb->bench.motor(0).place(2.0, 0);  // the other stands on its index, which the switches may contradict
    pcb->power_on(1);
    EXPECT_TRUE(configure());
    std::vector<Transfer> none;
    while (host.time_s() < 0.6) host.turn(none);  // the current sensors' offset is learnt
  }
  int say(const std::string& command) {
    return console::run_line(console, [&](CLI::App& app) { app.parse(command); });
  }
  float offset_rad() {
    return console.session().get(console.session().parameters().named("axis0.angle_offset_rad")).front();
  }
  static Options free_shafts() {
    Options o;
    o.locked = false;
    return o;
  }

  console::Console console{[this](const console::Options&) { return std::make_unique<Transport>(*this); }};
};

// Switches are mounted to the magnet; the bench's index is where the magnet lies on phase a, which makes the offset 0.
TEST(SlowConsole, AlignsAShaftWhoseIndexWasNotMetYet) {
  NEEDS_IMAGE(image);
  for (const float told_rad : {0.6f, 2.5f, -2.0f}) {
    SCOPED_TRACE(told_rad);
    Fresh board(told_rad);
    EXPECT_EQ(board.say("align --sim --yes"), 0);
    EXPECT_NEAR(board.offset_rad(), 0.0f, 0.06f);
    NO_TROUBLE_ON_USB(board);
  }
}

TEST(SlowConsole, AnEncoderThatCountsAgainstThePhasesIsNamedAndNothingWritten) {
  NEEDS_IMAGE(image);
  Fresh board(0.6f, true);
  testing::internal::CaptureStderr();
  EXPECT_EQ(board.say("align --sim --yes"), 3);
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_NE(said.find("counts against the phases; swap two of the motor's leads"), std::string::npos) << said;
  EXPECT_EQ(board.offset_rad(), 0.6f);
  NO_TROUBLE_ON_USB(board);
}

}  // namespace
}  // namespace image_tests

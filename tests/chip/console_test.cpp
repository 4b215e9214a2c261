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

/// What the board's axis 0 then believes; NaN where the command did not end with 0.
float offset_after(Plugged& plugged, const std::string& command) {
  console::Console console([&](const console::Options&) { return std::make_unique<Transport>(plugged); });
  console.options.sim = true;  // and not what hangs on this PC's USB
  if (console::run_line(console, [&](CLI::App& app) { app.parse(command); }) != 0) return NAN;
  return console.session().get(console.session().parameters().named("axis0.angle_offset_rad")).front();
}

// Switches are mounted to the magnet; the bench's index is where the magnet lies on phase a, which makes the offset 0.
TEST(SlowConsole, AlignsAShaftWhoseIndexWasNotMetYet) {
  NEEDS_IMAGE(image);
  for (const float told_rad : {0.6f, 2.5f, -2.0f}) {
    SCOPED_TRACE(told_rad);
    Options o;
    o.locked = false;
    Plugged p(o);
    firmware::AxisSet setup[2];
    setup_of(o, setup);
    for (auto& s : setup) s.drive.angle_offset_rad = told_rad;
    p.pcb->flash_parameters(setup);
    p.pcb->bench.motor(0).place(2.0, 0);  // the other stands on its index, which the switches may contradict
    p.pcb->power_on(1);
    ASSERT_TRUE(p.configure());
    std::vector<Transfer> none;
    while (p.host.time_s() < 0.6) p.host.turn(none);  // the current sensors' offset is learnt
    EXPECT_NEAR(offset_after(p, "align --yes"), 0.0f, 0.06f);
    NO_TROUBLE_ON_USB(p);
  }
}

}  // namespace
}  // namespace image_tests

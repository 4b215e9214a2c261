// SPDX-License-Identifier: MIT
// The link library as a robot's process uses it.
#include "console/link/board.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "console/link/messages.hpp"
#include "console/link/sim.hpp"

namespace {

std::atomic<int> allocations{0};

/// Sends every frame back as its own answer; memory is taken once.
class Echo final : public console::link::Transport {
 public:
  bool write(std::span<const std::uint8_t> bytes) override {
    if (full) return false;
    std::copy(bytes.begin(), bytes.end(), held_.begin());
    held_bytes_ = bytes.size();
    return true;
  }
  std::size_t read(std::span<std::uint8_t> room) override {
    std::copy_n(held_.begin(), held_bytes_, room.begin());
    return std::exchange(held_bytes_, 0);
  }
  void wait(int) override {}
  double now_s() const override { return 0; }
  bool gone() const override { return false; }
  bool full = false;

 private:
  std::array<std::uint8_t, 1024> held_{};
  std::size_t held_bytes_ = 0;
};

}  // namespace

// Not inlined: GCC 12 sees free() in place of delete and calls it a mismatch.
[[gnu::noinline]] void* operator new(std::size_t bytes) {
  ++allocations;
  if (void* memory = std::malloc(bytes)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace {

TEST(Board, NoMemoryIsTakenAfterItsStart) {
  console::link::Board board(std::make_unique<Echo>());
  wire::State state{};
  state.bus_V = 48.0f;
  const std::span payload(reinterpret_cast<const std::uint8_t*>(&state), sizeof state);
  const int before = allocations;
  ASSERT_GT(before, 0);  // the count counts
  double sum_V = 0;
  for (int i = 0; i < 10000; ++i) {
    board.write(wire::reply_to(wire::Kind::state), payload);
    while (const wire::Frame* frame = board.read()) sum_V += double{console::link::state_in(*frame)->bus_V};
  }
  EXPECT_EQ(allocations, before);
  EXPECT_EQ(sum_V, 480000.0);
}

/// The whole board included: firmware, USB stack and plant live in this process.
TEST(Board, ASimulatedOneTakesNoMemoryAfterItsStart) {
  for (const bool full_motors : {false, true}) {
    console::link::SimulatedBoard options;
    options.real_time = false;
    options.full_motors = full_motors;
    options.motor_folder = HOTCORE_SOURCE_DIR "/boards/motors";
    console::link::Board board(console::link::simulated_board(options));
    const wire::Setpoints wish{3, {}, 0, {0, 0}, {0, 0}};
    const std::span payload(reinterpret_cast<const std::uint8_t*>(&wish), sizeof wish);
    const int before = allocations;
    int states = 0;
    for (int i = 1; i <= 500 && states == i - 1; ++i) {
      board.write(static_cast<std::uint8_t>(wire::Kind::setpoint), payload);
      for (int packets = 0; packets < 10 && states < i; ++packets) {
        board.wait(10);
        while (const wire::Frame* frame = board.read()) states += console::link::state_in(*frame).has_value();
      }
    }
    EXPECT_EQ(allocations, before) << (full_motors ? "full" : "simple");
    EXPECT_EQ(states, 500);
  }
}

TEST(Board, AFullWayOutAndATooLongPayloadAreToldNotSent) {
  auto echo = std::make_unique<Echo>();
  Echo& way = *echo;
  console::link::Board board(std::move(echo));
  const std::vector<std::uint8_t> payload(wire::max_payload + 1);
  EXPECT_FALSE(board.write(1, payload));
  EXPECT_TRUE(board.write(1, std::span(payload).first(wire::max_payload)));
  way.full = true;
  EXPECT_FALSE(board.write(1, {}));
}

}  // namespace

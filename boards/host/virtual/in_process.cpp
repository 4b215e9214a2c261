// SPDX-License-Identifier: MIT
// The virtual board as the console's transport: this file is the host controller, the hub and the cable. Bytes go
// through the same USB stack as on a bus, a packet each way a PWM period (20 a ms; a full-speed bus carries 19).
#include <algorithm>
#include <chrono>
#include <thread>

#include "boards/host/virtual/virtual_board.hpp"
#include "console/link/ring.hpp"
#include "console/link/sim.hpp"
#include "wire/pc/motor_file.hpp"

namespace console::link {
namespace {

using boards::host::Handshake;
using boards::host::VirtualBoard;

constexpr std::uint8_t bus_address = 1;
constexpr double longest_lag_s = 1.0;  // of a program that stood still: then the board stood still as well
// Bytes on their way, as a host controller's queues would hold them: who does not read lets the board wait.
constexpr std::size_t out_bytes = 1 << 12, in_bytes = 1 << 16;

class InProcess final : public Transport {
 public:
  InProcess(const boards::host::VirtualBoardOptions& options, bool real_time) : board_(options), real_time_(real_time) {
    board_.bus().plug();
    board_.bus().reset();
    const auto set = [&](std::uint8_t address, std::uint8_t request, std::uint8_t value) {
      const std::uint8_t raw[8] = {0x00, request, value, 0,
                                   0,    0,       0,     0};  // USB 2.0, 9.4: no data, then the status stage
      Bus::Packet status;
      board_.bus().setup(address, raw);
      board_.bus().in(address, 0x80, status);
    };
    set(0, 5, bus_address);                                     // SET_ADDRESS
    set(bus_address, 9, 1);                                     // SET_CONFIGURATION
    board_.advance(static_cast<int>(0.5 / board_.period_s()));  // as if switched on a moment ago: sensors are settled
    start_ = std::chrono::steady_clock::now();
    start_s_ = board_.time_s();
  }

  bool write(std::span<const std::uint8_t> bytes) override {
    if (bytes.size() > out_.room()) return false;
    out_.put(bytes);
    return true;
  }

  std::size_t read(std::span<std::uint8_t> room) override { return in_.take(room); }

  void wait(int milliseconds) override {
    if (!real_time_) {
      run_until(board_.time_s() + milliseconds * 1e-3);
      return;
    }
    const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(milliseconds);
    while (true) {
      start_s_ = std::min(start_s_, start_s_ + board_.time_s() + longest_lag_s - world_s());
      run_until(world_s());
      if (in_.size() > 0 || std::chrono::steady_clock::now() >= until) return;
      std::this_thread::sleep_for(std::chrono::microseconds(500));
    }
  }

  double now_s() const override { return real_time_ ? world_s() : board_.time_s(); }
  bool gone() const override { return false; }

 private:
  using Bus = boards::host::UsbBus<VirtualBoard::Device>;

  double world_s() const {
    return start_s_ + std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

  /// Lets the board live until then, or, when time is free, until something has arrived.
  void run_until(double time_s) {
    while (board_.time_s() < time_s && (real_time_ || in_.size() == 0)) {
      exchange();
      board_.advance(1);
    }
  }

  void exchange() {
    if (out_.size() > 0) {
      std::uint8_t packet[hal::usb_packet_bytes];
      const std::size_t n = out_.peek(packet);
      if (board_.bus().out(bus_address, wire::link_out_endpoint, out_data1_, {packet, n}) == Handshake::ack) {
        out_data1_ = !out_data1_;
        out_.drop(n);
      }
    }
    Bus::Packet packet;
    if (in_.room() < hal::usb_packet_bytes) return;
    if (board_.bus().in(bus_address, wire::link_in_endpoint, packet) == Handshake::ack) in_.put(packet.view());
  }

  VirtualBoard board_;
  bool real_time_;
  std::chrono::steady_clock::time_point start_;
  double start_s_ = 0;
  bool out_data1_ = false;
  Ring<out_bytes> out_;
  Ring<in_bytes> in_;
};

}  // namespace

std::unique_ptr<Transport> simulated_board(const SimulatedBoard& options) {
  boards::host::VirtualBoardOptions board;
  board.motor = wire::pc::read_motor(options.motor, options.motor_folder).motor;
  board.serial = options.serial;
  board.full_motors = options.full_motors;
  return std::make_unique<InProcess>(board, options.real_time);
}

}  // namespace console::link

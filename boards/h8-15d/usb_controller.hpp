// SPDX-License-Identifier: MIT
// OTG_FS as a full-speed device (hal/usb_port.hpp), by RM0090 chapter 34. No DMA: this core has none; packets are
// copied through the FIFOs, one a transfer. VBUS is not sensed (PA9 is TIM1's), so that a pulled cable shows as a bus
// that went quiet. Everything below runs in the OTG_FS interrupt, or before that is enabled. Waits are bounded: the
// controller may be broken, the board may not hang.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/usb_port.hpp"

namespace h8_15d {

class UsbController {
 public:
  /// Clock, pins, core reset, device mode asked for; it holds 25 ms later (FDMOD, 34.16.2), and `connect` not before.
  void set_up();

  // hal::UsbPort
  void connect(bool on) noexcept;
  void set_address(std::uint8_t address) noexcept;
  void open(std::uint8_t endpoint, hal::EndpointKind kind, std::uint16_t bytes) noexcept;
  void close_all() noexcept;
  void stall(std::uint8_t endpoint) noexcept;
  void unstall(std::uint8_t endpoint) noexcept;
  void send(std::uint8_t endpoint, const std::uint8_t* data, std::size_t bytes) noexcept;
  void arm_out(std::uint8_t endpoint) noexcept;

  /// The interrupt: hands over at most a few events; what is left raises it again.
  template <hal::UsbEvents Device>
  void serve(Device& device) {
    for (int turn = 0; turn < 4; ++turn) {
      const Event event = next();
      switch (event.kind) {
        case Event::nothing:
          return;
        case Event::bookkeeping:
          break;
        case Event::reset:
          device.reset();
          break;
        case Event::suspend:
          device.suspend();
          break;
        case Event::resume:
          device.resume();
          break;
        case Event::start_of_frame:
          device.start_of_frame();
          break;
        case Event::setup:
          device.setup(event.data);
          break;
        case Event::out:
          device.out(event.endpoint, event.data, event.bytes);
          break;
        case Event::in_done:
          device.in_done(event.endpoint);
          break;
      }
    }
  }

 private:
  static constexpr int endpoints = 4;  // each way
  struct Event {
    enum Kind : std::uint8_t { nothing, bookkeeping, reset, suspend, resume, start_of_frame, setup, out, in_done } kind;
    std::uint8_t endpoint = 0;
    const std::uint8_t* data = nullptr;
    std::size_t bytes = 0;
  };
  Event next();
  Event next_of_endpoints();
  void prepare_device();
  void take_from_fifo();
  void forget_bus();
  void disable_in(int n);
  void disable_out(int n);

  std::uint32_t setup_[2]{};
  std::uint32_t received_[endpoints][hal::usb_packet_bytes / 4]{};
  std::uint8_t received_bytes_[endpoints]{};
};

static_assert(hal::UsbPort<UsbController>);

}  // namespace h8_15d

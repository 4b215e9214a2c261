// SPDX-License-Identifier: MIT
// The seam between a USB device controller and the device stack: events upward, operations downward.
//
// One context: every event comes from the same interrupt (or the same thread of a simulated board), operations are only
// called from within events. Endpoints are addressed as on the bus: 0x81 is IN 1, 0x01 is OUT 1. One send or one armed
// OUT is one packet, never more than the endpoint's packet size; the stack cuts what is longer.
//
// What the controller does by itself: CRC, handshakes, data toggles, NAK while nothing is armed or sent. A SETUP always
// comes through: it ends a stall of endpoint 0 and drops what was sent or armed there. A bus reset closes everything
// but endpoint 0, sets address 0, and is told before anything that follows it.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>

namespace hal {

inline constexpr std::uint8_t endpoint_in = 0x80;      // direction bit of an endpoint address
inline constexpr std::uint16_t usb_packet_bytes = 64;  // endpoint 0 and bulk, full speed
inline constexpr std::uint16_t usb_notify_bytes = 8;   // interrupt endpoint

enum class EndpointKind : std::uint8_t { control = 0, bulk = 2, interrupt = 3 };  // as in bmAttributes, USB 2.0 9.6.6

/// What the stack asks of the controller.
template <class Port>
concept UsbPort = requires(Port port, std::uint8_t endpoint, const std::uint8_t* data, std::size_t bytes) {
  /// Pull-up on or off: the host sees a device come or go.
  { port.connect(true) }
  noexcept->std::same_as<void>;
  /// Holds from the end of the present control transfer's status stage.
  { port.set_address(endpoint) }
  noexcept->std::same_as<void>;
  /// Ready from here on, data toggle at DATA0, nothing armed or sent.
  { port.open(endpoint, EndpointKind::bulk, usb_packet_bytes) }
  noexcept->std::same_as<void>;
  /// All but endpoint 0.
  { port.close_all() }
  noexcept->std::same_as<void>;
  /// Until `unstall`; on endpoint 0 both directions, until the next SETUP.
  { port.stall(endpoint) }
  noexcept->std::same_as<void>;
  /// Also sets the data toggle back to DATA0 (USB 2.0, 9.4.5) and drops what was sent or armed before.
  { port.unstall(endpoint) }
  noexcept->std::same_as<void>;
  /// Copies one packet (0 bytes: a zero-length one); `in_done` follows when the host has taken it. Never a second one
  /// before.
  { port.send(endpoint, data, bytes) }
  noexcept->std::same_as<void>;
  /// One packet may come now; `out` follows. Until then the host is told to wait.
  { port.arm_out(endpoint) }
  noexcept->std::same_as<void>;
};

/// What the controller tells the stack.
template <class Device>
concept UsbEvents = requires(Device device, std::uint8_t endpoint, const std::uint8_t* data, std::size_t bytes) {
  { device.reset() }
  noexcept->std::same_as<void>;
  { device.suspend() }
  noexcept->std::same_as<void>;  // the bus has been idle for 3 ms; also when the cable is pulled
  { device.resume() }
  noexcept->std::same_as<void>;
  { device.setup(data) }
  noexcept->std::same_as<void>;  // 8 bytes
  { device.out(endpoint, data, bytes) }
  noexcept->std::same_as<void>;  // valid during the call; also endpoint 0
  { device.in_done(endpoint) }
  noexcept->std::same_as<void>;
  { device.start_of_frame() }
  noexcept->std::same_as<void>;  // every ms while the bus is alive: the stack's pulse
};

}  // namespace hal

// SPDX-License-Identifier: MIT
// A USB device controller made of memory: hal::UsbPort towards the stack, and towards a host the packets of a bus, one
// transaction a call: reset, SETUP, OUT, IN. Strict: what the seam forbids is counted and named. One thread, no clock;
// a packet that the host does not fetch simply waits.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <span>

#include "hal/usb_port.hpp"

namespace boards::host {

enum class Handshake : std::uint8_t {
  ack,
  nak,    // later: nothing armed or sent
  stall,  // halted
  none,   // nobody answers: no such endpoint or address, or the cable is out
};

class UsbController {
 public:
  static constexpr int endpoints = 4;  // as many each way as the OTG_FS of an STM32F405 has

  // hal::UsbPort
  void connect(bool on) noexcept { connected_ = on; }
  void set_address(std::uint8_t address) noexcept { next_address_ = address; }
  void open(std::uint8_t endpoint, hal::EndpointKind, std::uint16_t bytes) noexcept {
    End& e = at(endpoint);
    e = {};
    e.open = true;
    e.size = bytes;
  }
  void close_all() noexcept {
    for (int i = 1; i < endpoints; ++i) in_[static_cast<std::size_t>(i)] = out_[static_cast<std::size_t>(i)] = {};
  }
  void stall(std::uint8_t endpoint) noexcept {
    must(at(endpoint).open, "stall of a closed endpoint");
    if ((endpoint & 0x7F) == 0) in_[0].stalled = out_[0].stalled = true;
    End& e = at(endpoint);
    e.stalled = true;
    e.ready = false;
  }
  void unstall(std::uint8_t endpoint) noexcept {
    End& e = at(endpoint);
    must(e.open, "unstall of a closed endpoint");
    e.stalled = e.ready = e.toggle = false;
  }
  void send(std::uint8_t endpoint, const std::uint8_t* data, std::size_t bytes) noexcept {
    End& e = at(endpoint);
    must((endpoint & hal::endpoint_in) != 0 && e.open, "send on a closed endpoint");
    must(!e.ready, "a second packet before the first was taken");
    must(bytes <= e.size, "a packet larger than its endpoint's");
    if (bytes > e.packet.size()) return;
    if (bytes > 0) std::memcpy(e.packet.data(), data, bytes);
    e.bytes = bytes;
    e.ready = true;
  }
  void arm_out(std::uint8_t endpoint) noexcept {
    End& e = at(endpoint);
    must((endpoint & hal::endpoint_in) == 0 && e.open, "arming of a closed endpoint");
    e.ready = true;
  }

  /// What the stack did that the seam forbids; null: nothing.
  const char* violation() const { return violation_; }

 private:
  template <class Device>
  friend class UsbBus;

  struct End {
    bool open = false, stalled = false;
    bool ready = false;   // OUT: armed. IN: a packet lies here
    bool toggle = false;  // of the next packet: DATA1
    std::uint16_t size = 0;
    std::size_t bytes = 0;
    std::array<std::uint8_t, hal::usb_packet_bytes> packet{};
  };

  End& at(std::uint8_t endpoint) {
    const auto number = static_cast<std::size_t>(endpoint & 0x7F);
    must(number < endpoints, "no such endpoint");
    return (endpoint & hal::endpoint_in ? in_ : out_)[number % endpoints];
  }
  void must(bool holds, const char* what) {
    if (!holds && violation_ == nullptr) violation_ = what;
  }
  void reset() {
    in_ = out_ = {};
    for (End* e : {&in_[0], &out_[0]}) e->open = true, e->size = hal::usb_packet_bytes;
    address_ = next_address_ = 0;
  }

  std::array<End, endpoints> in_{}, out_{};
  bool connected_ = false;
  std::uint8_t address_ = 0, next_address_ = 0;
  const char* violation_ = nullptr;
};
static_assert(hal::UsbPort<UsbController>);

/// The host's end of the cable.
template <class Device>
class UsbBus {
 public:
  UsbBus(UsbController& port, Device& device) : port_(port), device_(device) {}

  /// The device pulls its line up and the cable is in.
  bool present() const { return plugged_ && port_.connected_; }
  void plug() { plugged_ = true; }
  /// The device sees an idle bus; a controller without VBUS sense cannot tell it from a suspended one.
  void unplug() {
    plugged_ = false;
    device_.suspend();
  }
  void suspend() {
    if (present()) device_.suspend();
  }
  void resume() {
    if (present()) device_.resume();
  }
  void reset() {
    if (!present()) return;
    port_.reset();
    device_.reset();
  }
  /// Each ms.
  void frame() {
    if (present()) device_.start_of_frame();
  }

  Handshake setup(std::uint8_t address, const std::uint8_t* raw) {
    if (!present() || address != port_.address_) return Handshake::none;
    for (UsbController::End* e : {&port_.in_[0], &port_.out_[0]}) {
      e->stalled = e->ready = false;
      e->toggle = true;
    }
    port_.next_address_ = port_.address_;  // a SET_ADDRESS that was broken off never happened
    device_.setup(raw);
    return Handshake::ack;
  }

  /// A packet with the wrong toggle is one that was sent again: taken and thrown away (USB 2.0, 8.6.4).
  Handshake out(std::uint8_t address, std::uint8_t endpoint, bool data1, std::span<const std::uint8_t> data) {
    const Handshake ready = reach(address, endpoint);
    if (ready != Handshake::ack) return ready;
    UsbController::End& e = port_.at(endpoint);
    if (data.size() > e.size) return Handshake::none;  // babble: the controller drops it
    if (data1 != e.toggle) return Handshake::ack;
    e.ready = false;
    e.toggle = !e.toggle;
    device_.out(endpoint, data.data(), data.size());
    return Handshake::ack;
  }

  struct Packet {
    bool data1 = false;
    std::size_t bytes = 0;
    std::array<std::uint8_t, hal::usb_packet_bytes> data{};
    std::span<const std::uint8_t> view() const { return {data.data(), bytes}; }
  };
  Handshake in(std::uint8_t address, std::uint8_t endpoint, Packet& packet) {
    packet.bytes = 0;
    const Handshake ready = reach(address, endpoint);
    if (ready != Handshake::ack) return ready;
    UsbController::End& e = port_.at(endpoint);
    packet = {e.toggle, e.bytes, e.packet};
    e.ready = false;
    e.toggle = !e.toggle;
    if (endpoint == hal::endpoint_in) port_.address_ = port_.next_address_;
    device_.in_done(endpoint);
    return Handshake::ack;
  }

  /// DATA0 or DATA1 comes next on this endpoint.
  bool toggle(std::uint8_t endpoint) const { return port_.at(endpoint).toggle; }

 private:
  Handshake reach(std::uint8_t address, std::uint8_t endpoint) {
    if (!present() || address != port_.address_ || (endpoint & 0x7F) >= UsbController::endpoints)
      return Handshake::none;
    const UsbController::End& e = port_.at(endpoint);
    if (!e.open) return Handshake::none;
    if (e.stalled) return Handshake::stall;
    return e.ready ? Handshake::ack : Handshake::nak;
  }

  UsbController& port_;
  Device& device_;
  bool plugged_ = false;
};

}  // namespace boards::host

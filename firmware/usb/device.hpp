// SPDX-License-Identifier: MIT
// The full-speed device between a controller (hal/usb_port.hpp) and two byte streams: the link (frames) and the text
// port. Moves packets; what is said on endpoint 0 is decided in control.hpp. All of it runs in the controller's one
// context. Knows no liveness: whether the host is there is judged by setpoints alone.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>

#include "firmware/usb/control.hpp"
#include "hal/usb_port.hpp"

namespace firmware::usb {

/// One end of a bulk pair.
template <class T>
concept Stream = requires(T stream, const std::uint8_t* in, std::uint8_t* out, std::size_t bytes) {
  { stream.restart() } -> std::same_as<void>;                // a new host: forget what was begun
  { stream.wants() } -> std::same_as<bool>;                  // a packet may be taken
  { stream.take(in, bytes) } -> std::same_as<void>;          // a packet
  { stream.give(out, bytes) } -> std::same_as<std::size_t>;  // up to `bytes` to send now; 0: nothing
};

template <hal::UsbPort Port, Stream Link, Stream Text>
class Device {
 public:
  Device(Port& port, const Identity& identity, Link& link, Text& text)
      : port_(port), control_(identity), link_(link), text_(text) {}
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  // Events, as hal::UsbEvents.
  void reset() noexcept {
    suspended_ = false;
    control_.reset();
    restart_streams();
  }
  void suspend() noexcept { suspended_ = true; }
  void resume() noexcept {
    suspended_ = false;
    pump();
  }
  void setup(const std::uint8_t* raw) noexcept { obey(control_.setup(raw)); }
  void out(std::uint8_t endpoint, const std::uint8_t* data, std::size_t bytes) noexcept {
    if (endpoint == 0) {
      const Order order = control_.received(data, bytes);
      if (order != Order::answer) obey(order);
    } else if (endpoint == link_pipe.out) {
      arrived(link_pipe_, link_, data, bytes);
    } else if (endpoint == text_pipe.out) {
      arrived(text_pipe_, text_, data, bytes);
    }
    pump();
  }
  void in_done(std::uint8_t endpoint) noexcept {
    if (endpoint == hal::endpoint_in) send_answer();
    if (endpoint == link_pipe.in) link_pipe_.sending = false;
    if (endpoint == text_pipe.in) text_pipe_.sending = false;
    pump();
  }
  void start_of_frame() noexcept {
    suspended_ = false;
    pump();
  }

  bool configured() const { return control_.configured(); }

 private:
  struct Endpoints {
    std::uint8_t interface, out, in;
  };
  static constexpr Endpoints link_pipe{wire::link_interface, wire::link_out_endpoint, wire::link_in_endpoint};
  static constexpr Endpoints text_pipe{text_data_interface, text_out_endpoint, text_in_endpoint};
  struct Pipe {
    bool armed = false, sending = false;
    bool owes_end = false;  // the last packet was full: the host's read ends only with a shorter one
  };

  void obey(Order order) {
    const std::uint8_t argument = control_.argument();
    switch (order) {
      case Order::refuse:
        port_.stall(0);
        return;
      case Order::answer:
        port_.arm_out(0);  // the host may end it early
        send_answer();
        return;
      case Order::receive:
        port_.arm_out(0);
        return;
      case Order::acknowledge:
        break;
      case Order::address:
        port_.set_address(argument);
        break;
      case Order::configure:
        configure(argument == 1);
        break;
      case Order::halt:
        port_.stall(argument);
        dropped(argument);
        break;
      case Order::unhalt:
        port_.unstall(argument);
        dropped(argument);
        break;
      case Order::restart:
        if (argument == link_pipe.interface) restart(link_pipe, link_pipe_, link_);
        if (argument == text_control_interface) port_.unstall(notify_endpoint);
        if (argument == text_pipe.interface) restart(text_pipe, text_pipe_, text_);
        break;
    }
    port_.send(hal::endpoint_in, nullptr, 0);
    pump();
  }

  void send_answer() {
    Bytes packet;
    if (control_.next_packet(packet)) port_.send(hal::endpoint_in, packet.data, packet.count);
  }

  void configure(bool on) {
    port_.close_all();
    restart_streams();
    if (!on) return;
    for (const Endpoints& e : {link_pipe, text_pipe}) {
      port_.open(e.out, hal::EndpointKind::bulk, hal::usb_packet_bytes);
      port_.open(e.in, hal::EndpointKind::bulk, hal::usb_packet_bytes);
    }
    port_.open(notify_endpoint, hal::EndpointKind::interrupt, hal::usb_notify_bytes);
  }

  void restart_streams() {
    link_pipe_ = text_pipe_ = {};
    link_.restart();
    text_.restart();
  }

  template <Stream S>
  void restart(const Endpoints& e, Pipe& pipe, S& stream) {
    port_.unstall(e.out);
    port_.unstall(e.in);
    pipe = {};
    stream.restart();
  }

  /// A halt or its end drops what was armed or sent there.
  void dropped(std::uint8_t endpoint) {
    for (const auto& [e, pipe] : {Known{link_pipe, &link_pipe_}, Known{text_pipe, &text_pipe_}}) {
      if (endpoint == e.out) pipe->armed = false;
      if (endpoint == e.in) pipe->sending = pipe->owes_end = false;
    }
  }
  struct Known {
    Endpoints ends;
    Pipe* pipe;
  };

  template <Stream S>
  void arrived(Pipe& pipe, S& stream, const std::uint8_t* data, std::size_t bytes) {
    if (!pipe.armed || bytes > hal::usb_packet_bytes) return;
    pipe.armed = false;
    stream.take(data, bytes);
  }

  void pump() {
    if (suspended_ || !control_.configured()) return;
    pump(link_pipe, link_pipe_, link_);
    pump(text_pipe, text_pipe_, text_);
  }

  template <Stream S>
  void pump(const Endpoints& e, Pipe& pipe, S& stream) {
    if (!pipe.sending && !control_.halted(e.in)) {
      std::uint8_t packet[hal::usb_packet_bytes];
      const std::size_t bytes = stream.give(packet, sizeof packet);
      if (bytes > 0 || pipe.owes_end) {
        pipe.sending = true;
        pipe.owes_end = bytes == sizeof packet;
        port_.send(e.in, packet, bytes);
      }
    }
    if (!pipe.armed && !control_.halted(e.out) && stream.wants()) {
      pipe.armed = true;
      port_.arm_out(e.out);
    }
  }

  Port& port_;
  Control control_;
  Link& link_;
  Text& text_;
  Pipe link_pipe_, text_pipe_;
  bool suspended_ = false;
};

}  // namespace firmware::usb

// SPDX-License-Identifier: MIT
// The flash image on its board with a USB cable to a host that speaks the frames of wire/.
#pragma once

#include <cstring>

#include "boards/host/chip/cable.hpp"
#include "boards/host/usbip/transfers.hpp"
#include "tests/chip/image.hpp"
#include "wire/protocol.hpp"

namespace image_tests {

using boards::usb::Outcome;
using boards::usb::Transfer;

inline Transfer bulk(bool in, std::vector<std::uint8_t> bytes, std::size_t wanted, std::uint32_t id) {
  Transfer t;
  t.id = id;
  t.endpoint = 1;
  t.in = in;
  t.bytes = std::move(bytes);
  t.wanted = wanted;
  return t;
}

inline std::vector<std::uint8_t> encoded(wire::Kind kind, std::uint8_t sequence, const void* payload,
                                         std::size_t bytes) {
  std::vector<std::uint8_t> out(wire::max_encoded);
  out.resize(wire::encode({static_cast<std::uint8_t>(kind), sequence, static_cast<std::uint16_t>(bytes),
                           static_cast<const std::uint8_t*>(payload)},
                          out.data(), out.size()));
  return out;
}

struct Plugged {
  explicit Plugged(const Options& o = {}) : pcb(board(o)), cable(*pcb), host(cable) { cable.plug(true); }

  bool configure() {
    return host.enumerate() && host.control(0x00, 9, 1, 0, 0).outcome == Outcome::done;  // SET_CONFIGURATION
  }
  void pull() {
    cable.plug(false);
    host.forget();
  }

  /// One request and its answer; an empty payload: none came.
  template <class Request>
  std::vector<std::uint8_t> ask(wire::Kind kind, const Request& request, double patience_s = 0.2) {
    return ask_raw(kind, &request, sizeof request, patience_s);
  }
  std::vector<std::uint8_t> ask(wire::Kind kind) { return ask_raw(kind, nullptr, 0, 0.2); }

  template <class Message>
  static Message as(const std::vector<std::uint8_t>& payload) {
    Message m{};
    if (payload.size() < sizeof m) {
      m.answer.status = 0xFF;
      return m;
    }
    std::memcpy(static_cast<void*>(&m), payload.data(), sizeof m);
    return m;
  }

  std::unique_ptr<boards::Pcb> pcb;
  boards::Cable cable;
  boards::usb::Transfers host;

 private:
  std::vector<std::uint8_t> ask_raw(wire::Kind kind, const void* payload, std::size_t bytes, double patience_s) {
    const double until_s = host.time_s() + patience_s;
    if (host.wait_for(bulk(false, encoded(kind, ++sequence_, payload, bytes), 0, 1)).outcome != Outcome::done)
      return {};
    while (host.time_s() < until_s) {
      const Transfer read = host.wait_for(bulk(true, {}, 512, 2), until_s - host.time_s());
      if (read.outcome != Outcome::done) return {};
      for (const std::uint8_t byte : read.bytes) {
        if (!reader_.take(byte)) continue;
        const wire::Frame& f = reader_.frame();
        if (f.sequence == sequence_ && f.kind == wire::reply_to(kind)) return {f.payload, f.payload + f.bytes};
      }
    }
    return {};
  }

  wire::FrameReader reader_;
  std::uint8_t sequence_ = 0;
};

#define NO_TROUBLE_ON_USB(p)                                                      \
  EXPECT_EQ((p).pcb->chip.troubles().count(), 0u) << (p).pcb->chip.report_text(); \
  EXPECT_EQ((p).host.toggle_errors(), 0u)

}  // namespace image_tests

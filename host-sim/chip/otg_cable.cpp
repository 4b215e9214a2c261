// SPDX-License-Identifier: MIT
// OTG_FS from the other end of the cable: bus states and transactions.
#include <algorithm>

#include "host-sim/chip/otg.hpp"
#include "host-sim/chip/otg_bits.hpp"

namespace host_sim::chip {

using namespace otg_bits;

Time OtgFs::next_event() const {
  const Time idle = pulled_up_ && !suspended_ && idle_since_ != never ? idle_since_ + idle_time : never;
  return std::min({reset_ends_, plugged_ && awake_ ? next_sof_ : never, idle});
}

void OtgFs::advance(Time now) {
  if (reset_ends_ <= now) {
    reset_ends_ = never;
    enumerated_ = true;
    at(gintsts) |= enumdne;
    at(dsts) = (peek(dsts) & ~7u) | 3u << 1;  // full speed
    idle_since_ = now;
    awake_ = true;
    next_sof_ = now + frame_time;
  }
  if (plugged_ && awake_ && next_sof_ <= now) {
    next_sof_ += frame_time;
    idle_since_ = pulled_up_ ? now : never;
    if (enumerated_) {
      at(dsts) = (peek(dsts) & ~0x003FFF00u) | ((field(peek(dsts), 8, 14) + 1) & 0x7FF) << 8;
      at(gintsts) |= sof;
    }
  }
  if (pulled_up_ && !suspended_ && idle_since_ != never && idle_since_ + idle_time <= now) {
    suspended_ = true;
    at(gintsts) |= esusp | usbsusp;
    at(dsts) |= 1;
  }
  update();
}

void OtgFs::plug() {
  plugged_ = true;
  awake_ = false;
}

void OtgFs::unplug() {
  plugged_ = awake_ = enumerated_ = false;
  reset_ends_ = never;
}

void OtgFs::bus_reset() {
  if (!attached()) return;
  at(gintsts) |= usbrst;
  at(dsts) &= ~1u;
  suspended_ = enumerated_ = setup_open_ = setup_fresh_ = false;
  answers_to_ = field(peek(dcfg), 4, 7);  // the core forgets no address; the firmware has to
  for (int n = 1; n < endpoints; ++n) {
    at(control(true, n)) &= ~usbaep;
    at(control(false, n)) &= ~usbaep;
  }
  reset_ends_ = host_.now() + reset_time;
  idle_since_ = never;
  awake_ = false;
  update();
}

void OtgFs::suspend() { awake_ = false; }

void OtgFs::resume() {
  awake_ = true;
  next_sof_ = host_.now() + frame_time;
  idle_since_ = pulled_up_ ? host_.now() : never;
  if (suspended_ && attached()) {
    suspended_ = false;
    at(gintsts) |= wkupint;
    at(dsts) &= ~1u;
  }
  update();
}

bool OtgFs::hears(unsigned device) const { return ready() && !suspended_ && device == answers_to_; }

/// The first token after a SETUP: the core tells that no further SETUP came.
void OtgFs::token_after_setup() {
  if (!setup_fresh_) return;
  rx_.push_back({static_cast<std::uint32_t>(setup_done) << 17});
  setup_fresh_ = false;
}

UsbAnswer OtgFs::setup(unsigned device, const std::array<std::uint8_t, 8>& request) {
  if (!hears(device)) return {};
  std::uint32_t& size = at(out_base + 0x10);
  if (field(size, 29, 2) == 0)
    trouble("a SETUP arrived while STUPCNT was 0", out_base + 0x10);
  else
    size -= 1u << 29;
  if (rx_used() + 4 > peek(grxfsiz)) {
    trouble("RX FIFO too full for a SETUP", grxfsiz);
    return {};
  }
  rx_.push_back({static_cast<std::uint32_t>(setup_data) << 17 | 8 << 4, {request.begin(), request.end()}});
  for (const bool in : {true, false}) at(control(in, 0)) = (peek(control(in, 0)) | naksts) & ~stall_bit;
  setup_open_ = setup_fresh_ = true;
  update();
  return {UsbAnswer::ack};
}

UsbAnswer OtgFs::out(unsigned device, int n, bool data1, const std::uint8_t* bytes, std::size_t count) {
  if (!hears(device) || n >= endpoints || !active(false, n) || count > packet_size(false, n)) return {};
  if (n == 0) token_after_setup();
  const std::uint32_t where = control(false, n);
  std::uint32_t& c = at(where);
  std::uint32_t& size = at(where + 0x10);
  UsbAnswer answer{UsbAnswer::nak};
  const auto words = 1 + static_cast<std::uint32_t>((count + 3) / 4);
  if (c & stall_bit) {
    answer.kind = UsbAnswer::stall;
  } else if (!(c & epena) || (c & naksts) || (peek(gintsts) & gonakeff)) {
    if (!(c & epena)) flags(false, n) |= otepdis;
  } else if (n && data1 != ((c & dpid) != 0)) {
    answer.kind = UsbAnswer::ack;  // taken for a repetition and thrown away, USB 2.0 8.6.4
  } else if (rx_used() + words + 1 + setup_words <= peek(grxfsiz)) {
    if (count > (size & (n ? 0x7FFFFu : 0x7Fu))) trouble(endpoint(false, n) + "packet longer than DOEPTSIZ", where);
    const std::uint32_t pid = data1 ? 2u << 15 : 0;
    rx_.push_back({static_cast<std::uint32_t>(out_data) << 17 | pid | static_cast<std::uint32_t>(count) << 4 |
                       static_cast<std::uint32_t>(n),
                   {bytes, bytes + count}});
    size -= static_cast<std::uint32_t>(count) + (1u << 19);
    if (n) c ^= dpid;
    if (field(size, 19, n ? 10 : 1) == 0 || count < packet_size(false, n)) {
      rx_.push_back({static_cast<std::uint32_t>(out_done) << 17 | static_cast<std::uint32_t>(n)});
      c |= naksts;
    }
    answer.kind = UsbAnswer::ack;
  }
  update();
  return answer;
}

UsbAnswer OtgFs::in(unsigned device, int n) {
  if (!hears(device) || n >= endpoints || !active(true, n)) return {};
  if (n == 0) token_after_setup();
  const std::uint32_t where = control(true, n);
  std::uint32_t& c = at(where);
  std::uint32_t& size = at(where + 0x10);
  In& side = in_[static_cast<std::size_t>(n)];
  const std::uint32_t count = std::min(packet_size(true, n), size & (n ? 0x7FFFFu : 0x7Fu));
  UsbAnswer answer{UsbAnswer::nak};
  if (c & stall_bit) {
    answer.kind = UsbAnswer::stall;
  } else if ((c & naksts) || !(c & epena) || side.fifo.size() * 4 < count) {
    if (!(c & naksts)) flags(true, n) |= ittxfe;
  } else {
    answer = {UsbAnswer::ack, (c & dpid) != 0, std::vector<std::uint8_t>(count)};
    for (std::uint32_t i = 0; i < count; i += 4) {
      for (std::uint32_t k = 0; k < 4 && i + k < count; ++k)
        answer.bytes[i + k] = static_cast<std::uint8_t>(side.fifo.front() >> 8 * k);
      side.fifo.pop_front();
    }
    size -= count + (1u << 19);
    c ^= n ? dpid : 0;
    if (field(size, 19, n ? 10 : 2) == 0) {
      c &= ~epena;
      flags(true, n) |= xfrc;
    }
    if (n == 0 && count == 0) {  // a status stage: SET_ADDRESS takes effect
      answers_to_ = field(peek(dcfg), 4, 7);
      setup_open_ = false;
    }
  }
  update();
  return answer;
}

}  // namespace host_sim::chip

// SPDX-License-Identifier: MIT
// OTG_FS as a full-speed device (RM0090 chapter 34): registers, the shared FIFO memory of 320 words, four endpoints
// each way, and at the other end of the cable a host's transactions. Written from the manual and the public SVD, not
// from the driver. Host mode, DMA, isochronous transfers and VBUS sensing are absent: PA9 belongs to TIM1 on this
// board, so the chip can't see a pulled cable, only a bus that has gone quiet.
#pragma once

#include <array>
#include <deque>
#include <functional>

#include "host-sim/chip/device.hpp"

namespace host_sim::chip {

/// What the device said to one token. `none`: silence (not attached, another address, an endpoint that does not exist).
struct UsbAnswer {
  enum Kind { none, ack, nak, stall } kind = none;
  bool data1 = false;                 // PID of the data packet, IN only
  std::vector<std::uint8_t> bytes{};  // IN only
};

class OtgFs : public Device {
 public:
  static constexpr std::uint32_t address = 0x50000000;
  static constexpr int endpoints = 4, irq = 67;
  enum : std::uint32_t {
    gahbcfg = 0x008,
    gusbcfg = 0x00C,
    grstctl = 0x010,
    gintsts = 0x014,
    gintmsk = 0x018,
    grxstsr = 0x01C,
    grxstsp = 0x020,
    grxfsiz = 0x024,
    dieptxf0 = 0x028,
    gccfg = 0x038,
    cid = 0x03C,
    dieptxf1 = 0x104,  // 2, 3 follow
    dcfg = 0x800,
    dctl = 0x804,
    dsts = 0x808,
    diepmsk = 0x810,
    doepmsk = 0x814,
    daint = 0x818,
    daintmsk = 0x81C,
    diepempmsk = 0x834,
    in_base = 0x900,   // 0x20 an endpoint: control +0, interrupts +8, size +0x10, free FIFO space +0x18
    out_base = 0xB00,  // the same without the last
    pcgcctl = 0xE00,
    fifo_base = 0x1000  // 0x1000 an endpoint
  };

  struct Links {
    std::function<double()> usb_Hz;
    std::function<bool()> pins;  // PA11 and PA12 are OTG_FS's
  };
  OtgFs(Host& host, Links links);
  void reset() override;
  Time next_event() const override;
  void advance(Time now) override;

  // ---- the host's end of the cable; SOFs come by themselves while the bus is awake
  void plug();
  void unplug();
  void bus_reset();  // 10 ms; answers to nothing meanwhile
  void suspend();
  void resume();
  bool attached() const { return plugged_ && pulled_up_; }  // the pull-up on D+
  bool ready() const { return attached() && enumerated_; }
  UsbAnswer setup(unsigned device, const std::array<std::uint8_t, 8>& request);
  UsbAnswer out(unsigned device, int endpoint, bool data1, const std::uint8_t* bytes, std::size_t count);
  UsbAnswer in(unsigned device, int endpoint);

 protected:
  std::uint32_t on_read(std::uint32_t offset) override;
  void on_write(std::uint32_t offset, std::uint32_t value) override;

 private:
  struct Received {
    std::uint32_t status;
    std::vector<std::uint8_t> bytes{};
  };
  struct In {
    std::deque<std::uint32_t> fifo{};
    std::uint32_t words = 0;  // still to be pushed for the transfer that is enabled
  };
  static constexpr std::uint32_t control(bool in, int n) {
    return (in ? in_base : out_base) + 0x20u * static_cast<std::uint32_t>(n);
  }
  std::uint32_t& flags(bool in, int n) { return at(control(in, n) + 8); }
  std::uint32_t packet_size(bool in, int n) const;
  bool active(bool in, int n) const { return n == 0 || (peek(control(in, n)) >> 15 & 1); }
  std::uint32_t tx_depth(int n) const;
  std::uint32_t rx_used() const;

  void core_reset();
  void write_control(bool in, int n, std::uint32_t value);
  void enable(bool in, int n, std::uint32_t value);
  void write_reset_register(std::uint32_t value);
  void write_dctl(std::uint32_t value);
  void push(int n, std::uint32_t word);
  std::uint32_t pop_word(std::uint32_t offset);
  std::uint32_t pop_status();
  void check_fifos(int n, std::uint32_t offset);
  void check_attach();
  bool in_device_mode() const;
  std::uint32_t interrupts() const;
  std::uint32_t endpoint_interrupts() const;
  void update();  // the interrupt line
  bool hears(unsigned device) const;
  void token_after_setup();

  Links links_;
  bool plugged_ = false, pulled_up_ = false, awake_ = false, enumerated_ = false, suspended_ = false;
  bool setup_open_ = false, setup_fresh_ = false;  // until its status stage; until the first token behind it
  unsigned answers_to_ = 0;
  Time reset_ends_ = never, next_sof_ = never, idle_since_ = never, forced_at_ = 0, core_reset_ends_ = 0;
  std::array<In, endpoints> in_{};
  std::deque<Received> rx_;
  Received open_{};          // the packet whose words are being read
  std::size_t read_at_ = 0;  // bytes of it already read
};

}  // namespace host_sim::chip

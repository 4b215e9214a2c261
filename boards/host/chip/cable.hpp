// SPDX-License-Identifier: MIT
// The USB cable between a host's transactions and the OTG_FS of the chip on its board.
#pragma once

#include "boards/host/chip/pcb.hpp"
#include "boards/host/usbip/device.hpp"

namespace boards {

class Cable final : public usb::Device {
 public:
  explicit Cable(Pcb& pcb) : pcb_(pcb) {}
  void plug(bool in) override { in ? pcb_.chip.otg.plug() : pcb_.chip.otg.unplug(); }
  bool attached() const override { return pcb_.chip.otg.attached(); }
  void bus_reset() override { pcb_.chip.otg.bus_reset(); }
  usb::Answer setup(unsigned address, const std::array<std::uint8_t, 8>& request) override {
    return of(pcb_.chip.otg.setup(address, request));
  }
  usb::Answer out(unsigned address, int endpoint, bool data1, std::span<const std::uint8_t> bytes) override {
    return of(pcb_.chip.otg.out(address, endpoint, data1, bytes.data(), bytes.size()));
  }
  usb::Answer in(unsigned address, int endpoint) override { return of(pcb_.chip.otg.in(address, endpoint)); }
  void run(double seconds) override { pcb_.run_for(seconds); }
  void power_cycle() override {
    pcb_.chip.power_off();
    pcb_.power_on();
  }

 private:
  static usb::Answer of(host_sim::chip::UsbAnswer a) {
    return {static_cast<usb::Answer::Kind>(a.kind), a.data1, std::move(a.bytes)};
  }
  Pcb& pcb_;
};

}  // namespace boards

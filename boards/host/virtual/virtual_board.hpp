// SPDX-License-Identifier: MIT
// A board that isn't there: the firmware with its USB device and its link, on simulated motors. Time passes only in
// `advance`; between two calls the caller is the host on the USB bus. Boards share nothing: many fit into a process.
//
//   VirtualBoard board({.motor = ...});
//   board.bus().plug(); board.bus().reset(); ... board.bus().setup(...); board.advance(20);   // a millisecond
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "boards/host/virtual/memory_store.hpp"
#include "boards/host/virtual/plant.hpp"
#include "boards/host/virtual/usb_bus.hpp"
#include "firmware/link/link.hpp"
#include "firmware/link/text_port.hpp"
#include "firmware/usb/device.hpp"

namespace boards::host {

struct VirtualBoardOptions {
  wire::Motor motor{};  // on both axes
  std::string serial = "SIM0";
  bool full_motors = false;
  bool has_parameters = true;  // saved before: those of the motor; false: a board fresh from the factory
  std::uint64_t seed = 1;
};

class VirtualBoard {
 public:
  using Device = firmware::usb::Device<UsbController, firmware::Link, firmware::TextPort>;

  explicit VirtualBoard(const VirtualBoardOptions& options);
  VirtualBoard(const VirtualBoard&) = delete;
  VirtualBoard& operator=(const VirtualBoard&) = delete;

  /// So many PWM periods of 50 us.
  void advance(int periods);
  double time_s() const;
  double period_s() const;

  UsbBus<Device>& bus() { return usb_->bus; }
  /// Off and on again: what was saved is in force, everything else is new. The cable is out.
  void power_cycle();

  firmware::Driver& driver() { return *driver_; }
  firmware::Link& link() { return usb_->link; }
  firmware::ParameterStore& parameters() { return *parameters_; }
  Plant& plant() { return *plant_; }
  /// What the USB stack did that the seam forbids; null: nothing.
  const char* violation() const { return usb_->controller.violation(); }

 private:
  void save_parameters_of_motor();

  struct Usb {
    Usb(firmware::Driver& driver, firmware::Recorder& recorder, firmware::ParameterStore& parameters,
        const firmware::usb::Identity& identity);
    UsbController controller;
    firmware::Link link;
    firmware::TextPort text;
    Device device;
    UsbBus<Device> bus;
  };

  VirtualBoardOptions options_;
  firmware::usb::Identity identity_;
  std::unique_ptr<Plant> plant_;
  MemoryStore flash_;
  std::unique_ptr<firmware::Recorder> recorder_;
  std::optional<firmware::ParameterStore> parameters_;
  std::optional<firmware::Driver> driver_;
  std::optional<Usb> usb_;
  std::uint64_t periods_ = 0;
};

}  // namespace boards::host

// SPDX-License-Identifier: MIT
// The host controller's half of USB: cuts transfers into transactions, keeps data toggles, repeats what was answered
// with NAK, and gives every endpoint that has work its turn (USB 2.0 chapter 8). Time passes only in `turn`.
#pragma once

#include <deque>
#include <map>
#include <string>

#include "boards/host/usbip/device.hpp"

namespace boards::usb {

enum class Outcome { done, stalled, gone, garbled };

/// One transfer. IN: `wanted` bytes at most, or fewer after a short packet.
struct Transfer {
  std::uint32_t id = 0;  // the caller's
  int endpoint = 0;
  bool in = false;
  std::array<std::uint8_t, 8> setup{};  // endpoint 0 only
  std::vector<std::uint8_t> bytes{};    // OUT: to send; IN: received
  std::size_t wanted = 0;
  Outcome outcome = Outcome::done;
};

class Transfers {
 public:
  explicit Transfers(Device& device) : device_(device) {}

  /// Bus reset, address 1, device and configuration descriptors, serial number. False: nobody answers as a USB device
  /// does.
  bool enumerate();
  void forget();  // all that is under way; the cable was pulled

  void submit(Transfer transfer) { waiting_[slot(transfer)].push_back({std::move(transfer)}); }
  /// True: it was still waiting and is gone now.
  bool cancel(std::uint32_t id);
  /// One transaction for each endpoint that has work; finished transfers are appended. Passes between 20 us (nothing
  /// moved) and some 50 us a packet.
  void turn(std::vector<Transfer>& finished);
  /// Submits and waits, for tests and enumeration. What else finishes meanwhile is kept for the next `turn`.
  Transfer wait_for(Transfer transfer, double patience_s = 0.3);
  Transfer control(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
                   std::uint16_t length, std::vector<std::uint8_t> data = {});

  const std::vector<std::uint8_t>& device_descriptor() const { return device_descriptor_; }
  const std::vector<std::uint8_t>& configuration_descriptor() const { return configuration_descriptor_; }
  /// Printable characters only; empty: the device has none.
  const std::string& serial() const { return serial_; }
  double time_s() const { return time_s_; }
  std::uint64_t refused() const { return naks_; }
  /// Data packets whose toggle was not the expected one: a device that lost count.
  std::uint64_t toggle_errors() const { return toggle_errors_; }

 private:
  enum class Stage { setup, data, status };
  struct Job {
    Transfer transfer;
    Stage stage = Stage::setup;
    std::size_t moved = 0;
    int silent = 0;
    bool data1 = false;  // endpoint 0: of the next data packet
  };
  static int slot(const Transfer& t) { return t.endpoint == 0 ? 0 : t.endpoint | (t.in ? 0x80 : 0); }
  bool step(Job& job);  // true: finished
  bool step_control(Job& job);
  bool step_in(Job& job, bool& data1);
  bool step_out(Job& job, bool& data1);
  bool end(Job& job, Outcome outcome);
  Answer heard(Job& job, Answer answer, std::size_t bytes);
  void note_toggles(const Transfer& control);
  void pass(double seconds);

  Device& device_;
  unsigned address_ = 0;
  std::map<int, std::deque<Job>> waiting_;
  std::map<int, bool> data1_;  // of each endpoint's next packet
  std::vector<Transfer> finished_early_;
  std::vector<std::uint8_t> device_descriptor_, configuration_descriptor_;
  std::string serial_;
  double time_s_ = 0;
  std::uint64_t naks_ = 0, toggle_errors_ = 0;
};

}  // namespace boards::usb

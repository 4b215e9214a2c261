// SPDX-License-Identifier: MIT
// Boards on USB, by libusb-1.0: finding them, and the stream of bytes over the vendor interface's two bulk endpoints.
//
// One Usb serves any number of boards in one thread: waiting on one of them moves the bytes of all. After open() no
// memory is taken here; what libusb takes: board.hpp. A stalled endpoint is lifted and the stream begun anew.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "console/link/transport.hpp"
#include "wire/pc/user_error.hpp"

struct libusb_context;

namespace console::link {

/// wire's ids are a placeholder that others use too, so the manufacturer's name must fit as well.
inline constexpr const char* manufacturer = "hotcore";

/// A board seen on the bus.
struct Found {
  std::string serial;                                 // empty when it could not be read
  std::string product;                                // as the device says, printable characters only
  std::string place;                                  // "bus 1 port 2.3"
  wire::pc::Exit trouble = wire::pc::Exit::answered;  // why it cannot be talked to
  std::string sentence = "";                          // and what to do
};

class Usb {
 public:
  /// Throws UserError (no_permission) when the system has no USB at all.
  Usb();
  ~Usb();
  Usb(const Usb&) = delete;
  Usb& operator=(const Usb&) = delete;

  /// Every board on the bus, also those that cannot be opened, ordered by serial.
  std::vector<Found> list();

  /// Opens the one board whose serial begins with `prefix` (empty: the only board).
  /// Throws UserError in one sentence: no_board, no_permission, busy, gone.
  std::unique_ptr<Transport> open(const std::string& prefix);

 private:
  libusb_context* context_ = nullptr;
};

/// The udev rule that lets users at the machine reach a board.
std::string udev_rule();

}  // namespace console::link

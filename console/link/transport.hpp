// SPDX-License-Identifier: MIT
// A stream of bytes to and from one board. Never blocks but in wait(); allocates nothing after it was opened.
// Implemented by libusb (usb.hpp) and by a board in this process (sim.hpp). One thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace console::link {

class Transport {
 public:
  virtual ~Transport() = default;
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;

  /// Takes all of `bytes` or, while the way out is full, nothing: false, try again after wait().
  virtual bool write(std::span<const std::uint8_t> bytes) = 0;
  /// What has arrived, at most `room.size()` bytes.
  virtual std::size_t read(std::span<std::uint8_t> room) = 0;
  /// Returns when something has happened, at the latest after so many milliseconds. 0 only looks.
  virtual void wait(int milliseconds) = 0;
  /// The clock by which to pace and to give up, in seconds from anywhere: a simulated board may be faster than the
  /// world.
  virtual double now_s() const = 0;
  /// True from the moment at which the board was seen to be unplugged or to have failed. It does not come back: open
  /// anew.
  virtual bool gone() const = 0;
  /// How often the board has refused what was under way and the stream was begun anew: what was written or asked for
  /// before may be lost. Repeating a request is harmless.
  virtual int restarts() const { return 0; }

 protected:
  Transport() = default;
};

}  // namespace console::link

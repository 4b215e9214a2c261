// SPDX-License-Identifier: MIT
// The text port: one-line commands for people without the tool, in any terminal program. A usb::Stream for the USB
// context. Small on purpose: no telemetry; parameters are shown and not changed (that is an errand of the link's); a
// setpoint fades like any other unless it is sent again.
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/link/link.hpp"

namespace firmware {

class TextPort {
 public:
  explicit TextPort(Link& link) : link_(link), commands_(link.commands()) {}

  // usb::Stream
  void restart() { line_count_ = said_ = count_ = 0, too_long_ = false; }
  bool wants() const { return count_ == 0; }  // the last answer has left
  void take(const std::uint8_t* data, std::size_t bytes);
  std::size_t give(std::uint8_t* out, std::size_t room);

 private:
  void obey(char* line);
  void help();
  void state();
  void get(const char* name, const char* axis);
  void say(const char* text);
  void say(float value);
  void say_exactly(float value);
  void say(wire::Status status);

  const Link& link_;
  Commands& commands_;
  char line_[64]{};
  std::size_t line_count_ = 0;
  bool too_long_ = false;
  char answer_[512]{};
  std::size_t said_ = 0, count_ = 0;
};

}  // namespace firmware

// SPDX-License-Identifier: MIT
// What an axis is doing, and what may change it. The table is the whole truth; `next` is its only reader. ISR.
#pragma once

#include <cstdint>

namespace firmware {

enum class Mode : std::uint8_t {
  off,      // bridge open, learns the current sensors' offset
  ready,    // armed, bridge open, waits for a fresh setpoint
  running,  // bridge switches
  tripped   // bridge open and latched, evidence kept
};

enum class Event : std::uint8_t {
  arm,     // asked for, and nothing speaks against it
  disarm,  // asked for
  start,   // a fresh setpoint
  stop,    // the ramp after the last setpoint has ended
  trip,    // a fault
  clear    // asked for, with a zero setpoint
};

inline constexpr int mode_count = 4, event_count = 6;

inline constexpr Mode mode_table[mode_count][event_count] = {
    //             arm            disarm         start          stop           trip           clear
    /* off     */ {Mode::ready, Mode::off, Mode::off, Mode::off, Mode::tripped, Mode::off},
    /* ready   */ {Mode::ready, Mode::off, Mode::running, Mode::ready, Mode::tripped, Mode::ready},
    /* running */ {Mode::running, Mode::off, Mode::running, Mode::ready, Mode::tripped, Mode::running},
    /* tripped */ {Mode::tripped, Mode::tripped, Mode::tripped, Mode::tripped, Mode::tripped, Mode::off},
};

constexpr Mode next(Mode mode, Event event) { return mode_table[static_cast<int>(mode)][static_cast<int>(event)]; }

constexpr const char* text_of(Mode mode) {
  constexpr const char* texts[mode_count] = {"off", "ready", "running", "tripped"};
  return texts[static_cast<int>(mode)];
}

}  // namespace firmware

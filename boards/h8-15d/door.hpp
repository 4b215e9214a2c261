// SPDX-License-Identifier: MIT
// The debugger's door: a plain struct in RAM (symbol `door`) by which a debug probe commands and watches both axes. It
// stays for tests and for boards whose USB is dead; whoever holds a probe could write any register anyway. The
// same rules hold as for every host: setpoints age, arming is refused for its reasons, faults latch. Beside USB the
// last word counts: the door is looked at in the main loop, and the USB interrupt waits while something new is there.
#pragma once

#include <cstdint>

#include "firmware/driver.hpp"
#include "wire/protocol.hpp"

namespace h8_15d {

enum DoorWish : std::uint32_t { wish_none = 0, wish_arm = 1, wish_disarm = 2, wish_clear = 3 };

/// What firmware/parameter_store.hpp can do, by its own names.
enum DoorOrder : std::uint32_t { order_get = 1, order_stage = 2, order_commit = 3, order_save = 4 };

struct Door {
  static constexpr std::uint32_t open = 0x524F4F44;  // "DOOR"
  std::uint32_t magic;                               // `open` once the main loop looks
  std::uint32_t bytes;                               // sizeof(Door): a stranger's program must not poke blindly
  // In. Raise `serial` last: each new number is one fresh setpoint for the axes in `axes`.
  std::uint32_t serial;
  std::uint32_t axes;  // bit k: axis k
  float id_A[2], iq_A[2];
  std::uint32_t wish_serial;  // raise last: each new number is one wish
  std::uint32_t wish[2];
  std::uint32_t order_serial;  // raise last: each new number is one order about the parameters
  std::uint32_t order;
  wire::Assignment assignment;
  // Out.
  std::uint32_t answer[2];    // wire::Status of the last wish
  std::uint32_t reset_flags;  // RCC_CSR at the start
  std::uint32_t unique_id[3];
  std::uint32_t slow_ticks, lost_samples[2], stack_left_bytes;
  float vdda_V, bus_A, force_V[2];
  std::uint32_t restored;      // Recalled: 1 heat from the backup memory, 2 from the journal, 0 none: started hot
  wire::Answer parameters;     // what was found in flash at the start
  wire::Answer order_answer;   // of the last order
  float order_value;           // that order_get asked for
  std::uint32_t saved_serial;  // of the parameter record in flash, 0: none
  firmware::AxisState axis[2];
};

}  // namespace h8_15d

extern "C" h8_15d::Door door;

// SPDX-License-Identifier: MIT
// What the board and the PC say to each other, in frames of wire/framer.hpp. One table of kinds, one plain struct a
// message; the struct in memory is the message on the wire (little endian, IEEE 754, offsets asserted below).
//
// The PC asks, the board answers each request once, with the request's sequence number and its kind + 0x80; only
// telemetry comes unasked. Every answer begins with Answer; unless its status is `done`, nothing else follows. The
// board answers in order of arrival but for commit, save, load and ask: those take time and are answered when they are
// done; one of them at a time, and nothing can be staged meanwhile (status busy).
//
// A list fills the rest of the payload: its length says how many. Texts stand behind the struct, each ended by NUL.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "wire/codes.hpp"
#include "wire/framer.hpp"

namespace wire {

static_assert(std::endian::native == std::endian::little, "messages are memory images");

/// Rises when a PC that knows only the older one would misread the board, or the other way round.
inline constexpr std::uint16_t protocol_version = 4;  // 2: control modes; 3: time left; 4: bus trips

/// pid.codes' test id: a placeholder, to be replaced before anything is sold. https://pid.codes/1209/0001/
inline constexpr std::uint16_t usb_vendor_id = 0x1209, usb_product_id = 0x0001;
/// Interface 0, bulk endpoints of the frames; interfaces 1 and 2 are the text port.
inline constexpr std::uint8_t link_interface = 0, link_out_endpoint = 0x01, link_in_endpoint = 0x81;
inline constexpr char device_interface_guid[] = "{6F1D2B60-9E0B-4E43-9D5C-4B2C5D0A7E31}";  // drawn for this project

inline constexpr std::uint8_t reply_bit = 0x80;

// clang-format off
enum class Kind : std::uint8_t {        // request                            answer
  hello              = 0x01,            // -                                  Hello                takes back what is staged
  describe_parameter = 0x02,            // Index                              ParameterText + name, unit, doc
  describe_signal    = 0x03,            // Index                              SignalText + name, unit, doc
  get                = 0x04,            // Address[]                          Answer + float[]     values in force
  stage              = 0x05,            // Assignment[]                       Answer               the first refused
  commit             = 0x06,            // -                                  Answer               the first refused
  save               = 0x07,            // -                                  Answer               what is in force, to flash
  load               = 0x08,            // Load                               Answer               staged := ...
  arm                = 0x10,            // Axes                               Answer               the first refused
  disarm             = 0x11,            // Axes                               Answer
  clear              = 0x12,            // Axes                               Answer
  setpoint           = 0x13,            // Setpoints                          State
  state              = 0x14,            // -                                  State
  fault              = 0x15,            // Axes                               FaultEvidence        of the lowest axis named
  calibrate          = 0x16,            // Axes                               Offsets              of the lowest axis named
  ask                = 0x17,            // Ask + Segment[]                    Outlook              up to 60 s
  mode               = 0x18,            // ChooseMode                         Answer               all of them or none
  subscribe          = 0x20,            // Subscribe + SignalAddress[]        Answer               none: end
  capture            = 0x21,            // CaptureOrder + SignalAddress[]     Answer               none: end
  capture_status     = 0x22,            // -                                  CaptureStatus
  capture_read       = 0x23,            // Index (of a row)                   Rows + float[]
  telemetry          = 0x40,            // (pushed by the board)              Rows + float[]
};
// clang-format on

constexpr std::uint8_t reply_to(Kind kind) { return static_cast<std::uint8_t>(kind) | reply_bit; }

inline constexpr int axis_count = 2;
inline constexpr std::uint8_t no_axis = 0xFF;  // of an address: the whole board

// ---- requests -------------------------------------------------------------------------------------------------------

struct Index {
  std::uint16_t index;
};
/// Bit 0: axis 0, bit 1: axis 1.
struct Axes {
  std::uint8_t mask;
};
struct Address {
  std::uint16_t id;
  std::uint8_t axis;  // no_axis for a parameter of the whole board
  std::uint8_t zero = 0;
};
struct Assignment {
  Address address;
  float value;  // NaN: unset
};
enum class LoadFrom : std::uint8_t { in_force = 0, saved = 1, defaults = 2 };
struct Load {
  LoadFrom from;
};
/// What a setpoint means. Each start begins with current.
enum class ControlMode : std::uint8_t {
  current = 0,  // A of phase amplitude
  torque = 1,   // N m, by 3/2 pole pairs flux linkage: what the magnet makes, at the temperature of the sheet
};
inline constexpr int control_mode_count = 2;
constexpr const char* text_of(ControlMode mode) {
  constexpr const char* texts[control_mode_count] = {"current", "torque"};
  return static_cast<int>(mode) < control_mode_count ? texts[static_cast<int>(mode)] : "unknown";
}
struct ChooseMode {
  std::uint8_t mask;
  ControlMode mode;
};
/// For the axes in `mask`: the others keep what they have, and their clocks run on. `mode` is what the numbers are
/// meant as: an axis that has another mode refuses them.
struct Setpoints {
  std::uint8_t mask;
  ControlMode mode[axis_count]{};
  std::uint8_t zero = 0;
  float id_A[axis_count];
  float q[axis_count];  // current: iq in A; torque: N m
};
/// One piece of a motion: |i| for some time.
struct Segment {
  float seconds;
  float current_A;
};
struct Ask {
  std::uint8_t axis;
  std::uint8_t standing = 1;  // wherever it stands, each phase as if it were the hottest; 0: it turns, all phases share
  std::uint16_t zero = 0;
};
inline constexpr int max_segments = 16;
inline constexpr float longest_ask_s = 60.0f;  // all segments together

struct SignalAddress {
  std::uint8_t id;
  std::uint8_t axis;
};
inline constexpr int max_signals = 16;  // in one subscription or capture

/// A row each `decimation` PWM periods, 1 = every one. Ends the subscription before; so do `hello` and no signals at
/// all.
struct Subscribe {
  std::uint16_t decimation;
  std::uint16_t zero = 0;
};
enum class Edge : std::uint8_t { now = 0, rising = 1, falling = 2 };  // passing `level` with this row
/// `pre` rows from before the trigger and `post` from it on, one each `decimation` PWM periods:
/// (pre + post) (signals + 1) words, at most hello's capture_words. Ends a capture that was ordered before.
struct CaptureOrder {
  SignalAddress trigger;
  Edge edge;
  std::uint8_t zero = 0;
  float level;
  std::uint16_t pre, post;
  std::uint16_t decimation;
  std::uint16_t zero_too = 0;
};

// ---- answers --------------------------------------------------------------------------------------------------------

/// `axis` and `id` name what was refused, where that makes sense.
struct Answer {
  std::uint8_t status = 0;  // wire::Status
  std::uint8_t axis = no_axis;
  std::uint16_t id = 0;
};
constexpr Answer refused(Status why, std::uint8_t axis = no_axis, std::uint16_t id = 0) {
  return {static_cast<std::uint8_t>(why), axis, id};
}

/// Texts are padded with NUL and end with one.
struct Hello {
  Answer answer;
  std::uint16_t protocol;  // protocol_version; stands here in every version
  std::uint16_t max_payload;
  std::uint32_t dictionary_hash;  // over all parameters and signals: who knows it need not fetch them
  std::uint16_t parameters, signals;
  std::uint8_t axes;
  std::uint8_t zero[3]{};
  float pwm_Hz;
  std::uint32_t capture_words;  // a row takes one a signal and one more
  float bus_min_V, bus_max_V;   // outside, the bridges open
  char board[16];
  char firmware[16];  // version
  char serial[28];    // as in the USB string descriptor
};

struct ParameterText {
  Answer answer;
  std::uint16_t id;
  std::uint8_t axes;   // 2: one for each axis; 1: one for the board, addressed with no_axis
  std::uint8_t flags;  // ParameterFlag
  float min, max;
  float fallback;  // NaN: must be given
  // name, unit, doc
};
enum ParameterFlag : std::uint8_t {
  needs_disarmed = 1,  // a commit that changes it is refused unless all axes are off
  whole_number = 2,
};

struct SignalText {
  Answer answer;
  std::uint8_t id;
  std::uint8_t axes;  // as above
  std::uint16_t zero = 0;
  // name, unit, doc
};

struct AxisReport {
  std::uint8_t mode;         // firmware/mode.hpp: 0 off, 1 ready, 2 running, 3 tripped
  std::uint8_t limit;        // wire::Limit
  std::uint8_t fault;        // wire::Fault
  std::uint8_t refused = 0;  // wire::Status of the setpoint in this exchange
  ControlMode control;       // what a setpoint means
  std::uint8_t zero[3]{};
  float id_A, iq_A;       // measured
  float speed_rad_per_s;  // mechanical
  float rotor_rad;        // mechanical, [0, 2 pi]
  float core_degC;        // estimated, of the hottest phase
  float core_sigma_K;
  float housing_degC;            // estimated
  float allowance_A;             // largest |i| that is allowed now
  std::uint32_t estimate_flags;  // thermal::EstimateFlag
  float time_left_s;             // that the load may go on until the core's limit; +infinity beyond half a minute
  float allowance_1s_A;          // largest |i| that the core bears for the next second
};

struct State {
  Answer answer;
  std::uint32_t period;  // time stamp: number of the last PWM period
  float bus_V;
  AxisReport axis[axis_count];
};

/// The first fault since the last clear; 0 if there is none.
struct FaultEvidence {
  Answer answer;
  std::uint8_t fault, axis;
  std::uint16_t zero = 0;
  float value, threshold;
  float age_s;
};

/// Current sensors' offsets as learnt at rest.
struct Offsets {
  Answer answer;
  float phase_A[3];
};

struct Outlook {
  Answer answer;
  std::uint8_t feasible;  // 0: the governor would hold it back
  std::uint8_t zero[3]{};
  float peak_degC;           // of the node that comes closest to its limit, if nobody held it back
  float limits_after_s;      // +infinity when feasible
  float share_before_limit;  // of the ampere-seconds asked for, 0..1; the governor delivers more: it goes on with less
};

enum class CapturePhase : std::uint8_t { idle = 0, waiting = 1, filling = 2, complete = 3 };
struct CaptureStatus {
  Answer answer;
  CapturePhase phase;
  std::uint8_t signals;
  std::uint16_t rows;  // that may be read: all of them once complete
  std::uint16_t pre;   // rows before the trigger: fewer than ordered if it came early
  std::uint16_t decimation;
  std::uint32_t trigger_period;  // of row `pre`
};

/// `rows` times `signals` values follow, row by row. Row k is of PWM period first_period + k * decimation: where
/// periods are missing, a new frame begins.
struct Rows {
  Answer answer;
  std::uint32_t first_period;
  std::uint32_t dropped;  // rows lost between subscription and sending; 0 in a capture
  std::uint16_t decimation;
  std::uint8_t signals, rows;
};
inline constexpr std::size_t max_row_values = (max_payload - sizeof(Rows)) / sizeof(float);

// ---- layout ---------------------------------------------------------------------------------------------------------

#define HOTCORE_AT(type, member, offset) static_assert(offsetof(type, member) == (offset))
#define HOTCORE_SIZE(type, bytes) \
  static_assert(sizeof(type) == (bytes) && std::is_trivially_copyable_v<type> && (bytes) <= max_payload)
HOTCORE_SIZE(Index, 2);
HOTCORE_SIZE(Axes, 1);
HOTCORE_SIZE(Address, 4);
HOTCORE_AT(Address, axis, 2);
HOTCORE_SIZE(Assignment, 8);
HOTCORE_AT(Assignment, value, 4);
HOTCORE_SIZE(Load, 1);
HOTCORE_SIZE(ChooseMode, 2);
HOTCORE_SIZE(Setpoints, 20);
HOTCORE_AT(Setpoints, mode, 1);
HOTCORE_AT(Setpoints, id_A, 4);
HOTCORE_AT(Setpoints, q, 12);
HOTCORE_SIZE(Segment, 8);
HOTCORE_SIZE(Ask, 4);
HOTCORE_SIZE(SignalAddress, 2);
HOTCORE_SIZE(Subscribe, 4);
HOTCORE_SIZE(CaptureOrder, 16);
HOTCORE_AT(CaptureOrder, edge, 2);
HOTCORE_AT(CaptureOrder, level, 4);
HOTCORE_AT(CaptureOrder, pre, 8);
HOTCORE_AT(CaptureOrder, decimation, 12);
HOTCORE_SIZE(Answer, 4);
HOTCORE_AT(Answer, id, 2);
HOTCORE_SIZE(Hello, 96);
HOTCORE_AT(Hello, protocol, 4);
HOTCORE_AT(Hello, dictionary_hash, 8);
HOTCORE_AT(Hello, parameters, 12);
HOTCORE_AT(Hello, axes, 16);
HOTCORE_AT(Hello, pwm_Hz, 20);
HOTCORE_AT(Hello, capture_words, 24);
HOTCORE_AT(Hello, bus_min_V, 28);
HOTCORE_AT(Hello, board, 36);
HOTCORE_AT(Hello, firmware, 52);
HOTCORE_AT(Hello, serial, 68);
HOTCORE_SIZE(ParameterText, 20);
HOTCORE_AT(ParameterText, axes, 6);
HOTCORE_AT(ParameterText, min, 8);
HOTCORE_SIZE(SignalText, 8);
HOTCORE_AT(SignalText, axes, 5);
HOTCORE_SIZE(AxisReport, 52);
HOTCORE_AT(AxisReport, control, 4);
HOTCORE_AT(AxisReport, id_A, 8);
HOTCORE_AT(AxisReport, speed_rad_per_s, 16);
HOTCORE_AT(AxisReport, core_degC, 24);
HOTCORE_AT(AxisReport, allowance_A, 36);
HOTCORE_AT(AxisReport, time_left_s, 44);
HOTCORE_SIZE(State, 116);
HOTCORE_AT(State, period, 4);
HOTCORE_AT(State, axis, 12);
HOTCORE_SIZE(FaultEvidence, 20);
HOTCORE_AT(FaultEvidence, value, 8);
HOTCORE_SIZE(Offsets, 16);
HOTCORE_SIZE(Outlook, 20);
HOTCORE_AT(Outlook, peak_degC, 8);
HOTCORE_SIZE(CaptureStatus, 16);
HOTCORE_AT(CaptureStatus, rows, 6);
HOTCORE_AT(CaptureStatus, trigger_period, 12);
HOTCORE_SIZE(Rows, 16);
HOTCORE_AT(Rows, dropped, 8);
HOTCORE_AT(Rows, signals, 14);
#undef HOTCORE_AT
#undef HOTCORE_SIZE

/// The message at the start of a payload; false if the payload is shorter.
template <class Message>
bool read(const std::uint8_t* payload, std::size_t bytes, Message& message) {
  if (bytes < sizeof message) return false;
  std::memcpy(&message, payload, sizeof message);
  return true;
}

}  // namespace wire

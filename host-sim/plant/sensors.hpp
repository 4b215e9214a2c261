// SPDX-License-Identifier: MIT
// From amperes, volts, radians and kelvin to what a chip reads: 12-bit counts, encoder counts, Hall bits. Gains, noise,
// saturation, and a table of faults. The way back (counts to SI) belongs to the board, which gets the numbers of
// SensorDesign and nothing else.
#pragma once

#include <cstdint>
#include <vector>

#include "host-sim/plant/random.hpp"

namespace host_sim {

/// A 10 kohm NTC to ground under a 10 kohm pull-up, read against the pull-up's own reference: open reads full scale,
/// short reads 0. R = R25 exp(beta (1/T - 1/298.15 K)).
struct NtcDesign {
  double r25_ohm = 10000;
  double beta_K = 3950;
  double pull_up_ohm = 10000;
};

/// Defaults: a board of the 20 A class; assumptions of ours. What a board's converter from counts must know.
struct SensorDesign {
  int adc_full_scale = 4095;
  double current_zero_counts = 2048;
  double current_A_per_count = 40.0 / 2048;  // +-40 A: twice the burst current, so that faults stay visible
  double bus_V_per_count = 66.0 / 4096;
  double bus_zero_counts = 1024;         // bus current
  double bus_A_per_count = 60.0 / 3072;  // -20..+40 A would clip while braking hard; -20..+60 A
  double bus_filter_s = 1e-3;            // of the bus current amplifier
  int encoder_counts_per_turn = 4096;    // after quadrature
  NtcDesign housing, power_stage;
  // Imperfections, per reading.
  double current_noise_A = 0.03;
  double current_offset_A[3] = {0, 0, 0};  // what offset learning has to find
  double current_gain[3] = {1, 1, 1};
  double bus_noise_V = 0.02;
  double bus_noise_A = 0.05;
  double ntc_noise_K = 0.2;
};

/// ADC counts, rounded and clamped as a converter does.
std::uint16_t to_counts(double counts, int full_scale);
double ntc_counts(const NtcDesign& design, double degC, int full_scale);

enum class Channel : std::uint8_t {
  current_a,
  current_b,
  current_c,
  encoder,
  index,
  hall,
  housing,
  conversion,  // of an axis
  bus_voltage,
  bus_current,
  power_stage,  // of the board
  count
};

enum class FaultKind : std::uint8_t {
  off,           // reads nothing: 0 counts; encoder and index stop; conversion: no new sample
  stuck,         // the last good reading stays
  fixed,         // `value` counts: rail, NTC open (full scale) or short (0)
  garbage,       // uniform over the range
  gain,          // times `value` (encoder: -1 reverses it)
  offset,        // plus `value` in the channel's unit (A, V, degC, encoder counts)
  drift,         // plus `value` per second
  noise,         // plus white noise of `value` rms
  slow,          // first order lag of `value` s
  delayed,       // by `value` s
  intermittent,  // `stuck` for half of each `value` s
  swapped,       // the reading of `other_axis`, `other` stands here
};

struct SensorFault {
  int axis = 0;  // ignored for channels of the board
  Channel channel = Channel::current_a;
  FaultKind kind = FaultKind::off;
  double value = 0;
  double from_s = 0, to_s = 1e300;
  Channel other = Channel::current_a;
  int other_axis = 0;
};

/// The faults of one plant and their memories.
class FaultTable {
 public:
  void add(const SensorFault& fault) { entries_.push_back({fault, {}, 0, 0, false, false}); }
  void clear() { entries_.clear(); }
  bool empty() const { return entries_.empty(); }

  /// The true quantity of a channel as the faulted transducer passes it on (kinds that act before the converter).
  double bend(int axis, Channel channel, double value, double time_s, Random& random);
  /// The converter's counts as they arrive (kinds that act after it). `full_scale` bounds garbage.
  double replace(int axis, Channel channel, double counts, double full_scale, double time_s, Random& random);
  /// The entry that puts another channel's reading in this place, if one is active.
  const SensorFault* swap(int axis, Channel channel, double time_s) const;

 private:
  struct Entry {
    SensorFault fault;
    std::vector<double> past;
    double memory, since_s;
    bool started, holding;
  };
  static bool active(const Entry& entry, int axis, Channel channel, double time_s);
  std::vector<Entry> entries_;
};

}  // namespace host_sim

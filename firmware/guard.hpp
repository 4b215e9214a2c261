// SPDX-License-Identifier: MIT
// Stands at both ends of the fast lane and nowhere in the middle: what comes in must be believable, what goes out must
// be a duty. It finds; the axis decides (a fault found while the bridge is open trips nothing).
//
// One bad sample alone is bridged, the second in a row is a fault; a number that is out of bounds is one at once. No
// NaN passes a comparison. ISR.
#pragma once

#include <cstdint>

#include "firmware/bits.hpp"
#include "firmware/board_rating.hpp"
#include "hal/axis_port.hpp"
#include "thermal/flip_sum.hpp"
#include "wire/codes.hpp"

namespace firmware {

/// A fault with its evidence. `threshold` is the bound that `value` broke.
struct FaultRecord {
  wire::Fault fault = wire::Fault::none;
  std::uint8_t axis = 0;
  float value = 0.0f, threshold = 0.0f;
  float age_s = 0.0f;  // since it tripped
};

enum class Verdict : std::uint8_t { fresh, bridged, refused };

struct Sight {
  Verdict verdict;
  std::uint32_t periods;  // PWM periods since the last fresh sample; 1 in the ordinary case
};

class Guard {
 public:
  static constexpr std::uint32_t misses_to_trip = 2;  // in a row
  static constexpr std::uint32_t longest_gap = 200;   // periods between two samples that are still one walk: 10 ms
  static constexpr float full_turn_rad = 6.2831855f;  // the float above 2 pi: a board may round up to it

  Guard() = default;
  explicit Guard(const BoardRating& rating)
      : trip_A_(rating.trip_A),
        bus_V_(rating.bus_min_V, rating.bus_max_V),
        bus_min_V_(rating.bus_min_V),
        bus_max_V_(rating.bus_max_V),
        period_s_(1.0f / rating.pwm_Hz) {}

  Sight admits(const hal::AxisSample& s) {
    const std::uint32_t periods = s.sequence - sequence_;
    if (s.valid && periods - 1u < gap_ && within(s.current_A.a, trip_A_) && within(s.current_A.b, trip_A_) &&
        within(s.current_A.c, trip_A_) && bus_V_.holds(s.bus_V) && turn_rad.holds(s.rotor_rad)) [[likely]] {
      sequence_ = s.sequence;
      misses_ = 0;
      return {Verdict::fresh, periods};
    }
    return judge(s, periods);
  }

  /// True if the three ratios can be loaded.
  bool passes(const wire::Abc& ratio) {
    if (unit.holds(ratio.a) && unit.holds(ratio.b) && unit.holds(ratio.c)) [[likely]]
      return true;
    const float worst = !unit.holds(ratio.a) ? ratio.a : !unit.holds(ratio.b) ? ratio.b : ratio.c;
    found_ = {wire::Fault::not_finite, 0, worst, 1.0f, 0.0f};
    return false;
  }

  /// What the last refusal was about.
  const FaultRecord& found() const { return found_; }

  void add_built_to(thermal::FlipSum& sum) const { sum.add(trip_A_, bus_V_, bus_min_V_, bus_max_V_, period_s_); }

 private:
  [[gnu::noinline]] Sight judge(const hal::AxisSample& s, std::uint32_t periods);
  Sight refuse(wire::Fault fault, float value, float threshold);

  static constexpr Range turn_rad{0.0f, full_turn_rad}, unit{0.0f, 1.0f};

  float trip_A_ = 0.0f;
  Range bus_V_;
  float bus_min_V_ = 0.0f, bus_max_V_ = 0.0f;
  float period_s_ = 0.0f;
  std::uint32_t sequence_ = 0, misses_ = 0;
  std::uint32_t gap_ = 0;  // longest_gap once a first sample was seen; until then `admits` asks `judge`
  FaultRecord found_;
};

}  // namespace firmware

// SPDX-License-Identifier: MIT
// Moving a motor from the console: arm, send setpoints often enough, and disarm whatever happens.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "console/profile.hpp"
#include "console/session.hpp"

namespace console {

class Console;

/// Before anything is armed: refuses a course whose unit an axis does not take, and names the command that helps.
void need_mode(Console& console, std::uint8_t mask, wire::ControlMode mode);

/// Armed axes. They are disarmed when this ends, also by an exception or Ctrl-C; a board that is gone lets go by itself
/// (its setpoints grow old).
class Armed {
 public:
  Armed(Session& session, std::uint8_t mask);
  ~Armed();
  /// Ends it here, where that it did not work can be told: throws UserError as Session::disarm does.
  void disarm();
  Armed(const Armed&) = delete;
  Armed& operator=(const Armed&) = delete;

 private:
  Session& session_;
  std::uint8_t mask_;
  bool ended_ = false;
};

/// What a drive came to, of one axis.
struct Driven {
  double seconds = 0;
  float peak_A = 0;  // of |i|
  float start_degC = 0, peak_degC = 0, end_degC = 0;
  double held_back_s = 0;  // below what was asked
  std::uint8_t limit = 0;  // what held it back most recently
};

/// Where the current goes: iq turns the shaft; id makes no torque and only heats the winding, and a little iq holds a
/// shaft that creeps all the same, or keeps a free one turning slowly.
enum class Along { q, d };

/// Plays a course on the axes in `mask`, 200 setpoints a second; `look` sees every state. What it came to is told of
/// these axes. Throws UserError: refused
/// when an axis trips or refuses a setpoint (as one that has another control mode does), unusable when a shaft that
/// should turn stands for 10 s, interrupted after Ctrl-C, gone. The caller holds an Armed.
std::array<Driven, wire::axis_count> drive(Session& session, std::uint8_t mask, const std::vector<Piece>& profile,
                                           Along along, const std::function<void(const wire::State&, double)>& look,
                                           float turning_rad_per_s = 0);

/// The sentence of a fault: what happened, evidence, advice. Empty for none.
std::string fault_sentence(const wire::FaultEvidence& evidence);
/// Forgets the faults of these axes, which are off then.
void clear_fault(Session& session, std::uint8_t mask);

}  // namespace console

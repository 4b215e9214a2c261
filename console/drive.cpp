// SPDX-License-Identifier: MIT
#include "console/drive.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "console/console.hpp"

namespace console {
namespace {

constexpr double interval_s = 0.005;  // a twentieth of the time-out of setpoints

// Against creeping: 2 mA per rad/s slows the rotor of a 40 W motor within 0.1 s, far slower than setpoints come, and
// the most it may ask for moves no robot.
constexpr float hold_A_s_per_rad = 0.002f, hold_most_A = 0.2f;
// To turn a free shaft against its friction, whatever that is: within seconds, up to what a motor of 40 W needs idle.
constexpr float turn_A_per_rad = 0.002f, turn_most_A = 0.5f;
constexpr double longest_still_s = 10;  // a free shaft with the inertia of a joint is turning within 3 s

/// The iq of a shaft that is held, or kept turning.
class Hold {
 public:
  explicit Hold(float rad_per_s) : rad_per_s_(rad_per_s) {}
  float current_A() const { return current_A_; }
  void see(float rad_per_s) {
    const float slow = rad_per_s_ - rad_per_s;
    current_A_ = std::clamp(hold_A_s_per_rad * slow, -hold_most_A, hold_most_A);
    if (rad_per_s_ == 0) return;
    against_friction_A_ += turn_A_per_rad * slow * static_cast<float>(interval_s);
    against_friction_A_ = std::clamp(against_friction_A_, 0.0f, turn_most_A);
    current_A_ += against_friction_A_;
  }
  /// False: it has been slower than half of what it should for too long.
  bool turns(float rad_per_s, double time_s) {
    if (std::fabs(rad_per_s) >= 0.5f * rad_per_s_) turned_s_ = time_s;
    return time_s - turned_s_ < longest_still_s;
  }

 private:
  float rad_per_s_, current_A_ = 0, against_friction_A_ = 0;
  double turned_s_ = 0;
};

}  // namespace

Armed::Armed(Session& session, std::uint8_t mask) : session_(session), mask_(mask) {
  interrupted();  // from here on Ctrl-C is noted and no longer kills
  session_.arm(mask_);
}

void Armed::disarm() {
  session_.disarm(mask_);
  ended_ = true;
}

Armed::~Armed() {
  if (ended_) return;
  try {
    session_.disarm(mask_);
  } catch (const UserError&) {
    // The board is gone or deaf: setpoints have ended, so it ramps down and opens the bridge.
  }
}

std::string fault_sentence(const wire::FaultEvidence& evidence) {
  if (evidence.fault == 0) return "";
  const wire::CodeText text = wire::text_of(evidence.fault);
  const std::string unit = text.unit[0] != '\0' ? std::string(" ") + text.unit : "";
  std::string sentence =
      text.happened[0] != '\0' ? text.happened : fmt::format("fault {:#04x}, unknown to this program", evidence.fault);
  if (std::isfinite(evidence.value) && !unit.empty())
    sentence += fmt::format(": {:.4g}{}, the bound is {:.4g}{}", evidence.value, unit, evidence.threshold, unit);
  sentence += fmt::format(", {:.1f} s ago", evidence.age_s);
  if (text.advice[0] != '\0') sentence += fmt::format("; {}", text.advice);
  return sentence;
}

void clear_fault(Session& session, std::uint8_t mask) {
  const wire::State now = session.state();
  // Only a zero setpoint may stand when a fault is cleared.
  session.exchange({mask, {now.axis[0].control, now.axis[1].control}, 0, {0, 0}, {0, 0}});
  session.clear(mask);
}

void need_mode(Console& console, std::uint8_t mask, wire::ControlMode mode) {
  const wire::State state = console.session().state();
  for (int a = 0; a < wire::axis_count; ++a) {
    if ((mask >> a & 1) == 0 || state.axis[a].control == mode) continue;
    const std::string command = fmt::format("mode {} --axis {}", wire::text_of(mode), a);
    throw UserError(Exit::refused,
                    fmt::format("Axis {} is in {} mode and takes no {}; {}.", a, wire::text_of(state.axis[a].control),
                                unit_of(mode),
                                console.options.sim ? "a board of --sim is gone with its process, so say '" + command +
                                                          "' at the prompt of 'hotcore --sim', then this"
                                                    : "say 'hotcore " + command + "' first"));
  }
}

std::array<Driven, wire::axis_count> drive(Session& session, std::uint8_t mask, const std::vector<Piece>& profile,
                                           Along along, const std::function<void(const wire::State&, double)>& look,
                                           float turning_rad_per_s) {
  std::array<Driven, wire::axis_count> all;
  const double start_s = session.now_s();
  double last_s = start_s, end_s = start_s, next_s = start_s;
  bool begun = false;
  std::array<Hold, wire::axis_count> hold = {Hold(turning_rad_per_s), Hold(turning_rad_per_s)};
  for (const Piece& piece : profile) {
    end_s += double{piece.seconds};
    do {  // once at least: what is told is what the board said
      stop_if_interrupted("Stopped and disarmed.");
      const bool torque = along == Along::q;
      const float d_A = torque ? 0 : piece.level, q = torque ? piece.level : 0;
      const wire::State state = session.exchange(
          {mask, {piece.mode, piece.mode}, 0, {d_A, d_A}, {q + hold[0].current_A(), q + hold[1].current_A()}});
      const double now_s = session.now_s();
      for (int a = 0; a < wire::axis_count; ++a) {
        if ((mask >> a & 1) == 0) continue;
        if (state.axis[a].fault != 0) {
          throw UserError(Exit::refused, fmt::format("Axis {} tripped after {:.2f} s: {}.", a, now_s - start_s,
                                                     fault_sentence(session.fault(a))));
        }
        if (!torque) {
          Hold& shaft = hold[static_cast<std::size_t>(a)];
          shaft.see(state.axis[a].speed_rad_per_s);
          if (!shaft.turns(state.axis[a].speed_rad_per_s, now_s - start_s)) {
            refuse_data(fmt::format(
                "The shaft of axis {} does not turn, so its phases warm unequally and its resistance tells no "
                "temperature: free it, or leave out --turning.",
                a));
          }
        }
        if (state.axis[a].refused != 0) {
          const wire::CodeText text = wire::text_of(state.axis[a].refused);
          throw UserError(Exit::refused, fmt::format("Axis {} refused the setpoint {:g} {}: {}; {}.", a, piece.level,
                                                     unit_of(piece.mode), text.happened, text.advice));
        }
      }
      for (std::size_t a = 0; a < all.size(); ++a) {
        const wire::AxisReport& axis = state.axis[a];
        Driven& driven = all[a];
        if (!begun) driven.start_degC = driven.peak_degC = axis.core_degC;
        driven.peak_A = std::max(driven.peak_A, std::hypot(axis.id_A, axis.iq_A));
        driven.peak_degC = std::max(driven.peak_degC, axis.core_degC);
        driven.end_degC = axis.core_degC;
        if (axis.limit == 0) continue;
        driven.held_back_s += now_s - last_s;
        driven.limit = axis.limit;
      }
      begun = true;
      last_s = now_s;
      look(state, now_s - start_s);
      next_s = std::max(next_s + interval_s, now_s);
      session.wait_until(std::min(next_s, end_s));
    } while (session.now_s() < end_s);
  }
  for (Driven& driven : all) driven.seconds = session.now_s() - start_s;
  return all;
}

}  // namespace console

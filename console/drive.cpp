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

}  // namespace

Armed::Armed(Session& session, std::uint8_t mask) : session_(session), mask_(mask) {
  interrupted();  // from here on Ctrl-C is noted and no longer kills
  session_.arm(mask_);
}

Armed::~Armed() {
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
                                           Along along, const std::function<void(const wire::State&, double)>& look) {
  std::array<Driven, wire::axis_count> all;
  const double start_s = session.now_s();
  double last_s = start_s, end_s = start_s, next_s = start_s;
  bool begun = false;
  float hold_A[wire::axis_count]{};
  for (const Piece& piece : profile) {
    end_s += double{piece.seconds};
    do {  // once at least: what is told is what the board said
      stop_if_interrupted("Stopped and disarmed.");
      const bool turning = along == Along::q;
      const float d_A = turning ? 0 : piece.level, q = turning ? piece.level : 0;
      const wire::State state =
          session.exchange({mask, {piece.mode, piece.mode}, 0, {d_A, d_A}, {q + hold_A[0], q + hold_A[1]}});
      const double now_s = session.now_s();
      for (int a = 0; a < wire::axis_count; ++a) {
        if ((mask >> a & 1) == 0) continue;
        if (state.axis[a].fault != 0) {
          throw UserError(Exit::refused, fmt::format("Axis {} tripped after {:.2f} s: {}.", a, now_s - start_s,
                                                     fault_sentence(session.fault(a))));
        }
        if (!turning)
          hold_A[a] = std::clamp(-hold_A_s_per_rad * state.axis[a].speed_rad_per_s, -hold_most_A, hold_most_A);
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

// SPDX-License-Identifier: MIT
// Finds the encoder's angle_offset, without which no current makes the torque it should: a free shaft is pushed in all
// directions and turned once round.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "console/alignment.hpp"
#include "console/commands.hpp"
#include "console/drive.hpp"
#include "console/proposal.hpp"
#include "console/recorder.hpp"

namespace console {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double push_interval_s = 0.002;  // of setpoints; a light shaft gains its speed within a few of them
constexpr double telemetry_Hz = 1000;
constexpr int directions = 12;     // friction bends the answer, evenly spaced ones do not turn by it
constexpr double sure_rad = 0.03;  // one sigma: of the torque a thousandth
constexpr double turn = 1.1;       // of the shaft, to meet the encoder's index for certain
constexpr double longest_turn_s = 30;
constexpr double first_push_s = 0.02, longest_push_s = 0.3, coast_s = 0.05;
constexpr double noise_share = 0.05, runaway = 4;  // of the speed, of the fastest that is wanted
constexpr double learn_s = 0.5;  // more than twice what a board needs to learn its current sensors' offsets
constexpr double least_A = 0.1;  // five counts of the current sensors (boards/h8-15d/board.hpp); less creeps anywhere
constexpr double first_share = 0.05, louder = 1.5;  // of the most that may flow
// Back-EMF of the magnet where it is not believed to be: twice this is less than firmware/watch.hpp lets pass.
constexpr double most_of_bus = 0.01;

struct AlignArguments {
  std::string axis = "0";
  double current_A = 0;
  Consent consent;
};

/// The board's index contradicts its Hall switches, or samples are invalid for another reason.
struct Invalid : UserError {
  using UserError::UserError;
};

/// One axis that is armed and pushed.
class Shaft {
 public:
  Shaft(Session& session, int axis, const Values& values)
      : session_(session), axis_(axis), mask_(static_cast<std::uint8_t>(1 << axis)), armed_(session, mask_) {
    const double flux_Wb = value_of(values, "flux_linkage_Wb"), pole_pairs = value_of(values, "pole_pairs");
    const wire::State state = session.state();
    fastest_rad_per_s_ = most_of_bus * double{state.bus_V} / (flux_Wb * pole_pairs);
    session.subscribe(signals_called({"id_A", "iq_A", "speed_rad_per_s", "rotor_rad"}, session.signals(), axis),
                      static_cast<std::uint16_t>(std::lround(double{session.hello().pwm_Hz} / telemetry_Hz)),
                      [this, time = BoardTime(session.hello().pwm_Hz)](const link::RowsView& view) mutable {
                        for (std::uint32_t r = 0; r < view.head.rows; ++r)
                          seen_.take({time.at(view.head.first_period + r * view.head.decimation), view.value(r, 0),
                                      view.value(r, 1), view.value(r, 2), view.value(r, 3)});
                      });
  }
  ~Shaft() { session_.take_no_more(); }
  void end() {
    armed_.disarm();
    session_.unsubscribe();
  }

  /// Current at so many radians from where the board believes the magnet, for so long or until the shaft is as fast as
  /// it may be: how long that was.
  double push(double current_A, double angle_rad, double seconds) {
    const double start_s = session_.now_s();
    double slowest_rad_per_s = INFINITY;  // a push that slows a fast shaft goes on
    while (session_.now_s() < start_s + seconds) {
      const double speed_rad_per_s = std::fabs(step(current_A, angle_rad));
      if (speed_rad_per_s > std::max(fastest_rad_per_s_, slowest_rad_per_s + noise_share * fastest_rad_per_s_)) break;
      slowest_rad_per_s = std::min(slowest_rad_per_s, speed_rad_per_s);
      session_.wait_until(std::min(session_.now_s() + push_interval_s, start_s + seconds));
    }
    return session_.now_s() - start_s;
  }

  /// Turns once round, back, and stands. False: it does not.
  bool turn_round(double most_A, const Alignment::Found& found) {
    const double forward_rad = pi / 2 - found.ahead_rad;
    const double A_s_per_rad = 0.2 / (found.rad_per_s2_A * push_interval_s);  // slow beside setpoints
    double speed_rad_per_s = 0, friction_A = 0;
    for (const double towards : {1.0, -1.0, 0.0}) {
      const double wish_rad_per_s = 0.5 * towards * fastest_rad_per_s_, start_s = session_.now_s();
      double turned_rad = 0, last_s = start_s;
      const auto there = [&] {
        return towards == 0 ? std::fabs(speed_rad_per_s) < 0.05 * fastest_rad_per_s_
                            : towards * turned_rad > turn * 2 * pi;
      };
      while (!there()) {
        const double slow_rad_per_s = wish_rad_per_s - speed_rad_per_s;
        friction_A = std::clamp(friction_A + 0.05 * A_s_per_rad * slow_rad_per_s, -most_A, most_A);
        speed_rad_per_s = step(std::clamp(A_s_per_rad * slow_rad_per_s + friction_A, -most_A, most_A), forward_rad);
        session_.wait_until(session_.now_s() + push_interval_s);
        turned_rad += speed_rad_per_s * (session_.now_s() - last_s);
        last_s = session_.now_s();
        if (last_s - start_s > longest_turn_s) return false;
      }
    }
    return true;
  }

  /// Pushes in all directions, to and fro so that the shaft comes back, and forgets what was seen before.
  void push_around(double current_A, double seconds) {
    seen_ = {};
    for (int i = 0; i < directions; ++i) {
      const double angle_rad = 2 * pi * i / directions;
      const double pushed_s = push(current_A, angle_rad, seconds);
      const double back_s = push(-current_A, angle_rad, 2 * pushed_s);
      push(current_A, angle_rad, back_s - pushed_s);
      push(0, 0, coast_s);
    }
  }

  const Alignment& seen() const { return seen_; }

 private:
  /// One setpoint; the speed.
  double step(double current_A, double angle_rad) {
    stop_if_interrupted("Stopped and disarmed; nothing was written.");
    const auto d_A = static_cast<float>(current_A * std::cos(angle_rad)),
               q_A = static_cast<float>(current_A * std::sin(angle_rad));
    const wire::State state = session_.exchange({mask_, {}, 0, {d_A, d_A}, {q_A, q_A}});
    const wire::AxisReport& axis = state.axis[axis_];
    if (axis.fault == 0 && std::fabs(double{axis.speed_rad_per_s}) > runaway * fastest_rad_per_s_)
      refuse_data(
          fmt::format("The shaft of axis {} went on to {:.0f} rad/s, so it was let go: does something drive it? Stop "
                      "it and align again.",
                      axis_, axis.speed_rad_per_s));
    if (axis.fault == 0) return axis.speed_rad_per_s;
    const std::string tripped = fmt::format("Axis {} tripped: {}.", axis_, fault_sentence(session_.fault(axis_)));
    if (static_cast<wire::Fault>(axis.fault) == wire::Fault::invalid_sample) throw Invalid(Exit::refused, tripped);
    throw UserError(Exit::refused, tripped);
  }

  Session& session_;
  int axis_;
  std::uint8_t mask_;
  Armed armed_;
  double fastest_rad_per_s_ = 0;
  Alignment seen_;
};

/// Why the shaft answered as it did, if not because the magnet lies elsewhere.
void need_turns(const Alignment& seen, int axis, int pole_pairs) {
  const int turns = seen.turns(pole_pairs);
  if (turns == pole_pairs) return;
  const std::string count =
      fmt::format("the magnet makes {} electrical turns in one of the shaft, and axis{}.pole_pairs is {}; set it",
                  std::abs(turns), axis, pole_pairs);
  refuse_data(turns > 0
                  ? fmt::format("Axis {}: {}, then align again.", axis, count)
                  : fmt::format("Axis {}: the encoder counts against the phases; swap two of the motor's leads{}, "
                                "then align again.",
                                axis, turns == -pole_pairs ? "" : ". And " + count));
}

struct Aligned {
  Alignment::Found found;
  double current_A;
};

Aligned align_shaft(Console& console, int axis, const Values& values, double most_A) {
  Shaft shaft(console.session(), axis, values);
  const int pole_pairs = static_cast<int>(value_of(values, "pole_pairs"));
  double current_A = std::min(std::max(least_A, first_share * most_A), most_A), seconds = first_push_s;
  const auto push_until_sure = [&] {
    for (;;) {
      console.tell(
          fmt::format("  pushing with {:.2g} A for {:.0f} ms, {} ways", current_A, 1000 * seconds, directions));
      shaft.push_around(current_A, seconds);
      if (shaft.seen().found().sigma_rad < sure_rad) return;
      need_turns(shaft.seen(), axis, pole_pairs);
      if (current_A < most_A)
        current_A = std::min(louder * current_A, most_A);
      else if (seconds < longest_push_s)
        seconds *= 2;
      else
        refuse_data(fmt::format(
            "The shaft of axis {} does not answer {:.2g} A: is it free, is the motor connected, does the encoder count "
            "('hotcore watch')? More current: --current.",
            axis, most_A));
    }
  };
  push_until_sure();
  console.tell("  turning once round and back");
  if (!shaft.turn_round(most_A, shaft.seen().found())) {
    need_turns(shaft.seen(), axis, pole_pairs);
    refuse_data(fmt::format("The shaft of axis {} did not turn once round; free it.", axis));
  }
  push_until_sure();  // by the index, which the encoder has met by now
  shaft.end();
  return {shaft.seen().found(), current_A};
}

/// An offset that is tried: with the end of this, the one before is in force again.
class Trial {
 public:
  Trial(Session& session, int axis, float before_rad)
      : session_(session),
        offset_(session.parameters().named(fmt::format("axis{}.angle_offset_rad", axis)).front()),
        before_rad_(before_rad),
        in_force_rad_(before_rad) {}
  ~Trial() {
    try {
      put(before_rad_);
    } catch (const UserError&) {
      // The board is gone; it starts with what was saved.
    }
  }
  Trial(const Trial&) = delete;
  Trial& operator=(const Trial&) = delete;
  void put(float offset_rad) {
    if (offset_rad != in_force_rad_) session_.set({{offset_, offset_rad}});
    in_force_rad_ = offset_rad;
  }

 private:
  Session& session_;
  Target offset_;
  float before_rad_, in_force_rad_;
};

double within_a_turn(double rad) { return std::remainder(rad, 2 * pi); }

void align(Console& console, const AlignArguments& a) {
  Session& session = console.session();
  const int axis = a.axis == "1" ? 1 : 0;
  const auto mask = static_cast<std::uint8_t>(1 << axis);
  need_mode(console, mask, wire::ControlMode::current);
  const Values before = values_of(session, axis);
  const double most_A =
      std::min(a.current_A > 0 ? a.current_A : continuous_A(before), value_of(before, "current_limit_A"));
  console.tell(fmt::format(
      "Axis {} is pushed with up to {:.2g} A; its shaft must be free to turn round. Ctrl-C disarms.", axis, most_A));
  Aligned aligned;
  double offset_rad = value_of(before, "angle_offset_rad");
  {
    Trial trial(session, axis, static_cast<float>(offset_rad));
    // A board that has not met its encoder's index goes by its Hall switches; an index that contradicts them by more
    // than a sector it takes for a fault. Of four quarters one is close enough.
    for (int quarter = 0;; ++quarter) {
      try {
        aligned = align_shaft(console, axis, before, most_A);
        break;
      } catch (const UserError& error) {
        // Standing on the index it is not even armed.
        const bool refused = quarter > 0 && error.exit_code() == static_cast<int>(Exit::refused);
        if (quarter == 3 || !(refused || dynamic_cast<const Invalid*>(&error) != nullptr)) throw;
      }
      offset_rad = within_a_turn(offset_rad + pi / 2);
      trial.put(static_cast<float>(offset_rad));
      clear_fault(session, mask);
      session.wait_until(session.now_s() + learn_s);
    }
  }
  const Values proposed = {
      {"angle_offset_rad", static_cast<float>(within_a_turn(offset_rad + aligned.found.ahead_rad))}};
  const std::string found = fmt::format("Found to +-{:.2f} rad, electrical, two sigma:\n", 2 * aligned.found.sigma_rad);
  if (!console.options.json) put(found);
  Outcome outcome = put_in_force(console, axis, before, proposed, "align found ", a.consent);
  outcome.json["sigma_rad"] = aligned.found.sigma_rad;
  outcome.json["current_A"] = aligned.current_A;
  console.say(outcome.text, outcome.json);
}

}  // namespace

void add_align(CLI::App& app, Console& console) {
  auto a = std::make_shared<AlignArguments>();
  CLI::App* command = app.add_subcommand("align", "find angle_offset: a free shaft is pushed and turned once round");
  command->add_option("--axis", a->axis, "0 or 1")->capture_default_str()->check(CLI::IsMember({"0", "1"}));
  command->add_option("--current", a->current_A, "the most that may flow, A; else the continuous current")
      ->check(between(least_A, 1000));
  add_consent(*command, a->consent);
  command->callback([&console, a] { align(console, *a); });
}

}  // namespace console

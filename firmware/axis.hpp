// SPDX-License-Identifier: MIT
// THE walk of one axis, in two lanes.
//
//   tick       every PWM period   sample -> rotor frame -> permitted current -> voltage -> duty
//                                    |                        ^
//                                 A^2 s by phase           amperes
//                                    v                        |
//   slow_tick  every 10 ms        heat network -> core temperature (+ uncertainty) -> allowance
//
// Two hand-overs (heat_, allowance_) and no third; `watch`, every millisecond, only looks, and posts a trip. Two axes
// are two objects. `tick` is for the control interrupt and alone writes the mode; everything else is for one lower
// context (commands are posted, the next tick obeys). Knows no board, no clock, no host. Each step stands in the file
// of its name.
#pragma once

#include <atomic>
#include <cstdint>

#include "firmware/axis_parameters.hpp"
#include "firmware/board_rating.hpp"
#include "firmware/current_loop.hpp"
#include "firmware/dead_time.hpp"
#include "firmware/guard.hpp"
#include "firmware/heat_sums.hpp"
#include "firmware/mode.hpp"
#include "firmware/modulation.hpp"
#include "firmware/offsets.hpp"
#include "firmware/permit.hpp"
#include "firmware/rotor.hpp"
#include "firmware/setpoint.hpp"
#include "firmware/signals.hpp"
#include "firmware/watch.hpp"
#include "hal/axis_port.hpp"
#include "hal/board_port.hpp"
#include "thermal/core_estimator.hpp"
#include "thermal/governor.hpp"
#include "thermal/look_ahead.hpp"
#include "thermal/losses.hpp"
#include "wire/codes.hpp"
#include "wire/protocol.hpp"

namespace firmware {

/// One axis as it is set up: what it drives and how hot that may get.
struct AxisSetup {
  AxisParameters parameters;
  thermal::HeatSet<double> heat;
  thermal::EstimatorSettings estimator{};
  bool senses_housing = true;  // false: model alone. true and no reading: at most 60 % of the continuous current
};

/// What must survive a reset.
struct AxisMemory {
  thermal::HeatMemory heat;
  FaultRecord fault;
};

/// What the last fast tick saw and did: for telemetry and the slow lane.
struct FastView {
  Dq current_A;    // measured
  Dq permitted_A;  // the reference of the current loop
  Dq voltage_V;    // that reached the bridge, before dead-time compensation
  Abc ratio;
  float bus_V;
  float rad_per_s;  // mechanical
  float rotor_rad;  // mechanical, [0, 2 pi]
  wire::Limit limit;
};

/// Everything about an axis, once per slow tick.
struct AxisState {
  Mode mode = Mode::off;
  FastView fast{};
  float core_degC[3]{};         // estimated, of the first three nodes with a limit: the phase windings
  float core_sigma_K = 0.0f;    // of the hottest, with what is doubted: core + k sigma is what is limited
  float housing_degC = 0.0f;    // estimated
  thermal::Unseen unseen{};     // of the last 10 ms: what their samples did not show
  float heating_A = 0.0f;       // direct, through two terminals: heats as the phases did, ripple included
  float allowance_A = 0.0f;     // amplitude, the smallest of core, board and what blindness leaves
  float time_left_s = 0.0f;     // that what flows may go on until the core's limit; +infinity beyond half a minute
  float allowance_1s_A = 0.0f;  // amplitude that the core bears for the next second; both 0 where old, or unset
  wire::Limit limit = wire::Limit::none;  // what holds the output back, exactly one
  std::uint32_t estimate_flags = 0;       // thermal::EstimateFlag
  FaultRecord fault;
};

/// The governor's settings on this board.
thermal::GovernorSettings governor_settings(const BoardRating& rating);

/// What another set makes of the heat model.
enum class HeatModel : std::uint8_t { unchanged, changed };

class Axis {
 public:
  Axis(std::uint8_t index, const AxisSetup& setup, const BoardRating& rating);
  Axis(const Axis&) = delete;
  Axis& operator=(const Axis&) = delete;

  /// Another set for a disarmed axis; the fast lane takes it over at its next tick. With the heat model it had, the
  /// estimate goes on as it was. With another one the temperatures stay, but no winding is below the ambient believed:
  /// what the old model had learned of its surroundings proves nothing about the new one; what was found out about the
  /// housing sensor does. A set without a model leaves the estimate to the old one.
  void configure(const AxisSetup& setup, HeatModel heat);
  /// Off or tripped, and nothing posted that could change that.
  bool at_rest() const;

  /// What must survive a reset, as of the last slow tick.
  AxisMemory memory() const { return {core_.save(), behind_.fault != wire::Fault::none ? behind_ : fault()}; }
  /// Before the control interrupt runs. Time in reset is unknown: nothing has cooled. A fault stays latched.
  void restore(const AxisMemory& memory);
  /// The same without a memory: hot until something proves otherwise.
  void start_hot() { core_.start_hot(); }
  /// Before the control interrupt runs: stays tripped, for this reason.
  void hold(const FaultRecord& why) {
    if (mode_ != Mode::tripped) (void)trip(why);
  }

  /// Control interrupt, every PWM period, also while off: the duty for the next period.
  [[nodiscard]] hal::Duty tick(const hal::AxisSample& sample) noexcept;

  /// Every 10 ms, from one context below the control interrupt. `board`: what the shared power stage leaves this axis.
  /// `neighbour_degC`: how warm the other axis' housing may be.
  void slow_tick(const hal::AxisSlowSample& sample, const Allowance& board, float neighbour_degC);
  /// Every millisecond, from the same context: what no single sample shows, of faults and of heat. Not twice on one
  /// sample.
  void watch();

  /// Current command, amperes of phase amplitude (id, iq); keeps the axis alive for setpoint_timeout_s. Wakes an armed
  /// axis. Refused in another control mode.
  wire::Status set_current(const Dq& current_A) {
    return control_ == wire::ControlMode::current ? setpoint_.set(current_A) : wire::Status::other_mode;
  }
  /// The same in torque mode. Becomes a current here and nowhere else; every limit is one of current and comes after.
  wire::Status set_torque(float id_A, float torque_Nm) {
    return control_ == wire::ControlMode::torque ? setpoint_.set({id_A, torque_Nm * A_per_Nm_})
                                                 : wire::Status::other_mode;
  }

  /// What setpoints mean from now on. Only at rest, and torque only with a complete set.
  wire::Status choose(wire::ControlMode mode) {
    const wire::Status answer = against(mode);
    if (answer == wire::Status::done) {
      const bool whole = built_as_it_was();  // or what has flipped would pass for chosen
      control_ = mode;
      if (whole) built_ = built_sum();
    }
    return answer;
  }
  wire::Status against(wire::ControlMode mode) const;
  wire::ControlMode control() const { return control_; }

  /// off -> ready. Only setpoints that come later count. The answer says what speaks against it; done = posted.
  wire::Status arm();
  /// What speaks against arming now.
  wire::Status against_arming() const;
  /// Any mode but tripped -> off: bridge open at the next tick. Takes back an `arm` that was not obeyed yet.
  void disarm() {
    commands_.fetch_and(static_cast<std::uint8_t>(~static_cast<unsigned>(Command::arm)));
    post(Command::disarm);
  }
  /// tripped -> off, if the last setpoint is zero.
  wire::Status clear();

  /// Live: as of the last tick.
  Mode mode() const { return mode_; }
  bool sees() const { return sees_; }  // the last sample was admitted
  FastView fast() const;
  FaultRecord fault() const;
  /// Where a signal of axis.signals lies; empty if there is no such id.
  SignalPlace signal(std::uint8_t id) const;
  bool offset_known() const { return offsets_.known(); }
  /// Its parameters are complete and valid.
  bool configured() const { return configured_; }
  const Abc& current_offset_A() const { return offsets_.offset_A(); }

  /// Every 4 ms: a step of how long the load may go on. Changes nothing but what is said.
  void look_ahead();

  /// A question about this axis, as ProfileRun::begin. What samples do not show of the heat now goes on as it is; of an
  /// axis at rest nobody knows it.
  bool ask(thermal::ProfileRun& run, const thermal::Piece* pieces, int count,
           const thermal::PhaseShares& shares) const {
    return run.begin(core_, pieces, count, shares, state_.unseen.of_heat_A2);
  }

  /// As of the last slow tick.
  const AxisState& state() const { return state_; }
  const thermal::CoreEstimator& core() const { return core_; }
  /// Mean of |i|^2 over the steps of 10 ms that the last slow tick stood for, ripple included: what heats the power
  /// stage; how many they are.
  double current2_A2() const { return input_[thermal::Drive::current_A2] * static_cast<double>(charge_); }
  int elapsed_steps() const { return steps_; }

 private:
  friend struct AxisProbe;  // tests damage what no sample can reach

  // Two bits for `arm`: one that flips must not arm.
  enum class Command : std::uint8_t { arm = 1 + 64, disarm = 2, clear = 4, configure = 8, trip = 16, rest = 32 };

  void post(Command command) { commands_.fetch_or(static_cast<std::uint8_t>(command)); }
  void judge(const AxisSetup& setup);
  void take_over();
  std::uint32_t fixed_sum() const;
  std::uint32_t built_sum() const;
  bool built_as_it_was() const;
  void doubt(const FaultRecord& why);
  [[gnu::noinline]] void obey();
  [[gnu::noinline]] hal::Duty unseen(const hal::AxisSample& sample, Verdict verdict);
  [[gnu::noinline]] hal::Duty resting(const hal::AxisSample& sample, Dq current_A, std::uint32_t periods);
  [[gnu::noinline]] hal::Duty trip(const FaultRecord& found);
  void cleared();
  std::uint32_t add_heat(const Abc& phase_A, std::uint32_t periods);
  [[gnu::noinline]] HeatSums& add_missed(std::uint32_t missed);
  void add_contradicted(float (&phase_A2)[3]) const;
  thermal::HeatInput<> heat_input(const HeatSums& sums);
  void fill_currents(thermal::HeatInput<>& input, const HeatSums& sums) const;
  void surround(float neighbour_degC);
  thermal::HeatInput<> charged(thermal::HeatInput<> input) const;
  thermal::Unseen unseen_now() const;
  thermal::Unseen take_unseen();
  float warm_ohm() const;
  Allowance permitted_by(const thermal::Allowance& core, const Allowance& board);
  void publish();
  void change(Event event);
  void set(Mode mode) {
    mode_ = mode;
    mode_turned_ = turned(mode);
  }
  static constexpr std::uint8_t turned(Mode mode) { return static_cast<std::uint8_t>(~static_cast<unsigned>(mode)); }

  // The two hand-overs between the lanes.
  HeatHandOver heat_;
  Allowance allowance_{0.0f, wire::Limit::thermal_late};

  std::atomic<std::uint8_t> commands_{0};  // posted, for the next tick
  BoardRating rating_;
  // What `configure` brought, until the fast lane has taken it over.
  enum class SetState : std::uint8_t { incomplete, refused, good };
  AxisParameters next_;
  SetState next_state_ = SetState::incomplete;
  Finding finding_{};

  // Fast lane, in the order of the walk.
  Guard guard_;
  Offsets offsets_;
  Rotor rotor_;
  Setpoint setpoint_;
  Permit permit_;
  CurrentLoop current_loop_;
  DeadTime dead_time_;
  float usable_ratio_ = 1.0f;  // 1 - sampling window
  hal::Duty last_{{0.5f, 0.5f, 0.5f}, false};
  /// Written by each tick; the law does not read it back, but for the current that missed samples are charged with.
  struct Trace {
    Dq current_A{}, permitted_A{}, asked_V{};
    Abc phase_A{};
    float share = 1.0f, bus_V = 0.0f, rotor_rad = 0.0f;
    Abc ended{0.5f, 0.5f, 0.5f}, loaded{0.5f, 0.5f, 0.5f};  // ratios of the period that the sample ends, and begins
    wire::Limit limit = wire::Limit::none;

    void note_sample(const Abc& phase, float rotor, const Abc& loading) {
      phase_A.a = phase.a, phase_A.b = phase.b, phase_A.c = phase.c;
      rotor_rad = rotor;
      ended.a = loaded.a, ended.b = loaded.b, ended.c = loaded.c;
      loaded.a = loading.a, loaded.b = loading.b, loaded.c = loading.c;
    }
    void note(Dq current, Dq permitted, Dq asked, float given, float bus, wire::Limit why) {
      // By component: the compiler copies a whole Dq by way of the stack.
      current_A.d = current.d, current_A.q = current.q;
      permitted_A.d = permitted.d, permitted_A.q = permitted.q;
      asked_V.d = asked.d, asked_V.q = asked.q;
      share = given, bus_V = bus, limit = why;
    }
  } trace_;
  Mode mode_ = Mode::off;
  std::uint8_t mode_turned_ = turned(Mode::off);  // a bit of either that flips would arm an axis, or clear a fault
  wire::ControlMode control_ = wire::ControlMode::current;  // of the lower context; the fast lane knows current only
  float A_per_Nm_ = unset;
  bool configured_ = false;             // the parameter set is complete and valid
  bool sees_ = false;
  float quiet_rad_per_s_per_V_ = 0.0f;  // below it the back-EMF cannot push current through the diodes
  float offset_bound_A_ = 0.0f;

  // Slow lane, in the order of the walk.
  thermal::CoreEstimator core_;
  thermal::Governor governor_;
  thermal::Endurance endurance_;
  int endurance_age_steps_ = 0;  // since it last answered
  thermal::Unseen looked_{};     // sum over `looks_`, since the last slow tick
  int looks_ = 0;
  thermal::SpeedLooks speeds_;  // since the last slow tick
  thermal::Unseen unseen_{};
  thermal::HeatInput<> input_{};  // of the last slow tick: stands in for one without samples
  float owed_steps_ = 0.0f;       // time that is not yet a whole one
  int steps_ = 1;                 // that the last slow tick stood for
  float charge_ = 1.0f;           // time that really came, of these
  float phase_ohm_ = 0.0f, copper_per_K_ = 0.0f, flux_Wb_ = 0.0f, inductance_H_ = 1.0f, pwm_Hz_ = 0.0f;
  float peak_A_, blind_A_;  // what a missing housing reading leaves in the end,
  float blind_cap_A_;       // and what it leaves now
  bool senses_housing_;
  Watch watch_;
  FaultRecord doubted_;              // why `trip` was posted
  std::uint32_t fixed_, built_ = 0;  // sums of what is as the constructor, or the last set and choice, left it

  // Outward.
  std::uint32_t tripped_periods_ = 0;
  float period_s_ = 0.0f;
  FaultRecord fault_, behind_;  // the latter latched before a start that found another
  float housing_measured_degC_ = unset;
  AxisState state_;
  std::uint8_t index_;
};

}  // namespace firmware

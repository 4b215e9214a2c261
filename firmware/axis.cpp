// SPDX-License-Identifier: MIT
#include "firmware/axis.hpp"

#include <cmath>
#include <limits>
#include <new>
#include <utility>

#include "thermal/validate.hpp"

namespace firmware {

namespace {
constexpr hal::Duty released{{0.5f, 0.5f, 0.5f}, false};
constexpr std::uint32_t forever = 0xFFFF'FFFFu;
constexpr float blind_share = 0.6f;    // of the continuous current, while no housing reading comes
constexpr float blind_slope = 0.02f;   // of the peak per slow tick: as gentle as the governor
constexpr float nothing_degC = 1e30f;  // above any limit
constexpr float slow_Hz = 100.0f;
// Later no lane comes whose board has a watchdog: the count has flipped, and what it is shared by would seem to cool.
constexpr int late_steps = 3;
constexpr int most_endurance_age_steps = 300;  // an answer takes 160 to 180; while an `ask` is worked off there is none
constexpr float most_owed_steps = 1e6f;        // beyond any lateness, and a whole number
// Of three sensors: four times their noise, and gains apart by some percent. Half an ampere of offset is more heat by a
// tenth where a small winding is held at its limit.
constexpr float contradiction_A = 0.2f, contradiction_share = 0.03f;
constexpr float towards_hot = 1.005f;  // mostly, what samples do not show is known to half a percent (losses_test)

bool usable(const thermal::HeatSet<double>& set) { return thermal::validate(set, thermal::estimator_dt_s).ok(); }

/// A set that is refused must not even be looked at: the estimator gets a node that is nothing but ambient.
thermal::HeatSet<double> usable_or_nothing(const thermal::HeatSet<double>& set) {
  if (usable(set)) return set;
  thermal::HeatSet<double> nothing{};
  nothing.node_count = nothing.link_count = 1;
  nothing.nodes[0] = {1.0, nothing_degC};
  nothing.links[0] = {0, thermal::boundary_end(thermal::Boundary::ambient), thermal::LinkLaw::constant, 1.0, 0.0};
  return nothing;
}
}  // namespace

thermal::GovernorSettings governor_settings(const BoardRating& rating) {
  thermal::GovernorSettings settings;
  settings.max_A = rating.peak_A;
  return settings;
}

Axis::Axis(std::uint8_t index, const AxisSetup& setup, const BoardRating& rating)
    : rating_(rating),
      core_(usable_or_nothing(setup.heat), setup.estimator),
      governor_(governor_settings(rating)),
      endurance_(core_.network(), rating.peak_A),
      peak_A_(rating.peak_A),
      blind_A_(blind_share * rating.continuous_A),
      blind_cap_A_(rating.peak_A),
      senses_housing_(setup.senses_housing),
      index_(index) {
  judge(setup);
  take_over();
  fixed_ = fixed_sum();
  built_ = built_sum();
}

void Axis::configure(const AxisSetup& setup, HeatModel heat) {
  if (heat == HeatModel::changed && usable(setup.heat)) {  // without a model the old one goes on: it knows what is hot
    core_.replace(setup.heat, setup.estimator);
    new (&endurance_) thermal::Endurance(core_.network(), peak_A_);  // in place: too large for the stack
    senses_housing_ = setup.senses_housing;
  }
  allowance_ = {0.0f, wire::Limit::thermal_late};
  judge(setup);
  post(Command::configure);
}

bool Axis::at_rest() const { return commands_.load() == 0 && (mode_ == Mode::off || mode_ == Mode::tripped); }

void Axis::restore(const AxisMemory& memory) {
  core_.restore(memory.heat, -1.0);
  const wire::Fault fault = memory.fault.fault;
  const bool judged_anew = fault == wire::Fault::parameters || fault == wire::Fault::clock_lost;
  if (fault == wire::Fault::none || judged_anew) return;
  if (mode_ == Mode::tripped)
    behind_ = memory.fault;
  else
    hold(memory.fault);
}

/// A board or a heat set that cannot be is refused with id 0; a heat set without nodes is one that was never given.
void Axis::judge(const AxisSetup& setup) {
  next_ = setup.parameters;
  copper_per_K_ = setup.heat.source_count > 0 ? static_cast<float>(setup.heat.sources[0].coefficient_per_K) : 0.0f;
  finding_ = validate(setup.parameters, rating_);
  const bool no_heat = setup.heat.node_count == 0;
  const bool cannot_be = !plausible(rating_) || !(no_heat || usable(setup.heat));
  if (cannot_be || (finding_.id != 0 && !finding_.missing))
    next_state_ = SetState::refused;
  else
    next_state_ = no_heat || finding_.missing ? SetState::incomplete : SetState::good;
}

void Axis::take_over() {
  const AxisParameters& p = next_;
  configured_ = next_state_ == SetState::good;
  A_per_Nm_ = unset;
  if (!configured_) {
    permit_ = {};
    if (next_state_ == SetState::refused)
      trip({wire::Fault::parameters, index_, finding_.value, static_cast<float>(finding_.id), 0.0f});
    return;
  }
  guard_ = Guard(rating_);
  rotor_ = Rotor(p, rating_, rotor_);
  setpoint_.configure(p, rating_);
  permit_ = Permit(p, rating_);
  current_loop_ = CurrentLoop(p, rating_);
  usable_ratio_ = std::fmin(1.0f - rating_.sampling_window_s * rating_.pwm_Hz, full_bus);
  dead_time_ = DeadTime(rating_.dead_time_s, rating_.pwm_Hz, p.dead_time_soft_A);
  // Line-to-line back-EMF below half the bus: no diode conducts, whatever the ripple.
  quiet_rad_per_s_per_V_ = 0.5f / (1.7320508f * p.flux_linkage_Wb * p.pole_pairs_count);
  A_per_Nm_ = 1.0f / (1.5f * p.pole_pairs_count * p.flux_linkage_Wb);
  offset_bound_A_ = p.offset_bound_A;
  inductance_H_ = 0.5f * (p.inductance_d_H + p.inductance_q_H);
  phase_ohm_ = p.phase_resistance_ohm;
  flux_Wb_ = p.flux_linkage_Wb;
  pwm_Hz_ = rating_.pwm_Hz;
  period_s_ = 1.0f / rating_.pwm_Hz;
  if (fault_.fault == wire::Fault::parameters) cleared();
}

/// What nobody may write after the constructor.
std::uint32_t Axis::fixed_sum() const {
  return thermal::FlipSum().add(rating_, governor_.settings(), peak_A_, blind_A_, index_).word();
}

/// What another set brings, and how setpoints are understood.
std::uint32_t Axis::built_sum() const {
  thermal::FlipSum sum;
  guard_.add_built_to(sum);
  rotor_.add_built_to(sum);
  setpoint_.add_built_to(sum);
  permit_.add_built_to(sum);
  current_loop_.add_built_to(sum);
  return sum
      .add(next_, next_state_, dead_time_, usable_ratio_, A_per_Nm_, configured_, quiet_rad_per_s_per_V_,
           offset_bound_A_, control_, phase_ohm_, copper_per_K_, flux_Wb_, inductance_H_, pwm_Hz_, senses_housing_,
           period_s_)
      .word();
}

/// What `configure` brought is another set until the fast lane has taken it over.
bool Axis::built_as_it_was() const {
  const bool waits = (commands_.load() & static_cast<unsigned>(Command::configure)) != 0;
  return fixed_sum() == fixed_ && (waits || built_sum() == built_);
}

// ---- fast lane ------------------------------------------------------------------------------------------------------

hal::Duty Axis::tick(const hal::AxisSample& sample) noexcept {
  if (commands_.load(std::memory_order_relaxed) != 0) obey();
  const Sight sight = guard_.admits(sample);
  if (sight.verdict != Verdict::fresh) return unseen(sample, sight.verdict);

  const Abc phase_A = offsets_.correct(sample.current_A);
  const RotorAngle rotor = rotor_.follow(sample.rotor_rad, sight.periods);
  const Dq current_A = park(clarke(phase_A), sin_cos(rotor.at_sample));
  const std::uint32_t age_periods = add_heat(phase_A, sight.periods);
  trace_.note_sample(phase_A, sample.rotor_rad, last_.ratio);

  setpoint_.follow(sight.periods);
  if (mode_ != Mode::running || !(setpoint_.share() > 0.0f)) return resting(sample, current_A, sight.periods);

  const Permitted permitted = permit_.permit(setpoint_, allowance_, age_periods, sample.bus_V, rotor_.rad_per_s());
  const Dq error_A = {permitted.current_A.d - current_A.d, permitted.current_A.q - current_A.q};
  const Dq asked_V = current_loop_.ask(error_A, current_A, rotor_.electrical_rad_per_s());

  const SinCos ahead = sin_cos(rotor.at_output);
  const Abc phase_V = dead_time_.compensate(inverse_clarke(unpark(asked_V, ahead)),
                                            inverse_clarke(unpark(permitted.current_A, ahead)), sample.bus_V);
  const Modulated pulses = modulate(phase_V, sample.bus_V, usable_ratio_);
  current_loop_.settle(error_A, asked_V, pulses.share);
  if (!guard_.passes(pulses.ratio)) return trip(guard_.found());

  trace_.note(current_A, permitted.current_A, asked_V, pulses.share, sample.bus_V, permitted.reason);
  last_.ratio = pulses.ratio;
  last_.on = true;
  return last_;
}

/// Adds what one sample says; the periods that were missed before it are charged first, hotter. Returns how many there
/// are now.
inline std::uint32_t Axis::add_heat(const Abc& phase_A, std::uint32_t periods) {
  HeatSums& sums = periods != 1 ? add_missed(periods - 1) : heat_.adding();
  sums.phase_A2.a += phase_A.a * phase_A.a;
  sums.phase_A2.b += phase_A.b * phase_A.b;
  sums.phase_A2.c += phase_A.c * phase_A.c;
  return sums.periods += 1;
}

/// A tenth above the last current, and at its peak in every phase: nobody saw where the rotor went.
HeatSums& Axis::add_missed(std::uint32_t missed) {
  HeatSums& sums = heat_.adding();
  const float times = static_cast<float>(missed);
  const Dq i = trace_.current_A;
  const float hot_A2 = 1.21f * times * (i.d * i.d + i.q * i.q);
  sums.phase_A2.a += hot_A2;
  sums.phase_A2.b += hot_A2;
  sums.phase_A2.c += hot_A2;
  sums.periods += missed;
  return sums;
}

/// No sample to work with: one period goes on as it was, the second trips if the bridge could be on. Current may flow
/// through the diodes all the same: what can be read of it heats, and of what cannot the last, hotter.
hal::Duty Axis::unseen(const hal::AxisSample& sample, Verdict verdict) {
  sees_ = false;
  if (verdict == Verdict::refused) {
    const Abc phase_A = offsets_.correct(sample.current_A);
    if (std::isfinite(phase_A.a) && std::isfinite(phase_A.b) && std::isfinite(phase_A.c))
      (void)add_heat(phase_A, 1);
    else
      (void)add_missed(1);
  }
  offsets_.restart();
  if (tripped_periods_ != forever) ++tripped_periods_;
  if (verdict == Verdict::bridged && guard_.passes(last_.ratio)) {
    last_.on = last_.on && mode_ == Mode::running;  // a command may just have ended that
    return last_;
  }
  if (mode_ == Mode::ready || mode_ == Mode::running) return trip(guard_.found());
  return last_ = released;
}

/// A good sample with nothing to drive: follows the modes, learns the offset while off.
hal::Duty Axis::resting(const hal::AxisSample& sample, Dq current_A, std::uint32_t periods) {
  sees_ = true;
  trace_.note(current_A, {0.0f, 0.0f}, {0.0f, 0.0f}, 1.0f, sample.bus_V, wire::Limit::none);
  last_ = released;
  if (mode_ == Mode::running) {
    change(Event::stop);
    trace_.limit = wire::Limit::setpoint_old;
  } else if (mode_ == Mode::ready && setpoint_.share() > 0.0f && allowance_.current_A > 0.0f) {
    change(Event::start);
    current_loop_.reset();
  } else if (mode_ == Mode::off && std::fabs(rotor_.rad_per_s()) < quiet_rad_per_s_per_V_ * sample.bus_V) {
    const float offset_A = offsets_.learn(sample.current_A);
    if (offset_A > offset_bound_A_) {
      offsets_.forget();
      return trip({wire::Fault::current_offset, index_, offset_A, offset_bound_A_, 0.0f});
    }
  } else {
    offsets_.restart();
  }
  if (mode_ == Mode::ready && setpoint_.share() > 0.0f) trace_.limit = allowance_.reason;
  if (mode_ == Mode::tripped && tripped_periods_ < forever - periods) tripped_periods_ += periods;
  return last_;
}

/// Never from tripped: the first fault keeps its evidence.
hal::Duty Axis::trip(const FaultRecord& found) {
  fault_ = found;
  fault_.axis = index_;
  tripped_periods_ = 0;
  set(Mode::tripped);
  return last_ = released;
}

/// From a mode that has flipped there is no way but this.
void Axis::change(Event event) {
  if (mode_turned_ == turned(mode_))
    set(next(mode_, event));
  else
    (void)trip({wire::Fault::memory_changed});
}

/// What was latched behind it, by an earlier start, is next.
void Axis::cleared() {
  fault_ = behind_;
  behind_ = {};
  if (fault_.fault == wire::Fault::none) change(Event::clear);
}

// ---- commands -------------------------------------------------------------------------------------------------------

wire::Status Axis::against_arming() const {
  if (mode_ == Mode::tripped) return wire::Status::tripped;
  if (!configured_) return wire::Status::parameters_unset;
  if (!sees_) return wire::Status::sample_refused;
  if (!offsets_.known()) return wire::Status::offset_unknown;
  return wire::Status::done;
}

wire::Status Axis::arm() {
  const wire::Status answer = against_arming();
  if (answer == wire::Status::done) post(Command::arm);
  return answer;
}

wire::Status Axis::against(wire::ControlMode mode) const {
  if (!at_rest()) return wire::Status::mode_in_use;
  if (mode == wire::ControlMode::torque && !(A_per_Nm_ > 0.0f)) return wire::Status::parameters_unset;
  return wire::Status::done;
}

wire::Status Axis::clear() {
  if (!setpoint_.is_zero()) return wire::Status::setpoint_not_zero;
  if (fault_.fault == wire::Fault::parameters) return wire::Status::parameter_refused;  // only another set clears it
  post(Command::clear);
  return wire::Status::done;
}

/// What was posted since the last tick, the safest first; conditions are looked at again, for they may have changed.
void Axis::obey() {
  const std::uint8_t posted = commands_.exchange(0);
  const auto asked_for = [posted](Command c) {
    return (posted & static_cast<std::uint8_t>(c)) == static_cast<std::uint8_t>(c);
  };
  if (asked_for(Command::configure)) {
    take_over();
    built_ = built_sum();
  }
  if (asked_for(Command::disarm)) change(Event::disarm);
  if (asked_for(Command::clear) && setpoint_.is_zero() && fault_.fault != wire::Fault::parameters) {
    if (mode_ == Mode::tripped) cleared();
  }
  if (asked_for(Command::arm) && mode_ == Mode::off && against_arming() == wire::Status::done) {
    setpoint_.discard();
    change(Event::arm);
  }
  if (asked_for(Command::rest) && mode_ == Mode::running) change(Event::stop);
  const bool may_drive = mode_ == Mode::ready || mode_ == Mode::running || mode_turned_ != turned(mode_);
  if (asked_for(Command::trip) && may_drive) (void)trip(doubted_);
}

FastView Axis::fast() const {
  const float share = trace_.share;
  const bool saturated = trace_.limit == wire::Limit::none && share < 1.0f;
  return {trace_.current_A,
          trace_.permitted_A,
          {trace_.asked_V.d * share, trace_.asked_V.q * share},
          last_.ratio,
          trace_.bus_V,
          rotor_.rad_per_s(),
          trace_.rotor_rad,
          saturated ? wire::Limit::voltage : trace_.limit};
}

SignalPlace Axis::signal(std::uint8_t id) const {
  switch (id) {
#define SIGNAL(number, name, unit, where, doc) \
  case number:                                 \
    return SignalPlace(where);
#include "firmware/axis.signals"
#undef SIGNAL
    default:
      return {};
  }
}

FaultRecord Axis::fault() const {
  FaultRecord record = fault_;
  record.age_s = static_cast<float>(tripped_periods_) * period_s_;
  return record;
}

// ---- slow lane ------------------------------------------------------------------------------------------------------

void Axis::slow_tick(const hal::AxisSlowSample& sample, const Allowance& board, float neighbour_degC) {
  const HeatSums sums = heat_.take();
  input_ = heat_input(sums);
  surround(neighbour_degC);
  // What is less than a step waits for the next, or a lane that is a little late would lose up to a third of all time.
  const float came_steps = static_cast<float>(sums.periods) * period_s_ * slow_Hz;
  owed_steps_ = std::fmin(owed_steps_ + came_steps, most_owed_steps);
  steps_ = owed_steps_ > 1.0f ? static_cast<int>(owed_steps_ + 0.5f) : 1;
  // Its heat does not wait, or it would be that of the next. A lane that comes too often is charged for whole steps.
  charge_ = owed_steps_ < 0.5f ? 1.0f : came_steps / static_cast<float>(steps_);
  if (steps_ > late_steps) charge_ = std::fmax(charge_, 1.0f);
  owed_steps_ = std::fmax(owed_steps_ - static_cast<float>(steps_), -0.5f);
  core_.tick(charged(input_), {sample.housing.value_degC, senses_housing_ && sample.housing.valid}, {0.0f, false},
             steps_ - 1);
  const Allowance permitted = permitted_by(governor_.tick(core_), board);
  const bool whole = built_as_it_was() && (core_.estimate().flags & thermal::model_changed) == 0;
  allowance_ = whole ? permitted : Allowance{0.0f, wire::Limit::blind};
  if (!whole) doubt({wire::Fault::memory_changed});
  // A bridge that holds zero amperes heats a winding all the same, by ripple.
  if (mode_ == Mode::running && !(allowance_.current_A > 0.0f)) post(Command::rest);
  if ((endurance_age_steps_ += steps_) > most_endurance_age_steps) {
    endurance_.forget();
    endurance_age_steps_ = 0;
  }
  housing_measured_degC_ = sample.housing.valid ? sample.housing.value_degC : std::numeric_limits<float>::quiet_NaN();
  publish();
}

/// Into what has flipped the next slow tick looks, and nobody before.
void Axis::look_ahead() {
  if (!core_.whole()) return;
  if (!endurance_.whole()) new (&endurance_) thermal::Endurance(core_.network(), peak_A_);
  if (endurance_.go_on(core_, 1)) endurance_age_steps_ = 0;
}

/// The tick may come in at any place: what it changed under the look is not looked at.
void Axis::watch() {
  speeds_.add(rotor_.rad_per_s());
  const std::uint32_t before = heat_.adding().periods;
  std::atomic_signal_fence(std::memory_order_seq_cst);
  const bool whole = mode_turned_ == turned(mode_), armed = mode_ == Mode::ready || mode_ == Mode::running;
  const Watch::Look look = {trace_.phase_A, trace_.current_A, trace_.asked_V,        rotor_.electrical_rad_per_s(),
                            trace_.bus_V,   trace_.share,     mode_ == Mode::running};
  std::atomic_signal_fence(std::memory_order_seq_cst);
  if (heat_.adding().periods != before || commands_.load() != 0) return;
  if (!whole) return doubt({wire::Fault::memory_changed});
  if (!armed) return watch_.forget();
  const thermal::Unseen now = look.switches ? unseen_now() : thermal::Unseen{};
  looked_ = {looked_.of_mean_A2 + now.of_mean_A2, looked_.of_heat_A2 + now.of_heat_A2};
  ++looks_;
  const FaultRecord found = watch_.judge(look, {warm_ohm(), inductance_H_, flux_Wb_});
  if (found.fault != wire::Fault::none) doubt(found);
}

void Axis::doubt(const FaultRecord& why) {
  doubted_ = why;
  post(Command::trip);
}

/// The winding is taken as warm as the hottest phase is believed to be.
float Axis::warm_ohm() const {
  const float warm_K = static_cast<float>(core_.estimate().hottest_degC()) - 25.0f;
  return phase_ohm_ * (1.0f + copper_per_K_ * warm_K);
}

/// Squared current that the last sample did not show.
thermal::Unseen Axis::unseen_now() const {
  const float phase_ohm = warm_ohm();
  const float turn_rad = rotor_.electrical_rad_per_s() * period_s_;
  const SinCos middle = sin_cos(rotor_.half_a_period_before(trace_.rotor_rad));
  const auto phases = [&middle](Dq x) { return inverse_clarke(unpark(x, middle)); };
  const Dq i_A = trace_.current_A;
  const thermal::Chord chord = thermal::chord_of(turn_rad);
  const float vector_A2 = i_A.d * i_A.d + i_A.q * i_A.q;
  const thermal::Unseen rest = thermal::unseen(trace_.ended, phases({i_A.d * chord.middle, i_A.q * chord.middle}),
                                               phases({-thermal::bow_of(turn_rad, flux_Wb_, inductance_H_), 0.0f}),
                                               {trace_.bus_V, phase_ohm, inductance_H_, pwm_Hz_, rating_.dead_time_s});
  return {rest.of_mean_A2 + vector_A2 * chord.of_mean, rest.of_heat_A2 + vector_A2 * chord.of_heat};
}

/// The same of the last step, the mean of its looks: one alone would hide up to a seventh of the heat of a demand that
/// goes in step with the slow lane (losses_test). Without a look, as of the last sample.
thermal::Unseen Axis::take_unseen() {
  const float share = looks_ > 0 ? 1.0f / static_cast<float>(looks_) : 0.0f;
  thermal::Unseen mean = {looked_.of_mean_A2 * share, looked_.of_heat_A2 * share};
  if (looks_ == 0 && mode_ == Mode::running) mean = unseen_now();
  looked_ = {};
  looks_ = 0;
  return mean;
}

/// Three currents of a star have no sum, so where they have one a sensor lies, and nobody knows which: each phase as
/// hot as its own sensor or the other two say, of the last sample for the whole step. A phase whose sensor is dead
/// would carry three times what is asked for, and seem cold.
void Axis::add_contradicted(float (&phase_A2)[3]) const {
  const float own_A[3] = {trace_.phase_A.a, trace_.phase_A.b, trace_.phase_A.c};
  const float sum_A = own_A[0] + own_A[1] + own_A[2];
  const float largest_A = std::fmax(std::fabs(own_A[0]), std::fmax(std::fabs(own_A[1]), std::fabs(own_A[2])));
  if (within(sum_A, contradiction_A + contradiction_share * largest_A)) return;
  for (int k = 0; k < 3; ++k) {
    const float others_A = own_A[k] - sum_A, more_A2 = others_A * others_A - own_A[k] * own_A[k];
    if (more_A2 > 0.0f) phase_A2[k] += more_A2;
  }
}

/// Means over the step; of the speed, of its looks; the mode is taken as it stands. No sample at all: what went on
/// before, as long as the bridge is on.
thermal::HeatInput<> Axis::heat_input(const HeatSums& sums) {
  thermal::HeatInput<> input{};
  const thermal::Unseen looked = take_unseen();
  if (speeds_.none()) speeds_.add(rotor_.rad_per_s());
  const thermal::SpeedLooks speeds = std::exchange(speeds_, {});
  if (sums.periods == 0) {
    if (mode_ == Mode::running) return input_;
    unseen_ = {};
  } else {
    unseen_ = looked;
    fill_currents(input, sums);
    if (static_cast<float>(sums.periods) > late_steps * pwm_Hz_ / slow_Hz) {
      for (int k = 0; k < thermal::drive_count; ++k) {
        if (thermal::is_current_square(static_cast<thermal::Drive>(k)))
          input.drive[k] = std::fmax(input.drive[k], input_.drive[k]);
      }
    }
    input[thermal::Drive::enabled] = mode_ == Mode::running ? 1.0 : 0.0;
    speeds.fill(input);
  }
  input[thermal::Drive::one] = 1.0;
  return input;
}

/// By phase and in all, what their samples did not show included.
void Axis::fill_currents(thermal::HeatInput<>& input, const HeatSums& sums) const {
  const float share = 1.0f / static_cast<float>(sums.periods);
  float phase_A2[3] = {sums.phase_A2.a * share, sums.phase_A2.b * share, sums.phase_A2.c * share};
  add_contradicted(phase_A2);
  // What a sample misses of the mean goes with the phase's own current, ripple through all of them.
  const float all_A2 = phase_A2[0] + phase_A2[1] + phase_A2[2];
  const float missed = all_A2 > 0.0f ? 1.5f * unseen_.of_mean_A2 / all_A2 : 0.0f;
  const float ripple_A2 = 0.5f * (unseen_.of_heat_A2 - (all_A2 > 0.0f ? unseen_.of_mean_A2 : 0.0f));
  double sampled_A2 = 0.0, vector_A2 = 0.0;
  for (int k = 0; k < 3; ++k) {
    const float heats_A2 = towards_hot * (phase_A2[k] * (1.0f + missed) + ripple_A2);
    const double one_A2 = static_cast<double>(heats_A2 < 0.0f ? 0.0f : heats_A2);  // NaN stays: something hot follows
    input[thermal::phase_drive(k)] = one_A2;
    sampled_A2 += static_cast<double>(phase_A2[k]) / 1.5;
    vector_A2 += one_A2 / 1.5;
  }
  input[thermal::Drive::current_A2] = vector_A2;
  const double mean_A2 = sampled_A2 + static_cast<double>(unseen_.of_mean_A2);
  input[thermal::Drive::current_A] = std::sqrt(mean_A2 < 0.0 ? 0.0 : mean_A2);
}

/// Nobody measures the coolant: as warm as the surroundings are believed to be. Nor a frame; the two motors warm it, so
/// it is no warmer than the hotter of them, and that is what it is taken for: colder than it is, it would seem to cool.
void Axis::surround(float neighbour_degC) {
  const thermal::Estimate& now = core_.estimate();
  const double beside_degC = std::fmax(now.ambient_degC, static_cast<double>(neighbour_degC));
  input_[thermal::Boundary::coolant] = now.ambient_degC;
  input_[thermal::Boundary::neighbour] = beside_degC;
  input_[thermal::Boundary::frame] = std::fmax(beside_degC, now.housing_degC);
}

/// What the whole steps that stand for it are charged with.
thermal::HeatInput<> Axis::charged(thermal::HeatInput<> input) const {
  const double charge = static_cast<double>(charge_);
  for (int k = 0; k < thermal::drive_count; ++k) {
    const auto drive = static_cast<thermal::Drive>(k);
    if (thermal::is_current_square(drive) || drive == thermal::Drive::current2_speed2) input.drive[k] *= charge;
  }
  return input;
}

/// The smallest of core, board, and what is left without a housing reading; NaN allows nothing.
Allowance Axis::permitted_by(const thermal::Allowance& core, const Allowance& board) {
  const bool blind = senses_housing_ && (core_.estimate().flags & thermal::housing_missing) != 0;
  const float aim_A = blind ? blind_A_ : peak_A_, step_A = blind_slope * peak_A_;
  if (blind_cap_A_ > aim_A + step_A)
    blind_cap_A_ -= step_A;
  else if (blind_cap_A_ < aim_A - step_A)
    blind_cap_A_ += step_A;
  else
    blind_cap_A_ = aim_A;

  Allowance least = permit_.most();  // nothing if the parameters were refused
  const auto lower = [&least](float current_A, wire::Limit reason) {
    if (current_A >= least.current_A) return;
    least = {current_A > 0.0f ? current_A : 0.0f, reason};
  };
  lower(core.current_A, core.limit);
  lower(board.current_A, board.reason);
  lower(blind_cap_A_, wire::Limit::blind);
  return least;
}

void Axis::publish() {
  const thermal::Estimate& now = core_.estimate();
  AxisState state;
  state.mode = mode_;
  state.fast = fast();
  int winding = 0;
  float hottest_degC = -nothing_degC;
  for (int i = 0; i < now.node_count; ++i) {
    if (!(now.max_degC[i] < nothing_degC)) continue;
    const float degC = static_cast<float>(now.degC[i]);
    if (winding < 3) state.core_degC[winding++] = degC;
    if (!(degC <= hottest_degC)) {
      hottest_degC = degC;
      state.core_sigma_K = core_.counted_sigma_K(i);
    }
  }
  for (int k = winding; k > 0 && k < 3; ++k) state.core_degC[k] = state.core_degC[winding - 1];
  state.housing_degC = static_cast<float>(now.housing_degC);
  state.unseen = unseen_;
  state.heating_A = static_cast<float>(wire::direct_per_amplitude * std::sqrt(input_[thermal::Drive::current_A2]));
  state.allowance_A = allowance_.current_A;
  // Of a winding that nobody described there is a network all the same, one that nothing warms.
  state.time_left_s = configured_ ? endurance_.seconds_left() : 0.0f;
  state.allowance_1s_A = configured_ ? endurance_.current_A() : 0.0f;
  state.limit = state.fast.limit;
  state.estimate_flags = now.flags;
  state.fault = fault();
  state_ = state;
}

}  // namespace firmware

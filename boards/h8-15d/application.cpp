// SPDX-License-Identifier: MIT
#include "boards/h8-15d/application.hpp"

#include <cmath>
#include <cstring>

#include "boards/h8-15d/hardware.hpp"

using namespace h8_15d;

extern "C" {
constinit h8_15d::Door door{};
extern std::uint32_t stack_bottom[], stack_top[];
}

namespace {

constexpr std::uint32_t slow_channels[] = {vrefint_channel, ntc_channel[0], ntc_channel[1], board_ntc_channel,
                                           force_channel};
constexpr int slow_count = 5;
constexpr int slow_stale_ms = 100;  // a conversion takes one; what the safety table gives an open thermistor
constexpr std::uint32_t paint = 0xC0DEC0DE;

/// NTC to ground under a pull-up, read against its own supply. Open or short is no temperature.
hal::Temperature temperature_of(std::uint16_t counts) {
  if (counts < 40 || counts > 4055) return {0.0f, false};  // beyond -25 and above 200 degC with 10k / 3950 K
  const float n = static_cast<float>(counts);
  const float ohm = ntc_pull_up_ohm * n / (4095.0f - n);
  const float per_K = 1.0f / 298.15f + std::log(ohm / ntc_ohm) / ntc_beta_K;
  return {1.0f / per_K - 273.15f, true};
}

std::uint32_t stack_left() {
  std::uint32_t words = 0;
  while (stack_bottom + words < stack_top && stack_bottom[words] == paint) ++words;
  return 4 * words;
}

}  // namespace

namespace h8_15d {

Application::Application()
    : found_(parameters_.start(parameter_flash_)),
      driver_({rating, {setup_from(parameters_.in_force().axes[0]), setup_from(parameters_.in_force().axes[1])}, {}}) {}

void Application::prepare(std::uint32_t reset_flags, bool clock_good) {
  door = {};
  door.reset_flags = reset_flags;
  for (std::uint32_t i = 0; i < 3; ++i) door.unique_id[i] = reg(unique_id + 4 * i);
  for (std::uint32_t i = 0; i < 24; ++i)
    serial_[i] = "0123456789ABCDEF"[door.unique_id[i / 8] >> (28 - 4 * (i % 8)) & 0xF];
  door.parameters = found_;
  door.saved_serial = parameters_.saved_serial();
  good_ = clock_good_ = clock_good;
  remember();
  if (clock_good_) usb_port_.set_up();
  if (!good_) return;
  stage_.set_up();
  good_ = stage_.start();
}

/// Why not to arm, the gravest first, and how hot it was. Before the watchdogs run.
void Application::remember() {
  const auto why = static_cast<wire::Status>(found_.status);
  const bool no_set = why == wire::Status::parameter_refused || why == wire::Status::newer_record;
  for (int i = 0; i < 2; ++i) {
    if (!clock_good_) driver_.axis(i).hold({wire::Fault::clock_lost});
    if (no_set) driver_.axis(i).hold({wire::Fault::parameters, 0, 0.0f, static_cast<float>(found_.id)});
  }
  firmware::DriverMemory memory;
  const Recalled from = keeper_.recall(memory);
  door.restored = static_cast<std::uint32_t>(from);
  if (from == Recalled::nothing)
    driver_.start_hot();
  else
    driver_.restore(memory);
  keeper_.keep(driver_.memory());
}

/// Where the rotor stands before the first index pulse: somewhere in a Hall sector, or on the pulse itself.
void Application::find_rotor(int axis) {
  const std::uint32_t counter = reg((axis == 0 ? tim::tim3 : tim::tim4) + tim::cnt);
  const firmware::AxisParameters& p = parameters_.in_force().axes[axis].drive;
  stage_.distrust_encoder(axis);
  std::uint32_t hall = 0;
  for (int k = 0; k < 3; ++k) hall |= static_cast<std::uint32_t>(read_pin(pins[axis].hall[k])) << k;
  // Switch k is high for half an electrical turn from 120 k degrees: six sectors; here the middle of each, in turns.
  constexpr float middle_turns[8] = {-1.0f, 1.5f / 6, 3.5f / 6, 2.5f / 6, 5.5f / 6, 0.5f / 6, 4.5f / 6, -1.0f};
  // The switches tell where the magnet is; what the encoder has to read there is its offset more.
  const float turns = (middle_turns[hall] + p.angle_offset_rad * (0.5f / 3.1415927f)) / p.pole_pairs_count;
  on_hall_[axis] = middle_turns[hall] >= 0.0f && turns > -1.0f && turns < 2.0f;
  if (on_hall_[axis]) {
    const auto counts = static_cast<std::int32_t>(turns * static_cast<float>(encoder_counts));
    stage_.set_encoder_zero(axis, counter - static_cast<std::uint32_t>(counts));
    stage_.trust_encoder(axis);
  }  // else no such sector, or no such parameters: without an index the axis refuses to arm
  if (read_pin(pins[axis].index)) index(axis);
}

/// A commit may bring other pole pairs or another offset, and with them another place of a rotor whose index was not
/// seen yet. Nobody drives: what is armed behind the commit still waits for a setpoint.
void Application::follow_commit() {
  for (int i = 0; good_ && i < 2; ++i) {
    const firmware::AxisParameters& p = parameters_.in_force().axes[i].drive;
    const std::uint32_t now[2] = {firmware::bits(p.pole_pairs_count), firmware::bits(p.angle_offset_rad)};
    if (std::memcmp(now, found_with_[i], sizeof now) == 0 || !parameters_.whole()) continue;
    std::memcpy(found_with_[i], now, sizeof now);
    const Priority& index_irq = i == 0 ? index0_irq : index1_irq;
    hold_off(index_irq);
    if (!index_seen_[i]) find_rotor(i);
    let_in(index_irq);
  }
}

// ---- interrupts -----------------------------------------------------------------------------------------------------

void Application::control() {
  const int axis = stage_.take();
  if (axis < 0) return;
  const hal::AxisSample sample = stage_.sample(axis);
  stage_.drive(axis, driver_.axis(axis).tick(sample));
  const std::uint32_t mine = fast_ticks_[axis].load(std::memory_order_relaxed) + 1;
  fast_ticks_[axis].store(mine, std::memory_order_relaxed);
  if (axis == 1) {
    recorder_.tick(sample.sequence);
    const std::uint32_t other = fast_ticks_[0].load(std::memory_order_relaxed);
    if (other != fast_fed_) feed_wwdg();
    fast_fed_ = other;
  }
}

/// The first index moves the field by half a sector at most, and as much again for how the switches are mounted. What
/// asks for more is a glitch on the line, or an offset that is another motor's, and would turn the field anywhere.
bool Application::agrees_with_hall(int axis, std::uint32_t slipped) const {
  constexpr std::uint32_t sector = encoder_counts / 6;
  const auto pole_pairs = static_cast<std::uint32_t>(parameters_.in_force().axes[axis].drive.pole_pairs_count);
  const std::uint32_t electrical = slipped * pole_pairs & (encoder_counts - 1);
  return electrical <= sector || electrical >= encoder_counts - sector;
}

void Application::index(int axis) {
  const std::uint32_t counter = reg((axis == 0 ? tim::tim3 : tim::tim4) + tim::cnt);
  const std::uint32_t slipped = (counter - stage_.encoder_zero(axis)) & (encoder_counts - 1);
  constexpr std::uint32_t tolerance = 4;  // latency of this interrupt at 1000 rad/s, and which flank of the pulse
  if (index_seen_[axis] && slipped > tolerance && slipped < encoder_counts - tolerance) {
    stage_.distrust_encoder(axis);  // counts were lost or invented since the last turn
    return;
  }
  if (!index_seen_[axis] && on_hall_[axis] && !agrees_with_hall(axis, slipped)) {
    stage_.distrust_encoder(axis);
    return;
  }
  if (!index_seen_[axis]) stage_.set_encoder_zero(axis, counter);
  index_seen_[axis] = true;
  stage_.trust_encoder(axis);
}

void Application::supply_falls() {
  all_gates_off();
  // The fast lane has nothing left to drive and would run late behind the flash; if the supply comes back, the window
  // watchdog, which nobody feeds any more, starts everything anew.
  reg(system::nvic_icer) = bit(adc_irq.irq);
  stage_.stop_sampling();  // where this came into a tick, what is left of that must not meet another conversion
  keeper_.last_words(good_);
}

// ---- main loop ------------------------------------------------------------------------------------------------------

void Application::run() {
  bring_up_interrupts(clock_good_ ? hclk_Hz : hsi_Hz);
  start_watchdogs(good_);
  for (const AxisPins& a : pins) write_pin(a.enable, good_);
  door.bytes = sizeof door;
  door.magic = Door::open;
  std::uint32_t seen = milliseconds_.load();
  for (;;) {
    asm volatile("wfi");
    const std::uint32_t now = milliseconds_.load(std::memory_order_relaxed);
    if (now == seen) continue;
    seen = now;
    every_ms(now);
  }
}

void Application::every_ms(std::uint32_t ms) {
  driver_.watch();  // before new setpoints: the last ones have settled
  for (int i = 0; i < 2; ++i) stage_.watch_encoder_zero(i);
  read_slow_channel();
  look_at_door();
  link_.work(parameter_flash_);
  follow_commit();
  if (!usb_connected_ && clock_good_ && ms >= usb_connect_ms) {
    usb_connected_ = true;
    usb_port_.connect(true);
  }
  if (ms - slow_ms_ >= 10) {
    slow_ms_ = ms;
    slow_lane();
  } else if (!link_.looks_ahead()) {  // one at a time: curved laws of cooling make a step dear
    driver_.look_ahead();
  }
  // Fed only if everybody has moved on: both fast lanes since the last time, the slow lane within its time.
  const std::uint32_t fast[2] = {fast_ticks_[0].load(std::memory_order_relaxed),
                                 fast_ticks_[1].load(std::memory_order_relaxed)};
  const bool fast_alive = !good_ || (fast[0] != fed_[0] && fast[1] != fed_[1]);
  if (fast_alive && ms - slow_ms_ < 12) feed_iwdg();
  fed_[0] = fast[0];
  fed_[1] = fast[1];
}

void Application::read_slow_channel() {
  if (!stage_.slow_ready()) {
    stage_.ask_slow(slow_channels[slow_channel_]);
    if (slow_wait_ms_ < slow_stale_ms && ++slow_wait_ms_ == slow_stale_ms) {
      housing_[0] = housing_[1] = power_stage_ = {};  // what was read last is no reading any more
      stage_.set_reference_good(false);
    }
    return;
  }
  slow_wait_ms_ = 0;
  const std::uint16_t counts = stage_.fetch_slow();
  switch (slow_channel_) {
    case 0: {
      const float reference = static_cast<float>(*reinterpret_cast<const volatile std::uint16_t*>(vrefint_cal));
      door.vdda_V = counts == 0 ? 0.0f : vdda_V * reference / static_cast<float>(counts);
      stage_.set_reference_good(door.vdda_V > 0.96f * vdda_V && door.vdda_V < 1.04f * vdda_V);
      break;
    }
    case 1:
      housing_[0] = temperature_of(counts);
      break;
    case 2:
      housing_[1] = temperature_of(counts);
      break;
    case 3:
      power_stage_ = temperature_of(counts);
      break;
    default: {
      const int which = force_axis_ & 1;  // whatever flips, nothing else is written to
      door.force_V[which] = static_cast<float>(counts) * vdda_V / adc_counts;
      force_axis_ = 1 - which;
      write_pin(force_select, force_axis_ == 1);  // settles until its turn comes again
    }
  }
  slow_channel_ = (slow_channel_ + 1) % slow_count;
  stage_.ask_slow(slow_channels[slow_channel_]);
}

void Application::slow_lane() {
  const float bus_A = (static_cast<float>(stage_.bus_A_counts()) - bus_zero_counts) * bus_A_per_count;
  const hal::AxisSlowSample axes[2] = {{housing_[0]}, {housing_[1]}};
  driver_.slow_tick({.power_stage = power_stage_, .bus_A = bus_A, .bus_A_valid = true}, axes);
  ++slow_ticks_;
  door.slow_ticks = slow_ticks_;
  door.bus_A = bus_A;
  for (int i = 0; i < 2; ++i) {
    door.axis[i] = driver_.axis(i).state();
    door.lost_samples[i] = stage_.lost(i);
  }
  if (slow_ticks_ % 100 == 1) door.stack_left_bytes = stack_left();
  keeper_.keep(driver_.memory());
}

/// Setpoints, arming and parameters know one caller: USB waits while the door has something new.
void Application::look_at_door() {
  const volatile Door& in = door;
  if (in.serial == door_serial_ && in.order_serial == door_order_ && in.wish_serial == door_wish_) return;
  hold_off(usb_irq);
  obey_door(in);
  let_in(usb_irq);
}

void Application::obey_door(const volatile Door& in) {
  if (in.serial != door_serial_) {
    door_serial_ = in.serial;
    for (int i = 0; i < 2; ++i) {
      if (in.axes >> i & 1)
        door.answer[i] = static_cast<std::uint32_t>(driver_.axis(i).set_current({in.id_A[i], in.iq_A[i]}));
    }
  }
  if (in.order_serial != door_order_) {
    door_order_ = in.order_serial;
    door.order_answer = obey_order(door);
    door.saved_serial = parameters_.saved_serial();
  }
  if (in.wish_serial == door_wish_) return;
  door_wish_ = in.wish_serial;
  for (int i = 0; i < 2; ++i) {
    switch (in.wish[i]) {
      case wish_arm:
        door.answer[i] = static_cast<std::uint32_t>(driver_.axis(i).arm());
        break;
      case wish_disarm:
        driver_.axis(i).disarm();
        break;
      case wish_clear:
        door.answer[i] = static_cast<std::uint32_t>(driver_.axis(i).clear());
        break;
      default:
        break;
    }
  }
}

wire::Answer Application::obey_order(const Door& in) {
  switch (in.order) {
    case order_get:
      return {static_cast<std::uint8_t>(parameters_.get(in.assignment.address, door.order_value))};
    case order_stage:
      return parameters_.stage(in.assignment);
    case order_commit:
      return parameters_.commit(driver_);
    case order_save:
      return parameters_.save(driver_, parameter_flash_);
    default:
      return {static_cast<std::uint8_t>(wire::Status::unknown_parameter)};
  }
}

}  // namespace h8_15d

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
constexpr std::uint32_t paint = 0xC0DEC0DE;

const std::uint8_t* flash_at(std::uint32_t sector) {
  return reinterpret_cast<const std::uint8_t*>(sector_address(sector));
}

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

/// Backup memory takes words only (the model insists, silicon would not).
void copy_words(std::uint32_t to, const void* from, std::uint32_t bytes) {
  for (std::uint32_t at = 0; at < bytes; at += 4) {
    std::uint32_t word;
    std::memcpy(&word, static_cast<const std::uint8_t*>(from) + at, 4);
    reg(to + at) = word;
  }
}

}  // namespace

namespace h8_15d {

void Application::prepare(std::uint32_t reset_flags, bool clock_good) {
  reset_flags_ = static_cast<std::uint8_t>(reset_flags >> 24);
  door = {};
  door.reset_flags = reset_flags;
  for (std::uint32_t i = 0; i < 3; ++i) door.unique_id[i] = reg(unique_id + 4 * i);
  recall_heat(reset_flags);
  good_ = clock_good_ = clock_good;
  if (!good_) return;
  stage_.set_up();
  for (int i = 0; i < 2; ++i) find_rotor(i);
  good_ = stage_.start();
}

/// Where the rotor stands before the first index pulse: on the pulse itself, or somewhere in a Hall sector.
void Application::find_rotor(int axis) {
  if (read_pin(pins[axis].index)) {
    stage_.set_encoder_zero(axis, 0);
    index_seen_[axis] = true;
    stage_.trust_encoder(axis);
    return;
  }
  std::uint32_t hall = 0;
  for (int k = 0; k < 3; ++k) hall |= static_cast<std::uint32_t>(read_pin(pins[axis].hall[k])) << k;
  // Switch k is high for half an electrical turn from 120 k degrees: six sectors; here the middle of each, in turns.
  constexpr float middle_turns[8] = {-1.0f, 1.5f / 6, 3.5f / 6, 2.5f / 6, 5.5f / 6, 0.5f / 6, 4.5f / 6, -1.0f};
  const float pole_pairs = pole_pairs_[axis];
  if (middle_turns[hall] < 0.0f || !(pole_pairs >= 1.0f))
    return;  // no such sector: not trusted, the axis refuses to arm
  const auto counts = static_cast<std::uint32_t>(middle_turns[hall] / pole_pairs * static_cast<float>(encoder_counts));
  stage_.set_encoder_zero(axis, 0u - counts);
  stage_.trust_encoder(axis);
}

// ---- interrupts -----------------------------------------------------------------------------------------------------

void Application::control() {
  const int axis = stage_.take();
  if (axis < 0) return;
  stage_.drive(axis, driver_.axis(axis).tick(stage_.sample(axis)));
  const std::uint32_t mine = fast_ticks_[axis].load(std::memory_order_relaxed) + 1;
  fast_ticks_[axis].store(mine, std::memory_order_relaxed);
  if (axis == 1) {
    const std::uint32_t other = fast_ticks_[0].load(std::memory_order_relaxed);
    if (other != fast_fed_) feed_wwdg();
    fast_fed_ = other;
  }
}

void Application::index(int axis) {
  const std::uint32_t counter = reg((axis == 0 ? tim::tim3 : tim::tim4) + tim::cnt);
  const std::uint32_t slipped = (counter - stage_.encoder_zero(axis)) & (encoder_counts - 1);
  constexpr std::uint32_t tolerance = 4;  // latency of this interrupt at 1000 rad/s, and which flank of the pulse
  if (index_seen_[axis] && slipped > tolerance && slipped < encoder_counts - tolerance) {
    stage_.distrust_encoder(axis);  // counts were lost or invented since the last turn
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
  const HeatRecord last = heat_now();
  if (journal_room_ < sizeof last) return;
  std::uint32_t words[sizeof last / 4];
  std::memcpy(words, &last, sizeof last);
  program_flash(journal_at_, words, sizeof last / 4);
  journal_room_ = 0;  // once
}

// ---- main loop
// --------------------------------------------------------------------------------------------------------

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
  read_slow_channel();
  look_at_door();
  if (ms - slow_ms_ >= 10) {
    slow_ms_ = ms;
    slow_lane();
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
    return;
  }
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
      const int which = force_axis_;
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
  const HeatRecord now = heat_now();
  copy_words(backup_ram, &now, sizeof now);
}

void Application::look_at_door() {
  const volatile Door& in = door;
  if (in.serial != door_serial_) {
    door_serial_ = in.serial;
    for (int i = 0; i < 2; ++i) {
      if (in.axes >> i & 1)
        door.answer[i] = static_cast<std::uint32_t>(driver_.axis(i).set_current({in.id_A[i], in.iq_A[i]}));
    }
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

// ---- what survives
// ----------------------------------------------------------------------------------------------------

HeatRecord Application::heat_now() const {
  HeatRecord r{};
  for (int i = 0; i < 2; ++i) {
    const firmware::AxisState& state = driver_.axis(i).state();
    for (int k = 0; k < 3; ++k) r.payload.core_degC[i][k] = state.core_degC[k];
    r.payload.housing_degC[i] = state.housing_degC;
    r.payload.fault[i] = static_cast<std::uint8_t>(state.fault.fault);
  }
  r.payload.reset_flags = reset_flags_;
  r.seal(heat_serial_ + slow_ticks_ + 1);
  return r;
}

/// Before the watchdogs run: a journal sector that is full may be erased here, which takes a second, and nowhere else.
void Application::recall_heat(std::uint32_t) {
  HeatRecord kept;
  std::uint32_t words[sizeof kept / 4];
  for (std::uint32_t i = 0; i < sizeof kept / 4; ++i) words[i] = reg(backup_ram + 4 * i);
  std::memcpy(&kept, words, sizeof kept);
  const HeatRecord* journal = nullptr;
  int last_sector = 0;
  for (int i = 0; i < 2; ++i) {
    const HeatRecord* one = newest<HeatRecord>(flash_at(journal_sectors[i]), sector_bytes);
    if (one && (!journal || static_cast<std::int32_t>(one->header.serial - journal->header.serial) > 0)) {
      journal = one;
      last_sector = i;
    }
  }
  if (kept.whole()) {
    door.restored = 1;
    heat_serial_ = kept.header.serial;
  } else if (journal) {
    door.restored = 2;
    heat_serial_ = journal->header.serial;
  }
  std::size_t at = free_slot<HeatRecord>(flash_at(journal_sectors[last_sector]), sector_bytes);
  if (at + 4 * sizeof(HeatRecord) > sector_bytes) {
    last_sector = 1 - last_sector;
    erase_sector(journal_sectors[last_sector]);
    at = 0;
  }
  journal_at_ = sector_address(journal_sectors[last_sector]) + at;
  journal_room_ = sector_bytes - at;
}

}  // namespace h8_15d

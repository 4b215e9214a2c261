// SPDX-License-Identifier: MIT
#include "boards/host/chip/pcb.hpp"

#include <cmath>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "boards/dual_48v_20a.hpp"

namespace boards {
namespace {

using namespace host_sim::chip;

// README.md of the board, "Pins".
struct Wiring {
  Pin high[3], low[3];
  unsigned gate_function;
  Pin fault, enable, index, hall[3];
};
constexpr Wiring wiring[2] = {
    {{{'A', 8}, {'A', 9}, {'A', 10}},
     {{'B', 13}, {'B', 14}, {'B', 15}},
     1,
     {'B', 12},
     {'B', 9},
     {'B', 3},
     {{'C', 10}, {'C', 11}, {'C', 12}}},
    {{{'C', 6}, {'C', 7}, {'C', 8}},
     {{'A', 7}, {'B', 0}, {'B', 1}},
     3,
     {'A', 6},
     {'B', 2},
     {'B', 8},
     {{'B', 10}, {'B', 11}, {'D', 2}}},
};
struct AnalogPin {
  int channel;
  Pin pin;
};
constexpr AnalogPin analog_wiring[] = {{0, {'A', 0}},  {1, {'A', 1}},  {2, {'A', 2}},  {3, {'A', 3}},
                                       {4, {'A', 4}},  {5, {'A', 5}},  {10, {'C', 0}}, {11, {'C', 1}},
                                       {12, {'C', 2}}, {13, {'C', 3}}, {14, {'C', 4}}, {15, {'C', 5}}};
constexpr std::uint32_t current_zero = 2048, reference_counts = 1502, idle_force_counts = 100;
constexpr double settling_s = 1e-6;
// A cold thermistor lets the divider's 10 kohm feed the sampling capacitor: 16 kohm with the switch, 7 pF, a quarter of
// a count (STM32F405 datasheet, ADC characteristics, equation 1).
constexpr double thermistor_sampling_s = 16e3 * 7e-12 * 9.7;

constexpr int parameter_sector = 5, journal_sector = 7;

/// A debug probe with the chip in reset: writes flash as the firmware's own store does.
struct Programmer {
  Chip& chip;
  int sector;
  std::vector<std::uint8_t> cells[2] = {bytes(0), bytes(1)};

  std::vector<std::uint8_t> bytes(int which) const {
    std::vector<std::uint8_t> all(Flash::sector_size(sector + which));
    for (std::uint32_t at = 0; at < all.size(); at += 4) {
      const std::uint32_t word = chip.flash.word(Flash::sector_start(sector + which) + at);
      std::memcpy(all.data() + at, &word, 4);
    }
    return all;
  }
  std::span<const std::uint8_t> area(int which) const { return cells[which]; }
  bool program(int which, std::size_t byte, std::span<const std::uint32_t> words) {
    std::memcpy(cells[which].data() + byte, words.data(), words.size_bytes());
    chip.flash.load(Flash::sector_start(sector + which) + static_cast<std::uint32_t>(byte), words.data(),
                    static_cast<std::uint32_t>(words.size_bytes()));
    return true;
  }
  bool erase(int) { return false; }
};

/// What the last power-down left before a long night.
firmware::DriverMemory cold_memory() {
  const thermal::HeatMemory cold{4, {25, 25, 25, 25}, {5, 5, 5, 5}, 25};
  return {{{cold, {}}, {cold, {}}}, 0.0f};
}

}  // namespace

host_sim::SensorDesign h8_15d_sensors() {
  host_sim::SensorDesign s;
  const double V_per_count = 3.3 / 4096;
  s.current_A_per_count = V_per_count / (0.002 * 20);
  s.bus_V_per_count = V_per_count * 20;
  s.bus_zero_counts = 1024;
  s.bus_A_per_count = V_per_count / (0.001 * 40);
  return s;
}

Pcb::Pcb(const host_sim::BenchDesign& design, std::uint64_t seed)
    : bench(design, seed), pwm_period_s_(1 / design.bridge.pwm_Hz), dead_time_s_(design.bridge.dead_time_s) {
  chip.connect(this);
}

void Pcb::flash_parameters(const firmware::AxisSet (&axes)[2]) {
  Programmer programmer{chip, parameter_sector};
  const firmware::BoardRating rating = boards::dual_48V_20A;
  firmware::ParameterStore store(rating);
  (void)store.start(programmer);
  auto driver = std::make_unique<firmware::Driver>(firmware::DriverSetup{rating, {}, {}});
  const auto must = [](const wire::Answer& answer) {
    if (answer.status != 0)
      throw std::runtime_error(std::string("the parameters are refused: ") + wire::text_of(answer.status).happened);
  };
  for (int axis = 0; axis < 2; ++axis) {
    for (int i = 0; i < firmware::parameter_count; ++i) {
      must(store.stage({{firmware::parameter_info(i)->id, static_cast<std::uint8_t>(axis)},
                        firmware::parameter_value(axes[axis], i)}));
    }
  }
  must(store.commit(*driver));
  driver = std::make_unique<firmware::Driver>(firmware::DriverSetup{rating, {}, {}});  // one that has nothing posted
  must(store.save(*driver, programmer));
  flash_journal(cold_memory());
}

firmware::ParameterSet Pcb::saved_parameters() {
  Programmer programmer{chip, parameter_sector};
  firmware::ParameterStore store(boards::dual_48V_20A);
  if (store.start(programmer).status != 0) throw std::runtime_error("no whole parameter set is saved");
  return store.in_force();
}

void Pcb::flash_journal(const firmware::DriverMemory& memory) {
  std::uint32_t record[firmware::header_words + sizeof memory / 4] = {};
  std::memcpy(record + firmware::header_words, &memory, sizeof memory);
  firmware::seal(record, 0x41454848, 1);
  chip.flash.load(Flash::sector_start(journal_sector), record, sizeof record);
}

void Pcb::power_on(std::uint32_t seed, bool keep_backup) {
  chip.power_on(seed, keep_backup);
  advanced_.fill(chip.now());
  for (int i = 0; i < 2; ++i) {
    set_fault_pin(i, false);
    move_pins(i);
  }
}

void Pcb::set_fault_pin(int axis, bool fault) { chip.set_pin(wiring[axis].fault, !fault); }

void Pcb::run_for(double seconds) {
  const Time end = chip.now() + from_s(seconds), step = from_s(pwm_period_s_);
  while (chip.now() < end) {
    chip.run_until(std::min(end, chip.now() + step));
    // No counter, no period: the motor goes on by itself with open gates.
    for (int i = 0; i < 2; ++i) {
      auto& last = last_[static_cast<std::size_t>(i)];
      const Time& advanced = advanced_[static_cast<std::size_t>(i)];
      while (chip.now() - advanced > step + step / 2) {
        last = gates(i, nullptr);
        if (!chip.timer(i).running()) last.on = false;
        advance(i, advanced + step);
      }
    }
  }
}

hal::Duty Pcb::gates(int axis, std::string* complaint) const {
  const Wiring& w = wiring[axis];
  const AdvancedTimer& timer = axis == 0 ? chip.tim1 : chip.tim8;
  hal::Duty off{{0.5f, 0.5f, 0.5f}, false};
  const bool enabled = chip.port(w.enable.port).drives_high(w.enable.number);
  if (!timer.main_output() || !enabled) {
    if (complaint && timer.main_output()) *complaint = "MOE is set, but the gate driver's enable pin is low or floats";
    return off;
  }
  float ratio[3];
  for (int k = 0; k < 3; ++k) {
    const Leg leg = timer.leg(k);
    const bool high = chip.port(w.high[k].port).is_alternate(w.high[k].number, w.gate_function);
    const bool low = chip.port(w.low[k].port).is_alternate(w.low[k].number, w.gate_function);
    if (!high || !low || !leg.upper_driven || !leg.lower_driven) {
      if (complaint)
        *complaint =
            std::string("phase ") + "abc"[k] + ": a gate is not driven by the timer (pin function, CCxE or CCxNE)";
      return off;
    }
    if (leg.upper_ratio + leg.lower_ratio > 1.0 + 1e-9) {
      if (complaint)
        *complaint = std::string("phase ") + "abc"[k] + ": both switches are told to be on at once (polarity)";
      return off;
    }
    ratio[k] = static_cast<float>(leg.upper_ratio);
  }
  if (complaint && chip.port(w.fault.port).pull(w.fault.number) != 1)
    *complaint = "nFAULT is open-drain: nothing pulls it up";
  if (complaint && std::fabs(timer.period_s() - pwm_period_s_) > 1e-3 * pwm_period_s_)
    *complaint = "the PWM period is not the board's 50 us";
  if (complaint && !timer.centre_aligned())
    *complaint = "the PWM is not centre-aligned: the shunts are sampled on an edge";
  if (complaint && timer.dead_time_s() < weakest_dead_time_s)
    *complaint = "the dead time is shorter than the switches need";
  if (complaint && std::fabs(timer.dead_time_s() - dead_time_s_) > 0.05 * dead_time_s_)
    *complaint = "the dead time is not the board's 500 ns";
  return {{ratio[0], ratio[1], ratio[2]}, true};
}

void Pcb::period_ended(int bridge, Time when) {
  std::string complaint;
  last_[static_cast<std::size_t>(bridge)] = gates(bridge, &complaint);
  if (!complaint.empty()) chip.report((bridge == 0 ? "axis 0: " : "axis 1: ") + complaint, chip.timer(bridge).base());
  if (chip.tim1.main_output() && chip.tim8.main_output()) {
    const double apart = to_s(when - chip.timer(1 - bridge).last_overflow());
    if (std::fabs(apart - pwm_period_s_ / 2) > 0.02 * pwm_period_s_) {
      chip.report("the two timers do not stand half a period apart", chip.timer(bridge).base());
    }
  }
  advance(bridge, when);
}

void Pcb::advance(int axis, Time when) {
  advanced_[static_cast<std::size_t>(axis)] = when;
  bench.advance_axis(axis, last_[static_cast<std::size_t>(axis)]);
  move_pins(axis);
}

void Pcb::move_pins(int axis) {
  const auto n = static_cast<std::size_t>(axis);
  const host_sim::AxisRaw& raw = bench.raw(axis);
  edges_[n] += static_cast<std::int16_t>(static_cast<std::uint16_t>(raw.encoder_counts - counter_[n]));
  counter_[n] = raw.encoder_counts;
  EncoderTimer& counter = axis == 0 ? chip.tim3 : chip.tim4;
  counter.set_edges(edges_[n]);
  for (int k = 0; k < 3; ++k) chip.set_pin(wiring[axis].hall[k], raw.hall >> k & 1);
  const std::uint32_t crossed = raw.index_pulses - pulses_[n];
  pulses_[n] = raw.index_pulses;
  if (crossed) {
    counter.set_index_edges(
        edges_[n] + static_cast<std::int16_t>(static_cast<std::uint16_t>(raw.index_latch - raw.encoder_counts)));
    chip.set_pin(wiring[axis].index, false);
    chip.set_pin(wiring[axis].index, true);
  }
  chip.set_pin(wiring[axis].index, raw.encoder_counts % 4096 == 0);
}

std::uint32_t Pcb::analog(int adc, int channel, Time closed) {
  for (const AnalogPin& a : analog_wiring) {
    if (a.channel == channel && chip.port(a.pin.port).mode(a.pin.number) != PinMode::analog) {
      chip.report("a channel is converted whose pin is not in analog mode", 0x40012000);
    }
  }
  if (channel <= 2 || (channel >= 10 && channel <= 12)) {
    const int axis = channel <= 2 ? 0 : 1, phase = channel % 10;
    const auto n = static_cast<std::size_t>(axis);
    if (last_[n].on) {  // a low-side shunt carries current only while its switch is on, around the top of the counter
      const float ratio = phase == 0 ? last_[n].ratio.a : phase == 1 ? last_[n].ratio.b : last_[n].ratio.c;
      const double half_s = 0.5 * (1.0 - static_cast<double>(ratio)) * pwm_period_s_ - dead_time_s_;
      double away_s = std::fabs(to_s(closed) - to_s(chip.timer(axis).last_overflow()));
      away_s = std::min(away_s, std::fabs(pwm_period_s_ - away_s));
      if (away_s > 0.1e-6 && gates(axis, nullptr).on)  // a break that came since then leaves no zero vector to miss
        chip.report("phase currents are sampled away from the middle of the zero vector", 0x40012000);
      if (half_s - away_s < settling_s) return current_zero;
    }
    return bench.raw(axis).current_counts[static_cast<std::size_t>(phase)];
  }
  if ((channel == 4 || channel == 5 || channel == 14) && chip.adc(adc).sampling_s(channel) < thermistor_sampling_s)
    chip.report("a thermistor is sampled for too short a time", 0x40012000);
  switch (channel) {
    case 3:
      return bench.board_raw().bus_voltage_counts;
    case 13:
      return bench.board_raw().bus_current_counts;
    case 4:
      return bench.raw(0).housing_counts;
    case 5:
      return bench.raw(1).housing_counts;
    case 14:
      return bench.board_raw().power_stage_counts;
    case 15:
      return idle_force_counts;
    case 17:
      return reference_counts;
    default:
      chip.report("a channel is converted to which nothing is connected", 0x40012000);
      return 0;
  }
}

std::uint32_t Pcb::door_address() const {
  const std::uint32_t address = chip.symbol("door");
  if (address == 0) throw std::runtime_error("the image has no symbol 'door'");
  return address;
}

h8_15d::Door Pcb::door() const {
  h8_15d::Door d;
  std::memcpy(static_cast<void*>(&d), const_cast<Chip&>(chip).core().ram() + (door_address() - Core::ram_base),
              sizeof d);
  if (d.magic == h8_15d::Door::open && d.bytes != sizeof d)
    throw std::runtime_error("the image's door has another layout than this program's; build both anew");
  return d;
}

void Pcb::set_current(int axis, float id_A, float iq_A) {
  auto* at = chip.core().ram() + (door_address() - Core::ram_base);
  h8_15d::Door d = door();
  d.id_A[axis] = id_A;
  d.iq_A[axis] = iq_A;
  d.axes |= 1u << axis;
  ++d.serial;
  std::memcpy(at, static_cast<const void*>(&d), offsetof(h8_15d::Door, wish_serial));
}

void Pcb::wish(int axis, h8_15d::DoorWish what) {
  auto* at = chip.core().ram() + (door_address() - Core::ram_base);
  h8_15d::Door d = door();
  d.wish[axis] = what;
  d.wish[1 - axis] = h8_15d::wish_none;
  ++d.wish_serial;
  std::memcpy(at + offsetof(h8_15d::Door, wish_serial), static_cast<const void*>(&d.wish_serial),
              3 * sizeof(std::uint32_t));
}

void Pcb::post(h8_15d::DoorOrder what, const wire::Assignment& assignment) {
  auto* at = chip.core().ram() + (door_address() - Core::ram_base);
  h8_15d::Door d = door();
  d.order = what;
  d.assignment = assignment;
  ++d.order_serial;
  std::memcpy(at + offsetof(h8_15d::Door, order_serial), static_cast<const void*>(&d.order_serial),
              offsetof(h8_15d::Door, answer) - offsetof(h8_15d::Door, order_serial));
}

wire::Answer Pcb::order(h8_15d::DoorOrder what, const wire::Assignment& assignment) {
  post(what, assignment);
  run_for(0.02);
  return door().order_answer;
}

bool Pcb::arm(double patience_s) {
  const double until = to_s(chip.now()) + patience_s;
  while (to_s(chip.now()) < until) {
    bool ready = door().magic == h8_15d::Door::open;
    for (int i = 0; ready && i < 2; ++i) {
      if (door().axis[i].mode == firmware::Mode::off) {
        wish(i, h8_15d::wish_arm);
        run_for(0.003);
      }
    }
    run_for(0.012);
    if (ready && door().axis[0].mode == firmware::Mode::ready && door().axis[1].mode == firmware::Mode::ready)
      return true;
  }
  return false;
}

}  // namespace boards

// SPDX-License-Identifier: MIT
// The printed circuit board of the H8-15D in numbers: joins the pins of the chip model to the plant of host-sim, by the
// pin table of boards/h8-15d/README.md and not by the driver's board.hpp, so that a swapped pin shows. Each axis' motor
// takes steps of its own timer's period, from top to top, so axis 1 feels its duties half a period after axis 0. What
// the driver does to the power stage that no power stage stands is reported as the firmware's mistake.
#pragma once

#include <array>
#include <memory>

#include "boards/h8-15d/door.hpp"
#include "firmware/parameter_store.hpp"
#include "host-sim/chip/chip.hpp"
#include "host-sim/plant/bench.hpp"

namespace boards {

/// What the amplifiers and dividers of README.md make of amperes, volts and kelvin.
host_sim::SensorDesign h8_15d_sensors();

class Pcb final : public host_sim::chip::Board {
 public:
  Pcb(const host_sim::BenchDesign& design, std::uint64_t seed);

  /// As a programmer would: the image; and what a life before this one left: saved parameters, a journal that says
  /// cold.
  void flash_image(const std::string& elf) { chip.load(elf); }
  void flash_parameters(const firmware::AxisSet (&axes)[2]);
  /// What its parameter sectors hold; throws if that is nothing whole.
  firmware::ParameterSet saved_parameters();
  void flash_journal(const firmware::DriverMemory& memory);
  void power_on(std::uint32_t seed = 1, bool keep_backup = false);
  void run_for(double seconds);

  /// The debugger's door.
  h8_15d::Door door() const;
  void set_current(int axis, float id_A, float iq_A);
  void wish(int axis, h8_15d::DoorWish what);
  void post(h8_15d::DoorOrder what, const wire::Assignment& assignment = {});
  /// An order about the parameters, and the image's answer to it.
  wire::Answer order(h8_15d::DoorOrder what, const wire::Assignment& assignment = {});
  /// Arms both axes as a person would: waits until the offsets are known. False: refused.
  bool arm(double patience_s = 0.5);

  bool gates_open(int axis) const { return !last_[static_cast<std::size_t>(axis)].on; }
  hal::Duty duty(int axis) const { return gates(axis, nullptr); }
  void set_fault_pin(int axis, bool fault);

  // chip::Board
  void period_ended(int bridge, host_sim::chip::Time when) override;
  std::uint32_t analog(int adc, int channel, host_sim::chip::Time closed) override;

  host_sim::chip::Chip chip;
  host_sim::Bench bench;
  double weakest_dead_time_s = 450e-9;  // turn-off and driver skew of the assumed MOSFETs with margin

 private:
  hal::Duty gates(int axis, std::string* complaint) const;
  void advance(int axis, host_sim::chip::Time when);
  void move_pins(int axis);
  std::uint32_t door_address() const;

  double pwm_period_s_, dead_time_s_;
  std::array<hal::Duty, 2> last_{};  // of the period just over
  std::array<std::int64_t, 2> edges_{};
  std::array<std::uint16_t, 2> counter_{};
  std::array<std::uint32_t, 2> pulses_{};
  std::array<host_sim::chip::Time, 2> advanced_{};  // until when each axis' motor has come
};

}  // namespace boards

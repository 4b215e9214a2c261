// SPDX-License-Identifier: MIT
// The driver on this board: who is called when.
//
//   ADC interrupt   20 kHz per axis, alternating   fast lane: sample -> Driver -> duty; feeds the window watchdog
//   EXTI            index pulse                    rotor zero
//   EXTI 16         supply falls                   gates off, last heat into the journal
//   main loop       every 1 ms (SysTick wakes it)  slow conversions, door; every 10 ms the slow lane; feeds the IWDG
//
// The IWDG is fed only when both fast lanes and the slow lane have moved on, the WWDG only from the fast lane of axis 1
// when axis 0 has run since: a hang of either lane resets the chip, and reset opens the gates.
#pragma once

#include <atomic>
#include <cstdint>

#include "boards/h8-15d/door.hpp"
#include "boards/h8-15d/power_stage.hpp"
#include "boards/h8-15d/store.hpp"
#include "firmware/driver.hpp"

namespace h8_15d {

class Application {
 public:
  explicit Application(const firmware::DriverSetup& setup)
      : driver_(setup),
        pole_pairs_{setup.axes[0].parameters.pole_pairs_count, setup.axes[1].parameters.pole_pairs_count} {}

  void prepare(std::uint32_t reset_flags, bool clock_good);
  [[noreturn]] void run();

  void control();                                                         // ADC interrupt
  void index(int axis);                                                   // EXTI
  void supply_falls();                                                    // PVD
  void tick() { milliseconds_.fetch_add(1, std::memory_order_relaxed); }  // SysTick

 private:
  void find_rotor(int axis);
  void every_ms(std::uint32_t ms);
  void slow_lane();
  void read_slow_channel();
  void look_at_door();
  void recall_heat(std::uint32_t reset_flags);
  HeatRecord heat_now() const;

  firmware::Driver driver_;
  float pole_pairs_[2];
  PowerStage stage_;
  std::atomic<std::uint32_t> milliseconds_{0};
  std::atomic<std::uint32_t> fast_ticks_[2]{};
  std::uint32_t fast_fed_ = 0, fed_[2]{}, slow_ticks_ = 0, slow_fed_ = 0, slow_ms_ = 0;
  bool index_seen_[2]{};
  bool good_ = false, clock_good_ = false;
  int slow_channel_ = 0, force_axis_ = 0;
  hal::Temperature housing_[2]{}, power_stage_{};
  std::uint32_t door_serial_ = 0, door_wish_ = 0;
  std::uint32_t journal_at_ = 0, journal_room_ = 0, heat_serial_ = 0;
  std::uint8_t reset_flags_ = 0;
};

}  // namespace h8_15d

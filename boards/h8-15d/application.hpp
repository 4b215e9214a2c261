// SPDX-License-Identifier: MIT
// The driver on this board: who is called when.
//
//   ADC interrupt   20 kHz per axis, alternating   fast lane: sample -> Driver -> duty; feeds the window watchdog
//   EXTI            index pulse                    rotor zero
//   OTG_FS          a packet, or a ms of the bus   requests, setpoints, telemetry: below the fast lane, above the slow
//   EXTI 16         supply falls                   gates off, last heat into the journal
//   main loop       every 1 ms (SysTick wakes it)  slow conversions, door, errands of USB; feeds the IWDG
//                   every 10 ms                    slow lane
//
// The IWDG is fed only when both fast lanes and the slow lane have moved on, the WWDG only from the fast lane of axis 1
// when axis 0 has run since: a hang of either lane resets the chip, and reset opens the gates.
#pragma once

#include <atomic>
#include <cstdint>

#include "boards/h8-15d/door.hpp"
#include "boards/h8-15d/heat_keeper.hpp"
#include "boards/h8-15d/power_stage.hpp"
#include "boards/h8-15d/store.hpp"
#include "boards/h8-15d/usb_controller.hpp"
#include "firmware/link/link.hpp"
#include "firmware/link/text_port.hpp"
#include "firmware/parameter_store.hpp"
#include "firmware/usb/device.hpp"
#include "firmware/version.hpp"

namespace h8_15d {

class Application {
 public:
  Application();

  void prepare(std::uint32_t reset_flags, bool clock_good);
  [[noreturn]] void run();

  void control();                                                         // ADC interrupt
  void index(int axis);                                                   // EXTI
  void usb() { usb_port_.serve(usb_); }                                   // OTG_FS
  void supply_falls();                                                    // PVD
  void tick() { milliseconds_.fetch_add(1, std::memory_order_relaxed); }  // SysTick

 private:
  void find_rotor(int axis);
  void follow_commit();
  bool agrees_with_hall(int axis, std::uint32_t slipped) const;
  void every_ms(std::uint32_t ms);
  void slow_lane();
  void read_slow_channel();
  void look_at_door();
  void obey_door(const volatile Door& in);
  wire::Answer obey_order(const Door& in);
  void remember();

  FlashStore<parameter_sectors> parameter_flash_;
  firmware::ParameterStore parameters_{rating};
  wire::Answer found_;  // what the saved parameters were worth
  firmware::Driver driver_;
  HeatKeeper keeper_;
  firmware::Recorder recorder_;
  char serial_[25]{};  // the chip's unique id: 24 digits
  firmware::usb::Identity identity_{"h8-15d", firmware::version, serial_};
  firmware::Link link_{driver_, recorder_, parameters_, identity_};
  firmware::TextPort text_{link_};
  UsbController usb_port_;
  firmware::usb::Device<UsbController, firmware::Link, firmware::TextPort> usb_{usb_port_, identity_, link_, text_};
  bool usb_connected_ = false;
  PowerStage stage_;
  std::atomic<std::uint32_t> milliseconds_{0};
  std::atomic<std::uint32_t> fast_ticks_[2]{};
  std::uint32_t fast_fed_ = 0, fed_[2]{}, slow_ticks_ = 0, slow_ms_ = 0;
  bool index_seen_[2]{}, on_hall_[2]{};
  std::uint32_t found_with_[2][2]{};  // pole pairs and offset, as bits, that the encoder's zero was found with
  bool good_ = false, clock_good_ = false;
  int slow_channel_ = 0, force_axis_ = 0, slow_wait_ms_ = 0;
  hal::Temperature housing_[2]{}, power_stage_{};
  std::uint32_t door_serial_ = 0, door_wish_ = 0, door_order_ = 0;
};

}  // namespace h8_15d

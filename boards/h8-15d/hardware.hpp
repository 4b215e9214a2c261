// SPDX-License-Identifier: MIT
// Everything of the chip that is set up once: clocks, pins, supply watch, backup memory, encoders, watchdogs, flash
// writing. Values come from board.hpp. Each function leaves its part ready or says that it could not. Not for an ISR,
// except where it says so.
#pragma once

#include <cstdint>

#include "boards/h8-15d/board.hpp"

namespace h8_15d {

/// HSE, PLL, prescalers, wait states, CSS. False: the crystal does not start; the chip stays on HSI and must not arm.
[[nodiscard]] bool bring_up_clocks();

/// Gate drivers off first, then every pin of the schematic.
void bring_up_pins();

void bring_up_supply_watch();  // PVD at 2.9 V to EXTI16
void bring_up_backup_ram();
void bring_up_encoders();
void bring_up_usb_pins();  // and the clock of OTG_FS
void bring_up_cycle_counter();
void bring_up_interrupts(std::uint32_t core_Hz);
void start_watchdogs(bool fast_lane);  // the window watchdog watches the fast lane, if there is one
void wait_for_supply();                // returns when the logic supply is above the PVD threshold

inline void feed_iwdg() { reg(iwdg::kr) = 0xAAAA; }                        // 21.4.1
inline void feed_wwdg() { reg(wwdg::cr) = bit(7) | (0x3F + wwdg_steps); }  // 22.6.1: WDGA, T; ISR

/// Until `let_in`, this interrupt waits; what raised it meanwhile is remembered (PM0214 4.3.3, 4.3.2).
inline void hold_off(const Priority& p) {
  reg(system::nvic_icer + 4 * static_cast<std::uint32_t>(p.irq / 32)) = bit(p.irq % 32);
  asm volatile("dsb\nisb" ::: "memory");  // from the next instruction on, 4.3.11 there
}
inline void let_in(const Priority& p) {
  asm volatile("" ::: "memory");
  reg(system::nvic_iser + 4 * static_cast<std::uint32_t>(p.irq / 32)) = bit(p.irq % 32);
}

inline void write_pin(Pin p, bool high) {
  reg(gpio::base(p.port) + gpio::bsrr) = high ? bit(p.number) : bit(p.number + 16);
}
inline bool read_pin(Pin p) { return (reg(gpio::base(p.port) + gpio::idr) & bit(p.number)) != 0; }

/// Both bridges open and both gate drivers off, from anywhere, with nothing but stores.
void all_gates_off();

/// Programs one word of erased flash and reads it back. Only with both bridges open: the core stands still for 16..100
/// us. ISR only for the last record when the supply goes.
bool program_flash(std::uint32_t address, std::uint32_t word);
/// Takes a second or two; only before the watchdogs run.
bool erase_sector(std::uint32_t sector);

}  // namespace h8_15d

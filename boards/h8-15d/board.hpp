// SPDX-License-Identifier: MIT
// The schematic of the H8-15D, as code: every pin, every divider, every time. STM32F405RG (LQFP64), two axes, 48 V,
// 46 x 36 mm. Power-stage numbers are design values of our own, not of a built board; README.md lists them with the
// parts they assume. What contradicts itself does not compile (the static_asserts at the end). Registers:
// registers.hpp.
#pragma once

#include <cstdint>

#include "boards/dual_48v_20a.hpp"
#include "boards/h8-15d/registers.hpp"

namespace h8_15d {

inline constexpr firmware::BoardRating rating = boards::dual_48V_20A;

// ---- clocks (RM0090 7.2, Figure 21) ---------------------------------------------------------------------------------
inline constexpr std::uint32_t hsi_Hz = 16'000'000;  // 7.2.2, until the crystal runs
inline constexpr std::uint32_t hse_Hz = 8'000'000;   // crystal Y1
inline constexpr std::uint32_t pll_m = 4, pll_n = 168, pll_p = 2, pll_q = 7;
inline constexpr std::uint32_t vco_Hz = hse_Hz / pll_m * pll_n;  // 336 MHz
inline constexpr std::uint32_t hclk_Hz = vco_Hz / pll_p;         // 168 MHz
inline constexpr std::uint32_t pclk1_Hz = hclk_Hz / 4, pclk2_Hz = hclk_Hz / 2;
inline constexpr std::uint32_t usb_Hz = vco_Hz / pll_q;  // 48 MHz
inline constexpr std::uint32_t timer_Hz = 2 * pclk2_Hz;  // TIM1, TIM8: doubled behind the prescaler
inline constexpr std::uint32_t adc_Hz = pclk2_Hz / 6;    // 14 MHz: 144 cycles then suffice for VREFINT
inline constexpr std::uint32_t flash_wait_states = 5;    // 3.5.1, Table 10: 2.7..3.6 V, above 150 MHz

// ---- pins -----------------------------------------------------------------------------------------------------------
struct Pin {
  char port;
  int number;
};

struct AxisPins {
  Pin high[3], low[3];  // gate inputs: CHx, CHxN
  Pin fault;            // BKIN: open-drain nFAULT of the gate driver, low = fault
  Pin enable;           // gate driver; 10 kohm to ground keeps it off whenever the pin floats
  Pin encoder_a, encoder_b, index, hall[3];
  std::uint32_t bridge_af, fault_af, encoder_af;  // datasheet table 9
};

inline constexpr AxisPins pins[2] = {
    {.high = {{'A', 8}, {'A', 9}, {'A', 10}},
     .low = {{'B', 13}, {'B', 14}, {'B', 15}},
     .fault = {'B', 12},
     .enable = {'B', 9},
     .encoder_a = {'B', 4},
     .encoder_b = {'B', 5},
     .index = {'B', 3},
     .hall = {{'C', 10}, {'C', 11}, {'C', 12}},
     .bridge_af = 1,
     .fault_af = 1,
     .encoder_af = 2},
    {.high = {{'C', 6}, {'C', 7}, {'C', 8}},
     .low = {{'A', 7}, {'B', 0}, {'B', 1}},
     .fault = {'A', 6},
     .enable = {'B', 2},
     .encoder_a = {'B', 6},
     .encoder_b = {'B', 7},
     .index = {'B', 8},
     .hall = {{'B', 10}, {'B', 11}, {'D', 2}},
     .bridge_af = 3,
     .fault_af = 3,
     .encoder_af = 2},
};
inline constexpr Pin usb_dm{'A', 11}, usb_dp{'A', 12};  // AF10; VBUS is not sensed, PA9 belongs to TIM1
inline constexpr Pin led{'C', 13}, force_select{'C', 9};
// Analog: PA0..5, PC0..5. Channel numbers as on the ADCs (datasheet table 7).
inline constexpr Pin analog_pins[] = {{'A', 0}, {'A', 1}, {'A', 2}, {'A', 3}, {'A', 4}, {'A', 5},
                                      {'C', 0}, {'C', 1}, {'C', 2}, {'C', 3}, {'C', 4}, {'C', 5}};

// ---- analog: who converts what --------------------------------------------------------------------------------------
/// Phase a on ADC1, b on ADC2, c on ADC3: the three of an axis are sampled at the same instant.
inline constexpr std::uint32_t phase_channel[2][3] = {{0, 1, 2}, {10, 11, 12}};
inline constexpr std::uint32_t bus_V_channel = 3;   // PA3, ADC1 and once more on ADC3
inline constexpr std::uint32_t bus_A_channel = 13;  // PC3, ADC2
inline constexpr std::uint32_t ntc_channel[2] = {4, 5}, board_ntc_channel = 14, force_channel = 15,
                               vrefint_channel = 17;

inline constexpr float vdda_V = 3.3f;
inline constexpr float adc_counts = 4096.0f;
inline constexpr float shunt_ohm = 0.002f, shunt_gain = 20.0f;  // low side of each phase; zero at VDDA/2
inline constexpr float A_per_count = vdda_V / adc_counts / (shunt_ohm * shunt_gain);
inline constexpr float current_zero_counts = 2048.0f;
inline constexpr float full_scale_A = current_zero_counts * A_per_count;  // 41 A
inline constexpr float bus_V_per_count = vdda_V / adc_counts * 20.0f;     // 190 kohm over 10 kohm
inline constexpr float bus_shunt_ohm = 0.001f, bus_shunt_gain = 40.0f;
inline constexpr float bus_A_per_count = vdda_V / adc_counts / (bus_shunt_ohm * bus_shunt_gain);
inline constexpr float bus_zero_counts = 1024.0f;  // VDDA/4: -20 A .. +62 A
inline constexpr float ntc_ohm = 10e3f, ntc_beta_K = 3950.0f, ntc_pull_up_ohm = 10e3f;
inline constexpr int encoder_counts = 4096;  // per turn, 1024 lines

// ---- times ----------------------------------------------------------------------------------------------------------
inline constexpr std::uint32_t pwm_Hz = 20'000;
inline constexpr std::uint32_t reload = timer_Hz / pwm_Hz / 2;  // 4200: counts up and down
inline constexpr std::uint32_t dead_counts = 84;                // DTG, CKD = 0: 84 / 168 MHz = 500 ns
inline constexpr std::uint32_t sample_cycles = 3;               // SMPx = 0, 13.13.5
inline constexpr std::uint32_t conversion_cycles = 12;          // 12 bits, 13.5
/// Channel 4 fires this long before the top, so that the sample closes in the middle of the zero vector.
inline constexpr std::uint32_t sample_lead = sample_cycles * timer_Hz / adc_Hz;
inline constexpr float amplifier_settling_s = 1.0e-6f;  // to 1 %, INA240 class

inline constexpr std::uint32_t usb_connect_ms = 30;  // device mode is forced for 25 ms by then, 34.16.2

inline constexpr std::uint32_t cycles_per_period = hclk_Hz / pwm_Hz;

// ---- watchdogs ------------------------------------------------------------------------------------------------------
inline constexpr std::uint32_t lsi_slowest_Hz = 17'000, lsi_fastest_Hz = 47'000;  // datasheet, LSI characteristics
inline constexpr std::uint32_t iwdg_reload = 147;                                 // x 4 / LSI: 12.6 .. 34.8 ms
inline constexpr std::uint32_t wwdg_steps = 16;                                   // x 4096 / PCLK1: 1.56 ms

// ---- flash: image in sectors 0..4, then parameters and journal (3.4, Table 5)
// ------------------------------------------
inline constexpr std::uint32_t sector_bytes = 128 * 1024;
inline constexpr std::uint32_t parameter_sectors[2] = {5, 6}, journal_sectors[2] = {7, 8};
constexpr std::uint32_t sector_address(std::uint32_t sector) { return 0x08020000u + (sector - 5) * sector_bytes; }

// ---- interrupt priorities: lower preempts (16 levels, PM0214 4.3.7)
// ------------------------------------------------------
struct Priority {
  int irq;  // RM0090 12.2, Table 61
  std::uint32_t level;
};
inline constexpr Priority pvd_irq{1, 0};            // supply goes: gates off, nothing may hold it up
inline constexpr Priority index0_irq{9, 1};         // EXTI3: reads a counter, 1.5 us per count at 1000 rad/s
inline constexpr Priority index1_irq{23, 1};        // EXTI9_5
inline constexpr Priority adc_irq{18, 2};           // the fast lane of both axes
inline constexpr Priority usb_irq{67, 8};           // above the slow lane: a setpoint that came is in force next period
inline constexpr std::uint32_t systick_level = 14;  // the clock of the main loop, where the slow lane runs

// ---- what must fit together
// -------------------------------------------------------------------------------------------
static_assert(hclk_Hz == 168'000'000 && pclk1_Hz <= 42'000'000 && pclk2_Hz <= 84'000'000 && usb_Hz == 48'000'000);
static_assert(vco_Hz >= 100'000'000 && vco_Hz <= 432'000'000 && hse_Hz / pll_m >= 1'000'000 &&
              hse_Hz / pll_m <= 2'000'000);
static_assert(adc_Hz <= 36'000'000 && 144 * 1'000'000u / (adc_Hz / 1000u) >= 10'000, "VREFINT needs 10 us of sampling");
static_assert(static_cast<float>(pwm_Hz) == rating.pwm_Hz && reload * 2 * pwm_Hz == timer_Hz);
static_assert(full_scale_A > 1.2f * rating.trip_A, "a trip must be seen before the amplifier saturates");
static_assert(4095.0f * bus_V_per_count > 1.1f * rating.bus_max_V);
static_assert(static_cast<float>(dead_counts) / static_cast<float>(timer_Hz) == rating.dead_time_s);
static_assert(0.5f * rating.sampling_window_s > rating.dead_time_s + amplifier_settling_s +
                                                    static_cast<float>(sample_cycles) / static_cast<float>(adc_Hz),
              "a shunt must settle and be sampled before the middle of its window");
static_assert(2e6f * static_cast<float>(sample_cycles + conversion_cycles) / static_cast<float>(adc_Hz) <
                  0.5e6f / rating.pwm_Hz,
              "two conversions must end before the other axis begins");
static_assert((iwdg_reload + 1) * 4'000u / lsi_slowest_Hz < 35 && (iwdg_reload + 1) * 4'000u / lsi_fastest_Hz >= 12);
static_assert(wwdg_steps * 4096u < pclk1_Hz / 500, "a hang of the fast lane: gates off within 2 ms");
static_assert(pvd_irq.level < index0_irq.level && index0_irq.level < adc_irq.level && adc_irq.level < usb_irq.level &&
              usb_irq.level < systick_level);

}  // namespace h8_15d

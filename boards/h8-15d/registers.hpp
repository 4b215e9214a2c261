// SPDX-License-Identifier: MIT
// The registers of the STM32F405 that this board touches, each with its section of RM0090 (DM00031020) or of the
// Armv7-M Architecture Reference Manual. Addresses only; what a bit means stands where it is used.
#pragma once

#include <cstdint>

namespace h8_15d {

inline volatile std::uint32_t& reg(std::uint32_t address) {
  return *reinterpret_cast<volatile std::uint32_t*>(address);
}
inline volatile std::uint8_t& byte_reg(std::uint32_t address) {
  return *reinterpret_cast<volatile std::uint8_t*>(address);
}
inline void set(std::uint32_t address, std::uint32_t bits) { reg(address) = reg(address) | bits; }
inline void clear(std::uint32_t address, std::uint32_t bits) { reg(address) = reg(address) & ~bits; }

constexpr std::uint32_t bit(int n) { return 1u << n; }

namespace rcc {                                       // 7.3
inline constexpr std::uint32_t cr = 0x40023800;       // 7.3.1
inline constexpr std::uint32_t pllcfgr = 0x40023804;  // 7.3.2
inline constexpr std::uint32_t cfgr = 0x40023808;     // 7.3.3
inline constexpr std::uint32_t cir = 0x4002380C;      // 7.3.4
inline constexpr std::uint32_t ahb1enr = 0x40023830;  // 7.3.10
inline constexpr std::uint32_t ahb2enr = 0x40023834;  // 7.3.11
inline constexpr std::uint32_t apb1enr = 0x40023840;  // 7.3.13
inline constexpr std::uint32_t apb2enr = 0x40023844;  // 7.3.14
inline constexpr std::uint32_t csr = 0x40023874;      // 7.3.21
}  // namespace rcc

namespace flash {                                  // 3.9
inline constexpr std::uint32_t acr = 0x40023C00;   // 3.9.1
inline constexpr std::uint32_t keyr = 0x40023C04;  // 3.9.2
inline constexpr std::uint32_t sr = 0x40023C0C;    // 3.9.4
inline constexpr std::uint32_t cr = 0x40023C10;    // 3.9.5
}  // namespace flash

namespace pwr {                                   // 5.4
inline constexpr std::uint32_t cr = 0x40007000;   // 5.4.1
inline constexpr std::uint32_t csr = 0x40007004;  // 5.4.2
}  // namespace pwr

namespace gpio {  // 8.4; ports A.. are 0x400 apart
constexpr std::uint32_t base(char port) { return 0x40020000u + 0x400u * static_cast<std::uint32_t>(port - 'A'); }
inline constexpr std::uint32_t moder = 0x00;    // 8.4.1
inline constexpr std::uint32_t ospeedr = 0x08;  // 8.4.3
inline constexpr std::uint32_t pupdr = 0x0C;    // 8.4.4
inline constexpr std::uint32_t idr = 0x10;      // 8.4.5
inline constexpr std::uint32_t bsrr = 0x18;     // 8.4.7
inline constexpr std::uint32_t afrl = 0x20;     // 8.4.9
}  // namespace gpio

namespace syscfg {
inline constexpr std::uint32_t exticr1 = 0x40013808;  // 9.2.3
inline constexpr std::uint32_t exticr3 = 0x40013810;  // 9.2.5
}  // namespace syscfg

namespace exti {                                   // 12.3
inline constexpr std::uint32_t imr = 0x40013C00;   // 12.3.1
inline constexpr std::uint32_t rtsr = 0x40013C08;  // 12.3.3
inline constexpr std::uint32_t pr = 0x40013C14;    // 12.3.6
}  // namespace exti

namespace adc {  // 13.13; units are 0x100 apart
constexpr std::uint32_t base(int unit) { return 0x40012000u + 0x100u * static_cast<std::uint32_t>(unit - 1); }
inline constexpr std::uint32_t sr = 0x00;     // 13.13.1
inline constexpr std::uint32_t cr1 = 0x04;    // 13.13.2
inline constexpr std::uint32_t cr2 = 0x08;    // 13.13.3
inline constexpr std::uint32_t smpr1 = 0x0C;  // 13.13.4
inline constexpr std::uint32_t smpr2 = 0x10;  // 13.13.5
inline constexpr std::uint32_t htr = 0x24;    // 13.13.7
inline constexpr std::uint32_t ltr = 0x28;    // 13.13.8
inline constexpr std::uint32_t sqr3 = 0x34;   // 13.13.11
inline constexpr std::uint32_t jsqr = 0x38;   // 13.13.12
inline constexpr std::uint32_t jdr1 = 0x3C;   // 13.13.13
inline constexpr std::uint32_t jdr2 = 0x40;
inline constexpr std::uint32_t dr = 0x4C;         // 13.13.14
inline constexpr std::uint32_t ccr = 0x40012304;  // 13.13.16, common
}  // namespace adc

namespace tim {  // 17.4 (TIM1, TIM8), 18.4 (TIM3, TIM4)
inline constexpr std::uint32_t tim1 = 0x40010000, tim8 = 0x40010400, tim3 = 0x40000400, tim4 = 0x40000800;
inline constexpr std::uint32_t cr1 = 0x00;    // 17.4.1
inline constexpr std::uint32_t cr2 = 0x04;    // 17.4.2
inline constexpr std::uint32_t smcr = 0x08;   // 17.4.3
inline constexpr std::uint32_t sr = 0x10;     // 17.4.5
inline constexpr std::uint32_t egr = 0x14;    // 17.4.6
inline constexpr std::uint32_t ccmr1 = 0x18;  // 17.4.7
inline constexpr std::uint32_t ccmr2 = 0x1C;  // 17.4.8
inline constexpr std::uint32_t ccer = 0x20;   // 17.4.9
inline constexpr std::uint32_t cnt = 0x24;    // 17.4.10
inline constexpr std::uint32_t arr = 0x2C;    // 17.4.12
inline constexpr std::uint32_t rcr = 0x30;    // 17.4.13
inline constexpr std::uint32_t ccr1 = 0x34;   // 17.4.14
inline constexpr std::uint32_t ccr4 = 0x40;   // 17.4.17
inline constexpr std::uint32_t bdtr = 0x44;   // 17.4.18
}  // namespace tim

namespace iwdg {                                  // 21.4
inline constexpr std::uint32_t kr = 0x40003000;   // 21.4.1
inline constexpr std::uint32_t pr = 0x40003004;   // 21.4.2
inline constexpr std::uint32_t rlr = 0x40003008;  // 21.4.3
inline constexpr std::uint32_t sr = 0x4000300C;   // 21.4.4
}  // namespace iwdg

namespace wwdg {                                  // 22.6
inline constexpr std::uint32_t cr = 0x40002C00;   // 22.6.1
inline constexpr std::uint32_t cfr = 0x40002C04;  // 22.6.2
}  // namespace wwdg

namespace otg_fs {                                    // 34.16
inline constexpr std::uint32_t gahbcfg = 0x50000008;  // 34.16.2, core global registers
inline constexpr std::uint32_t gusbcfg = 0x5000000C;
inline constexpr std::uint32_t grstctl = 0x50000010;
inline constexpr std::uint32_t gintsts = 0x50000014;
inline constexpr std::uint32_t gintmsk = 0x50000018;
inline constexpr std::uint32_t grxstsp = 0x50000020;
inline constexpr std::uint32_t grxfsiz = 0x50000024;
inline constexpr std::uint32_t dieptxf0 = 0x50000028;
inline constexpr std::uint32_t gccfg = 0x50000038;
inline constexpr std::uint32_t dieptxf1 = 0x50000104;  // 2 and 3 follow
inline constexpr std::uint32_t dcfg = 0x50000800;      // 34.16.4, device mode registers
inline constexpr std::uint32_t dctl = 0x50000804;
inline constexpr std::uint32_t diepmsk = 0x50000810;
inline constexpr std::uint32_t doepmsk = 0x50000814;
inline constexpr std::uint32_t daint = 0x50000818;
inline constexpr std::uint32_t daintmsk = 0x5000081C;
constexpr std::uint32_t in(int n) { return 0x50000900 + 0x20 * static_cast<std::uint32_t>(n); }
constexpr std::uint32_t out(int n) { return 0x50000B00 + 0x20 * static_cast<std::uint32_t>(n); }
inline constexpr std::uint32_t ctl = 0x00, intr = 0x08, siz = 0x10;                                  // of one endpoint
constexpr std::uint32_t fifo(int n) { return 0x50001000 + 0x1000 * static_cast<std::uint32_t>(n); }  // 34.16.1
}  // namespace otg_fs

inline constexpr std::uint32_t backup_ram = 0x40024000, backup_ram_bytes = 4096;  // 2.3, 5.1.2
inline constexpr std::uint32_t unique_id = 0x1FFF7A10;                            // 39.1, 96 bits
inline constexpr std::uint32_t vrefint_cal = 0x1FFF7A2A;  // STM32F405 datasheet, VREFIN_CAL at 3.3 V

namespace system {  // Armv7-M ARM B3
inline constexpr std::uint32_t systick_csr = 0xE000E010, systick_rvr = 0xE000E014, systick_cvr = 0xE000E018;  // B3.3
inline constexpr std::uint32_t nvic_iser = 0xE000E100, nvic_icer = 0xE000E180, nvic_ipr = 0xE000E400;         // B3.4
inline constexpr std::uint32_t vtor = 0xE000ED08, aircr = 0xE000ED0C, shpr3_systick = 0xE000ED23,
                               cpacr = 0xE000ED88;                                                  // B3.2
inline constexpr std::uint32_t demcr = 0xE000EDFC, dwt_ctrl = 0xE0001000, dwt_cyccnt = 0xE0001004;  // C1.6, C1.8
}  // namespace system

}  // namespace h8_15d

// SPDX-License-Identifier: MIT
// Bits, FIFO words and times of OTG_FS that its two halves share: registers (otg.cpp) and cable (otg_cable.cpp).
#pragma once

#include <cstdint>
#include <string>

#include "host-sim/chip/trouble.hpp"

namespace host_sim::chip::otg_bits {

constexpr std::uint32_t bit(int n) { return 1u << n; }
// Endpoint control, RM0090 34.16.4.
inline constexpr std::uint32_t usbaep = bit(15), dpid = bit(16), naksts = bit(17), stall_bit = bit(21), cnak = bit(26),
                               snak = bit(27), sd0pid = bit(28), sd1pid = bit(29), epdis = bit(30), epena = bit(31);
// Endpoint interrupts.
inline constexpr std::uint32_t xfrc = bit(0), epdisd = bit(1), stup = bit(3), otepdis = bit(4), ittxfe = bit(4),
                               inepne = bit(6);
// Core interrupts; what is cleared by writing 1.
inline constexpr std::uint32_t sof = bit(3), rxflvl = bit(4), ginakeff = bit(6), gonakeff = bit(7), esusp = bit(10),
                               usbsusp = bit(11), usbrst = bit(12), enumdne = bit(13), iepint = bit(18),
                               oepint = bit(19), wkupint = bit(31);
inline constexpr std::uint32_t cleared_by_one = 0xF030FC0A;
// RX FIFO status, GRXSTSP.PKTSTS.
enum Status : std::uint32_t { out_nak = 1, out_data = 2, out_done = 3, setup_done = 4, setup_data = 6 };

inline constexpr std::uint32_t fifo_words = 320;   // 1.25 KiB, 34.11
inline constexpr std::uint32_t setup_words = 10;   // always kept free for three SETUP packets, 34.11.1
inline constexpr Time force_time = from_s(25e-3);  // GUSBCFG.FDMOD, 34.16.2
inline constexpr Time reset_time = from_s(10e-3);  // USB 2.0 7.1.7.5, the shortest a port drives
inline constexpr Time frame_time = from_s(1e-3), idle_time = from_s(3e-3);  // USB 2.0 7.1.7.6
inline constexpr Time core_reset_time = from_s(3 / 48e6);                   // three PHY clocks

inline std::string endpoint(bool in, int n) {
  return std::string(in ? "IN" : "OUT") + " endpoint " + std::to_string(n) + ": ";
}

}  // namespace host_sim::chip::otg_bits

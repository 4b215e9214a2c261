// SPDX-License-Identifier: MIT
// Deliberate mistakes in the USB driver, made on the way of its writes over the bus (as mutation_test.cpp does for the
// power stage). The examination below, which the healthy image passes, has to notice each of them.
#include <cstdio>

#include "tests/chip/plugged.hpp"

namespace image_tests {
namespace {

using host_sim::chip::Mutation;
using wire::Kind;

constexpr std::uint32_t otg = 0x50000000, rcc_ahb2enr = 0x40023834, gpioa_moder = 0x40020000, gpioa_afrh = 0x40020024,
                        rcc_pllcfgr = 0x40023804, nvic_iser2 = 0xE000E108;
constexpr std::uint32_t in_0 = otg + 0x900, out_0 = otg + 0xB00;

/// Bits cleared and set in what is written to one register, or to the same one of all four endpoints.
Mutation bits(const char* name, std::uint32_t address, std::uint32_t clear, std::uint32_t set = 0, bool all = false) {
  Mutation m;
  m.name = name;
  m.on_write = [=](std::uint32_t at, std::uint32_t& value) {
    if (at == address || (all && at >= address && at < address + 0x80 && (at - address) % 0x20 == 0))
      value = (value & ~clear) | set;
    return true;
  };
  return m;
}
/// Writes that hold any of these bits (0: all writes) get lost.
Mutation lost(const char* name, std::uint32_t address, std::uint32_t with = 0, bool all = false) {
  Mutation m;
  m.name = name;
  m.on_write = [=](std::uint32_t at, std::uint32_t& value) {
    const bool here = at == address || (all && at >= address && at < address + 0x80 && (at - address) % 0x20 == 0);
    return !(here && (with == 0 || (value & with)));
  };
  return m;
}

std::vector<Mutation> mutations() {
  return {
      bits("clock of OTG_FS off", rcc_ahb2enr, 1u << 7),
      bits("PLLQ = 8: 42 MHz", rcc_pllcfgr, 0xFu << 24, 8u << 24),
      bits("D+ has another function", gpioa_afrh, 0xFu << 16, 9u << 16),
      bits("D- left an input", gpioa_moder, 3u << 22),
      bits("interrupt never enabled", nvic_iser2, 1u << 3),
      bits("global interrupt gate closed", otg + 0x008, 1),
      bits("VBUS sensed", otg + 0x038, 1u << 21),
      bits("transceiver off", otg + 0x038, 1u << 16),
      bits("soft disconnect never lifted", otg + 0x804, 0, 2),
      bits("device mode not forced", otg + 0x00C, 1u << 30),
      bits("turnaround time 5", otg + 0x00C, 0xFu << 10, 5u << 10),
      bits("high speed asked of the full-speed PHY", otg + 0x800, 3),
      bits("receive FIFO of 16 words", otg + 0x024, 0xFFFF, 16),
      bits("transmit FIFO 0 in the receive FIFO", otg + 0x028, 0xFFFF, 100),
      bits("transmit FIFO 1 where FIFO 0 lies", otg + 0x104, 0xFFFF, 130),
      bits("transmit FIFO 1 of 8 words", otg + 0x104, 0xFFFFu << 16, 8u << 16),
      bits("transmit FIFO 3 beyond the memory", otg + 0x10C, 0xFFFF, 310),
      bits("receive interrupt masked", otg + 0x018, 1u << 4),
      bits("bus reset interrupt masked", otg + 0x018, 1u << 12),
      bits("IN interrupts masked", otg + 0x018, 1u << 18),
      bits("OUT interrupts masked", otg + 0x018, 1u << 19),
      bits("end of SETUP masked", otg + 0x814, 1u << 3),
      bits("end of OUT transfers masked", otg + 0x814, 1),
      bits("end of IN transfers masked", otg + 0x810, 1),
      bits("endpoint 1 masked", otg + 0x81C, 1u << 1 | 1u << 17),
      lost("bus reset never acknowledged", otg + 0x014, 1u << 12),
      lost("address never written", otg + 0x800, 0x7F0),
      bits("address one too high", otg + 0x800, 0, 1u << 4),
      bits("no SETUP expected", out_0 + 0x10, 3u << 29),
      bits("no packet announced on OUT", out_0 + 0x10, 1u << 19, 0, true),
      bits("32 bytes announced on OUT", out_0 + 0x10, 0x7F, 32, true),
      bits("no packet announced on IN", in_0 + 0x10, 3u << 19, 0, true),
      bits("one byte more announced on IN", in_0 + 0x10, 1, 1, true),
      bits("NAK never cleared on IN", in_0, 1u << 26, 0, true),
      bits("NAK never cleared on OUT", out_0, 1u << 26, 0, true),
      bits("toggles of IN not set back", in_0, 1u << 28, 0, true),
      bits("toggles of OUT not set back", out_0, 1u << 28, 0, true),
      bits("endpoint 1 never activated", in_0 + 0x20, 1u << 15),
      bits("FIFO number 0 for all", in_0, 0xFu << 22, 0, true),
      bits("stall never set on IN", in_0, 1u << 21, 0, true),
      bits("stall never lifted on IN", in_0, 0, 1u << 21, true),
      bits("packets of 8 bytes on endpoint 0", in_0, 3, 3),
      lost("IN completion never acknowledged", in_0 + 8, 1, true),
      lost("OUT completion never acknowledged", out_0 + 8, 1, true),
      lost("SETUP never acknowledged", out_0 + 8, 8),
      lost("transmit FIFOs never flushed", otg + 0x010, 1u << 5),
      bits("endpoints disabled without SNAK", in_0, 1u << 27, 0, true),
      lost("global OUT NAK never asked for", otg + 0x804, 1u << 9),
      lost("global OUT NAK never lifted", otg + 0x804, 1u << 10),
  };
}

// Not in the list: leaving out the core's soft reset, which after power-on changes nothing that could be seen.

/// What a healthy image can do. Empty: it did; else what went wrong first.
std::string examine(const Mutation* mutation) {
  Plugged p;
  if (mutation) {
    p.pcb->chip.mutate(*mutation);
    p.pcb->power_on();
  }
  const auto hello = [&] {
    const auto h = Plugged::as<wire::Hello>(p.ask(Kind::hello));
    return h.answer.status == 0 && std::string(h.board) == "h8-15d";
  };
  const auto passes = [&]() -> std::string {
    for (int round = 0; round < 2; ++round) {
      if (!p.configure()) return "does not enumerate";
      for (int k = 0; k < 3; ++k) {
        if (!hello()) return "does not answer";
      }
      if (p.host.control(0xC0, 0x77, 0, 0, 64).outcome != Outcome::stalled)
        return "does not stall what it does not know";
      for (const std::uint16_t endpoint : {std::uint16_t{0x81}, std::uint16_t{0x01}}) {
        if (p.host.control(0x02, 3, 0, endpoint, 0).outcome != Outcome::done) return "SET_FEATURE fails";
        if (p.host.wait_for(bulk(endpoint == 0x81, {1}, 64, 9)).outcome != Outcome::stalled) return "does not halt";
        if (p.host.control(0x02, 1, 0, endpoint, 0).outcome != Outcome::done) return "CLEAR_FEATURE fails";
      }
      if (!hello()) return "does not come back from a halt";
      if (p.ask(Kind::disarm, wire::Axes{3}).empty()) return "does not answer in one packet";  // toggles: an odd number
      if (p.ask(Kind::setpoint, wire::Setpoints{}).empty()) return "does not take a longer frame";
      Transfer line = bulk(false, {'s', 't', 'a', 't', 'e', '\r'}, 0, 3), said = bulk(true, {}, 512, 4);
      line.endpoint = said.endpoint = 3;
      if (p.host.wait_for(line).outcome != Outcome::done || p.host.wait_for(said).bytes.empty()) return "no text port";
      // An answer left in its FIFO, a read of endpoint 0 that the host gives up: then a bus reset.
      p.host.wait_for(bulk(false, encoded(Kind::hello, 77, nullptr, 0), 0, 1));
      p.host.submit([] {
        Transfer t;
        t.id = 5;
        t.in = true;
        t.setup = {0x80, 6, 0, 2, 0, 0, 200, 0};
        t.wanted = 200;
        return t;
      }());
      std::vector<Transfer> finished;
      for (int k = 0; k < 3; ++k) p.host.turn(finished);
      p.host.forget();
    }
    if (p.host.toggle_errors()) return "data toggles differ";
    return "";
  };
  std::string wrong = passes();
  if (wrong.empty() && p.pcb->chip.resets() > 0) wrong = "resets itself";
  if (wrong.empty() && p.pcb->chip.troubles().count()) wrong = p.pcb->chip.troubles().list().front().what;
  return wrong;
}

TEST(UsbMutation, TheHealthyImagePassesTheExamination) {
  NEEDS_IMAGE(image);
  EXPECT_EQ(examine(nullptr), "");
}

TEST(SlowUsbMutation, AlmostEveryMistakeInTheUsbDriverIsCaught) {
  NEEDS_IMAGE(image);
  int caught = 0, all = 0;
  for (const Mutation& m : mutations()) {
    const std::string wrong = examine(&m);
    std::printf("%-6s %-46s %s\n", wrong.empty() ? "MISSED" : "caught", m.name.c_str(), wrong.c_str());
    caught += !wrong.empty();
    ++all;
  }
  std::printf("%d of %d caught\n", caught, all);
  EXPECT_GE(caught * 100, all * 95);
}

}  // namespace
}  // namespace image_tests

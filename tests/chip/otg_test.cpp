// SPDX-License-Identifier: MIT
// The model of OTG_FS forgives nothing: a driver that does it right passes in silence, and each mistake that silicon
// would answer with a device that does not appear, or hangs on some hosts, is named. Registers are touched over the
// bus.
#include <gtest/gtest.h>

#include "host-sim/chip/chip.hpp"

namespace host_sim::chip {
namespace {

constexpr std::uint32_t rcc = 0x40023800, gpioa = 0x40020000, otg = OtgFs::address;
constexpr std::uint32_t in_0 = otg + OtgFs::in_base, out_0 = otg + OtgFs::out_base, in_1 = in_0 + 0x20,
                        out_1 = out_0 + 0x20, fifo_0 = otg + OtgFs::fifo_base, fifo_1 = fifo_0 + 0x1000;
constexpr std::uint32_t epena = 1u << 31, epdis = 1u << 30, sd0pid = 1u << 28, snak = 1u << 27, cnak = 1u << 26,
                        usbaep = 1u << 15, bulk = 2u << 18, stall = 1u << 21, one_packet = 1u << 19;

struct Otg : ::testing::Test {
  Otg() {
    const std::uint32_t vectors[3] = {0x20010000, 0x08000009, 0xE7FEE7FE};  // b .
    chip.flash.load(0x08000000, vectors, sizeof vectors);
    chip.power_on();
    write(rcc, read(rcc) | 1u << 16);  // HSE, then the PLL with 336 MHz / 7
    chip.run_for(5e-3);
    write(rcc + 4, (read(rcc + 4) & 0xF0BC8000) | 7u << 24 | 1u << 22 | 168u << 6 | 4);
    write(rcc, read(rcc) | 1u << 24);
    chip.run_for(1e-3);
    write(rcc + 0x30, 1u << 20 | 1);
    write(rcc + 0x34, 1u << 7);
  }
  void write(std::uint32_t address, std::uint32_t value) { chip.bus_write(address, value, 4); }
  std::uint32_t read(std::uint32_t address) { return chip.bus_read(address, 4); }
  void give_pins() {
    write(gpioa + 0x24, 10u << 12 | 10u << 16);
    write(gpioa + 0x00, read(gpioa) | 2u << 22 | 2u << 24);
  }
  void prepare(double forced_s = 26e-3) {
    write(otg + 0x00C, 0x00000A40u | 1u << 30);  // GUSBCFG: FDMOD
    chip.run_for(forced_s);
    write(otg + 0x00C, 0x00000040u | 1u << 30 | 6u << 10);  // TRDT = 6
    write(otg + 0x804, 2);                                  // DCTL: SDIS
    write(otg + 0x800, 0x02200003);                         // DCFG: full speed
    write(otg + 0x024, 128);
    for (std::uint32_t n = 0; n < 4; ++n) write(n == 0 ? otg + 0x028 : otg + 0x100 + 4 * n, 16u << 16 | (128 + 16 * n));
    write(otg + 0x010, 0x10u << 6 | 1u << 5);
    write(otg + 0x018, 1u << 4 | 1u << 12 | 1u << 18 | 1u << 19);
    write(otg + 0x038, 1u << 21);
  }
  void attach() {
    write(otg + 0x038, 1u << 21 | 1u << 16);
    write(otg + 0x804, 0);
  }
  void come_up() {
    give_pins();
    prepare();
    attach();
    chip.otg.plug();
    chip.otg.bus_reset();
    write(otg + 0x014, 1u << 12);
    write(out_0 + 0x10, 3u << 29);
    chip.run_for(11e-3);
  }
  void open_1() {
    write(in_1, snak | sd0pid | bulk | usbaep | 1u << 22 | 64);
    write(out_1, snak | sd0pid | bulk | usbaep | 64);
  }
  void send(std::uint32_t endpoint, std::uint32_t fifo, std::uint32_t bytes) {
    write(endpoint + 0x10, one_packet | bytes);
    write(endpoint, read(endpoint) | epena | cnak);
    for (std::uint32_t at = 0; at < bytes; at += 4) write(fifo, 0x04030201);
  }
  void arm(std::uint32_t endpoint) {
    write(endpoint + 0x10, one_packet | 64 | (endpoint == out_0 ? 3u << 29 : 0));
    write(endpoint, read(endpoint) | epena | cnak);
  }
  UsbAnswer::Kind out(int n, std::size_t bytes, bool data1 = false) {
    const std::vector<std::uint8_t> data(bytes, 0x55);
    return chip.otg.out(0, n, data1, data.data(), data.size()).kind;
  }
  testing::AssertionResult complains(const std::string& part) {
    if (chip.troubles().mention(part)) return testing::AssertionSuccess();
    return testing::AssertionFailure() << "no word about '" << part << "'; said:\n" << chip.report_text();
  }
  Chip chip;
};

#define SILENT() EXPECT_EQ(chip.troubles().count(), 0u) << chip.report_text()

TEST_F(Otg, AControlTransferAndBulkPacketsPassInSilenceWhenDoneRight) {
  come_up();
  ASSERT_TRUE(chip.otg.ready());
  EXPECT_EQ(chip.otg.setup(0, {0x80, 6, 0, 1, 0, 0, 64, 0}).kind, UsbAnswer::ack);
  EXPECT_EQ(chip.otg.in(0, 0).kind, UsbAnswer::nak) << "a SETUP sets NAK on both sides";
  EXPECT_EQ(read(otg + 0x020) >> 17 & 0xF, 6u);
  EXPECT_EQ(read(fifo_0), 0x01000680u);
  EXPECT_EQ(read(fifo_0), 0x00400000u);
  EXPECT_EQ(read(otg + 0x020) >> 17 & 0xF, 4u);
  EXPECT_TRUE(read(out_0 + 8) & 8) << "STUP comes with the end of the SETUP phase";
  write(out_0 + 8, 8);
  arm(out_0);
  send(in_0, fifo_0, 18);
  const UsbAnswer data = chip.otg.in(0, 0);
  EXPECT_EQ(data.bytes.size(), 18u);
  EXPECT_EQ(data.bytes[17], 2);
  EXPECT_EQ(out(0, 0, true), UsbAnswer::ack);
  EXPECT_EQ(read(otg + 0x020) >> 17 & 0xF, 2u);
  EXPECT_EQ(read(otg + 0x020) >> 17 & 0xF, 3u);
  EXPECT_TRUE(read(out_0 + 8) & 1);
  open_1();
  EXPECT_EQ(out(1, 64), UsbAnswer::nak);
  arm(out_1);
  EXPECT_EQ(out(1, 64), UsbAnswer::ack);
  EXPECT_EQ(out(1, 64, true), UsbAnswer::nak) << "one packet was asked for";
  send(in_1, fifo_1, 64);
  EXPECT_FALSE(chip.otg.in(0, 1).data1);
  send(in_1, fifo_1, 0);
  const UsbAnswer zero = chip.otg.in(0, 1);
  EXPECT_EQ(zero.kind, UsbAnswer::ack);
  EXPECT_TRUE(zero.data1 && zero.bytes.empty());
  SILENT();
}

TEST_F(Otg, HalfADriverIsNoDevice) {
  chip.otg.plug();
  prepare();
  EXPECT_FALSE(chip.otg.attached()) << "soft disconnect";
  attach();
  EXPECT_TRUE(complains("PA11 and PA12 are not OTG_FS's"));
}

TEST_F(Otg, ComingTooEarlyOrSensingTheWrongPinIsAMistake) {
  give_pins();
  prepare(24e-3);
  for (const std::uint32_t of_device_mode : {otg + 0x00C, otg + 0x800}) {
    chip.clear_troubles();
    write(of_device_mode, read(of_device_mode) ^ 1u << 10);
    EXPECT_TRUE(complains("before device mode was forced for 25 ms (FDMOD)")) << std::hex << of_device_mode;
  }
  write(otg + 0x038, 1u << 16);
  write(otg + 0x804, 0);
  EXPECT_TRUE(complains("VBUS is sensed on PA9"));
}

TEST_F(Otg, WithoutIts48MHzItIsDeaf) {
  write(rcc, read(rcc) & ~(1u << 24));
  chip.run_for(1e-3);
  write(otg + 0x024, 128);
  EXPECT_TRUE(complains("48 MHz"));
}

TEST_F(Otg, ReservedBitsAndUnknownRegistersAreMistakes) {
  write(otg + 0x008, 1u << 6);
  EXPECT_TRUE(complains("reserved bit of OTG_FS_GAHBCFG"));
  read(otg + 0x400);
  EXPECT_TRUE(complains("does not exist"));
}

/// RM0090 Rev 21, 34.16.2: reset value 0x0000 0A40; PHYSEL (bit 6) is always 1 and read-only.
TEST_F(Otg, TheTransceiverSelectIsAlwaysOne) {
  EXPECT_EQ(read(otg + 0x00C), 0x0A40u);
  write(otg + 0x00C, 0);
  EXPECT_EQ(read(otg + 0x00C), 0x0040u);
}

TEST_F(Otg, ABusResetClosesEndpointsAndTheAddressIsTheFirmwaresToForget) {
  come_up();
  open_1();
  EXPECT_EQ(chip.otg.setup(0, {0x00, 5, 9, 0, 0, 0, 0, 0}).kind, UsbAnswer::ack);
  write(otg + 0x800, 0x02200003 | 9u << 4);
  send(in_0, fifo_0, 0);
  EXPECT_EQ(chip.otg.in(0, 0).kind, UsbAnswer::ack) << "the status stage still has the old address";
  EXPECT_EQ(chip.otg.in(0, 0).kind, UsbAnswer::none);
  EXPECT_EQ(chip.otg.in(9, 0).kind, UsbAnswer::nak);
  chip.otg.bus_reset();
  chip.run_for(11e-3);
  EXPECT_FALSE(read(in_1) & usbaep);
  EXPECT_EQ(chip.otg.setup(0, {0x80, 6, 0, 1, 0, 0, 64, 0}).kind, UsbAnswer::none) << "still at address 9";
  write(otg + 0x800, 0x02200003 | 4u << 4);
  EXPECT_TRUE(complains("outside SET_ADDRESS"));
}

TEST_F(Otg, ASetupNeedsItsCount) {
  come_up();
  write(out_0 + 0x10, 0);
  chip.otg.setup(0, {0x80, 6, 0, 1, 0, 0, 64, 0});
  EXPECT_TRUE(complains("STUPCNT was 0"));
}

TEST_F(Otg, EndpointsEnabledWrongAreMistakes) {
  come_up();
  send(in_1, fifo_1, 4);
  EXPECT_TRUE(complains("IN endpoint 1: enabled without USBAEP"));
  chip.clear_troubles();
  write(out_1, snak | bulk | usbaep | 64);
  write(out_1 + 0x10, one_packet | 64);
  write(out_1, read(out_1) | epena);
  EXPECT_TRUE(complains("EPENA while NAK stays set"));
  chip.clear_troubles();
  write(out_1 + 0x10, one_packet | 64);
  EXPECT_TRUE(complains("size written while its transfer is enabled"));
}

TEST_F(Otg, SizesThatDoNotFitAreMistakes) {
  come_up();
  open_1();
  write(out_1 + 0x10, one_packet | 32);
  write(out_1, read(out_1) | epena | cnak);
  EXPECT_TRUE(complains("transfer size and packet count do not fit"));
  EXPECT_EQ(out(1, 64), UsbAnswer::ack);
  EXPECT_TRUE(complains("packet longer than DOEPTSIZ"));
  write(in_1 + 0x10, 0);
  write(in_1, read(in_1) | epena | cnak);
  EXPECT_TRUE(complains("enabled for no packet"));
}

TEST_F(Otg, TheTransmitFifoIsGuardedAtBothEnds) {
  come_up();
  open_1();
  write(fifo_1, 0);
  EXPECT_TRUE(complains("FIFO written while not enabled"));
  send(in_1, fifo_1, 4);
  write(fifo_1, 0);
  EXPECT_TRUE(complains("more data than DIEPTSIZ announced"));
  chip.clear_troubles();
  write(in_1, read(in_1) | epdis);
  EXPECT_TRUE(complains("EPDIS without SNAK"));
  write(in_1, read(in_1) | snak);
  write(in_1, read(in_1) | snak | epdis);
  EXPECT_TRUE(read(in_1 + 8) & 2);
  chip.clear_troubles();
  send(in_1, fifo_1, 4);
  EXPECT_TRUE(complains("old data in its TX FIFO")) << "disabled, but not flushed";
}

TEST_F(Otg, FifosThatOverlapAreMistakes) {
  come_up();
  write(otg + 0x104, 16u << 16 | 130);  // in FIFO 0
  open_1();
  send(in_1, fifo_1, 4);
  EXPECT_TRUE(complains("overlaps that of endpoint 0"));
  write(in_1, read(in_1) | snak);
  write(in_1, read(in_1) | snak | epdis);
  write(otg + 0x010, 1u << 6 | 1u << 5);
  write(otg + 0x104, 16u << 16 | 310);
  send(in_1, fifo_1, 4);
  EXPECT_TRUE(complains("beyond the 320 words"));
}

TEST_F(Otg, TheReceiveFifoWantsToBeReadInOrder) {
  come_up();
  read(otg + 0x020);
  EXPECT_TRUE(complains("GRXSTSP read while the RX FIFO is empty"));
  open_1();
  arm(out_1);
  EXPECT_EQ(out(1, 8), UsbAnswer::ack);
  read(otg + 0x020);
  read(fifo_0);
  read(otg + 0x020);
  EXPECT_TRUE(complains("half read"));
  read(fifo_0);
  EXPECT_TRUE(complains("beyond the packet"));
}

TEST_F(Otg, AnOutEndpointIsDisabledOnlyUnderTheGlobalNak) {
  come_up();
  open_1();
  arm(out_1);
  write(out_1, read(out_1) | snak | epdis);
  EXPECT_TRUE(complains("global OUT NAK"));
  chip.clear_troubles();
  write(otg + 0x804, 1u << 9);
  EXPECT_EQ(read(otg + 0x020) >> 17 & 0xF, 1u);
  EXPECT_TRUE(read(otg + 0x014) & 1u << 7);
  write(out_1, read(out_1) | snak | epdis);
  write(otg + 0x804, 1u << 10);
  EXPECT_FALSE(read(out_1) & epena);
  SILENT();
}

TEST_F(Otg, AStallHoldsUntilItIsLiftedButASetupEndsThatOfEndpoint0) {
  come_up();
  open_1();
  write(in_1, read(in_1) | stall);
  EXPECT_EQ(chip.otg.in(0, 1).kind, UsbAnswer::stall);
  write(in_1, read(in_1) & ~stall);
  EXPECT_EQ(chip.otg.in(0, 1).kind, UsbAnswer::nak);
  write(in_0, read(in_0) | stall);
  EXPECT_EQ(chip.otg.in(0, 0).kind, UsbAnswer::stall);
  chip.otg.setup(0, {0x80, 6, 0, 1, 0, 0, 64, 0});
  EXPECT_EQ(chip.otg.in(0, 0).kind, UsbAnswer::nak);
  SILENT();
}

TEST_F(Otg, ARepeatedPacketIsAcknowledgedAndThrownAway) {
  come_up();
  open_1();
  arm(out_1);
  EXPECT_EQ(out(1, 8, true), UsbAnswer::ack) << "DATA1 where DATA0 was due";
  EXPECT_FALSE(read(otg + 0x014) & 1u << 4) << "nothing in the FIFO";
  EXPECT_EQ(out(1, 8, false), UsbAnswer::ack);
  EXPECT_TRUE(read(otg + 0x014) & 1u << 4);
}

TEST_F(Otg, AQuietBusIsASuspendedOneAndAPulledCableLooksTheSame) {
  come_up();
  write(otg + 0x014, 0xFFFFFFFF);
  chip.run_for(5e-3);
  EXPECT_FALSE(read(otg + 0x014) & 1u << 11) << "a frame each ms keeps it awake";
  EXPECT_TRUE(read(otg + 0x014) & 1u << 3);
  chip.otg.suspend();
  chip.run_for(4e-3);
  EXPECT_TRUE(read(otg + 0x014) & 1u << 11);
  EXPECT_EQ(chip.otg.in(0, 0).kind, UsbAnswer::none);
  chip.otg.resume();
  EXPECT_TRUE(read(otg + 0x014) & 1u << 31);
  write(otg + 0x014, 0xFFFFFFFF);
  chip.otg.unplug();
  chip.run_for(4e-3);
  EXPECT_TRUE(read(otg + 0x014) & 1u << 11);
}

}  // namespace
}  // namespace host_sim::chip

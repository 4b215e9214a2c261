// SPDX-License-Identifier: MIT
#include "boards/h8-15d/usb_controller.hpp"

#include <cstring>

#include "boards/h8-15d/hardware.hpp"

namespace h8_15d {
namespace {

using namespace otg_fs;

// GINTSTS, 34.16.2.
constexpr std::uint32_t sof = bit(3), rxflvl = bit(4), gonakeff = bit(7), usbsusp = bit(11), usbrst = bit(12),
                        enumdne = bit(13), iepint = bit(18), oepint = bit(19), wkupint = bit(31);
// Endpoint control and interrupts, 34.16.4.
constexpr std::uint32_t usbaep = bit(15), stalled = bit(21), cnak = bit(26), snak = bit(27), sd0pid = bit(28),
                        epdis = bit(30), epena = bit(31);
constexpr std::uint32_t xfrc = bit(0), epdisd = bit(1), stup = bit(3), inepne = bit(6);
constexpr std::uint32_t one_packet = 1u << 19, three_setups = 3u << 29;

/// FIFO memory, 320 words (34.11): for receiving 10 words for SETUPs and, of each OUT endpoint, a packet with its
/// status and end; for each IN endpoint the one packet that may be on its way.
constexpr std::uint32_t rx_words = 128, tx_words = hal::usb_packet_bytes / 4;
static_assert(rx_words >= 10 + 4 * (tx_words + 2) + 1 && rx_words + 4 * tx_words <= 320);

constexpr std::uint32_t patience = 2000;  // polls: some 100 us; a packet takes 50 us

bool wait_until(std::uint32_t address, std::uint32_t bits, bool up) {
  for (std::uint32_t i = 0; i < patience; ++i) {
    if (((reg(address) & bits) != 0) == up) return true;
  }
  return false;
}

void flush_tx(int n) {
  reg(grstctl) = static_cast<std::uint32_t>(n) << 6 | bit(5);  // TXFNUM, TXFFLSH
  wait_until(grstctl, bit(5), false);
}

constexpr bool is_in(std::uint8_t endpoint) { return (endpoint & hal::endpoint_in) != 0; }
constexpr int number(std::uint8_t endpoint) { return endpoint & 3; }

}  // namespace

void UsbController::set_up() {
  bring_up_usb_pins();
  wait_until(grstctl, bit(31), true);  // AHBIDL
  reg(grstctl) = bit(0);               // CSRST
  wait_until(grstctl, bit(0), false);
  wait_until(grstctl, bit(31), true);
  set(gusbcfg, bit(30));  // FDMOD
  reg(gccfg) = bit(21);   // NOVBUSSENS, transceiver off
}

/// What may be written in device mode only: TRDT (34.16.2), the registers of 34.16.4.
void UsbController::prepare_device() {
  reg(gusbcfg) = (reg(gusbcfg) & ~(0xFu << 10)) | 6u << 10;  // TRDT for AHB above 32 MHz, Table 204
  set(dctl, bit(1));                                         // SDIS
  set(dcfg, 3);                                              // DSPD: full speed, internal PHY
  reg(grxfsiz) = rx_words;
  reg(dieptxf0) = tx_words << 16 | rx_words;
  for (std::uint32_t n = 1; n < endpoints; ++n)
    reg(dieptxf1 + 4 * (n - 1)) = tx_words << 16 | (rx_words + n * tx_words);
  flush_tx(0x10);         // all
  reg(grstctl) = bit(4);  // RXFFLSH
  wait_until(grstctl, bit(4), false);
  reg(diepmsk) = xfrc;
  reg(doepmsk) = xfrc | stup;
  reg(daintmsk) = 0x000F000F;
  reg(gintsts) = sof | usbsusp | usbrst | enumdne | wkupint;
  reg(gintmsk) = sof | rxflvl | usbsusp | usbrst | enumdne | iepint | oepint | wkupint;
  reg(gahbcfg) = 1;  // GINTMSK: interrupts may go out
}

void UsbController::connect(bool on) noexcept {
  if (on) {
    prepare_device();
    set(gccfg, bit(16));  // PWRDWN = 1: transceiver on
    clear(dctl, bit(1));  // SDIS
  } else {
    set(dctl, bit(1));
    clear(gccfg, bit(16));
  }
}

/// To be written before the status packet is handed over, which the host still fetches at the old address: the core
/// sees to that (34.17.5, SetAddress command).
void UsbController::set_address(std::uint8_t address) noexcept {
  reg(dcfg) = (reg(dcfg) & ~(0x7Fu << 4)) | static_cast<std::uint32_t>(address & 0x7F) << 4;
}

void UsbController::open(std::uint8_t endpoint, hal::EndpointKind kind, std::uint16_t bytes) noexcept {
  const int n = number(endpoint);
  const auto txfnum = static_cast<std::uint32_t>(n);
  const std::uint32_t shape = snak | sd0pid | usbaep | static_cast<std::uint32_t>(kind) << 18 | bytes;
  if (is_in(endpoint)) {
    disable_in(n);
    reg(in(n) + ctl) = shape | txfnum << 22;
  } else {
    disable_out(n);
    reg(out(n) + ctl) = shape;
  }
}

void UsbController::close_all() noexcept {
  for (int n = 1; n < endpoints; ++n) {
    disable_in(n);
    disable_out(n);
    reg(in(n) + ctl) = 0;
    reg(out(n) + ctl) = 0;
  }
}

void UsbController::stall(std::uint8_t endpoint) noexcept {
  const int n = number(endpoint);
  if (n == 0 || is_in(endpoint)) {
    disable_in(n);
    set(in(n) + ctl, stalled);
  }
  if (n == 0 || !is_in(endpoint)) set(out(n) + ctl, stalled);
}

void UsbController::unstall(std::uint8_t endpoint) noexcept {
  const int n = number(endpoint);
  const std::uint32_t where = is_in(endpoint) ? in(n) : out(n);
  is_in(endpoint) ? disable_in(n) : disable_out(n);
  reg(where + ctl) = (reg(where + ctl) & ~stalled) | sd0pid;
}

void UsbController::send(std::uint8_t endpoint, const std::uint8_t* data, std::size_t bytes) noexcept {
  const int n = number(endpoint);
  if (bytes > hal::usb_packet_bytes || (reg(in(n) + ctl) & epena)) return;
  reg(in(n) + siz) = one_packet | static_cast<std::uint32_t>(bytes);
  set(in(n) + ctl, epena | cnak);
  for (std::size_t at = 0; at < bytes; at += 4) {
    std::uint32_t word = 0;
    std::memcpy(&word, data + at, bytes - at < 4 ? bytes - at : 4);
    reg(fifo(n)) = word;
  }
}

void UsbController::arm_out(std::uint8_t endpoint) noexcept {
  const int n = number(endpoint);
  if (reg(out(n) + ctl) & epena) return;
  reg(out(n) + siz) = (n == 0 ? three_setups : 0) | one_packet | hal::usb_packet_bytes;
  set(out(n) + ctl, epena | cnak);
}

/// 34.17.6, "IN endpoint disable".
void UsbController::disable_in(int n) {
  const std::uint32_t where = in(n);
  if (reg(where + ctl) & epena) {
    set(where + ctl, snak);
    wait_until(where + intr, inepne, true);
    set(where + ctl, epdis | snak);
    wait_until(where + intr, epdisd, true);
  }
  reg(where + intr) = xfrc | epdisd | inepne;
  flush_tx(n);
}

/// 34.17.6, "Disabling an OUT endpoint": only while the global OUT NAK holds, which comes through the receive FIFO
/// behind the packets that were there first.
void UsbController::disable_out(int n) {
  const std::uint32_t where = out(n);
  if (reg(where + ctl) & epena) {
    set(dctl, bit(9));  // SGONAK
    for (std::uint32_t i = 0; i < patience && !(reg(gintsts) & gonakeff); ++i) {
      if (reg(gintsts) & rxflvl) take_from_fifo();
    }
    if (reg(where + ctl) & epena) {
      set(where + ctl, epdis | snak);
      wait_until(where + intr, epdisd, true);
    }
    set(dctl, bit(10));  // CGONAK
  }
  reg(where + intr) = xfrc | epdisd;
}

/// After a bus reset (34.17.5): nothing is armed or on its way, address 0, endpoint 0 hears SETUPs.
void UsbController::forget_bus() {
  disable_in(0);
  for (int n = 0; n < endpoints; ++n) set(out(n) + ctl, snak);
  close_all();
  set_address(0);
  reg(out(0) + siz) = three_setups;
}

void UsbController::take_from_fifo() {
  enum : std::uint32_t { out_data = 2, setup_data = 6 };  // PKTSTS
  const std::uint32_t status = reg(grxstsp);
  const std::uint32_t what = status >> 17 & 0xF, bytes = status >> 4 & 0x7FF;
  const int n = number(static_cast<std::uint8_t>(status));
  if (what == setup_data) {
    for (std::uint32_t& word : setup_) word = reg(fifo(0));
  } else if (what == out_data) {
    received_bytes_[n] = static_cast<std::uint8_t>(bytes <= hal::usb_packet_bytes ? bytes : 0);
    for (std::uint32_t at = 0; at < bytes; at += 4) {
      const std::uint32_t word = reg(fifo(0));
      if (at < hal::usb_packet_bytes) received_[n][at / 4] = word;
    }
  }
}

UsbController::Event UsbController::next_of_endpoints() {
  const std::uint32_t waiting = reg(daint);
  for (int n = 0; n < endpoints; ++n) {
    if (!(waiting & bit(n))) continue;
    reg(in(n) + intr) = xfrc;
    return {Event::in_done, static_cast<std::uint8_t>(n | hal::endpoint_in)};
  }
  for (int n = 0; n < endpoints; ++n) {
    if (!(waiting & bit(16 + n))) continue;
    if (reg(out(n) + intr) & xfrc) {
      reg(out(n) + intr) = xfrc;
      return {Event::out, static_cast<std::uint8_t>(n), reinterpret_cast<const std::uint8_t*>(received_[n]),
              received_bytes_[n]};
    }
    reg(out(n) + intr) = stup;
    disable_in(0);  // an answer that the host no longer wants
    reg(out(0) + siz) = three_setups;
    return {Event::setup, 0, reinterpret_cast<const std::uint8_t*>(setup_)};
  }
  return {Event::bookkeeping};
}

UsbController::Event UsbController::next() {
  const std::uint32_t now = reg(gintsts) & reg(gintmsk);
  if (now & usbrst) {
    reg(gintsts) = usbrst;
    forget_bus();
    return {Event::reset};
  }
  if (now & (iepint | oepint)) return next_of_endpoints();  // what is older than the packets still in the FIFO
  if (now & rxflvl) {
    take_from_fifo();
    return {Event::bookkeeping};
  }
  constexpr struct {
    std::uint32_t flag;
    Event::Kind kind;
  } of_the_bus[] = {
      {enumdne, Event::bookkeeping}, {wkupint, Event::resume}, {usbsusp, Event::suspend}, {sof, Event::start_of_frame}};
  for (const auto& [flag, kind] : of_the_bus) {
    if (!(now & flag)) continue;
    reg(gintsts) = flag;
    return {kind};
  }
  return {Event::nothing};
}

}  // namespace h8_15d

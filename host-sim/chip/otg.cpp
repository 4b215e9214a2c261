// SPDX-License-Identifier: MIT
#include "host-sim/chip/otg.hpp"

#include <algorithm>
#include <cmath>

#include "host-sim/chip/otg_bits.hpp"

namespace host_sim::chip {
namespace {

using namespace otg_bits;

std::vector<Register> registers() {
  using O = OtgFs;
  std::vector<Register> map = {
      {O::gahbcfg, "OTG_FS_GAHBCFG", 0, 0x181, 0x181},
      {O::gusbcfg, "OTG_FS_GUSBCFG", 0x00000A40, 0xE0003FC7, 0xE0003F87},  // PHYSEL is read-only 1
      {O::grstctl, "OTG_FS_GRSTCTL", 0x80000000, 0x800007F7, 0},
      {O::gintsts, "OTG_FS_GINTSTS", 0x04000020, 0xF73CFCFF, 0},
      {O::gintmsk, "OTG_FS_GINTMSK", 0, 0xF73EFCFE, 0xF73EFCFE},
      {O::grxstsr, "OTG_FS_GRXSTSR", 0, 0x01FFFFFF, 0},
      {O::grxstsp, "OTG_FS_GRXSTSP", 0, 0x01FFFFFF, 0},
      {O::grxfsiz, "OTG_FS_GRXFSIZ", 0x200, 0xFFFF, 0xFFFF},
      {O::dieptxf0, "OTG_FS_DIEPTXF0", 0x02000200, 0xFFFFFFFF, 0xFFFFFFFF},
      {O::gccfg, "OTG_FS_GCCFG", 0, 0x003D0000, 0x003D0000},
      {O::cid, "OTG_FS_CID", 0x00001100, 0xFFFFFFFF, 0xFFFFFFFF},
      {O::dieptxf1, "OTG_FS_DIEPTXF1", 0x02000400, 0xFFFFFFFF, 0xFFFFFFFF},
      {O::dieptxf1 + 4, "OTG_FS_DIEPTXF2", 0x02000400, 0xFFFFFFFF, 0xFFFFFFFF},
      {O::dieptxf1 + 8, "OTG_FS_DIEPTXF3", 0x02000400, 0xFFFFFFFF, 0xFFFFFFFF},
      {O::dcfg, "OTG_FS_DCFG", 0x02200000, 0x1FF7, 0x1FF7},
      {O::dctl, "OTG_FS_DCTL", 0, 0xFFF, 0x873},
      {O::dsts, "OTG_FS_DSTS", 0x10, 0x003FFF1F, 0},
      {O::diepmsk, "OTG_FS_DIEPMSK", 0, 0x7B, 0x7B},
      {O::doepmsk, "OTG_FS_DOEPMSK", 0, 0x1B, 0x1B},
      {O::daint, "OTG_FS_DAINT", 0, 0x000F000F, 0},
      {O::daintmsk, "OTG_FS_DAINTMSK", 0, 0x000F000F, 0x000F000F},
      {O::diepempmsk, "OTG_FS_DIEPEMPMSK", 0, 0xF, 0xF},
      {O::pcgcctl, "OTG_FS_PCGCCTL", 0, 0x13, 0x3},
  };
  for (std::uint32_t n = 0; n < O::endpoints; ++n) {
    const std::uint32_t in = O::in_base + 0x20 * n, out = O::out_base + 0x20 * n;
    map.push_back({in, "OTG_FS_DIEPCTL", n ? 0 : usbaep, n ? 0xFFEF87FF : 0xCFEE8003, n ? 0x03EC87FFu : 0x03E00003u});
    map.push_back({in + 8, "OTG_FS_DIEPINT", 0x80, 0xDB, 0});
    map.push_back({in + 0x10, "OTG_FS_DIEPTSIZ", 0, n ? 0x7FFFFFFF : 0x0018007Fu, n ? 0x7FFFFFFF : 0x0018007Fu});
    map.push_back({in + 0x18, "OTG_FS_DTXFSTS", 0, 0xFFFF, 0});
    map.push_back({out, "OTG_FS_DOEPCTL", n ? 0 : usbaep, n ? 0xFC3F87FF : 0xCC3E8003, n ? 0x003C87FFu : 0x00300000u});
    map.push_back({out + 8, "OTG_FS_DOEPINT", 0x80, 0xDB, 0});
    map.push_back({out + 0x10, "OTG_FS_DOEPTSIZ", 0, n ? 0x7FFFFFFF : 0x6008007Fu, n ? 0x7FFFFFFF : 0x6008007Fu});
    map.push_back({O::fifo_base + 0x1000 * n, "OTG_FS FIFO", 0, 0xFFFFFFFF, 0});
  }
  return map;
}

}  // namespace

OtgFs::OtgFs(Host& host, Links links)
    : Device(host, "OTG_FS", address, registers(), 0x34, 7), links_(std::move(links)) {}

void OtgFs::reset() {
  Device::reset();
  core_reset();
  forced_at_ = 0;
  update();
}

/// What CSRST forgets: everything but GCCFG, PCGCCTL and the speed (34.16.2).
void OtgFs::core_reset() {
  pulled_up_ = enumerated_ = suspended_ = setup_open_ = setup_fresh_ = false;
  answers_to_ = 0;
  reset_ends_ = idle_since_ = never;
  in_ = {};
  rx_.clear();
  open_ = {};
  read_at_ = 0;
}

std::uint32_t OtgFs::packet_size(bool in, int n) const {
  if (n == 0) return 64u >> (peek(in_base) & 3);  // OUT 0 follows IN 0
  return peek(control(in, n)) & 0x7FF;
}

std::uint32_t OtgFs::tx_depth(int n) const {
  return peek(n == 0 ? dieptxf0 : dieptxf1 + 4 * static_cast<std::uint32_t>(n - 1)) >> 16;
}

std::uint32_t OtgFs::rx_used() const {
  const std::size_t left = open_.bytes.size() - std::min(open_.bytes.size(), read_at_);
  std::uint32_t words = static_cast<std::uint32_t>((left + 3) / 4);
  for (const Received& r : rx_) words += 1 + static_cast<std::uint32_t>((r.bytes.size() + 3) / 4);
  return words;
}

// ---- what the firmware sees -----------------------------------------------------------------------------------------

std::uint32_t OtgFs::endpoint_interrupts() const {
  std::uint32_t any = 0;
  for (int n = 0; n < endpoints; ++n) {
    const std::uint32_t in = peek(control(true, n) + 8), out = peek(control(false, n) + 8);
    const bool empty = (in & bit(7)) && (peek(diepempmsk) >> n & 1);
    if ((in & peek(diepmsk) & 0x7Bu) || empty) any |= bit(n);
    if (out & peek(doepmsk)) any |= bit(16 + n);
  }
  return any;
}

std::uint32_t OtgFs::interrupts() const {
  const std::uint32_t wanted = endpoint_interrupts() & peek(daintmsk);
  return peek(gintsts) | (rx_.empty() ? 0 : rxflvl) | (wanted & 0xFFFF ? iepint : 0) | (wanted >> 16 ? oepint : 0);
}

void OtgFs::update() {
  host_.set_line(irq, (peek(gahbcfg) & 1) && (interrupts() & peek(gintmsk)));
  host_.reschedule();
}

std::uint32_t OtgFs::on_read(std::uint32_t offset) {
  if (offset >= fifo_base) return pop_word(offset);
  switch (offset) {
    case grstctl:
      return bit(31) | (host_.now() < core_reset_ends_ ? 1u : 0u);
    case gintsts:
      return interrupts();
    case grxstsr:
      return rx_.empty() ? 0 : rx_.front().status;
    case grxstsp:
      return pop_status();
    case daint:
      return endpoint_interrupts();
    default:
      if (offset >= in_base && offset < in_base + 0x80 && (offset & 0x1F) == 0x18) {
        const auto n = static_cast<int>((offset - in_base) / 0x20);
        const auto used = static_cast<std::uint32_t>(in_[static_cast<std::size_t>(n)].fifo.size());
        return tx_depth(n) - std::min(tx_depth(n), used);
      }
      return peek(offset);
  }
}

std::uint32_t OtgFs::pop_status() {
  if (rx_.empty()) {
    trouble("GRXSTSP read while the RX FIFO is empty", grxstsp);
    return 0;
  }
  if (read_at_ < open_.bytes.size()) trouble("a packet was left half read in the RX FIFO", grxstsp);
  open_ = std::move(rx_.front());
  rx_.pop_front();
  read_at_ = 0;
  const auto n = static_cast<int>(open_.status & 0xF);
  switch (field(open_.status, 17, 4)) {
    case out_nak:
      at(gintsts) |= gonakeff;
      break;
    case setup_done:
      flags(false, 0) |= stup;
      at(control(false, 0)) &= ~epena;
      break;
    case out_done:
      flags(false, n) |= xfrc;
      at(control(false, n)) &= ~epena;
      break;
    default:
      break;
  }
  update();
  return open_.status;
}

std::uint32_t OtgFs::pop_word(std::uint32_t offset) {
  if (read_at_ >= open_.bytes.size()) {
    trouble("RX FIFO read beyond the packet", offset);
    return 0;
  }
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < 4 && read_at_ + i < open_.bytes.size(); ++i)
    word |= static_cast<std::uint32_t>(open_.bytes[read_at_ + i]) << 8 * i;
  read_at_ += 4;
  return word;
}

void OtgFs::on_write(std::uint32_t offset, std::uint32_t value) {
  if (std::abs(links_.usb_Hz() - 48e6) > 120e3) trouble("its 48 MHz clock is missing (PLLQ)", offset);
  if (host_.now() < core_reset_ends_) trouble("written while the core soft reset still runs", offset);
  if (offset != pcgcctl && (peek(pcgcctl) & 3)) trouble("written while PCGCCTL stops its clocks", offset);
  if (!in_device_mode() && ((offset >= dcfg && offset < fifo_base && offset != pcgcctl) ||
                            (offset == gusbcfg && ((value ^ peek(gusbcfg)) & 0xF << 10))))  // TRDT
    trouble("written before device mode was forced for 25 ms (FDMOD)", offset);
  if (offset >= fifo_base) {
    push(static_cast<int>((offset - fifo_base) / 0x1000), value);
  } else if (offset >= in_base && offset < out_base + 0x80) {
    const bool in = offset < out_base;
    const auto n = static_cast<int>((offset & 0x7F) / 0x20);
    switch (offset & 0x1F) {
      case 0:
        write_control(in, n, value);
        break;
      case 8:
        at(offset) &= ~(value & 0x5B);  // TXFE is a level
        break;
      case 0x10:
        // STUPCNT is written anew after a bus reset, whatever was armed before (34.17.5).
        if ((peek(control(in, n)) & epena) && !(!in && n == 0 && (peek(control(in, n)) & naksts)))
          trouble(endpoint(in, n) + "size written while its transfer is enabled", offset);
        keep(offset, value);
        break;
      default:
        trouble("write to a read-only register", offset);
    }
  } else {
    switch (offset) {
      case grstctl:
        write_reset_register(value);
        break;
      case gintsts:
        at(gintsts) &= ~(value & cleared_by_one);
        break;
      case gusbcfg:
        if ((value & bit(30)) && !(peek(gusbcfg) & bit(30))) forced_at_ = host_.now();
        keep(offset, value);
        break;
      case gccfg:
        keep(offset, value);
        check_attach();
        break;
      case dctl:
        write_dctl(value);
        break;
      case dcfg:
        if (((value ^ peek(dcfg)) & 0x7F0) && (value & 0x7F0) && !setup_open_)
          trouble("device address written outside SET_ADDRESS: it belongs between SETUP and status stage", offset);
        if (!(value & 0x7F0)) answers_to_ = 0;
        keep(offset, value);
        break;
      default:
        keep(offset, value);
        break;
    }
  }
  update();
}

void OtgFs::write_reset_register(std::uint32_t value) {
  if (value & 1) {
    const std::uint32_t kept[] = {peek(gccfg), peek(pcgcctl), peek(dcfg) & 3};
    Device::reset();
    core_reset();
    at(gccfg) = kept[0];
    at(pcgcctl) = kept[1];
    at(dcfg) |= kept[2];
    core_reset_ends_ = host_.now() + core_reset_time;
  }
  if (value & bit(4)) {
    rx_.clear();
    open_ = {};
    read_at_ = 0;
  }
  if (!(value & bit(5))) return;
  for (int n = 0; n < endpoints; ++n) {
    if (field(value, 6, 5) != 0x10 && field(value, 6, 5) != static_cast<std::uint32_t>(n)) continue;
    const std::uint32_t c = peek(control(true, n));
    if ((c & epena) && !(c & naksts))
      trouble(endpoint(true, n) + "TX FIFO flushed while the core may be sending from it", grstctl);
    in_[static_cast<std::size_t>(n)].fifo.clear();
  }
}

void OtgFs::write_dctl(std::uint32_t value) {
  keep(dctl, value);
  if (value & bit(7)) at(gintsts) |= ginakeff;
  if (value & bit(8)) at(gintsts) &= ~ginakeff;
  if (value & bit(9)) rx_.push_back({static_cast<std::uint32_t>(out_nak) << 17});
  if (value & bit(10)) at(gintsts) &= ~gonakeff;
  check_attach();
}

bool OtgFs::in_device_mode() const { return (peek(gusbcfg) & bit(30)) && host_.now() >= forced_at_ + force_time; }

/// The pull-up on D+ follows PWRDWN (which means powered) and soft disconnect.
void OtgFs::check_attach() {
  const bool up = (peek(gccfg) & bit(16)) && !(peek(dctl) & bit(1));
  if (up && !pulled_up_) {
    if (!(peek(gccfg) & bit(21))) trouble("VBUS is sensed on PA9, which is TIM1's (NOVBUSSENS is 0)", gccfg);
    if (!links_.pins()) trouble("attached, but PA11 and PA12 are not OTG_FS's (AF10)", gccfg);
    if ((peek(dcfg) & 3) != 3) trouble("attached with DSPD other than full speed on the internal PHY", dcfg);
    if (!in_device_mode()) trouble("attached before device mode was forced for 25 ms (FDMOD)", gusbcfg);
    if (field(peek(gusbcfg), 10, 4) != 6) trouble("TRDT is not 6, as AHB clocks above 32 MHz need", gusbcfg);
    idle_since_ = host_.now();
  }
  if (!up) {
    enumerated_ = false;
    idle_since_ = never;
  }
  pulled_up_ = up;
}

// ---- endpoints ------------------------------------------------------------------------------------------------------

void OtgFs::write_control(bool in, int n, std::uint32_t value) {
  const std::uint32_t where = control(in, n);
  const bool was_enabled = peek(where) & epena;
  if (!in && n == 0 && (value & epdis)) trouble("OUT endpoint 0 can't be disabled", where);
  keep(where, value);
  if (n == 0) at(where) |= usbaep;
  if (value & sd0pid && n) at(where) &= ~dpid;
  if (value & sd1pid && n) at(where) |= dpid;
  if (value & snak) {
    at(where) |= naksts;
    if (in) flags(true, n) |= inepne;
  }
  if (value & cnak) at(where) &= ~naksts;
  if ((value & epdis) && !(value & epena && !was_enabled)) {
    if (!was_enabled) {
      trouble(endpoint(in, n) + "EPDIS while it is not enabled", where);
    } else if (!(peek(where) & naksts)) {
      trouble(endpoint(in, n) + "EPDIS without SNAK before it", where);
    } else if (!in && !(peek(gintsts) & gonakeff)) {
      trouble(endpoint(in, n) + "EPDIS without the global OUT NAK in effect", where);
    } else {
      at(where) &= ~epena;
      flags(in, n) |= epdisd;
    }
  } else if (value & epena) {
    if (!was_enabled)
      enable(in, n, value);
    else if (value & (cnak | sd0pid))
      trouble(endpoint(in, n) + "enabled again before its transfer ended", where);
  }
}

void OtgFs::enable(bool in, int n, std::uint32_t value) {
  const std::uint32_t where = control(in, n);
  const std::uint32_t size = peek(where + 0x10), bytes = size & (n ? 0x7FFFFu : 0x7Fu);
  const std::uint32_t packets = field(size, 19, n ? 10 : in ? 2 : 1), largest = packet_size(in, n);
  if (!active(in, n)) trouble(endpoint(in, n) + "enabled without USBAEP", where);
  if (largest == 0 || largest > 64) trouble(endpoint(in, n) + "a full-speed packet holds 1 to 64 bytes", where);
  if (peek(where) & naksts) trouble(endpoint(in, n) + "EPENA while NAK stays set: it would never answer", where);
  if (packets == 0) trouble(endpoint(in, n) + "enabled for no packet", where);
  if (in ? bytes > packets * largest : bytes != packets * largest)
    trouble(endpoint(in, n) + "transfer size and packet count do not fit each other", where);
  at(where) |= epena;
  if (!in) return;
  if (field(value, 22, 4) != static_cast<std::uint32_t>(n))
    trouble(endpoint(in, n) + "TXFNUM names another endpoint's FIFO", where);
  check_fifos(n, where);
  In& side = in_[static_cast<std::size_t>(n)];
  if (!side.fifo.empty()) trouble(endpoint(in, n) + "enabled with old data in its TX FIFO", where);
  side.words = (bytes + 3) / 4;
}

/// The FIFOs that are in use lie in the 320 words and do not overlap (34.11).
void OtgFs::check_fifos(int n, std::uint32_t offset) {
  const auto span = [&](int k) {
    const std::uint32_t v = peek(k == 0 ? dieptxf0 : dieptxf1 + 4 * static_cast<std::uint32_t>(k - 1));
    return std::pair(v & 0xFFFF, (v & 0xFFFF) + (v >> 16));
  };
  const auto mine = span(n);
  if (mine.second - mine.first < 16 || (mine.second - mine.first) * 4 < packet_size(true, n))
    trouble(endpoint(true, n) + "its TX FIFO is smaller than 16 words or than its packets", offset);
  if (mine.second > fifo_words) trouble(endpoint(true, n) + "its TX FIFO lies beyond the 320 words", offset);
  if (mine.first < peek(grxfsiz)) trouble(endpoint(true, n) + "its TX FIFO lies in the RX FIFO", offset);
  for (int k = 0; k < endpoints; ++k) {
    const auto other = span(k);
    if (k != n && active(true, k) && mine.first < other.second && other.first < mine.second)
      trouble(endpoint(true, n) + "its TX FIFO overlaps that of endpoint " + std::to_string(k), offset);
  }
}

void OtgFs::push(int n, std::uint32_t word) {
  In& side = in_[static_cast<std::size_t>(n)];
  const std::uint32_t where = fifo_base + 0x1000 * static_cast<std::uint32_t>(n);
  if (!(peek(control(true, n)) & epena)) return trouble(endpoint(true, n) + "FIFO written while not enabled", where);
  if (side.words == 0) return trouble(endpoint(true, n) + "more data than DIEPTSIZ announced", where);
  if (side.fifo.size() >= tx_depth(n)) return trouble(endpoint(true, n) + "TX FIFO overrun", where);
  side.fifo.push_back(word);
  --side.words;
}

}  // namespace host_sim::chip

// SPDX-License-Identifier: MIT
#include "host-sim/chip/power.hpp"

namespace host_sim::chip {
namespace {

constexpr Register pwr_map[] = {{Pwr::cr, "PWR_CR", 0x4000, 0x43FF, 0x43F3},
                                {Pwr::csr, "PWR_CSR", 0, 0x430F, 0x0100}};  // RM0090 5.4
constexpr double pvd_V[] = {2.0, 2.1, 2.3, 2.5, 2.6, 2.7, 2.8, 2.9};        // PLS, falling, RM0090 5.4.1

constexpr Register iwdg_map[] = {  // RM0090 21.4
    {Iwdg::kr, "IWDG_KR", 0, 0xFFFF, 0},
    {Iwdg::pr, "IWDG_PR", 0, 0x7, 0x7},
    {Iwdg::rlr, "IWDG_RLR", 0xFFF, 0xFFF, 0xFFF},
    {Iwdg::sr, "IWDG_SR", 0, 0x3, 0}};

constexpr Register wwdg_map[] = {  // RM0090 22.6
    {Wwdg::cr, "WWDG_CR", 0x7F, 0xFF, 0xFF},
    {Wwdg::cfr, "WWDG_CFR", 0x7F, 0x3FF, 0x3FF},
    {Wwdg::sr, "WWDG_SR", 0, 0x1, 0x1}};

}  // namespace

Pwr::Pwr(Host& host, std::function<void(bool)> pvd_edge)
    : Device(host, "PWR", address, pwr_map, 0x40, 28), pvd_edge_(std::move(pvd_edge)) {}

void Pwr::reset() {
  const std::uint32_t kept = peek(csr) & 0x208;  // BRE and BRR live in the backup domain
  Device::reset();
  at(csr) |= kept;
  compare();
}

void Pwr::compare() {
  const bool low = (peek(cr) >> 4 & 1) && supply_V_ < pvd_V[field(peek(cr), 5, 3)];
  if (low == static_cast<bool>(peek(csr) >> 2 & 1)) return;
  at(csr) ^= 4;
  if (pvd_edge_) pvd_edge_(low);
}

void Pwr::set_supply(double volts) {
  supply_V_ = volts;
  compare();
}

void Pwr::on_write(std::uint32_t offset, std::uint32_t value) {
  if (offset == csr && ((value ^ peek(csr)) >> 9 & 1)) {
    if (!backup_writable()) return trouble("BRE is in the backup domain: PWR_CR.DBP first", offset);
    at(csr) = (peek(csr) & ~0x208u) | ((value >> 9 & 1) ? 0x208 : 0);  // BRR follows; its delay is not modelled
  }
  keep(offset, value);
  compare();
}

Iwdg::Iwdg(Host& host, std::function<void()> bite)
    : Device(host, "IWDG", address, iwdg_map, 0, -1), bite_(std::move(bite)) {}

void Iwdg::reset() {
  Device::reset();
  running_ = open_ = false;
  deadline_ = never;
  updated_ = 0;
}

double Iwdg::timeout_s() const {
  const int shift = static_cast<int>(std::min<std::uint32_t>(peek(pr), 6));
  return (4 << shift) * (peek(rlr) + 1.0) / lsi_Hz_;
}

void Iwdg::reload() { deadline_ = host_.now() + from_s(timeout_s()); }

void Iwdg::advance(Time now) {
  if (running_ && deadline_ <= now) bite_();
}

std::uint32_t Iwdg::on_read(std::uint32_t offset) {
  if (offset == sr) return host_.now() < updated_ ? 3 : 0;
  return offset == kr ? 0 : peek(offset);
}

void Iwdg::on_write(std::uint32_t offset, std::uint32_t value) {
  switch (offset) {
    case kr:
      if (value == 0x5555)
        open_ = true;
      else if (value == 0xAAAA) {
        open_ = false;
        reload();
      } else if (value == 0xCCCC) {
        open_ = false;
        running_ = true;
        reload();
      } else
        trouble("unknown key", offset);
      break;
    case sr:
      trouble("SR is read-only", offset);
      break;
    default:
      if (!open_) return trouble("PR or RLR written without the key 0x5555", offset);
      keep(offset, value);
      updated_ = host_.now() + from_s(5 / lsi_Hz_);  // RM0090 21.4.4: up to 5 LSI cycles
  }
  host_.reschedule();
}

Wwdg::Wwdg(Host& host, std::function<double()> pclk1_Hz, std::function<void(const char*)> bite)
    : Device(host, "WWDG", address, wwdg_map, 0x40, 11), pclk1_Hz_(std::move(pclk1_Hz)), bite_(std::move(bite)) {}

void Wwdg::reset() {
  Device::reset();
  running_ = false;
  deadline_ = never;
}

Time Wwdg::count() const { return from_s(4096.0 * (1u << field(peek(cfr), 7, 2)) / pclk1_Hz_()); }

std::uint32_t Wwdg::value() const {
  if (!running_) return loaded_;
  const auto gone = static_cast<std::uint32_t>((host_.now() - from_) / count());
  return loaded_ - std::min(gone, loaded_);
}

void Wwdg::advance(Time now) {
  if (running_ && deadline_ <= now) bite_("T6 fell to 0");
}

std::uint32_t Wwdg::on_read(std::uint32_t offset) {
  return offset == cr ? (running_ ? 0x80u : 0) | value() : peek(offset);
}

void Wwdg::on_write(std::uint32_t offset, std::uint32_t v) {
  if (offset != cr) {
    keep(offset, v);
    return;
  }
  if (!(v >> 6 & 1)) {
    if (running_ || (v >> 7 & 1)) bite_("T6 was written as 0");
    return;
  }
  if (running_ && value() > field(peek(cfr), 0, 7)) return bite_("refreshed before its window opened");
  running_ = running_ || (v >> 7 & 1);
  loaded_ = v & 0x7F;
  from_ = host_.now();
  deadline_ = from_ + count() * (loaded_ - 0x3F);
  host_.reschedule();
}

}  // namespace host_sim::chip

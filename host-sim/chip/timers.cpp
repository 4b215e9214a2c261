// SPDX-License-Identifier: MIT
#include "host-sim/chip/timers.hpp"

#include <algorithm>
#include <cmath>

namespace host_sim::chip {
namespace {

using T = AdvancedTimer;
constexpr Register map[] = {
    // RM0090 17.4
    {T::cr1, "CR1", 0, 0x3FF, 0x3EF},
    {T::cr2, "CR2", 0, 0x7FFD, 0x7FFD},
    {T::smcr, "SMCR", 0, 0xFFF7, 0xFFF7},
    {T::dier, "DIER", 0, 0x7FFF, 0x7FFF},
    {T::sr, "SR", 0, 0x1EFF, 0},
    {T::egr, "EGR", 0, 0xFF, 0},
    {T::ccmr1, "CCMR1", 0, 0xFFFF, 0xFFFF},
    {T::ccmr2, "CCMR2", 0, 0xFFFF, 0xFFFF},
    {T::ccer, "CCER", 0, 0x3FFF, 0x3FFF},
    {T::cnt, "CNT", 0, 0xFFFF, 0},
    {T::psc, "PSC", 0, 0xFFFF, 0xFFFF},
    {T::arr, "ARR", 0xFFFF, 0xFFFF, 0xFFFF},
    {T::rcr, "RCR", 0, 0xFF, 0xFF},
    {T::ccr1, "CCR1", 0, 0xFFFF, 0xFFFF},
    {0x38, "CCR2", 0, 0xFFFF, 0xFFFF},
    {0x3C, "CCR3", 0, 0xFFFF, 0xFFFF},
    {T::ccr4, "CCR4", 0, 0xFFFF, 0xFFFF},
    {T::bdtr, "BDTR", 0, 0xFFFF, 0xFFFF},
};

using E = EncoderTimer;
constexpr Register encoder_map[] = {
    // RM0090 18.4
    {E::cr1, "CR1", 0, 0x3FF, 0x3EF},       {0x04, "CR2", 0, 0xF8, 0xF8},       {E::smcr, "SMCR", 0, 0xFFF7, 0xFFF7},
    {0x0C, "DIER", 0, 0x5F5F, 0x5F5F},      {0x10, "SR", 0, 0x1E5F, 0},         {0x14, "EGR", 0, 0x5F, 0},
    {E::ccmr1, "CCMR1", 0, 0xFFFF, 0xFFFF}, {0x1C, "CCMR2", 0, 0xFFFF, 0xFFFF}, {E::ccer, "CCER", 0, 0xBBBB, 0xBBBB},
    {E::cnt, "CNT", 0, 0xFFFF, 0},          {E::psc, "PSC", 0, 0xFFFF, 0xFFFF}, {E::arr, "ARR", 0xFFFF, 0xFFFF, 0xFFFF},
};

}  // namespace

AdvancedTimer::AdvancedTimer(Host& host, const char* name, std::uint32_t base, int enable_bit, Links links)
    : Device(host, name, base, map, 0x44, enable_bit), links_(std::move(links)) {}

void AdvancedTimer::reset() {
  Device::reset();
  active_ = {};
  break_connected_ = false;
  running_ = down_ = lock_written_ = update_on_underflow_ = compare_fresh_ = false;
  silent_periods_ = 0;
  frozen_ = 0;
  underflow_ = overflow_ = compare_ = never;
  lines();
}

void AdvancedTimer::clocks_changed() {
  const auto old = tick_;
  tick_ = std::max<Time>(1, static_cast<Time>(std::lround(static_cast<double>(ticks_per_s) / links_.clock_Hz())));
  if (running_ && old != tick_) {  // the counter goes on from where it is, at the new pace
    frozen_ = position();
    start();
  }
}

double AdvancedTimer::period_s() const { return to_s(tick() * (centre_aligned() ? 2 * peek(arr) : peek(arr) + 1)); }

double AdvancedTimer::dead_time_s() const {  // RM0090 17.4.18, DTG
  const std::uint32_t d = field(peek(bdtr), 0, 8);
  const double dts = to_s(tick_) * (1u << field(peek(cr1), 8, 2));
  if (!(d & 0x80)) return d * dts;
  if ((d & 0xC0) == 0x80) return (64 + (d & 0x3F)) * 2 * dts;
  if ((d & 0xE0) == 0xC0) return (32 + (d & 0x1F)) * 8 * dts;
  return (32 + (d & 0x1F)) * 16 * dts;
}

void AdvancedTimer::start() {
  const std::uint32_t top = peek(arr);
  if (top == 0) return trouble("started with ARR = 0: the counter stands", arr);
  const Time now = host_.now(), step = tick();
  const std::uint32_t at_count = std::min(frozen_, top);
  running_ = true;
  if (!centre_aligned()) {
    overflow_ = now + step * (top + 1 - at_count);
    underflow_ = never;
  } else if (down_) {
    underflow_ = now + step * at_count;
    overflow_ = underflow_ + step * top;
  } else {
    overflow_ = now + step * (top - at_count);
    underflow_ = overflow_ + step * top;
  }
  update_on_underflow_ = false;
  const Time lead = step * (top - std::min(active_[3], top));
  const bool up = !centre_aligned() || field(peek(cr1), 5, 2) >= 2;  // CMS: 1 down, 2 up, 3 both (17.3.2)
  compare_ = up ? overflow_ - lead - (centre_aligned() ? 0 : step) : overflow_ + lead;
  if (compare_ < now) compare_ += step * (centre_aligned() ? 2 * top : top + 1);
  host_.reschedule();
}

std::uint32_t AdvancedTimer::position() const {
  if (!running_) return frozen_;
  const Time now = host_.now(), step = tick();
  const std::uint32_t top = peek(arr);
  if (!centre_aligned())
    return top -
           std::min<std::uint32_t>(top, static_cast<std::uint32_t>((overflow_ - std::min(now, overflow_)) / step));
  if (overflow_ < underflow_)
    return top -
           std::min<std::uint32_t>(top, static_cast<std::uint32_t>((overflow_ - std::min(now, overflow_)) / step));
  return std::min<std::uint32_t>(top, static_cast<std::uint32_t>((underflow_ - std::min(now, underflow_)) / step));
}

Time AdvancedTimer::next_event() const { return running_ ? std::min({overflow_, underflow_, compare_}) : never; }

/// The match is a rising edge of OC4REF: PWM mode 2 on the way up, mode 1 on the way down (17.3.9).
bool AdvancedTimer::compare4_works() const {
  const bool up = !centre_aligned() || field(peek(cr1), 5, 2) >= 2;
  return running_ && (peek(ccer) >> 12 & 1) && field(peek(ccmr2), 8, 2) == 0 &&
         field(peek(ccmr2), 12, 3) == (up ? 7u : 6u);
}

void AdvancedTimer::advance(Time now) {
  while (running_ && next_event() <= now) {
    const Time event = next_event(), step = tick();
    const std::uint32_t top = peek(arr);
    if (compare_ == event) {
      compare_ += step * (centre_aligned() ? 2 * top : top + 1);
      at(sr) |= 1u << 4;
      if (compare4_works() && links_.compare4) links_.compare4(event);
    } else if (overflow_ == event) {
      last_overflow_ = event;
      down_ = centre_aligned();
      overflow_ += step * (centre_aligned() ? 2 * top : top + 1);
      // Once is legal: whoever opens the gates may have interrupted whoever writes the compare values.
      silent_periods_ = compare_fresh_ && !main_output() && !(peek(sr) >> 7 & 1) ? silent_periods_ + 1 : 0;
      if (silent_periods_ == 2) trouble("compare values are written, but MOE is off: no output", bdtr);
      compare_fresh_ = false;
      if (links_.overflow) links_.overflow(event);
      if (!centre_aligned() || peek(rcr) == 0 || !update_on_underflow_) update();
    } else {
      down_ = false;
      underflow_ += step * 2 * top;
      if (peek(rcr) == 0 || update_on_underflow_) update();
    }
    lines();
  }
}

void AdvancedTimer::update() {
  if (peek(cr1) >> 1 & 1) return;  // UDIS
  for (std::uint32_t i = 0; i < 4; ++i) active_[i] = peek(ccr1 + 4 * i);
  const Time step = tick();
  if (running_ && centre_aligned()) {  // CCR4 may have moved
    const Time lead = step * (peek(arr) - std::min(active_[3], peek(arr)));
    const Time top = overflow_ < underflow_ ? overflow_ : overflow_ - step * 2 * peek(arr);
    const bool up = field(peek(cr1), 5, 2) >= 2;
    compare_ = up ? top - lead : top + lead;
    while (compare_ <= host_.now()) compare_ += step * 2 * peek(arr);
  }
  at(sr) |= 1;
  if ((peek(bdtr) >> 14 & 1) && !main_output()) {  // AOE
    const bool active =
        (peek(bdtr) >> 12 & 1) && break_connected_ && break_high_ == static_cast<bool>(peek(bdtr) >> 13 & 1);
    if (!active) at(bdtr) |= 1u << 15;
  }
  if (trgo_mode() == 2 && links_.trgo) links_.trgo();
}

void AdvancedTimer::lines() {
  const std::uint32_t on = peek(sr) & peek(dier);
  host_.set_line(links_.irq_update, on & 1);
  host_.set_line(links_.irq_compare, on & 0x1E);
  host_.set_line(links_.irq_break, on >> 7 & 1);
}

void AdvancedTimer::check_break() {
  const std::uint32_t b = peek(bdtr);
  if (!(b >> 12 & 1) || !break_connected_ || break_high_ != static_cast<bool>(b >> 13 & 1)) return;
  at(bdtr) &= ~(1u << 15);
  at(sr) |= 1u << 7;
  lines();
}

void AdvancedTimer::break_pin(bool connected, bool high) {
  break_connected_ = connected;
  break_high_ = high;
  check_break();
}

void AdvancedTimer::clock_failure() {
  if (!(peek(bdtr) >> 12 & 1)) return;
  at(bdtr) &= ~(1u << 15);
  at(sr) |= 1u << 7;
  lines();
}

void AdvancedTimer::trigger_in() {
  if (!slave_trigger_itr0() || !clocked()) return;
  at(sr) |= 1u << 6;
  if (running_) return;
  at(cr1) |= 1;
  start();
}

Leg AdvancedTimer::leg(int phase) const {
  const auto n = static_cast<std::uint32_t>(phase);
  const std::uint32_t mode_bits = n < 2 ? field(peek(ccmr1), 8 * phase, 8) : field(peek(ccmr2), 0, 8);
  const unsigned mode = field(mode_bits, 4, 3), enables = field(peek(ccer), 4 * phase, 4);
  Leg leg;
  if (!main_output() || (mode_bits & 3) != 0) return leg;
  const double r = std::min(1.0, static_cast<double>(active_[n]) / std::max(1u, peek(arr)));
  const double ref = mode == 6 ? r : mode == 7 ? 1 - r : mode == 5 ? 1 : 0;
  const bool p = enables & 1, pn = enables >> 2 & 1;
  leg.upper_driven = p;
  leg.lower_driven = pn;
  const double oc = ref, ocn = p ? 1 - ref : ref;  // RM0090 Table 97: alone, OCxN carries OCxREF itself
  leg.upper_ratio = p ? ((enables >> 1 & 1) ? 1 - oc : oc) : 0;
  leg.lower_ratio = pn ? ((enables >> 3 & 1) ? 1 - ocn : ocn) : 0;
  return leg;
}

bool AdvancedTimer::locked(std::uint32_t offset, std::uint32_t value, std::uint32_t bits, int level) {
  if (static_cast<int>(field(peek(bdtr), 8, 2)) < level || !((value ^ peek(offset)) & bits)) return false;
  trouble("a bit is to change that LOCK protects until the next reset", offset);
  return true;
}

void AdvancedTimer::write_bdtr(std::uint32_t value) {
  std::uint32_t v = value & 0xFFFF;
  if (locked(bdtr, v, 0x70FF, 1)) v = (v & ~0x70FFu) | (peek(bdtr) & 0x70FF);  // AOE BKP BKE DTG
  if (locked(bdtr, v, 0x0C00, 2)) v = (v & ~0x0C00u) | (peek(bdtr) & 0x0C00);
  if (lock_written_) v = (v & ~0x300u) | (peek(bdtr) & 0x300);
  lock_written_ = lock_written_ || (v & 0x300);
  const bool sets = (v >> 15 & 1) && !main_output();
  at(bdtr) = v;
  check_break();
  if (!sets || !main_output()) return;
  if (!running_) trouble("MOE set while the counter stands still", bdtr);
  if (field(v, 0, 8) == 0) trouble("MOE set with no dead time", bdtr);
  if (!(v >> 12 & 1))
    trouble("MOE set with the break input off", bdtr);
  else if (!break_connected_)
    trouble("MOE set while no pin feeds the break input", bdtr);
}

std::uint32_t AdvancedTimer::on_read(std::uint32_t offset) {
  if (offset == cnt) return position();
  if (offset == cr1) return peek(cr1) | (down_ ? 1u << 4 : 0);
  return peek(offset);
}

void AdvancedTimer::on_write(std::uint32_t offset, std::uint32_t value) {
  switch (offset) {
    case cr1: {
      if (running_ && ((value ^ peek(cr1)) & 0x60)) trouble("CMS changed while the counter runs", offset);
      const bool was = peek(cr1) & 1;
      keep(offset, value);
      if (!was && (value & 1)) {
        start();
        if (trgo_mode() == 1 && links_.trgo) links_.trgo();
      } else if (was && !(value & 1)) {
        frozen_ = position();
        running_ = false;
        if (main_output()) trouble("counter stopped while MOE is set", offset);
      }
      break;
    }
    case cr2:
      if (locked(offset, value, 0x7F00, 1)) return;
      keep(offset, value);
      break;
    case sr:
      at(sr) &= value;
      check_break();
      break;  // rc_w0
    case egr:
      if (value & 1) {
        if (running_) trouble("UG restarts a counter that drives the ADC and the bridge", offset);
        frozen_ = 0;
        down_ = false;
        const std::uint32_t flags = peek(sr);
        update();
        if (peek(cr1) >> 2 & 1) at(sr) = flags;  // URS
      }
      if (value >> 7 & 1) {
        at(bdtr) &= ~(1u << 15);
        at(sr) |= 1u << 7;
      }
      if (value & 0x7E) trouble("EGR bits other than UG and BG are not modelled", offset);
      break;
    case ccmr1:
    case ccmr2:
      if (locked(offset, value, offset == ccmr1 ? 0x7878 : 0x0078, 3)) return;
      keep(offset, value);
      break;
    case ccer:
      if (locked(offset, value, 0x0AAA, 2)) return;
      keep(offset, value);
      break;
    case cnt:
      if (running_) return trouble("CNT written while the counter runs", offset);
      frozen_ = value & 0xFFFF;
      break;
    case arr:
      if (running_ && value != peek(arr)) trouble("ARR changed while the counter runs: not modelled", offset);
      keep(offset, value);
      break;
    case rcr:
      if (value > 1) trouble("RCR above 1 is not modelled", offset);
      if (running_ && value != peek(rcr)) update_on_underflow_ = true;  // 17.3.3: written after the start
      keep(offset, value);
      break;
    case bdtr:
      write_bdtr(value);
      break;
    default:
      keep(offset, value);
      if (offset >= ccr1 && offset <= ccr4) {
        const auto i = (offset - ccr1) / 4;
        const std::uint32_t m =
            i < 2 ? field(peek(ccmr1), 8 * static_cast<int>(i), 8) : field(peek(ccmr2), 8 * static_cast<int>(i - 2), 8);
        compare_fresh_ = compare_fresh_ || (i < 3 && running_ && !main_output());
        if (i < 3 && value > peek(arr)) trouble("compare value above the reload value", offset);
        if (!(m >> 3 & 1)) {
          active_[i] = value;
          if (i < 3 && running_ && main_output())
            trouble("compare value changed in the middle of a period: OCxPE is off", offset);
        }
      }
  }
  lines();
}

EncoderTimer::EncoderTimer(Host& host, const char* name, std::uint32_t base, int enable_bit,
                           std::function<bool()> pins_connected, std::function<bool()> at_index)
    : Device(host, name, base, encoder_map, 0x40, enable_bit),
      pins_connected_(std::move(pins_connected)),
      at_index_(std::move(at_index)) {}

void EncoderTimer::reset() {
  Device::reset();
  stopped_at_ = 0;
}

std::uint32_t EncoderTimer::count() const {
  if (!(peek(cr1) & 1)) return stopped_at_;
  const unsigned mode = field(peek(smcr), 0, 3);
  const bool both = mode == 3, one = mode == 1 || mode == 2;
  if (!both && !one) return stopped_at_;
  const bool inputs = field(peek(ccmr1), 0, 2) == 1 && field(peek(ccmr1), 8, 2) == 1;
  if (!inputs || !pins_connected_()) return stopped_at_;
  const std::int64_t size = static_cast<std::int64_t>(peek(arr)) + 1;
  std::int64_t moved = (at_index_() ? index_edges_ : edges_) - base_;
  if (one) moved /= 2;
  if (((peek(ccer) >> 1) ^ (peek(ccer) >> 5)) & 1) moved = -moved;
  return static_cast<std::uint32_t>(((static_cast<std::int64_t>(stopped_at_) + moved) % size + size) % size);
}

std::uint32_t EncoderTimer::on_read(std::uint32_t offset) {
  if (offset == cnt) {
    if (!(peek(cr1) & 1))
      trouble("counter read while it is off", offset);
    else if (field(peek(smcr), 0, 3) != 3)
      trouble("counter read outside encoder mode 3 (both edges of both inputs)", offset);
    else if (!pins_connected_())
      trouble("encoder counter read, but its pins are not on its alternate function", offset);
    return count();
  }
  return peek(offset);
}

void EncoderTimer::on_write(std::uint32_t offset, std::uint32_t value) {
  if (offset == cr1 || offset == cnt) {
    const std::uint32_t now = count();
    stopped_at_ = offset == cnt ? value & 0xFFFF : now;
    base_ = edges_;
  }
  if (offset == E::psc && value) trouble("a prescaler in encoder mode", offset);
  keep(offset, value);
}

}  // namespace host_sim::chip

// SPDX-License-Identifier: MIT
#include "boards/h8-15d/power_stage.hpp"

namespace h8_15d {
namespace {

constexpr std::uint32_t timer[2] = {tim::tim1, tim::tim8};
constexpr std::uint32_t encoder[2] = {tim::tim3, tim::tim4};
constexpr std::uint32_t trigger[2] = {0,
                                      14};  // JEXTSEL: TIM1_CC4, TIM8_CC4 (13.13.3; the SVD's names are another chip's)
constexpr std::uint32_t second_channel[3] = {bus_V_channel, bus_A_channel, bus_V_channel};
constexpr float rad_per_count = 6.2831853f / static_cast<float>(encoder_counts);
constexpr float usable_ratio = 1.0f - rating.sampling_window_s * rating.pwm_Hz;

// BDTR, 17.4.18: MOE is kept apart. BKE, BKP = 0 (low is a fault), AOE = 0, OSSR, OSSI: idle outputs are driven low.
constexpr std::uint32_t bdtr_fixed = bit(12) | bit(11) | bit(10) | 1u << 8 | dead_counts;  // LOCK level 1

constexpr std::uint32_t cr1_base = bit(22) | bit(9) | bit(8) | bit(6);  // JAWDEN, AWDSGL, SCAN, AWDIE (13.13.2)
constexpr float watchdog_counts = 1.1f * rating.trip_A / A_per_count;

constexpr std::uint32_t sequence_of(std::uint32_t first, std::uint32_t second) {  // 13.13.12: JL = 1 begins at JSQ3
  return 1u << 20 | second << 15 | first << 10;
}
constexpr std::uint32_t cr2_armed(int axis) { return 1u << 20 | trigger[axis] << 16 | bit(0); }  // JEXTEN rising, ADON

}  // namespace

void PowerStage::set_up() {
  set(rcc::apb2enr, bit(0) | bit(1) | bit(8) | bit(9) | bit(10));  // TIM1, TIM8, ADC1..3
  for (const std::uint32_t t : timer) {
    reg(t + tim::cr1) = 2u << 5;                       // CMS = 2: compare events on the way up (17.3.2)
    reg(t + tim::cr2) = t == tim::tim1 ? 2u << 4 : 0;  // TIM1: TRGO at the update
    reg(t + tim::arr) = reload;
    reg(t + tim::rcr) = 1;         // one update per period; written before the start: at the top
    reg(t + tim::ccmr1) = 0x6868;  // PWM mode 1 with preload, channels 1 and 2
    reg(t + tim::ccmr2) = 0x7868;  // channel 3 the same; channel 4 PWM mode 2: rises at its match
    reg(t + tim::ccr4) = reload - sample_lead;
    for (std::uint32_t k = 0; k < 3; ++k) reg(t + tim::ccr1 + 4 * k) = reload / 2;
    reg(t + tim::bdtr) = bdtr_fixed;
    reg(t + tim::ccer) = 0x1555;  // CH1..3 with their complements, CH4
    reg(t + tim::egr) = 1;        // UG: load the preloads
    reg(t + tim::sr) = 0;
  }
  reg(tim::tim8 + tim::smcr) = 6;  // trigger mode on ITR0 = TIM1 (17.4.3, Table 98)

  reg(adc::ccr) = bit(23) | 2u << 16;  // TSVREFE; ADCPRE = /6
  for (int unit = 1; unit <= 3; ++unit) {
    const std::uint32_t a = adc::base(unit);
    reg(a + adc::smpr1) = 6u << 21 | 6u << 15 | 6u << 12;  // 144 cycles: VREFINT, force, board NTC; 3 cycles: all else
    reg(a + adc::smpr2) = 6u << 15 | 6u << 12;             // 144 cycles: motor NTCs
    reg(a + adc::htr) = static_cast<std::uint32_t>(current_zero_counts + watchdog_counts);
    reg(a + adc::ltr) = static_cast<std::uint32_t>(current_zero_counts - watchdog_counts);
    reg(a + adc::cr2) = bit(0);  // ADON, 13.3.1: a moment before the first conversion
  }
  arm(0);
}

bool PowerStage::start() {
  reg(tim::tim1 + tim::cr1) = 2u << 5 | 1u;
  // TIM8 follows at TIM1's first top. Watch one whole period: 25 us apart, updates at the top (then they count down).
  const std::uint32_t begin = reg(system::dwt_cyccnt);
  bool good = true;
  bool seen[2] = {};
  while (reg(system::dwt_cyccnt) - begin < 3 * cycles_per_period) {
    for (int i = 0; i < 2; ++i) {
      if (reg(timer[i] + tim::sr) & 1u) {
        seen[i] = true;
        const std::uint32_t mine = reg(timer[i] + tim::cnt), other = reg(timer[1 - i] + tim::cnt);
        reg(timer[i] + tim::sr) = 0;
        // Just behind the top, the other just behind the bottom (if it runs already).
        good = good && mine > 3 * reload / 4 && ((i == 0 && !seen[1]) || other < reload / 4);
      }
    }
  }
  return good && seen[0] && seen[1];
}

void PowerStage::arm(int axis) {
  for (int unit = 1; unit <= 3; ++unit) {
    const std::uint32_t a = adc::base(unit), first = phase_channel[axis][unit - 1];
    reg(a + adc::sr) = 0x33;  // JEOC and JSTRT (rc_w0); EOC may just have come and stays
    reg(a + adc::jsqr) = sequence_of(first, second_channel[unit - 1]);
    reg(a + adc::cr1) = cr1_base | first | (unit == 1 ? bit(7) : 0);  // JEOCIE on ADC1: all three end together
    std::uint32_t cr2 = cr2_armed(axis);
    if (unit == 1 && !slow_running_ && slow_wanted_) {
      reg(a + adc::sqr3) = slow_wanted_ & 0x1Fu;
      slow_wanted_ = 0;
      slow_running_ = true;
      cr2 |= bit(30);  // SWSTART
    }
    reg(a + adc::cr2) = cr2;
  }
  armed_ = axis;
}

void PowerStage::stop_sampling() {
  for (int unit = 1; unit <= 3; ++unit) reg(adc::base(unit) + adc::cr2) = bit(0);
}

int PowerStage::take() {
  std::uint32_t status[3];
  for (int unit = 1; unit <= 3; ++unit) status[unit - 1] = reg(adc::base(unit) + adc::sr);
  const int axis = armed_;
  if ((status[0] | status[1] | status[2]) & bit(0)) {  // AWD, 13.3.7: beyond the trip level
    release(axis);
    over_current_[axis] = true;
    for (int unit = 1; unit <= 3; ++unit) reg(adc::base(unit) + adc::sr) = 0x3E;
  }
  if (slow_running_ && (status[0] & bit(1))) {  // EOC
    slow_counts_ = static_cast<std::uint16_t>(reg(adc::base(1) + adc::dr));
    slow_running_ = false;
    slow_ready_ = true;
  }
  if (!(status[0] & bit(2))) return -1;
  complete_ = (status[1] & status[2] & bit(2)) != 0;
  if (complete_) {
    for (int unit = 1; unit <= 3; ++unit)
      counts_[axis][unit - 1] = static_cast<std::uint16_t>(reg(adc::base(unit) + adc::jdr1));
    bus_counts_ = static_cast<std::uint16_t>(reg(adc::base(1) + adc::jdr2));
    bus_A_counts_ = static_cast<std::uint16_t>(reg(adc::base(2) + adc::jdr2));
    bus_again_ = static_cast<std::uint16_t>(reg(adc::base(3) + adc::jdr2));
  }
  arm(1 - axis);
  return axis;
}

bool PowerStage::driven(int axis) const { return (reg(timer[axis] + tim::bdtr) & bit(15)) != 0; }

hal::AxisSample PowerStage::sample(int axis) {
  // The number of the period: whole periods on the cycle counter since the last one, so lost ones are counted too.
  const std::uint32_t now = reg(system::dwt_cyccnt), gone = now - cycles_[axis];
  const std::uint32_t periods =
      gone < cycles_per_period + cycles_per_period / 2 ? 1 : (gone + cycles_per_period / 2) / cycles_per_period;
  if (sequence_[axis] != 0) lost_[axis] += periods - 1;
  sequence_[axis] += periods;
  cycles_[axis] = now;

  float i_A[3];
  for (int k = 0; k < 3; ++k) i_A[k] = (static_cast<float>(counts_[axis][k]) - current_zero_counts) * A_per_count;
  const float ratio[3] = {active_[axis].ratio.a, active_[axis].ratio.b, active_[axis].ratio.c};
  const int largest = ratio[0] >= ratio[1] ? (ratio[0] >= ratio[2] ? 0 : 2) : (ratio[1] >= ratio[2] ? 1 : 2);
  if (active_[axis].on && ratio[largest] > usable_ratio) {  // its shunt had no time: the other two say it
    i_A[largest] = -(i_A[(largest + 1) % 3] + i_A[(largest + 2) % 3]);
  }
  active_[axis] = loading_[axis];

  const std::uint32_t zero = encoder_zero_[axis];  // once: the index interrupt may come in between
  const auto angle_counts = (reg(encoder[axis] + tim::cnt) - zero) & (encoder_counts - 1);
  if (zero != zero_seen_[axis]) ++sequence_[axis];  // set anew is not moved: behind a gap the core begins anew as well
  zero_seen_[axis] = zero;
  if (wanted_on_[axis] && !driven(axis)) broken_[axis] = true;  // the break input, or the clock guard
  const int difference = static_cast<int>(bus_counts_) - static_cast<int>(bus_again_);
  const bool agrees = difference < 64 && difference > -64;  // 1 V between two converters on one pin
  return {
      .current_A = {i_A[0], i_A[1], i_A[2]},
      .bus_V = static_cast<float>(bus_counts_) * bus_V_per_count,
      .rotor_rad = static_cast<float>(angle_counts) * rad_per_count,
      .sequence = sequence_[axis],
      .valid = complete_ && agrees && encoder_good_[axis] && reference_good_ && !broken_[axis] && !over_current_[axis]};
}

void PowerStage::drive(int axis, const hal::Duty& duty) {
  loading_[axis] = duty;
  if (!duty.on) {
    release(axis);
    broken_[axis] = over_current_[axis] = false;  // open is what a fault wants; the core decides what comes next
    return;
  }
  if (broken_[axis]) return;  // a break has opened the bridge: the core learns it from the next sample
  const std::uint32_t t = timer[axis];
  reg(t + tim::ccr1) = static_cast<std::uint32_t>(duty.ratio.a * static_cast<float>(reload) + 0.5f);
  reg(t + tim::ccr1 + 4) = static_cast<std::uint32_t>(duty.ratio.b * static_cast<float>(reload) + 0.5f);
  reg(t + tim::ccr1 + 8) = static_cast<std::uint32_t>(duty.ratio.c * static_cast<float>(reload) + 0.5f);
  // The bridge follows a period later, when what is written here shapes it: until then the timer still has the duty of
  // the last run, which would short a turning motor's back-EMF. Nor after an over-current that the core has not seen.
  if (!wanted_on_[axis] && active_[axis].on && !over_current_[axis]) {
    reg(t + tim::sr) = 0x1E7F;  // BIF of an old break (rc_w0)
    reg(t + tim::bdtr) = bdtr_fixed | bit(15);
    wanted_on_[axis] = true;
  }
}

void PowerStage::release(int axis) {
  reg(timer[axis] + tim::bdtr) = bdtr_fixed;
  wanted_on_[axis] = false;
}

}  // namespace h8_15d

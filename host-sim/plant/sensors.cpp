// SPDX-License-Identifier: MIT
#include "host-sim/plant/sensors.hpp"

#include <algorithm>
#include <cmath>

namespace host_sim {

std::uint16_t to_counts(double counts, int full_scale) {
  // Written so that NaN becomes 0, which every board takes for a broken sensor.
  if (!(counts > 0)) return 0;
  return counts < full_scale ? static_cast<std::uint16_t>(counts + 0.5) : static_cast<std::uint16_t>(full_scale);
}

double ntc_counts(const NtcDesign& design, double degC, int full_scale) {
  const double r_ohm = design.r25_ohm * std::exp(design.beta_K * (1 / (degC + 273.15) - 1 / 298.15));
  return full_scale * r_ohm / (r_ohm + design.pull_up_ohm);
}

bool FaultTable::active(const Entry& entry, int axis, Channel channel, double time_s) {
  const SensorFault& f = entry.fault;
  if (f.channel != channel || time_s < f.from_s || time_s >= f.to_s) return false;
  return channel >= Channel::bus_voltage || f.axis == axis;
}

double FaultTable::bend(int axis, Channel channel, double value, double time_s, Random& random) {
  for (Entry& e : entries_) {
    if (!active(e, axis, channel, time_s)) continue;
    const double amount = e.fault.value;
    switch (e.fault.kind) {
      case FaultKind::gain:
        value *= amount;
        break;
      case FaultKind::offset:
        value += amount;
        break;
      case FaultKind::drift:
        value += amount * (time_s - e.fault.from_s);
        break;
      case FaultKind::noise:
        value += amount * random.gauss();
        break;
      case FaultKind::slow:
        if (!e.started) e.memory = value;
        e.memory += (value - e.memory) * (amount > 0 ? 1 - std::exp(-(time_s - e.since_s) / amount) : 1);
        value = e.memory;
        break;
      case FaultKind::delayed: {  // a ring of 256 readings over the delay
        constexpr long slots = 256;
        if (!e.started) e.past.assign(slots, value);
        const auto slot = [&](double at_s) { return static_cast<long>((at_s - e.fault.from_s) / amount * slots); };
        const long now = slot(time_s), before = e.started ? slot(e.since_s) : now - 1;
        if (now != before) e.memory = e.past[static_cast<std::size_t>(now % slots)];
        for (long k = std::max(before + 1, now - slots + 1); k <= now; ++k)
          e.past[static_cast<std::size_t>(k % slots)] = value;
        value = e.memory;
        break;
      }
      default:
        continue;
    }
    e.since_s = time_s;
    e.started = true;
  }
  return value;
}

double FaultTable::replace(int axis, Channel channel, double counts, double full_scale, double time_s, Random& random) {
  for (Entry& e : entries_) {
    if (e.fault.channel != channel) continue;
    const bool now = active(e, axis, channel, time_s);
    if (channel < Channel::bus_voltage && e.fault.axis != axis) continue;
    switch (e.fault.kind) {
      case FaultKind::off:
        if (now) counts = 0;
        break;
      case FaultKind::fixed:
        if (now) counts = e.fault.value;
        break;
      case FaultKind::garbage:
        if (now) counts = random.uniform(0, full_scale);
        break;
      case FaultKind::stuck:
      case FaultKind::intermittent: {
        const bool half =
            e.fault.kind == FaultKind::stuck || std::fmod(time_s - e.fault.from_s, e.fault.value) < 0.5 * e.fault.value;
        if (now && half && e.started) {
          counts = e.memory;
        } else {
          e.memory = counts;  // the last good one
          e.started = true;
        }
        break;
      }
      default:
        break;
    }
  }
  return counts;
}

const SensorFault* FaultTable::swap(int axis, Channel channel, double time_s) const {
  for (const Entry& e : entries_) {
    if (e.fault.kind == FaultKind::swapped && active(e, axis, channel, time_s)) return &e.fault;
  }
  return nullptr;
}

}  // namespace host_sim

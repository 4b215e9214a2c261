// SPDX-License-Identifier: MIT
#include "console/ohmmeter.hpp"

#include <cmath>

namespace console {
namespace {

// A current loop of 50 Hz has come within 1e-4 after 0.03 s. Noise of 30 mA in the samples makes 2 % of a voltage of
// 1 V at a row, and a tenth of that of 30.
constexpr double settling_s = 0.04, averaged_s = 0.06;
constexpr double same_level_s = 0.2;  // a probe that comes later is another one
constexpr float near = 0.01f;         // of a current that is asked for: what limits it shows

}  // namespace

std::optional<Ohmmeter::Mean> Ohmmeter::averaged(const Row& row, float level_A) {
  const bool another = level_A != level_A_;
  level_A_ = level_A;
  if (another) from_s_ = row.time_s + settling_s;
  if (another || rows_ == 0) first_s_ = row.time_s, volts_ = amperes_ = 0, rows_ = 0;
  if (level_A == 0 || row.time_s < from_s_) return {};
  volts_ += double{row.asked_V} * double{row.share};
  amperes_ += double{row.current_A};
  ++rows_;
  if (row.time_s - first_s_ < averaged_s) return {};
  const Mean mean{0.5 * (first_s_ + row.time_s), volts_ / rows_, amperes_ / rows_, level_A == probe_A_};
  rows_ = 0;
  return mean;
}

std::optional<Ohmmeter::Reading> Ohmmeter::take(const Row& row) {
  const auto flows = [&](float A) { return std::fabs(row.permitted_A - A) < near * A; };
  const bool larger = cold_ && flows(larger_A_);
  const std::optional<Mean> mean = averaged(row, flows(probe_A_) ? probe_A_ : larger ? larger_A_ : 0);
  if (!mean) return {};
  if (!cold_) return Reading{mean->time_s, mean->V / mean->A - added_ohm_};
  if (first_.empty() || first_.back().probe != mean->probe || mean->time_s - first_.back().time_s > same_level_s)
    first_.push_back(*mean);
  return {};
}

std::vector<double> Ohmmeter::cold() {
  cold_ = false;
  std::vector<double> readings, added;
  for (std::size_t i = 0; i < first_.size(); ++i) {
    const Mean& probe = first_[i];
    if (i + 2 < first_.size() && !first_[i + 1].probe) {
      const Mean &larger = first_[i + 1], &again = first_[i + 2];
      const double probe_V = 0.5 * (probe.V + again.V), probe_A = 0.5 * (probe.A + again.A);
      added.push_back(probe_V / probe_A - (larger.V - probe_V) / (larger.A - probe_A) + leads_ohm_);
      i += 2;
    } else {
      readings.push_back(probe.V / probe.A);
    }
  }
  for (const double ohm : added) added_ohm_ += ohm / static_cast<double>(added.size());
  if (added.empty()) return {};
  for (double& ohm : readings) {
    ohm -= added_ohm_;
    if (!(ohm > 0)) return {};
  }
  return readings;
}

}  // namespace console

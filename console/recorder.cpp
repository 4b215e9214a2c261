// SPDX-License-Identifier: MIT
#include "console/recorder.hpp"

#include <algorithm>
#include <cmath>

namespace console {
namespace {

std::vector<std::string> columns_of(const std::vector<Target>& signals, const std::vector<std::string>& more) {
  std::vector<std::string> names;
  for (const Target& signal : signals) names.push_back(column_name(signal));
  names.insert(names.end(), more.begin(), more.end());
  return names;
}

}  // namespace

Recorder::Recorder(Session& session, const std::string& path, const std::string& what,
                   const std::vector<Target>& signals, double rate_Hz, const std::vector<std::string>& more_columns,
                   Sieve sieve)
    : session_(session),
      file_(path, preamble(session, what, signals), columns_of(signals, more_columns)),
      sieve_(std::move(sieve)),
      time_(session.hello().pwm_Hz) {
  const double pwm_Hz = session.hello().pwm_Hz;
  const double decimation = std::clamp(std::round(pwm_Hz / rate_Hz), 1.0, 65535.0);
  rate_Hz_ = pwm_Hz / decimation;
  row_.resize(signals.size());
  session.subscribe(signals, static_cast<std::uint16_t>(decimation),
                    [this](const link::RowsView& view) { take(view); });
}

void Recorder::take(const link::RowsView& view) {
  dropped_ = view.head.dropped;
  for (std::uint32_t r = 0; r < view.head.rows; ++r) {
    for (std::size_t s = 0; s < row_.size(); ++s) row_[s] = view.value(r, s);
    const double time_s = time_.at(view.head.first_period + r * view.head.decimation);
    if (sieve_)
      sieve_(time_s, row_, file_);
    else
      file_.add(time_s, row_);
  }
}

void Recorder::finish() {
  session_.unsubscribe();
  file_.finish();
}

std::vector<Target> signals_called(const std::vector<std::string>& names, const Dictionary& signals, int axis) {
  std::vector<Target> found;
  for (const std::string& name : names) {
    for (const Target& signal : signals.all()) {
      const bool mine = signal.axis == axis || signal.axis == wire::no_axis;
      if (mine && full_name(*signal.what) == name && found.size() < wire::max_signals) found.push_back(signal);
    }
  }
  return found;
}

std::vector<Target> usual_signals(const Dictionary& signals, int axis) {
  return signals_called(
      {"current_A", "id_A", "iq_A", "speed_rad_per_s", "bus_V", "housing_measured_degC", "ambient_degC", "board_degC",
       "core_a_degC", "core_b_degC", "core_c_degC", "housing_degC", "allowance_A", "mode", "limit"},
      signals, axis);
}

}  // namespace console

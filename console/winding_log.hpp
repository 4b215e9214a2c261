// SPDX-License-Identifier: MIT
// What goes into a log of telemetry while an ohmmeter looks on.
#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "console/ohmmeter.hpp"
#include "console/recorder.hpp"

namespace console {

/// The course's log where the winding is read: the current that heats as that until the next row did; last, the
/// resistance that was read nearest to the row.
class WindingLog {
 public:
  static constexpr double log_Hz = 20;
  static constexpr int telemetry_rows = 25;  // to one of the log, for the ohmmeter looks on
  static constexpr double telemetry_Hz = telemetry_rows * log_Hz;

  explicit WindingLog(const Ohmmeter& ohmmeter) : ohmmeter_(ohmmeter) {}

  /// First what the ohmmeter needs. No speed: there is one only, at which what goes by speed cannot be told from more
  /// or less copper loss, of which a standing rotor then had another; and a heavy one coasts into the log's rest.
  static std::vector<Target> signals(Session& session, int axis) {
    return signals_called({"id_permitted_A", "id_A", "vd_asked_V", "voltage_share", "current_A", "bus_V",
                           "housing_measured_degC", "ambient_degC", "board_degC", "core_a_degC", "core_b_degC",
                           "core_c_degC", "housing_degC", "allowance_A", "limit"},
                          session.signals(), axis);
  }

  /// Ends what was read while all was cold; rows begin with that, being as cold. False: nothing was, nor will be.
  bool begin() {
    cold_ohm_ = ohmmeter_.cold();
    begun_ = true;
    return !cold_ohm_.empty();
  }

  void take(double time_s, const std::vector<float>& row, LogFile& file) {
    const auto reading = ohmmeter_.take({time_s, row[0], row[1], row[2], row[3]});
    if (!begun_) return;
    if (reading && !cold_ohm_.empty()) {
      const bool nearer = !last_.empty() && reading->time_s - last_s_ < 0.5 / log_Hz;
      (nearer ? last_.back() : next_ohm_) = static_cast<float>(reading->ohm);
    }
    if (taken_ == telemetry_rows) {
      last_[current] = std::sqrt(current_A2_ / telemetry_rows);
      file.add(last_s_, last_);
      taken_ = 0;
      current_A2_ = 0;
    }
    current_A2_ += row[current] * row[current];
    if (taken_++ > 0) return;
    if (written_ < cold_ohm_.size()) next_ohm_ = static_cast<float>(cold_ohm_[written_++]);
    last_ = row;
    last_s_ = time_s;
    last_.push_back(std::exchange(next_ohm_, nothing));
  }

 private:
  static constexpr float nothing = std::numeric_limits<float>::quiet_NaN();
  static constexpr std::size_t current = 4;  // among the signals

  Ohmmeter ohmmeter_;
  std::vector<double> cold_ohm_;
  bool begun_ = false;
  std::vector<float> last_;  // not yet in the file
  double last_s_ = 0;
  float next_ohm_ = nothing, current_A2_ = 0;
  int taken_ = 0;
  std::size_t written_ = 0;
};

}  // namespace console

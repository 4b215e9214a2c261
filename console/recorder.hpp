// SPDX-License-Identifier: MIT
// Telemetry of one axis into a log while the session does something else.
#pragma once

#include <optional>

#include "console/log_file.hpp"

namespace console {

class Recorder {
 public:
  /// Subscribes to the signals at about `rate_Hz` and opens the log.
  Recorder(Session& session, const std::string& path, const std::string& what, const std::vector<Target>& signals,
           double rate_Hz);
  /// Without finish(): nothing more is taken, and what came is kept.
  ~Recorder() { session_.take_no_more(); }
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;
  /// Ends telemetry and the log. Throws UserError as LogFile::finish does.
  void finish();

  double rate_Hz() const { return rate_Hz_; }
  const LogFile& file() const { return file_; }
  std::int64_t rows() const { return file_.rows(); }
  double seconds() const { return file_.last_s(); }
  std::uint32_t dropped() const { return dropped_; }

 private:
  void take(const link::RowsView& view);

  Session& session_;
  LogFile file_;
  BoardTime time_;
  double rate_Hz_ = 0;
  std::vector<float> row_;
  std::uint32_t dropped_ = 0;
};

/// What a log holds unless told otherwise: what identify needs, and what the board makes of it.
std::vector<Target> usual_signals(const Dictionary& signals, int axis);

}  // namespace console

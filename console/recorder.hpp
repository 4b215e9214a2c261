// SPDX-License-Identifier: MIT
// Telemetry of one axis into a log while the session does something else.
#pragma once

#include <functional>

#include "console/log_file.hpp"

namespace console {

class Recorder {
 public:
  /// What goes into the file of a row of telemetry.
  using Sieve = std::function<void(double time_s, const std::vector<float>& row, LogFile& file)>;

  /// Subscribes to the signals at about `rate_Hz` and opens the log. Without a `sieve` each row goes into it as it is;
  /// with one it may add columns of its own.
  Recorder(Session& session, const std::string& path, const std::string& what, const std::vector<Target>& signals,
           double rate_Hz, const std::vector<std::string>& more_columns = {}, Sieve sieve = {});
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
  Sieve sieve_;
  BoardTime time_;
  double rate_Hz_ = 0;
  std::vector<float> row_;
  std::uint32_t dropped_ = 0;
};

/// Those of one axis, and of the board, that are called so, as many as fit.
std::vector<Target> signals_called(const std::vector<std::string>& names, const Dictionary& signals, int axis);
/// What a log holds unless told otherwise: what identify needs, and what the board makes of it.
std::vector<Target> usual_signals(const Dictionary& signals, int axis);

}  // namespace console

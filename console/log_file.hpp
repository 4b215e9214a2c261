// SPDX-License-Identifier: MIT
// A log on its way to disk: rows go to PATH.part and the whole takes its name when it ends, so that PATH is never half
// a log; a row is written whole or not at all. The preamble tells board, firmware and parameters; identify reads it as
// it is.
#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include "console/session.hpp"
#include "wire/pc/user_error.hpp"

namespace console {

/// Name of a signal's column: identify's own where it has one. There "housing_degC" is what a sensor measured, so what
/// the board estimates is called so.
std::string column_name(const Target& signal);

/// The preamble's lines, with what the numbers mean where a signal is a code; fetches the parameters for their hash.
std::string preamble(Session& session, const std::string& what, const std::vector<Target>& signals);

class LogFile {
 public:
  /// Throws UserError (usage) when the place cannot be written.
  LogFile(const std::string& path, const std::string& preamble, const std::vector<std::string>& columns);
  /// Without finish(): keeps the rows that were written, if any.
  ~LogFile();
  LogFile(const LogFile&) = delete;
  LogFile& operator=(const LogFile&) = delete;

  /// Throws UserError (usage) once, with the first row for which there is no room; it and what comes later are left
  /// out.
  void add(double time_s, const std::vector<float>& values);
  std::int64_t rows() const { return rows_; }
  double last_s() const { return last_s_; }
  void finish();
  /// Throws `error` again; its sentence then says what the file holds.
  [[noreturn]] void end(const wire::pc::UserError& error) const;

 private:
  std::string path_, unfinished_;
  std::ofstream out_;
  std::uintmax_t whole_bytes_ = 0;
  std::int64_t rows_ = 0;
  double last_s_ = 0;
  bool finished_ = false;
};

/// Time stamps of 32 bits that wrap, as seconds since the first one.
class BoardTime {
 public:
  explicit BoardTime(float pwm_Hz) : pwm_Hz_(pwm_Hz) {}
  double at(std::uint32_t period);

 private:
  double pwm_Hz_;
  bool begun_ = false;
  std::uint32_t last_ = 0;
  std::uint64_t elapsed_ = 0;
};

}  // namespace console

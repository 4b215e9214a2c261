// SPDX-License-Identifier: MIT
#include "console/log_file.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <filesystem>

#include "console/live.hpp"
#include "console/parameter_file.hpp"
#include "wire/pc/files.hpp"

namespace console {

using wire::pc::Exit;
using wire::pc::refuse;
using wire::pc::UserError;

std::string column_name(const Target& signal) {
  const std::string name = full_name(*signal.what);
  if (name == "housing_measured_degC") return "housing_degC";
  if (name == "housing_degC" || name == "core_degC") return signal.what->name + "_estimate_degC";
  return name;
}

namespace {

/// What the numbers of a signal mean; empty for a quantity.
std::string legend(const std::string& signal) {
  std::vector<std::string> meanings;
  if (signal == "mode") {
    for (std::uint8_t mode = 0; mode < 4; ++mode) meanings.push_back(fmt::format("{} {}", mode, mode_text(mode)));
  } else if (signal == "limit" || signal == "fault") {
    meanings.push_back("0 none");
    for (const wire::CodeText& code : wire::code_texts) {  // faults, then limits, then what refuses
      const bool is_fault = code.number < static_cast<std::uint8_t>(wire::Limit::hardware);
      const bool refuses = code.number >= static_cast<std::uint8_t>(wire::Status::parameters_unset);
      if (!refuses && is_fault == (signal == "fault")) meanings.push_back(fmt::format("{} {}", code.number, code.name));
    }
  }
  return fmt::to_string(fmt::join(meanings, ", "));
}

}  // namespace

std::string preamble(Session& session, const std::string& what, const std::vector<Target>& signals) {
  const wire::Hello& hello = session.hello();
  const std::vector<Target> targets = session.parameters().all();
  std::string legends;
  for (const Target& signal : signals) {
    const std::string name = full_name(*signal.what), meaning = legend(name);
    const std::string line = fmt::format("# {}: {}\n", name, meaning);
    if (!meaning.empty() && legends.find(line) == std::string::npos) legends += line;
  }
  return fmt::format(
      "# hotcore log: {}\n# board: {} {}\n# firmware: {}\n# parameters: {:08x}\n# recorded: {:%Y-%m-%dT%H:%M:%SZ}\n{}",
      what, hello.board, hello.serial, hello.firmware, hash_of(targets, session.get(targets)),
      fmt::gmtime(std::chrono::system_clock::to_time_t(std::chrono::system_clock::now())), legends);
}

LogFile::LogFile(const std::string& path, const std::string& preamble, const std::vector<std::string>& columns)
    : path_(path), unfinished_(wire::pc::unfinished(path)) {
  const std::string head = fmt::format("{}time_s,{}\n", preamble, fmt::join(columns, ","));
  out_.open(unfinished_, std::ios::binary);
  out_ << head << std::flush;
  if (!out_) {
    std::error_code ignored;  // what was begun would be taken for another's
    if (out_.is_open() && unfinished_ != path_) std::filesystem::remove(unfinished_, ignored);
    refuse(path + ": cannot be written; choose another folder or make room.");
  }
  whole_bytes_ = head.size();
}

LogFile::~LogFile() {
  if (finished_) return;
  out_.close();
  if (unfinished_ == path_) return;
  std::error_code ignored;
  if (rows_ > 0)
    std::filesystem::rename(unfinished_, path_, ignored);
  else
    std::filesystem::remove(unfinished_, ignored);
}

void LogFile::add(double time_s, const std::vector<float>& values) {
  if (!out_) return;
  std::string row = fmt::format("{:.6f}", time_s);
  for (const float v : values) row += std::isnan(v) ? std::string(",") : fmt::format(",{:.7g}", v);
  row += "\n";
  out_ << row << std::flush;  // so that who is killed leaves the rows until then, and a full disk is seen at once
  if (!out_) {
    std::error_code ignored;
    if (unfinished_ != path_) std::filesystem::resize_file(unfinished_, whole_bytes_, ignored);
    refuse(path_ + ": the disk is full; make room and log again.");
  }
  whole_bytes_ += row.size();
  ++rows_;
  last_s_ = time_s;
}

void LogFile::finish() {
  out_.close();
  if (!out_) refuse(path_ + ": the disk is full; make room and log again.");
  finished_ = true;
  if (unfinished_ == path_) return;
  std::error_code error;
  std::filesystem::rename(unfinished_, path_, error);
  if (error) refuse(path_ + ": cannot be written (" + error.message() + "); its rows are in " + unfinished_ + ".");
}

void LogFile::end(const UserError& error) const {
  if (rows_ == 0 || finished_) throw error;
  std::string sentence = error.what();
  if (!sentence.empty() && sentence.back() == '.') sentence.pop_back();
  throw UserError(static_cast<Exit>(error.exit_code()),
                  fmt::format("{}; {} holds the {} rows until then.", sentence, path_, rows_));
}

double BoardTime::at(std::uint32_t period) {
  if (begun_) elapsed_ += period - last_;
  begun_ = true;
  last_ = period;
  return static_cast<double>(elapsed_) / pwm_Hz_;
}

}  // namespace console

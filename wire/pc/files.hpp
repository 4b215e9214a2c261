// SPDX-License-Identifier: MIT
// Writing files whole or not at all.
#pragma once

#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "wire/pc/user_error.hpp"

namespace wire::pc {

/// A device, a pipe or a link is written to and stays what it is: a file that takes its name would put it away.
inline bool stays(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (fs::is_symlink(path, error)) return true;
  return fs::exists(path, error) && !fs::is_regular_file(path, error) && !fs::is_directory(path, error);
}

/// Where `path` is written until it is whole.
inline std::string unfinished(const std::string& path) { return stays(path) ? path : path + ".part"; }

/// Writes `text` beside `path` and renames it into place: whoever reads `path` sees the old file or the new one. Makes
/// the folder if it is missing. Throws UserError (usage) when the place cannot be written.
inline void write_whole(const std::string& path, const std::string& text) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path folder = fs::path(path).parent_path();
  if (!folder.empty()) fs::create_directories(folder, error);
  const std::string part = unfinished(path);
  {
    std::ofstream out(part, std::ios::binary);
    out << text;
    out.flush();
    if (!out) {
      if (part != path) std::remove(part.c_str());
      throw UserError(Exit::usage, path + ": cannot be written; choose another folder or make room.");
    }
  }
  if (part == path) return;
  fs::rename(part, path, error);
  if (error) {
    std::remove(part.c_str());
    throw UserError(Exit::usage, path + ": cannot be written (" + error.message() + "); choose another place.");
  }
}

/// Before work whose results go into a folder: makes it if it is missing. Throws UserError (usage) when nothing can be
/// written there.
inline void need_folder(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  fs::create_directories(path, error);
  if (!fs::is_directory(path, error) || ::access(path.c_str(), W_OK) != 0)
    refuse(path + ": cannot be written, or is no folder; choose another place.");
}

/// Before work whose result goes into a file: its folder must be there, and a file that is there stays unless `force`.
/// For what cannot be had a second time, such as a log; what a command makes anew it may replace. Throws UserError
/// (usage).
inline void need_new_file(const std::string& path, bool force) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path folder = fs::path(path).parent_path();
  if (!folder.empty() && !fs::is_directory(folder, error))
    refuse(path + ": there is no folder " + folder.string() + "; make it, or choose another place.");
  if (fs::is_directory(path, error)) refuse(path + ": this is a folder; name a file in it.");
  if (!force && fs::is_regular_file(path, error))
    refuse(path + ": there is such a file already; choose another name, or say --force to write over it.");
  if (!force && fs::is_regular_file(path + ".part", error))
    refuse(path +
           ".part: another hotcore writes it now, or was killed while it did; move it away, or say --force to "
           "write over it.");
}

}  // namespace wire::pc

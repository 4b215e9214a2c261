// SPDX-License-Identifier: MIT
// The program identify, asked as a user asks it.
#pragma once

#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace tests {

struct Outcome {
  int code;
  std::string out;  // and what went to standard error
};

inline Outcome run(const std::string& arguments) {
  const std::string out = (std::filesystem::temp_directory_path() / "hotcore_identify_out").string();
  const int status = std::system((std::string(IDENTIFY_PROGRAM) + " " + arguments + " > '" + out + "' 2>&1").c_str());
  std::ostringstream text;
  text << std::ifstream(out).rdbuf();
  return {WEXITSTATUS(status), text.str()};
}

}  // namespace tests

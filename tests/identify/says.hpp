// SPDX-License-Identifier: MIT
// What a sentence must say, shown whole where it does not.
#pragma once

#include <gtest/gtest.h>

#include <source_location>
#include <string>

namespace tests {

inline void says(const std::string& text, const std::string& part,
                 const std::source_location& at = std::source_location::current()) {
  if (text.find(part) != std::string::npos) return;
  ADD_FAILURE_AT(at.file_name(), static_cast<int>(at.line())) << "'" << text << "' does not say '" << part << "'";
}

}  // namespace tests

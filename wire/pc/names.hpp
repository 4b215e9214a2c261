// SPDX-License-Identifier: MIT
// "Did you mean": the known name closest to a misspelt one.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace wire::pc {

/// The entry of `known` with the smallest edit distance to `given`; empty when none is closer than half its length.
std::string nearest(std::string_view given, const std::vector<std::string>& known);

/// ", did you mean 'x'?" or nothing.
std::string did_you_mean(std::string_view given, const std::vector<std::string>& known);

}  // namespace wire::pc

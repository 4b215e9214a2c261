// SPDX-License-Identifier: MIT
// Of this firmware, as `hello` says it.
#pragma once

namespace firmware {

inline constexpr char version[] = "0.5.0";

}  // namespace firmware

// SPDX-License-Identifier: MIT
// In the sanitizer build every invalid operation, division by zero and overflow of a fault-free run stops the program.
#ifdef HOTCORE_TRAP_FLOATS
#include <cfenv>

namespace {
[[maybe_unused]] const int trapping = feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
}
#endif

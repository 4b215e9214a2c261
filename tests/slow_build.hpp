// SPDX-License-Identifier: MIT
// A search is hundreds of fits, a campaign hundreds of starts of the chip; with sanitizers a few of them are enough to
// look for undefined behaviour.
#pragma once

#ifdef HOTCORE_TRAP_FLOATS
constexpr bool slow_build = true;
#else
constexpr bool slow_build = false;
#endif

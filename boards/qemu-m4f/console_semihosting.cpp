// SPDX-License-Identifier: MIT
// ARM semihosting: operation in r0, argument in r1, `bkpt 0xab`; QEMU answers with -semihosting-config enable=on.
#include <cstdint>

#include "boards/qemu-m4f/console.hpp"

namespace console {

namespace {
void ask_host(std::uint32_t operation, const void* argument) {
  register std::uint32_t r0 asm("r0") = operation;
  register const void* r1 asm("r1") = argument;
  asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}
}  // namespace

void write(const char* text) { ask_host(0x04, text); }  // SYS_WRITE0

void quit(int code) {
  const std::uint32_t block[2] = {0x20026, static_cast<std::uint32_t>(code)};  // ADP_Stopped_ApplicationExit
  for (;;) ask_host(0x20, block);                                              // SYS_EXIT_EXTENDED
}

}  // namespace console

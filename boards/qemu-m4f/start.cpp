// SPDX-License-Identifier: MIT
// Start-up for the two QEMU machines: FPU on, memory set, main, and its result as the emulator's exit code. Any
// exception ends the run with code 99.
#include <cstdint>
#include <cstring>

#include "boards/qemu-m4f/console.hpp"

int main();

extern "C" {
extern std::uint8_t data_in_flash[], data_start[], data_end[], bss_start[], bss_end[];
extern std::uint32_t stack_top;
extern void (*init_array_start[])();
extern void (*init_array_end[])();

[[noreturn]] void unexpected() {
  console::write("unexpected exception\n");
  console::quit(99);
}

[[noreturn]] void reset() {
  constexpr std::uintptr_t cpacr = 0xE000ED88;  // ARMv7-M: coprocessor access, 10 and 11 are the FPU
  *reinterpret_cast<volatile std::uint32_t*>(cpacr) |= 0xFu << 20;
  asm volatile("dsb\nisb");
  std::memcpy(data_start, data_in_flash, static_cast<std::size_t>(data_end - data_start));
  std::memset(bss_start, 0, static_cast<std::size_t>(bss_end - bss_start));
  for (auto constructor = init_array_start; constructor != init_array_end; ++constructor) (*constructor)();
  console::quit(main());
}

struct Vectors {
  const void* stack;
  void (*handlers[15])();
};

[[gnu::section(".vectors"), gnu::used]] const Vectors vectors{
    &stack_top,
    {reset, unexpected, unexpected, unexpected, unexpected, unexpected, nullptr, nullptr, nullptr, nullptr, unexpected,
     unexpected, nullptr, unexpected, unexpected}};
}

// SPDX-License-Identifier: MIT
// From the reset vector to the application, and every vector. The first thing an image does on silicon: FPU, RAM,
// clocks, pins; gates stay off all the while (resistors hold them until bring_up_pins, then the pins do).
#include <cstdint>
#include <cstring>
#include <new>

#include "boards/h8-15d/application.hpp"
#include "boards/h8-15d/hardware.hpp"

extern "C" {
extern std::uint32_t stack_bottom[], stack_top[], data_load[], data_start[], data_end[], bss_start[], bss_end[];
[[noreturn]] void reset_handler();
[[noreturn]] void fault_handler();
void nmi_handler();
void pvd_handler();
void index0_handler();
void index1_handler();
void adc_handler();
void usb_handler();
void systick_handler();
[[noreturn]] void unexpected_handler();

alignas(h8_15d::Application) unsigned char application_storage[sizeof(h8_15d::Application)];
}

namespace {

using namespace h8_15d;

/// No pointer to it: a flipped one would let every interrupt work on what is none. Not before it is built.
Application& application() { return *std::launder(reinterpret_cast<Application*>(application_storage)); }

[[noreturn]] void sleep_for_ever() {
  for (;;) asm volatile("wfi");
}

}  // namespace

extern "C" {

[[gnu::section(".text.reset")]] void reset_handler() {
  reg(system::cpacr) = 0xFu << 20;  // full access to the FPU, B3.2.20
  asm volatile("dsb\nisb");
  std::uint32_t* here;
  asm volatile("mov %0, sp" : "=r"(here));
  for (std::uint32_t* p = stack_bottom; p < here - 16; ++p) *p = 0xC0DEC0DE;  // paint, to see how deep it goes
  for (std::uint32_t *to = data_start, *from = data_load; to < data_end;) *to++ = *from++;
  for (std::uint32_t* p = bss_start; p < bss_end;) *p++ = 0;
  reg(system::vtor) = 0x08000000;

  const std::uint32_t reset_flags = reg(rcc::csr);
  bring_up_pins();
  const bool clock_good = bring_up_clocks();
  set(rcc::csr, bit(24));  // RMVF: the next start has its own cause
  bring_up_supply_watch();
  wait_for_supply();
  bring_up_backup_ram();
  bring_up_cycle_counter();
  if (clock_good) bring_up_encoders();
  new (application_storage) Application();
  application().prepare(reset_flags, clock_good);
  application().run();
}

/// The crystal stopped (CSS). The break has opened the bridges by itself; start again from HSI and stay disarmed.
void nmi_handler() {
  all_gates_off();
  reg(rcc::cir) = bit(23);          // CSSC
  reg(system::aircr) = 0x05FA0004;  // SYSRESETREQ
  sleep_for_ever();
}

void fault_handler() {
  all_gates_off();
  for (;;) {
  }  // a watchdog ends it
}

void unexpected_handler() {
  all_gates_off();
  for (;;) {
  }
}

void pvd_handler() {
  reg(exti::pr) = bit(16);
  application().supply_falls();
}

void index0_handler() {
  reg(exti::pr) = bit(3);
  application().index(0);
}

void index1_handler() {
  reg(exti::pr) = bit(8);
  application().index(1);
}

void adc_handler() { application().control(); }
void usb_handler() { application().usb(); }
void systick_handler() { application().tick(); }

// RM0090 12.2, Table 61.
using Vector = void (*)();
struct VectorTable {
  std::uint32_t* initial_stack;
  Vector handlers[15 + 82];
};
extern const VectorTable vectors;
[[gnu::section(".vectors"), gnu::used]] const VectorTable vectors = {stack_top,
                                                                     {
                                                                         reset_handler,
                                                                         nmi_handler,
                                                                         fault_handler,
                                                                         fault_handler,
                                                                         fault_handler,
                                                                         fault_handler,
                                                                         nullptr,
                                                                         nullptr,
                                                                         nullptr,
                                                                         nullptr,
                                                                         unexpected_handler,
                                                                         unexpected_handler,
                                                                         nullptr,
                                                                         unexpected_handler,
                                                                         systick_handler,
#define U unexpected_handler
                                                                         U,
                                                                         pvd_handler,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,  // 0 WWDG .. 7 EXTI1
                                                                         U,
                                                                         index0_handler,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,  // 8 EXTI2, 9 EXTI3 ..
                                                                         U,
                                                                         U,
                                                                         adc_handler,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         index1_handler,  // 16.. 18 ADC, 23 EXTI9_5
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         usb_handler,  // 67 OTG_FS
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
                                                                         U,
#undef U
                                                                     }};

}  // extern "C"

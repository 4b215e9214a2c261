// SPDX-License-Identifier: MIT
// Common test image for two NVICs: QEMU's (mps2-an386) and the chip model's. Pends interrupts of several priorities
// from thread and from handlers, masks and unmasks them, and writes down the order in which handlers begin and end.
// Bare metal, no peripheral but the system control space; talks by semihosting, so both homes print the same words or
// they do not.
#include <cstdint>

extern "C" {
extern std::uint32_t stack_top;
[[noreturn]] void reset_handler();
}

namespace {

volatile std::uint32_t& reg(std::uint32_t address) { return *reinterpret_cast<volatile std::uint32_t*>(address); }
volatile std::uint8_t& byte(std::uint32_t address) { return *reinterpret_cast<volatile std::uint8_t*>(address); }

char text[2048];
volatile unsigned length;

void say(char a, unsigned number) {
  if (length > sizeof text - 8) return;
  text[length] = a;
  text[length + 1] = static_cast<char>('0' + number / 10);
  text[length + 2] = static_cast<char>('0' + number % 10);
  text[length + 3] = ' ';
  length = length + 4;
}

int semihost(int operation, const void* argument) {
  register int r0 asm("r0") = operation;
  register const void* r1 asm("r1") = argument;
  asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}

void pend(unsigned irq) {
  reg(0xE000E200 + 4 * (irq / 32)) = 1u << (irq % 32);
  asm volatile("dsb\nisb" ::: "memory");
}
void priority(unsigned irq, unsigned level) { byte(0xE000E400 + irq) = static_cast<std::uint8_t>(level << 4); }
void enable(unsigned irq) { reg(0xE000E100 + 4 * (irq / 32)) = 1u << (irq % 32); }
unsigned running() {
  unsigned ipsr;
  asm volatile("mrs %0, ipsr" : "=r"(ipsr));
  return ipsr;
}

void barrier() { asm volatile("dsb\nisb" ::: "memory"); }

volatile unsigned script;  // which of the scenarios a handler plays

extern "C" void handler() {
  const unsigned me = running();
  say('<', me);
  volatile float touched = 1.5f;  // a handler that uses the FPU: 26 words on the stack
  touched = touched * 2.0f;
  if (me == 16 + 5 && script == 1) pend(2);  // more urgent: preempts
  if (me == 16 + 5 && script == 2) pend(9);  // less urgent: waits, then tail-chains
  if (me == 16 + 5 && script == 3) {
    pend(9);
    pend(2);
    pend(7);
  }
  if (me == 16 + 7 && script == 3) pend(7);  // itself once more
  if (me == 16 + 7) script = 4;
  if (me == 16 + 11 && script == 5) {
    reg(0xE000ED04) = 1u << 28;
    barrier();
    pend(5);
  }
  if (me == 16 + 2 && script == 6) {
    reg(0xE000ED04) = 1u << 31;
    barrier();
  }  // NMI out of the most urgent one
  say('>', me);
}

}  // namespace

#define H handler
using Vector = void (*)();
struct Table {
  std::uint32_t* top;
  Vector handlers[47];
};
extern "C" __attribute__((section(".vectors"), used)) const Table vectors = {&stack_top,
                                                                             {reset_handler,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              0,
                                                                              0,
                                                                              0,
                                                                              0,
                                                                              H,
                                                                              H,
                                                                              0,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H,
                                                                              H}};

extern "C" void reset_handler() {
  reg(0xE000ED88) = 0xFu << 20;  // CPACR, Armv7-M ARM B3.2.20
  barrier();
  length = 0;
  script = 0;
  priority(2, 1);
  priority(5, 4);
  priority(7, 4);
  priority(9, 8);
  priority(11, 12);
  byte(0xE000ED22) = 0xF0;  // PendSV last
  constexpr unsigned used[] = {2, 5, 7, 9, 11};
  for (const unsigned irq : used) enable(irq);
  barrier();
  for (unsigned s = 1; s <= 3; ++s) {
    script = s;
    say('s', script);
    pend(5);
  }
  script = 4;
  say('m', 0);
  asm volatile("cpsid i");
  pend(11);
  pend(9);
  pend(7);
  pend(5);
  pend(2);  // all wait
  say('m', 1);
  asm volatile("cpsie i\nisb");
  say('b', 0);
  unsigned base = 0x40;
  asm volatile("msr basepri, %0\nisb" ::"r"(base));
  pend(5);
  pend(9);
  pend(2);  // only the one above 4 passes
  say('b', 1);
  base = 0;
  asm volatile("msr basepri, %0\nisb" ::"r"(base));
  script = 5;
  say('s', 5);
  pend(11);
  script = 6;
  say('s', 6);
  pend(2);
  script = 0;
  reg(0xE000ED0C) = 0x05FA0500;  // PRIGROUP 5: groups of four levels
  say('g', 0);
  script = 1;
  priority(2, 3);  // same group as 0: of 5 (group 1) still more urgent
  pend(5);
  priority(2, 5);  // same group as 4: no preemption any more
  script = 1;
  pend(5);
  say('e', 0);
  text[length] = '\n';
  text[length + 1] = 0;
  semihost(4, text);
  const std::uint32_t code[2] = {0x20026, 0};
  semihost(0x20, code);
  for (;;) {
  }
}

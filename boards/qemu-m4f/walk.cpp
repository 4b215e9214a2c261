// SPDX-License-Identifier: MIT
// Prints the digits of the walk: every 100 ms both axes' state as bits, and a hash over every duty of every period. The
// same source runs on the PC and on the Cortex-M4F; compare.cmake wants the same text.
#include <bit>

#include "boards/qemu-m4f/console.hpp"
#include "boards/qemu-m4f/replay.hpp"

namespace {

struct Hash {
  std::uint64_t value = 0xcbf29ce484222325u;  // FNV-1a, 64 bit
  void add(std::uint32_t word) {
    for (int i = 0; i < 4; ++i, word >>= 8) value = (value ^ (word & 0xFF)) * 0x100000001b3u;
  }
  void add(float x) { add(std::bit_cast<std::uint32_t>(x)); }
};

struct DutyHash {
  Hash hash;
  void before() {}
  void after_tick(int, const hal::Duty& duty) {
    hash.add(duty.ratio.a);
    hash.add(duty.ratio.b);
    hash.add(duty.ratio.c);
    hash.add(static_cast<std::uint32_t>(duty.on));
  }
  void after_slow() {}
};

void print(float x) {
  console::write(" ");
  console::write_hex(std::bit_cast<std::uint32_t>(x), 8);
}

void print(const firmware::Axis& axis) {
  const firmware::AxisState& s = axis.state();
  console::write(" | ");
  console::write(text_of(s.mode));
  console::write(" ");
  console::write(wire::text_of(s.limit).name);
  console::write(" ");
  console::write(wire::text_of(s.fault.fault).name);
  for (const float x : {s.fast.current_A.d, s.fast.current_A.q, s.fast.voltage_V.q, s.fast.rad_per_s, s.allowance_A,
                        s.core_sigma_K, s.fault.value, s.fault.age_s})
    print(x);
  for (int i = 0; i < axis.core().estimate().node_count; ++i) {
    console::write(" ");
    console::write_hex(std::bit_cast<std::uint64_t>(axis.core().estimate().degC[i]), 16);
  }
}

}  // namespace

int main() {
  DutyHash watch;
  replay::Walk walk(watch);
  for (int t = 0; t < replay::slow_ticks; ++t) {
    walk.run(t);
    if (t % 10 != 9) continue;
    console::write_hex(static_cast<unsigned>(t), 3);
    print(walk.driver().axis(0));
    print(walk.driver().axis(1));
    console::write(" | ");
    console::write_hex(watch.hash.value, 16);
    console::write("\n");
  }
  console::write("calls refused ");
  console::write(static_cast<unsigned>(walk.refused));
  console::write("\n");
  console::quit(0);
}

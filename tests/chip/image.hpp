// SPDX-License-Identifier: MIT
// The flash image on its board, for tests: two motors from their sheets, parameters flashed, powered on. Without the
// image (preset h8-15d not built) a test says so and is skipped; ./test builds it first.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>

#include "boards/h8-15d/board.hpp"
#include "boards/host/chip/pcb.hpp"
#include "wire/pc/motor_file.hpp"

namespace image_tests {

inline const std::string image = std::getenv("HOTCORE_IMAGE")
                                     ? std::getenv("HOTCORE_IMAGE")  // a mutant
                                     : std::string(HOTCORE_SOURCE_DIR) + "/build/h8-15d/bin/h8-15d.elf";
inline const std::string order_image = std::string(HOTCORE_SOURCE_DIR) + "/build/h8-15d/bin/nvic-order.elf";

#define NEEDS_IMAGE(path)                                                                              \
  if (!std::filesystem::exists(path)) {                                                                \
    ASSERT_EQ(std::getenv("HOTCORE_ALL"), nullptr) << path << " is missing";                           \
    GTEST_SKIP() << "skipped: no flash image; cmake --preset h8-15d && cmake --build --preset h8-15d"; \
  }

struct Options {
  std::string motor = "ec-powermax-30-48v";
  bool locked = true;
  bool parameters = true;
  double offset_A = 0.2;
  unsigned cycles_per_instruction = 1;
  std::uint64_t seed = 1;
};

inline host_sim::BenchDesign design_of(const Options& o) {
  const wire::Motor sheet = wire::pc::read_motor(o.motor, std::string(HOTCORE_SOURCE_DIR) + "/boards/motors").motor;
  host_sim::BenchDesign d;
  for (auto& axis : d.axes) axis = host_sim::axis_from_sheet(sheet);
  d.sensors = boards::h8_15d_sensors();
  d.sensors.current_offset_A[0] = o.offset_A;
  d.sensors.current_offset_A[2] = -o.offset_A;
  return d;
}

inline void setup_of(const Options& o, firmware::AxisSet (&setup)[2]) {
  const wire::Motor sheet = wire::pc::read_motor(o.motor, std::string(HOTCORE_SOURCE_DIR) + "/boards/motors").motor;
  for (auto& s : setup) {
    s.drive = firmware::parameters_from(sheet, h8_15d::rating, {48.0f, 0.0f});
    s.heat = firmware::heat_parameters_from(sheet, thermal::sheet_trust);
  }
}

inline std::unique_ptr<boards::Pcb> board(const Options& o = {}) {
  auto pcb = std::make_unique<boards::Pcb>(design_of(o), o.seed);
  pcb->flash_image(image);
  if (o.parameters) {
    firmware::AxisSet setup[2];
    setup_of(o, setup);
    pcb->flash_parameters(setup);
  }
  if (o.locked) {
    for (int i = 0; i < 2; ++i) pcb->bench.load(i).mode = host_sim::Load::Mode::locked;
  }
  pcb->chip.core().set_cycles_per_instruction(o.cycles_per_instruction);
  pcb->power_on(static_cast<std::uint32_t>(o.seed));
  return pcb;
}

/// Keeps both setpoints alive for a while, as a host would, every 10 ms.
inline void hold(boards::Pcb& pcb, float iq0_A, float iq1_A, double seconds) {
  for (int k = static_cast<int>(seconds / 0.01 + 0.5); k > 0; --k) {
    pcb.set_current(0, 0.0f, iq0_A);
    pcb.set_current(1, 0.0f, iq1_A);
    pcb.run_for(0.01);
  }
}

/// Mean of the true current over some periods: noise and ripple of the loop away.
inline double mean_iq_A(boards::Pcb& pcb, int axis, float iq0_A, float iq1_A, double seconds = 0.02) {
  double sum = 0;
  const int n = static_cast<int>(seconds / 1e-3);
  for (int k = 0; k < n; ++k) {
    if (k % 10 == 0) hold(pcb, iq0_A, iq1_A, 0.0);
    pcb.set_current(0, 0.0f, iq0_A);
    pcb.set_current(1, 0.0f, iq1_A);
    pcb.run_for(1e-3);
    sum += pcb.bench.truth(axis).current_q_A;
  }
  return sum / n;
}

}  // namespace image_tests

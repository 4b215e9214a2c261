// SPDX-License-Identifier: MIT
#include "firmware/axis.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "tests/firmware/bench.hpp"

namespace {

using firmware::Mode;

/// A driver whose first axis runs a bench motor.
struct Rig {
  explicit Rig(const firmware::DriverSetup& setup = bench::driver_setup()) : driver(setup) {}

  void run(int periods) {
    for (int i = 0; i < periods; ++i) {
      duty = axis().tick(motor.sample());
      motor.run(duty);
      if (++ticks % 200 == 0) driver.slow_tick({{25.0f, true}, 0.0f, false}, {{{25.0f, true}}, {{25.0f, true}}});
    }
  }
  void bring_up() {
    run(2100);
    ASSERT_EQ(axis().arm(), wire::Status::done);
    run(1);
    ASSERT_EQ(axis().mode(), Mode::ready);
  }
  void hold(wire::Dq current_A, int periods) {
    for (int i = 0; i < periods; i += 100) {
      ASSERT_EQ(axis().set_current(current_A), wire::Status::done);
      run(100);
    }
  }
  firmware::Axis& axis() { return driver.axis(0); }

  firmware::Driver driver;
  bench::Motor motor;
  hal::Duty duty{};
  int ticks = 0;
};

TEST(Axis, ReachesTheAskedCurrentAtStandstillAndAtSpeed) {
  for (const double rad_per_s : {0.0, 300.0, -600.0}) {
    Rig rig;
    rig.motor.rad_per_s = rad_per_s;
    rig.run(1);
    rig.motor.rad_per_s = 0.0;
    rig.bring_up();
    rig.motor.rad_per_s = rad_per_s;
    rig.hold({0.0f, 0.0f}, 2000);
    rig.hold({1.0f, 5.0f}, 2000);
    // Means over 0.1 s: where a phase current crosses zero, dead time leaves a tenth of an ampere for some periods.
    double id_A = 0.0, iq_A = 0.0;
    constexpr int periods = 2000;
    for (int i = 0; i < periods; ++i) {
      ASSERT_EQ(rig.axis().set_current({1.0f, 5.0f}), wire::Status::done);
      rig.run(1);
      id_A += rig.motor.id_A / periods;
      iq_A += rig.motor.iq_A / periods;
    }
    EXPECT_NEAR(id_A, 1.0, 0.02) << rad_per_s;
    EXPECT_NEAR(iq_A, 5.0, 0.02) << rad_per_s;
    EXPECT_EQ(rig.axis().mode(), Mode::running);
  }
}

}  // namespace

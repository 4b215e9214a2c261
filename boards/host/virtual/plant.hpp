// SPDX-License-Identifier: MIT
// What a virtual board drives: two motors on one supply. Either host-sim's bench (full), or a dq motor with an averaged
// bridge, ideal sensors and two thermal resistors that costs a hundredth of it: for many boards in one process.
#pragma once

#include <cstdint>
#include <memory>

#include "firmware/driver.hpp"
#include "wire/motor.hpp"

namespace boards::host {

class Plant {
 public:
  virtual ~Plant() = default;
  virtual hal::AxisSample sample(int axis) = 0;
  /// One PWM period with the duties given the period before; these load for the next one.
  virtual void advance(const hal::Duty (&next)[firmware::axis_count]) = 0;
  virtual hal::AxisSlowSample slow(int axis) = 0;
  virtual hal::BoardSlowSample slow() = 0;
};

/// `motor` on both axes, free shafts with a load of ten rotor inertias, everything at 25 degC.
std::unique_ptr<Plant> full_plant(const wire::Motor& motor, const firmware::BoardRating& rating, std::uint64_t seed);
std::unique_ptr<Plant> simple_plant(const wire::Motor& motor, const firmware::BoardRating& rating);

}  // namespace boards::host

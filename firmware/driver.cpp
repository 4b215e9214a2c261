// SPDX-License-Identifier: MIT
#include "firmware/driver.hpp"

namespace firmware {

Driver::Driver(const DriverSetup& setup)
    : peak_A_(setup.rating.peak_A), axes_{{0, setup.axes[0], setup.rating}, {1, setup.axes[1], setup.rating}} {}

void Driver::slow_tick(const hal::BoardSlowSample&, const hal::AxisSlowSample (&axes)[axis_count]) {
  for (int i = 0; i < axis_count; ++i) axes_[i].slow_tick(axes[i], {peak_A_, wire::Limit::board_hot});
}

}  // namespace firmware

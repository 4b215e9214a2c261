// SPDX-License-Identifier: MIT
// What a scene sets up whoever plays it, the firmware built for this PC (run_scene.hpp) or the flash image
// (chip/play.hpp).
#pragma once

#include "boards/host/scene.hpp"
#include "boards/host/trace.hpp"
#include "firmware/parameter_store.hpp"
#include "host-sim/plant/bench.hpp"
#include "thermal/core_estimator.hpp"
#include "wire/pc/motor_file.hpp"

namespace boards::host {

constexpr double warm_up_s = 1;  // the board has been on for a second: offsets learnt, housing heard

/// How its motors' heat goes away.
host_sim::HeatOptions heat_options(const Scene& scene);

/// Two of the motor, the supply, and how warm all is. Bridge and sensors are the board's.
host_sim::BenchDesign bench_of(const Scene& scene, const wire::Motor& motor);
host_sim::Load load_of(const Shaft& shaft);

/// `of_the_model`: of a scene whose trust is identified.
thermal::Trust trust_of(const Scene& scene, const thermal::Trust& of_the_model = thermal::identified_trust);

/// How many axes are asked for anything.
int axes_of(const Scene& scene);

/// Refuses a motor whose parameters a board of this rating would not take.
void need_drivable(const std::string& motor, const firmware::AxisSet& set, const firmware::BoardRating& rating);

/// Nothing played yet.
Result result_of(const Scene& scene, const wire::pc::MotorFile& file);

/// As the firmware believes.
double hottest_degC(const firmware::AxisState& state);

}  // namespace boards::host

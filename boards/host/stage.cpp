// SPDX-License-Identifier: MIT
#include "boards/host/stage.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "wire/pc/user_error.hpp"

namespace boards::host {

/// Than the room around the motors: the board's own electronics warm the air in its case. 40 degC in an ordinary room.
constexpr double case_warmer_K = 15;

host_sim::HeatOptions heat_options(const Scene& scene) {
  host_sim::HeatOptions options;
  options.coolant_R2_K_per_W = scene.coolant_K_per_W;
  return options;
}

host_sim::BenchDesign bench_of(const Scene& scene, const wire::Motor& motor) {
  host_sim::BenchDesign design;
  for (host_sim::AxisDesign& axis : design.axes) axis = host_sim::axis_from_sheet(motor, heat_options(scene));
  design.supply.open_V = scene.supply_V;
  design.supply.can_sink = scene.supply_sinks;
  design.start_degC = scene.start_degC;
  design.ambient_degC = scene.ambient_degC;
  design.board_ambient_degC = scene.ambient_degC + case_warmer_K;
  return design;
}

host_sim::Load load_of(const Shaft& shaft) {
  host_sim::Load load;
  if (shaft.kind == Shaft::Kind::locked) load.mode = host_sim::Load::Mode::locked;
  if (shaft.kind == Shaft::Kind::imposed) load.mode = host_sim::Load::Mode::imposed_speed;
  load.inertia_kg_m2 = shaft.load_inertia_kg_m2;
  return load;
}

thermal::Trust trust_of(const Scene& scene, const thermal::Trust& of_the_model) {
  return scene.trust == "sheet"        ? thermal::sheet_trust
         : scene.trust == "identified" ? of_the_model
                                       : thermal::exact_trust;
}

int axes_of(const Scene& scene) {
  return std::any_of(scene.demands.begin(), scene.demands.end(), [](const Demand& d) { return d.axis == 1; }) ? 2 : 1;
}

void need_drivable(const std::string& motor, const firmware::AxisSet& set, const firmware::BoardRating& rating) {
  const wire::Answer found = firmware::check({{set, set}}, rating);
  if (found.status == 0) return;
  for (int i = 0; i < firmware::parameter_count; ++i) {
    const wire::ParameterInfo& p = *firmware::parameter_info(i);
    if (p.id != found.id) continue;
    wire::pc::refuse(fmt::format("{}: a board does not take its {} = {:g} {} ({:g} to {:g}: {}).", motor, p.name,
                                 firmware::parameter_value(set, i), wire::text_of(p.unit), p.min, p.max, p.doc));
  }
}

Result result_of(const Scene& scene, const wire::pc::MotorFile& file) {
  return {.scene = scene,
          .motor_name = file.name,
          .surrogate = file.surrogate,
          .winding_max_degC = file.motor.winding_max_degC,
          .optimal_impulse_As = 0,
          .traces = {}};
}

double hottest_degC(const firmware::AxisState& state) {
  return static_cast<double>(std::max({state.core_degC[0], state.core_degC[1], state.core_degC[2]}));
}

}  // namespace boards::host

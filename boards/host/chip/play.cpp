// SPDX-License-Identifier: MIT
#include "boards/host/chip/play.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <filesystem>

#include "boards/h8-15d/board.hpp"
#include "boards/host/chip/pcb.hpp"
#include "boards/host/stage.hpp"
#include "wire/pc/motor_file.hpp"
#include "wire/pc/user_error.hpp"

namespace boards {
namespace {

using host::warm_up_s;
using host_sim::chip::to_s;

constexpr int adc_exception = 16 + 18;

double counts_to_degC(double counts) {
  const double ohm = 10e3 * counts / (4095 - counts);
  return 1 / (1 / 298.15 + std::log(ohm / 10e3) / 3950) - 273.15;
}

}  // namespace

std::unique_ptr<Pcb> board_of(const host::Scene& scene, const std::string& elf, const std::string& motor_folder) {
  if (std::error_code none; !std::filesystem::is_regular_file(elf, none))
    wire::pc::refuse(elf +
                     ": there is no such image; build it with: cmake --preset h8-15d && cmake --build --preset h8-15d");
  if (scene.board != "h8-15d")
    wire::pc::refuse("The chip model has the board h8-15d only; use host-sim for " + scene.board + ".");
  const wire::pc::MotorFile file = wire::pc::read_motor(scene.motor, motor_folder);

  host_sim::BenchDesign design = bench_of(scene, file.motor);
  design.sensors = h8_15d_sensors();
  const wire::Motor known = host_sim::true_sheet(file.motor, design.axes[0].heat);

  auto pcb = std::make_unique<Pcb>(design, scene.seed);
  pcb->flash_image(elf);
  const firmware::AxisSet set{
      firmware::parameters_from(known, h8_15d::rating, {static_cast<float>(scene.supply_V), 0.0f}),
      firmware::heat_parameters_from(known, trust_of(scene))};
  host::need_drivable(scene.motor, set, h8_15d::rating);
  pcb->flash_parameters({set, set});
  for (int axis = 0; axis < 2; ++axis) pcb->bench.load(axis) = load_of(scene.shaft);
  return pcb;
}

ChipPlay play_on_chip(const host::Scene& scene, const std::string& elf, const std::string& motor_folder,
                      const std::function<void(double)>& progress) {
  const std::unique_ptr<Pcb> board = board_of(scene, elf, motor_folder);
  Pcb& pcb = *board;
  const wire::pc::MotorFile file = wire::pc::read_motor(scene.motor, motor_folder);
  const auto started = std::chrono::steady_clock::now();
  const std::clock_t processor = std::clock();
  pcb.power_on(scene.seed);
  pcb.run_for(
      0.5 * warm_up_s);  // on its index pulse at power-on, so the encoder knows its zero; then somebody turns the shaft
  for (int axis = 0; axis < 2; ++axis) pcb.bench.motor(axis).place(scene.shaft.angle_rad / file.motor.pole_pairs, 0);
  pcb.run_for(0.5 * warm_up_s - 0.03);
  if (!pcb.arm()) {
    const wire::CodeText text = wire::text_of(static_cast<wire::Status>(pcb.door().answer[0]));
    wire::pc::refuse(std::string("The image would not arm: ") + text.happened + "; " + text.advice + ".\n" +
                     pcb.chip.report_text());
  }

  ChipPlay play;
  play.result = result_of(scene, file);
  play.result.motor_name += ", on the chip model";
  play.result.scene.limiters = {host::Limiter::governor};
  for (int axis = 0; axis < axes_of(scene); ++axis) play.result.traces.push_back({host::Limiter::governor, axis, {}});
  pcb.chip.core().clear_counts();
  const double first_s = to_s(pcb.chip.now());
  const int log_ms = std::max(1, static_cast<int>(std::lround(1000 / scene.log_Hz)));
  const int total_ms = static_cast<int>(std::lround(scene.seconds * 1000));
  double squares[2] = {}, currents[2] = {}, speeds[2] = {}, torques[2] = {}, shafts[2] = {};
  int summed = 0;
  std::vector<double> landings = scene.shaft.landings_s;
  for (int ms = 0; ms < total_ms; ++ms) {
    const double time_s = ms * 1e-3;
    for (const host::Trace& t : play.result.traces)
      pcb.set_current(t.axis, 0.0f, static_cast<float>(host::demand_A(scene, t.axis, time_s)));
    if (scene.shaft.kind == host::Shaft::Kind::imposed) {
      for (int axis = 0; axis < 2; ++axis)
        pcb.bench.load(axis).speed_rad_per_s = imposed_speed_rad_per_s(scene, time_s);
    }
    if (!landings.empty() && time_s >= landings.front()) {
      for (int axis = 0; axis < 2; ++axis) pcb.bench.motor(axis).place(pcb.bench.motor(axis).angle_rad(), 0);
      landings.erase(landings.begin());
    }
    for (int step = 0; step < 4; ++step) {  // truth at 4 kHz
      pcb.run_for(0.25e-3);
      ++summed;
      for (host::Trace& t : play.result.traces) {
        const host_sim::AxisTruth truth = pcb.bench.truth(t.axis);
        const double i_A2 = truth.current_d_A * truth.current_d_A + truth.current_q_A * truth.current_q_A;
        squares[t.axis] += i_A2;
        currents[t.axis] += truth.current_q_A;
        speeds[t.axis] += truth.speed_rad_per_s;
        torques[t.axis] += truth.torque_Nm;
        shafts[t.axis] += truth.shaft_W;
        t.hottest_true_degC = std::max(t.hottest_true_degC, truth.hottest_degC);
        t.peak_shaft_W = std::max(t.peak_shaft_W, truth.shaft_W);
        if (host::demand_A(scene, t.axis, time_s) != 0) t.impulse_As += std::sqrt(i_A2) * 0.25e-3;
      }
    }
    if ((ms + 1) % log_ms != 0) continue;
    const h8_15d::Door door = pcb.door();
    for (host::Trace& t : play.result.traces) {
      const firmware::AxisState& state = door.axis[t.axis];
      const host_sim::AxisTruth truth = pcb.bench.truth(t.axis);
      host::Row row{};
      row.time_s = time_s + 1e-3;
      row.demand_A = host::demand_A(scene, t.axis, time_s);
      row.allowance_A = static_cast<double>(state.allowance_A);
      row.id_now_A = truth.current_d_A;
      row.iq_now_A = truth.current_q_A;
      row.iq_A = currents[t.axis] / summed;
      row.current_A = wire::direct_per_amplitude * std::sqrt(squares[t.axis] / summed);
      row.speed_rad_per_s = speeds[t.axis] / summed;
      row.torque_Nm = torques[t.axis] / summed;
      row.shaft_W = shafts[t.axis] / summed;
      row.bus_V = pcb.bench.bus_V();
      row.bus_A = static_cast<double>(door.bus_A);
      row.depth_ratio = host::modulation_depth(pcb.duty(t.axis));
      row.estimated_core_degC = host::hottest_degC(state);
      row.core_sigma_K = static_cast<double>(state.core_sigma_K);
      row.true_core_degC = truth.hottest_degC;
      row.housing_degC = counts_to_degC(pcb.bench.raw(t.axis).housing_counts);
      row.true_housing_degC = truth.housing_degC;
      row.ambient_degC = scene.ambient_degC;
      row.limit = state.limit;
      row.fault = state.fault.fault;
      t.rows.push_back(row);
      squares[t.axis] = currents[t.axis] = speeds[t.axis] = torques[t.axis] = shafts[t.axis] = 0;
    }
    summed = 0;
    if (progress) progress(static_cast<double>(ms + 1) / total_ms);
  }
  play.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
  play.result.simulated_s = warm_up_s + scene.seconds;
  play.result.cpu_s = static_cast<double>(std::clock() - processor) / CLOCKS_PER_SEC;
  play.mistakes = pcb.chip.report_text();
  play.mistake_count = pcb.chip.troubles().count();
  play.resets = pcb.chip.resets();
  for (int lane = 0; lane < 2; ++lane) {
    const host_sim::chip::LaneCount& count = pcb.chip.core().lane(lane == 0 ? adc_exception : 0);
    play.lane_worst[lane] = static_cast<double>(count.worst);
    play.lane_mean[lane] =
        static_cast<double>(count.total) / static_cast<double>(std::max<std::uint64_t>(1, count.calls));
  }
  play.asleep_share = to_s(pcb.chip.core().slept()) / std::max(to_s(pcb.chip.now()) - first_s, 1e-9);
  return play;
}

}  // namespace boards

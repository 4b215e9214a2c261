// SPDX-License-Identifier: MIT
#include "boards/host/run_scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>

#include "boards/dual_48v_80a.hpp"
#include "boards/host/board.hpp"
#include "boards/host/heat_file.hpp"
#include "boards/host/optimum.hpp"
#include "boards/host/stage.hpp"
#include "firmware/driver.hpp"
#include "host-sim/plant/bench.hpp"
#include "thermal/motor_set.hpp"
#include "wire/pc/motor_file.hpp"
#include "wire/pc/user_error.hpp"

namespace boards::host {
namespace {

constexpr double no_limit_degC = 1000;    // for limiters that must do without the governor
constexpr double oracle_band_K = 1;       // within which the oracle's current falls from all to none
constexpr double restart_K = 10;          // a cut limiter comes back this far below its limit
constexpr int setpoint_periods = 20;      // the robot's computer speaks every millisecond
constexpr long progress_periods = 20000;  // a simulated second

/// What stands between the demand and the firmware.
class Wish {
 public:
  Wish(const Scene& scene, Limiter limiter, const wire::pc::MotorFile& file)
      : scene_(scene), limiter_(limiter), motor_(file.motor) {}

  /// What passes of the demand.
  double amperes(double demand_A, double estimated_core_degC, double true_core_degC, const hal::Temperature& housing) {
    return passed_A_ = passed(demand_A, estimated_core_degC, true_core_degC, housing);
  }
  /// Of what the firmware allows, what is left behind this limiter.
  double allowance_A(double of_the_firmware_A) const {
    return limiter_ == Limiter::governor ? of_the_firmware_A : std::min(of_the_firmware_A, std::abs(passed_A_));
  }

 private:
  double passed(double demand_A, double estimated_core_degC, double true_core_degC, const hal::Temperature& housing) {
    const double rated_A = motor_.rated_current_A / wire::direct_per_amplitude;
    switch (limiter_) {
      case Limiter::governor:
        return demand_A;
      case Limiter::rated:
        return std::clamp(demand_A, -rated_A, rated_A);
      case Limiter::housing:
        return cut(housing.value_degC, scene_.housing_limit_degC) ? 0 : demand_A;
      case Limiter::hard_cut:
        return cut(estimated_core_degC, motor_.winding_max_degC) ? 0 : demand_A;
      case Limiter::oracle:
        return demand_A * std::clamp((motor_.winding_max_degC - true_core_degC) / oracle_band_K, 0.0, 1.0);
    }
    return 0;
  }
  bool cut(double degC, double limit_degC) {
    if (degC >= limit_degC) cut_ = true;
    if (degC < limit_degC - restart_K) cut_ = false;
    return cut_;
  }

  const Scene& scene_;
  Limiter limiter_;
  const wire::Motor& motor_;
  bool cut_ = false;
  double passed_A_ = 0;
};

/// Means over one log interval.
class Sums {
 public:
  /// `unseen`: of the slow lane's last 10 ms.
  void add(const firmware::FastView& fast, const thermal::Unseen& unseen, const host_sim::AxisTruth& truth) {
    const double d = static_cast<double>(fast.current_A.d), q = static_cast<double>(fast.current_A.q);
    sampled_A2_ += d * d + q * q;
    unseen_of_heat_A2_ += static_cast<double>(unseen.of_heat_A2);
    unseen_of_mean_A2_ += static_cast<double>(unseen.of_mean_A2);
    q_A_ += q;
    speed_ += static_cast<double>(fast.rad_per_s);
    bus_V_ += static_cast<double>(fast.bus_V);
    torque_Nm_ += truth.torque_Nm;
    shaft_W_ += truth.shaft_W;
    ++count_;
  }
  /// `noise_A`: of one phase's samples, which is no current.
  void write(Row& row, double noise_A) {
    const double n = std::max(count_, 1), sampled_A2 = sampled_A2_ / n - 4.0 / 3 * noise_A * noise_A;
    const auto amplitude_A = [&](double unseen_A2) {
      return std::copysign(std::sqrt(std::max(0.0, sampled_A2 + unseen_A2 / n)), q_A_);
    };
    row.iq_A = amplitude_A(unseen_of_mean_A2_);
    row.current_A = wire::direct_per_amplitude * amplitude_A(unseen_of_heat_A2_);
    row.speed_rad_per_s = speed_ / n;
    row.bus_V = bus_V_ / n;
    row.torque_Nm = torque_Nm_ / n;
    row.shaft_W = shaft_W_ / n;
    *this = {};
  }

 private:
  double sampled_A2_ = 0, unseen_of_heat_A2_ = 0, unseen_of_mean_A2_ = 0, q_A_ = 0;
  double speed_ = 0, bus_V_ = 0, torque_Nm_ = 0, shaft_W_ = 0;
  int count_ = 0;
};

firmware::BoardRating rating_of(const std::string& board) {
  return board == "h8-17.5d" ? dual_48V_80A : dual_48V_20A;  // scene.cpp lets no other name through
}

/// One board with its motors, and the firmware on it.
class Board {
 public:
  Board(const Scene& scene, Limiter limiter, const wire::pc::MotorFile& file, const RunOptions& options)
      : scene_(scene),
        limiter_(limiter),
        file_(file),
        design_(plant(scene, file, options)),
        bench_(design_, scene.seed),
        doors_{AxisDoor(bench_, design_.sensors, 0), AxisDoor(bench_, design_.sensors, 1)},
        driver_(setup(scene, limiter, file, design_, options)) {
    for (int axis = 0; axis < firmware::axis_count; ++axis) {
      bench_.load(axis) = load_of(scene.shaft);
      bench_.motor(axis).place(scene.shaft.angle_rad / file.motor.pole_pairs, 0);
    }
  }

  std::vector<Trace> play(const std::function<void(double)>& progress);

 private:
  static host_sim::BenchDesign plant(const Scene& scene, const wire::pc::MotorFile& file, const RunOptions& options);
  static firmware::DriverSetup setup(const Scene& scene, Limiter limiter, const wire::pc::MotorFile& file,
                                     const host_sim::BenchDesign& design, const RunOptions& options);
  void period();
  void arm(int axis);
  void speak(const Trace& trace, Wish& wish, double time_s);
  void slow_tick();
  Row row(int axis, double time_s, double demand) const;

  const Scene& scene_;
  Limiter limiter_;
  const wire::pc::MotorFile& file_;
  host_sim::BenchDesign design_;
  host_sim::Bench bench_;
  AxisDoor doors_[2];
  firmware::Driver driver_;
  long periods_ = 0;
};

host_sim::BenchDesign Board::plant(const Scene& scene, const wire::pc::MotorFile& file, const RunOptions& options) {
  host_sim::BenchDesign design = bench_of(scene, options.plant_motor.value_or(file.motor));
  for (host_sim::AxisDesign& axis : design.axes) axis.hidden = options.hidden;
  const firmware::BoardRating rating = rating_of(scene.board);
  design.bridge.pwm_Hz = static_cast<double>(rating.pwm_Hz);
  design.bridge.dead_time_s = static_cast<double>(rating.dead_time_s);
  design.power_stage =
      host_sim::power_stage_from_rating(design.bridge, design.supply.open_V, static_cast<double>(rating.continuous_A));
  const double larger = static_cast<double>(rating.peak_A / dual_48V_20A.peak_A);
  design.sensors.current_A_per_count *= larger;
  design.sensors.bus_A_per_count *= larger;
  return design;
}

firmware::DriverSetup Board::setup(const Scene& scene, Limiter limiter, const wire::pc::MotorFile& file,
                                   const host_sim::BenchDesign& design, const RunOptions& options) {
  wire::Motor known = options.plant_motor ? file.motor : host_sim::true_sheet(file.motor, design.axes[0].heat);
  known.winding_max_degC -= options.winding_margin_K;
  const firmware::BoardRating rating = rating_of(scene.board);
  firmware::AxisSetup axis;
  axis.parameters = firmware::parameters_from(known, rating, {static_cast<float>(scene.supply_V), 0.0f});
  need_drivable(scene.motor, {axis.parameters, firmware::heat_parameters_from(known, thermal::sheet_trust)}, rating);
  thermal::Trust of_the_model = thermal::identified_trust;
  if (scene.model.empty()) {
    axis.heat = thermal::three_phase_set(known);
  } else {
    const HeatModel model = read_heat_model(scene.model);
    if (!model.motor.empty() && model.motor != file.name)
      wire::pc::refuse(
          fmt::format("{}: it was identified on {}, and this scene's motor is {}; identify that one, or say "
                      "--set motor=NAME.",
                      scene.model, model.motor, file.name));
    axis.heat = thermal::split_phases(model.set, known.phase_coupling_W_per_K);
    of_the_model = model.trust.value_or(of_the_model);
  }
  if (limiter != Limiter::governor) {
    for (thermal::Node<double>& node : axis.heat.nodes) {
      if (std::isfinite(node.max_degC)) node.max_degC = static_cast<float>(no_limit_degC);
    }
  }
  axis.estimator.trust = trust_of(scene, of_the_model);
  return {rating, {axis, axis}};
}

void Board::period() {
  const double time_s = static_cast<double>(periods_) * bench_.period_s() - warm_up_s;
  std::array<hal::Duty, 2> duty;
  for (std::size_t axis = 0; axis < duty.size(); ++axis) {
    const int index = static_cast<int>(axis);
    duty[axis] = doors_[axis].next();
    doors_[axis].drive(driver_.axis(index).tick(doors_[axis].sample()));
    for (const double landing_s : scene_.shaft.landings_s) {
      if (periods_ == std::lround((landing_s + warm_up_s) / bench_.period_s())) {
        bench_.motor(index).place(bench_.motor(index).angle_rad(), 0);
      }
    }
    if (scene_.shaft.kind == Shaft::Kind::imposed) {
      bench_.load(index).speed_rad_per_s = imposed_speed_rad_per_s(scene_, time_s);
    }
  }
  bench_.advance_period(duty);
  ++periods_;
}

void Board::arm(int axis) {
  const wire::Status status = driver_.axis(axis).arm();
  if (status == wire::Status::done) return;
  const wire::CodeText text = wire::text_of(status);
  wire::pc::refuse(fmt::format("Axis {} would not arm: {}; {}.", axis, text.happened, text.advice));
}

void Board::speak(const Trace& trace, Wish& wish, double time_s) {
  firmware::Axis& axis = driver_.axis(trace.axis);
  const hal::Temperature housing = slow_sample(bench_.raw(trace.axis), design_.sensors).housing;
  const double wish_A = wish.amperes(demand_A(scene_, trace.axis, time_s), hottest_degC(axis.state()),
                                     bench_.truth(trace.axis).hottest_degC, housing);
  (void)axis.set_current({0.0f, static_cast<float>(wish_A)});  // a refused setpoint shows in the trace as old
}

void Board::slow_tick() {
  driver_.slow_tick(slow_sample(bench_.board_raw(), design_.sensors),
                    {slow_sample(bench_.raw(0), design_.sensors), slow_sample(bench_.raw(1), design_.sensors)});
}

Row Board::row(int axis, double time_s, double demand) const {
  const firmware::AxisState& state = driver_.axis(axis).state();
  const firmware::FastView& fast = driver_.axis(axis).fast();
  const host_sim::AxisTruth truth = bench_.truth(axis);
  Row row{};
  row.time_s = time_s;
  row.demand_A = demand;
  row.allowance_A = static_cast<double>(state.allowance_A);
  row.id_now_A = static_cast<double>(fast.current_A.d);
  row.iq_now_A = static_cast<double>(fast.current_A.q);
  row.bus_A = static_cast<double>(slow_sample(bench_.board_raw(), design_.sensors).bus_A);
  row.depth_ratio = modulation_depth(doors_[axis].next());
  row.estimated_core_degC = hottest_degC(state);
  row.core_sigma_K = static_cast<double>(state.core_sigma_K);
  row.true_core_degC = truth.hottest_degC;
  row.true_winding_degC = truth.winding_degC;
  row.housing_degC = static_cast<double>(slow_sample(bench_.raw(axis), design_.sensors).housing.value_degC);
  row.true_housing_degC = truth.housing_degC;
  row.ambient_degC = scene_.ambient_degC;
  row.limit = state.limit;
  row.fault = driver_.axis(axis).fault().fault;
  return row;
}

std::vector<Trace> Board::play(const std::function<void(double)>& progress) {
  const double period_s = bench_.period_s();
  const auto periods_in = [&](double seconds) { return std::lround(seconds / period_s); };
  const long slow_periods = periods_in(thermal::estimator_dt_s), warm_up = periods_in(warm_up_s);
  const long total = warm_up + periods_in(scene_.seconds), log_periods = std::max(1L, periods_in(1 / scene_.log_Hz));

  std::vector<Trace> traces;
  std::vector<Wish> wishes;
  std::vector<Sums> sums(2);
  for (int axis = 0; axis < axes_of(scene_); ++axis) {
    traces.push_back({limiter_, axis, {}});
    wishes.emplace_back(scene_, limiter_, file_);
  }
  while (periods_ < total) {
    const double time_s = static_cast<double>(periods_ - warm_up) * period_s;
    for (std::size_t i = 0; i < traces.size(); ++i) {
      if (periods_ == warm_up) arm(traces[i].axis);
      if (periods_ > warm_up && periods_ % setpoint_periods == 0) speak(traces[i], wishes[i], time_s);
    }
    period();
    if (periods_ % setpoint_periods == 0) driver_.watch();
    if (periods_ % slow_periods == 0) slow_tick();
    if (periods_ % setpoint_periods == 0) driver_.look_ahead();
    if (periods_ <= warm_up) continue;

    for (std::size_t i = 0; i < traces.size(); ++i) {
      Trace& trace = traces[i];
      const host_sim::AxisTruth truth = bench_.truth(trace.axis);
      const double demand = demand_A(scene_, trace.axis, time_s);
      const firmware::Axis& axis = driver_.axis(trace.axis);
      sums[i].add(axis.fast(), axis.state().unseen, truth);
      trace.hottest_true_degC = std::max(trace.hottest_true_degC, truth.hottest_degC);
      trace.peak_shaft_W = std::max(trace.peak_shaft_W, truth.shaft_W);
      if (demand != 0) trace.impulse_As += std::hypot(truth.current_d_A, truth.current_q_A) * period_s;
      if ((periods_ - warm_up) % log_periods == 0) {
        Row line = row(trace.axis, time_s, demand);
        if (demand != 0) line.allowance_A = wishes[i].allowance_A(line.allowance_A);
        sums[i].write(line, design_.sensors.current_noise_A);
        trace.rows.push_back(line);
      }
    }
    if (progress && periods_ % progress_periods == 0)
      progress(static_cast<double>(periods_) / static_cast<double>(total));
  }
  return traces;
}

}  // namespace

Result run_scene(const Scene& scene, const RunOptions& options) {
  const wire::pc::MotorFile file = wire::pc::read_motor(scene.motor, options.motor_folder);
  Result result = result_of(scene, file);
  // A motor that hides something is another one than the optimum's.
  if (scene.shaft.kind != Shaft::Kind::locked && scene.program.empty() && !options.plant_motor) {
    const wire::Motor known =
        host_sim::true_sheet(file.motor, host_sim::heat_from_sheet(file.motor, heat_options(scene)));
    result.optimal_impulse_As = optimal_impulse_As(scene, known, static_cast<double>(rating_of(scene.board).peak_A));
  }

  const std::clock_t start = std::clock();
  for (std::size_t i = 0; i < scene.limiters.size(); ++i) {
    std::function<void(double)> share;
    if (options.progress) {
      share = [&, i](double done) {
        options.progress((static_cast<double>(i) + done) / static_cast<double>(scene.limiters.size()));
      };
    }
    Board board(scene, scene.limiters[i], file, options);
    for (Trace& trace : board.play(share)) result.traces.push_back(std::move(trace));
    result.simulated_s += scene.seconds;
  }
  result.cpu_s = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  return result;
}

}  // namespace boards::host

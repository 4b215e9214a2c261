// SPDX-License-Identifier: MIT
#include "tests/identify/hidden_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <optional>
#include <random>
#include <stdexcept>

#include "host-sim/plant/excitation.hpp"

namespace tests {
namespace {

using host_sim::HiddenEffects;

/// Motors of catalogues and robots: K/W, K/W, s, s. Where C1 and C2 come from: the time constants over R1 and R2.
struct MotorRow {
  const char* name;
  double R1, R2, tau_w, tau_m;
};
constexpr MotorRow motors[] = {{"EC-powermax 30", 0.209, 7.4, 2.11, 1180}, {"EC 16", 1.08, 16.3, 1.22, 294},
                               {"EC-max 16 8 W", 1.41, 17.7, 0.90, 427},   {"EC-max 16 5 W", 2.57, 23.5, 0.943, 390},
                               {"RE 40", 1.93, 4.65, 41.6, 1120},          {"RE 50", 2.27, 3.81, 137, 406},
                               {"EC 45 flat", 4.3, 3.1, 28.8, 157},        {"ActPack", 1.07, 1.94, 17.4, 994}};

struct Row {
  double current_A, speed_rad_per_s;  // amplitude with sign, mechanical
};

struct Draw {
  std::mt19937_64 random;
  double uniform(double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); }
  double gauss() { return std::normal_distribution<double>()(random); }
  double sign() { return uniform(0, 1) < 0.5 ? -1 : 1; }
  double log_uniform(double a, double b) { return a * std::exp(uniform(0, 1) * std::log(b / a)); }
};

constexpr double row_s = 0.1;
constexpr double least_error_K = 1, largest_error_K = 10;  // of the winding, or the reading, before any refit
constexpr double hottest_degC = 150;                       // of a winding, before an effect is hidden

/// What a robot's joint does: stand, hold, walk with a gait ripple, push, spin, rest.
std::vector<Row> robot_duty(Draw& d, double rms_A, double top, double seconds) {
  std::vector<Row> rows;
  const auto n = static_cast<std::size_t>(seconds / row_s);
  const auto hold = [&](double for_s, double amps, double speed, double ripple) {
    const double phase = d.uniform(0, 6.28), rate = d.uniform(1.0, 1.8);
    for (double t = 0; t < for_s && rows.size() < n; t += row_s) {
      const double wave = std::sin(6.2832 * rate * t + phase);
      rows.push_back({amps * (1 + ripple * wave), speed * (1 + 0.4 * ripple * wave)});
    }
  };
  hold(d.uniform(20, 40), 0, 0, 0);
  while (rows.size() < n) {
    const double what = d.uniform(0, 1), sign = d.uniform(0, 1) < 0.7 ? 1 : -1;
    if (rows.size() > n * 9 / 10)
      hold(60, 0, 0, 0);
    else if (what < 0.12)
      hold(d.uniform(20, 80), 0, 0, 0);
    else if (what < 0.30)
      hold(d.uniform(15, 60), sign * rms_A * d.uniform(0.3, 1.1), 0, 0);
    else if (what < 0.70)
      hold(d.uniform(30, 120), sign * rms_A * d.uniform(0.5, 1.3), sign * top * d.uniform(0.15, 0.7), 0.8);
    else if (what < 0.82)
      hold(d.uniform(3, 12), sign * rms_A * d.uniform(1.6, 2.4), top * d.uniform(-0.2, 0.2), 0);
    else if (what < 0.92)
      hold(d.uniform(20, 60), sign * rms_A * 0.12, sign * top * d.uniform(0.3, 1), 0);
    else
      hold(d.uniform(10, 40), -sign * rms_A * d.uniform(0.3, 0.9), sign * top * d.uniform(0.2, 0.6), 0.3);
  }
  return rows;
}

/// As host-sim records it, at another load.
std::vector<Row> designed_profile(Draw& d, const wire::Motor& sheet, double rms_A, double top, double seconds) {
  const auto demands =
      host_sim::make_excitation(host_sim::Excitation::designed, sheet, top, seconds, 1 / row_s, d.random());
  double mean2 = 0;
  for (const host_sim::Demand& demand : demands)
    mean2 += demand.current_A * demand.current_A / static_cast<double>(demands.size());
  std::vector<Row> rows;
  for (const host_sim::Demand& demand : demands)
    rows.push_back({rms_A / std::sqrt(mean2) * demand.current_A, demand.speed_rad_per_s});
  return rows;
}

/// Sets one effect of size a (about 1) in a motor whose mean copper heat is `heat_W`.
void hide(HiddenEffects& x, const std::string& id, double a, const wire::Motor& m, double heat_W, double rms_A,
          double top, double when_s, bool other) {
  const double k = std::abs(a), G2 = 1 / m.R2_K_per_W;
  if (id == "speed_loss_linear") (other ? x.hysteresis_W_s : x.coulomb_drag_W_s) = k * heat_W / (0.3 * top);
  if (id == "speed_loss_quadratic") (other ? x.eddy_W_s2 : x.viscous_drag_W_s2) = k * heat_W / (0.15 * top * top);
  if (id == "windage") x.windage_W_s3 = k * heat_W / (0.1 * top * top * top);
  if (id == "winding_eddy") x.winding_eddy_W_s2 = k * heat_W / (0.15 * top * top);
  if (id == "ac_copper_loss") x.ac_copper_s2 = k / (0.1 * top * top);
  if (id == "load_friction") x.load_friction_W_s_per_A = k * heat_W / (0.25 * top * rms_A);
  if (id == "copper_coefficient") x.copper_coefficient_per_K = std::max(-0.0039, std::min(0.005, 0.003 * a));
  if (id == "bridge_loss") x.bridge_loss_W_per_A = k * heat_W / rms_A;
  if (id == "current_offset") x.current_offset_A = 0.3 * a * rms_A;
  if (id == "board_heat") x.board_heat_ohm = k * heat_W / (rms_A * rms_A);
  if (id == "constant_heat") x.constant_heat_W = a * heat_W;
  if (id == "speed_cooling") x.speed_cooling_per_speed08 = k / std::pow(0.4 * top, 0.8);
  if (id == "natural_convection") x.convection_exponent = std::min(0.5, 0.3 * k);
  if (id == "radiation") x.radiation_W_per_K = k * G2;
  if (id == "cooling_change") x.cooling_change = std::clamp(std::exp(-a), 0.2, 5.0), x.cooling_change_s = when_s;
  if (id == "third_mass")
    x.third_mass_J_per_K = m.C2_J_per_K * (0.3 + 1.0 * k), x.third_mass_K_per_W = m.R2_K_per_W * (other ? 0.3 : 0.8);
  if (id == "hot_spot")
    x.hot_spot_J_per_K = m.C1_J_per_K * 0.4, x.hot_spot_K_per_W = m.R1_K_per_W * k, x.hot_spot_share = 0.4;
  if (id == "neighbour_heat") x.neighbour_W_per_K = k * G2;
  if (id == "frame_conduction") x.frame_W_per_K = k * G2;
  if (id == "sensor_lag") x.sensor_lag_s = 20 * k;
  if (id == "sensor_offset") x.sensor_offset_K = 3 * a;
  if (id == "sensor_gain") x.sensor_gain = std::max(-0.35, std::min(0.35, 0.1 * a));
  if (id == "sensor_placement") x.sensor_share = std::min(0.9, 0.3 * k);
  if (id == "ambient_drift") x.ambient_drift_K_per_s = 0.008 * a;
  if (id == "clock_delay") x.clock_delay_s = std::min(50.0, 10 * k);
  if (id == "stall_imbalance") x.stall_imbalance = std::min(1.0, k), x.stall_below_rad_per_s = 1;
  if (id == "latent")
    x.latent_J = 15 * k * m.C2_J_per_K, x.latent_degC = 45 + 10 * (other ? 1 : 0), x.latent_width_K = 2;
  if (id == "gusts") x.gust_depth = 2 * k, x.gust_mean_s = 80;
  if (id == "contact") x.contact_per_K = 0.01 * k;
  if (id == "grease") x.grease_W_s = k * heat_W / (0.2 * top), x.grease_K = 15;
  if (id == "thermostat") x.thermostat_gain = 1.5 * k, x.thermostat_degC = 48;
  if (id == "curing") x.curing_gain = std::min(0.6, 0.4 * k), x.curing_s = 200;
  if (id == "overload") x.overload_W_per_A4 = k * heat_W / std::pow(1.4 * rms_A, 4);
}

/// Warm things beside the motor that live their own lives: random levels, reached slowly.
std::vector<double> wandering(Draw& d, std::size_t rows, double ambient_degC, double tau_s) {
  std::vector<double> out(rows);
  double level = ambient_degC, target = ambient_degC;
  for (std::size_t i = 0; i < rows; ++i) {
    if (i % 2000 == 0) target = ambient_degC + (d.uniform(0, 1) < 0.35 ? 0 : d.uniform(10, 50));
    out[i] = level += (target - level) * row_s / tau_s;
  }
  return out;
}

std::vector<Row> played(const std::vector<ProfileStretch>& profile) {
  std::vector<Row> rows;
  for (const ProfileStretch& p : profile) {
    for (double t = 0; t < p.seconds - 1e-9; t += row_s)
      rows.push_back({p.current_A * 2 / std::sqrt(3.0), p.speed_rad_per_s});
  }
  return rows;
}

struct Track {
  std::vector<double> core, housing, sensed, neighbour;
};

Track run(const wire::Motor& truth, const host_sim::HeatOptions& options, const HiddenEffects& hidden,
          const std::vector<Row>& rows, double ambient_degC, double start_degC, const std::vector<double>& neighbour,
          const std::vector<double>& frame, std::uint64_t seed) {
  host_sim::Stove stove(host_sim::heat_from_sheet(truth, options), hidden, seed);
  stove.soak(start_degC);
  stove.around.ambient_degC = ambient_degC;
  Track out;
  double angle_rad = host_sim::Random(seed).uniform(0, 2 * std::numbers::pi);
  const auto late = static_cast<long>(std::lround(hidden.clock_delay_s / row_s));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    out.core.push_back(stove.copper_degC());
    out.housing.push_back(stove.degC(host_sim::Place::housing));
    out.sensed.push_back(stove.sensed_degC());
    const Row row = static_cast<long>(i) >= late ? rows[i - static_cast<std::size_t>(late)] : Row{0, 0};
    const double amps = row.current_A + hidden.current_offset_A, w = std::abs(row.speed_rad_per_s);
    // Where the rotor stands its phases share the heat by its angle; turning, alike.
    const double advance_rad = truth.pole_pairs * row.speed_rad_per_s * row_s;
    angle_rad = std::remainder(angle_rad + advance_rad, 2 * std::numbers::pi);
    host_sim::HeatDrive drive;
    for (int k = 0; k < 3; ++k) {
      const double along = std::sin(angle_rad - k * 2 * std::numbers::pi / 3);
      const double share = std::abs(advance_rad) > 0.5 ? 0.5 : along * along;
      drive.copper_W[static_cast<std::size_t>(k)] = share * stove.phase_ohm(k, w) * amps * amps;
    }
    drive.current_A = std::abs(amps);
    drive.current2_A2 = amps * amps;
    drive.speed_rad_per_s = w;
    stove.around.neighbour_degC = neighbour[i];
    stove.around.frame_degC = frame[i];
    stove.advance(row_s, drive);
  }
  return out;
}

double rms(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum / static_cast<double>(a.size()));
}

}  // namespace

std::vector<std::string> hideable() {
  return {"speed_loss_linear",
          "speed_loss_quadratic",
          "windage",
          "winding_eddy",
          "ac_copper_loss",
          "load_friction",
          "copper_coefficient",
          "bridge_loss",
          "current_offset",
          "board_heat",
          "constant_heat",
          "speed_cooling",
          "natural_convection",
          "radiation",
          "cooling_change",
          "third_mass",
          "hot_spot",
          "neighbour_heat",
          "frame_conduction",
          "sensor_lag",
          "sensor_offset",
          "sensor_gain",
          "ambient_drift",
          "clock_delay",
          "stall_imbalance",
          "sensor_placement"};
}

std::vector<double> in_words_of_the_table(const std::string& id, const host_sim::HiddenEffects& x,
                                          const wire::Motor& m) {
  if (id == "speed_loss_linear") return {x.hysteresis_W_s + x.coulomb_drag_W_s};
  if (id == "speed_loss_quadratic") return {x.eddy_W_s2 + x.viscous_drag_W_s2};
  if (id == "windage") return {x.windage_W_s3};
  if (id == "winding_eddy") return {x.winding_eddy_W_s2};
  if (id == "ac_copper_loss") return {1.5 * m.phase_resistance_ohm * x.ac_copper_s2};
  if (id == "load_friction") return {x.load_friction_W_s_per_A};
  if (id == "copper_coefficient") return {m.copper_coefficient_per_K + x.copper_coefficient_per_K};
  if (id == "bridge_loss") return {x.bridge_loss_W_per_A};
  if (id == "current_offset") return {x.current_offset_A};
  if (id == "board_heat") return {x.board_heat_ohm};
  if (id == "constant_heat") return {x.constant_heat_W};
  if (id == "speed_cooling") return {x.speed_cooling_per_speed08};
  if (id == "natural_convection") return {x.convection_exponent};
  if (id == "radiation") return {x.radiation_W_per_K};
  if (id == "cooling_change") return {1 / x.cooling_change, x.cooling_change_s};
  if (id == "third_mass") return {x.third_mass_J_per_K, x.third_mass_K_per_W};
  if (id == "hot_spot") return {x.hot_spot_J_per_K, x.hot_spot_K_per_W};
  if (id == "neighbour_heat") return {x.neighbour_W_per_K};
  if (id == "frame_conduction") return {x.frame_W_per_K};
  if (id == "sensor_lag") return {x.sensor_lag_s};
  if (id == "sensor_offset") return {x.sensor_offset_K};
  if (id == "sensor_gain") return {x.sensor_gain};
  if (id == "sensor_placement") return {x.sensor_share};
  if (id == "ambient_drift") return {x.ambient_drift_K_per_s};
  if (id == "clock_delay") return {x.clock_delay_s};
  if (id == "stall_imbalance") return {x.stall_imbalance};
  return {};
}

std::vector<std::string> outside() {
  return {"latent", "gusts", "contact", "grease", "thermostat", "curing", "overload"};
}

namespace {

/// One draw. An effect that this motor cannot show as large as it was drawn is as large as it can be; below 0.9 K
/// nothing is written.
std::optional<HiddenLog> drawn(const HiddenLogOptions& o, std::uint64_t draw, const std::string& path) {
  Draw d{std::mt19937_64(o.seed * 7919 + 17 + draw * 6700417)};
  HiddenLog out;
  const MotorRow& row = motors[static_cast<std::size_t>(d.uniform(0, 0.9999) * static_cast<double>(std::size(motors)))];
  out.sheet = wire::pc::read_motor("ec-16-40w", HOTCORE_SOURCE_DIR "/boards/motors");
  out.sheet.name = row.name;
  wire::Motor& sheet = out.sheet.motor;
  sheet.R1_K_per_W = row.R1;
  sheet.R2_K_per_W = row.R2;
  sheet.C1_J_per_K = row.tau_w / row.R1;
  sheet.C2_J_per_K = row.tau_m / row.R2;
  sheet.rated_current_A = 1e3;  // resistance, and with it current, is a gauge here: no sheet value to compare with
  wire::Motor& m = out.truth = sheet;
  for (double* v : {&m.R1_K_per_W, &m.R2_K_per_W, &m.C1_J_per_K, &m.C2_J_per_K}) *v *= d.log_uniform(0.6, 1.8);

  // Load such that the housing ends about 45 K up; a slow motor is loaded harder, or 20 minutes would not warm it.
  const double tau = m.R2_K_per_W * m.C2_J_per_K, reached = 1 - std::exp(-0.6 * o.seconds / tau);
  const double heat_W = d.uniform(35, 55) / (m.R2_K_per_W * reached) / 1.25;
  double rms_A = std::sqrt(heat_W / (1.5 * m.phase_resistance_ohm));
  // The long hold at 1.6 times the mean shall not bring the winding to its limit.
  rms_A = std::min(rms_A, std::sqrt(60 / (1.5 * m.phase_resistance_ohm * 1.4 * m.R1_K_per_W)) / 1.6);
  const double top = d.uniform(250, 600), ambient = d.uniform(18, 30);
  const double start = d.uniform(0, 1) < 0.6 ? ambient : ambient + d.uniform(0, 12);
  const auto duty = [&](Draw& of) {
    return o.duty == Duty::robot ? robot_duty(of, rms_A, top, o.seconds)
                                 : designed_profile(of, sheet, rms_A, top, o.seconds);
  };
  auto rows = duty(d);
  auto neighbour = wandering(d, rows.size(), ambient, 180);
  Draw mount{
      std::mt19937_64(o.seed * 104729 + 3)};  // its own stream: the rest stays as it was before there was a frame
  auto frame = wandering(mount, rows.size(), ambient, 250);

  host_sim::HeatOptions options;
  for (double* v : {&options.teeth_yoke_share_of_R1, &options.yoke_housing_share_of_R1, &options.teeth_share_of_C2,
                    &options.yoke_share_of_C2, &options.frame_share_of_C2, &options.frame_contact_share_of_R2,
                    &options.frame_share_of_cooling}) {
    *v *= o.structure;
  }

  // Size: the winding (or, for what only the sensor sees, the reading) is to be off by 1..10 K rms before any refit.
  HiddenEffects hidden;
  Track clean = run(m, options, hidden, rows, ambient, start, neighbour, frame, o.seed);
  for (double hottest; (hottest = *std::max_element(clean.core.begin(), clean.core.end())) > hottest_degC;) {
    const double less = 0.99 * std::sqrt((hottest_degC - ambient) / (hottest - ambient));
    rms_A *= less;
    for (Row& r : rows) r.current_A *= less;
    clean = run(m, options, hidden, rows, ambient, start, neighbour, frame, o.seed);
  }
  double mean2 = 0;
  for (const Row& r : rows) mean2 += r.current_A * r.current_A / static_cast<double>(rows.size());
  const double mean_heat = 1.5 * m.phase_resistance_ohm * mean2;
  for (std::size_t e = 0; o.strength > 0 && e < o.effects.size(); ++e) {
    const bool other = d.uniform(0, 1) < 0.5;
    const double sign = d.sign(), when = d.uniform(0.25, 0.75) * o.seconds;
    const double wanted = o.strength * (o.mostly_small ? d.log_uniform(least_error_K, largest_error_K)
                                                       : d.uniform(least_error_K, largest_error_K));
    double a = 0.2 * sign, error = 0;
    for (int i = 0; i < 4; ++i) {
      HiddenEffects one;
      hide(one, o.effects[e], a, m, mean_heat, rms_A, top, when, other);
      const Track t = run(m, options, one, rows, ambient, start, neighbour, frame, o.seed);
      error = std::max(rms(t.core, clean.core), rms(t.sensed, clean.sensed));
      if (!(error > 1e-6) || std::abs(error / wanted - 1) < 0.1) break;
      a = std::max(-6.0, std::min(6.0, a * std::max(0.1, std::min(10.0, wanted / error))));
    }
    if (error < 0.9 * least_error_K * o.strength) return std::nullopt;
    hide(hidden, o.effects[e], a, m, mean_heat, rms_A, top, when, other);
    out.core_error_K = std::max(out.core_error_K, error);
  }
  if (o.small_ones) {
    for (const char* id :
         {"speed_loss_linear", "ac_copper_loss", "bridge_loss", "board_heat", "constant_heat", "speed_cooling",
          "natural_convection", "radiation", "neighbour_heat", "sensor_lag", "stall_imbalance"}) {
      HiddenEffects before = hidden;
      hide(hidden, id, 0.012 * (1 + d.uniform(0, 1)), m, mean_heat, rms_A, top, 0, false);
      if (std::find(o.effects.begin(), o.effects.end(), id) != o.effects.end()) hidden = before;
    }
  }
  for (const std::string& id : o.effects) {
    if (auto values = in_words_of_the_table(id, hidden, m); !values.empty()) out.parameters[id] = values;
  }
  if (o.again != 0 || !o.profile.empty()) {
    d = Draw{std::mt19937_64((o.seed ^ (o.again << 32)) * 15485863 + 11)};
    rows = o.profile.empty() ? duty(d) : played(o.profile);
    neighbour = wandering(d, rows.size(), ambient, 180);
    frame = wandering(d, rows.size(), ambient, 250);
  }
  const Track t = run(m, options, hidden, rows, ambient, start, neighbour, frame, o.seed + o.again);
  out.core_degC = t.core;

  std::ofstream csv(path);
  csv << "time_s,current_A,speed_rad_per_s,housing_degC,ambient_degC,neighbour_housing_degC,frame_degC"
      << (o.core == Core::none ? "" : ",core_degC") << "\n";
  const double noise = o.noisy ? 1 : 0;
  const auto in_steps = [](double degC, double step_K) { return step_K * std::round(degC / step_K); };
  double wander = 0.05 * d.gauss();
  Draw chip{std::mt19937_64(o.seed * 15485863 + 5)};  // its own stream, for the same reason
  const double chip_A = noise * o.current_noise * std::sqrt(mean2);
  const double keep = std::exp(-row_s / 20), direct = std::sqrt(3.0) / 2;
  std::string text;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    wander = keep * wander + std::sqrt(1 - keep * keep) * 0.05 * d.gauss();
    const double reading = t.sensed[i] + noise * (wander + 0.2 * d.gauss());
    const double housing = o.noisy ? in_steps(reading, o.step_K) : reading;
    double amps = rows[i].current_A == 0 ? 0 : rows[i].current_A * (1 + noise * 0.01 * d.gauss());
    if (chip_A > 0) amps += chip_A * chip.gauss();
    fmt::format_to(std::back_inserter(text), "{:.1f},{:.4f},{:.2f},{:.3f},{:.2f},{:.2f},{:.2f}",
                   static_cast<double>(i) * row_s, amps * direct, rows[i].speed_rad_per_s, housing,
                   ambient + 0.05 * d.gauss(), neighbour[i] + 0.1 * d.gauss(), frame[i] + 0.1 * mount.gauss());
    if (o.core != Core::none) text += ',';
    if (o.core == Core::dense) {
      const double core = t.core[i] + noise * 0.2 * d.gauss();
      fmt::format_to(std::back_inserter(text), "{:.3f}", o.step_K > 0.1 ? in_steps(core, o.step_K) : core);
    }
    if (o.core == Core::sparse && i % 300 == 0)
      fmt::format_to(std::back_inserter(text), "{:.3f}", t.core[i] + noise * 2 * d.gauss());
    text += '\n';
  }
  csv << text;
  return out;
}

}  // namespace

HiddenLog make_hidden_log(const HiddenLogOptions& o, const std::string& path) {
  for (std::uint64_t draw = 0; draw < 100; ++draw) {
    if (auto log = drawn(o, draw, path)) return *log;
  }
  throw std::runtime_error("no motor shows an effect so large");
}

}  // namespace tests

// SPDX-License-Identifier: MIT
#include "host-sim/plant/motor.hpp"

#include <algorithm>
#include <cmath>

namespace host_sim {
namespace {

constexpr double half_sqrt3 = 0.8660254037844386;
// Axis of each phase in the stator frame.
constexpr double axis_alpha[3] = {1.0, -0.5, -0.5};
constexpr double axis_beta[3] = {0.0, half_sqrt3, -half_sqrt3};

/// Inductance of the fitted step: (x/2)/tanh(x/2) times the true one.
double fitted(double inductance_H, double resistance_ohm, double h_s) {
  const double half_x = 0.5 * h_s * resistance_ohm / inductance_H;
  return half_x < 1e-6 ? inductance_H : inductance_H * half_x / std::tanh(half_x);
}

/// Turns a unit vector by less than half a radian: Taylor series, the first term left out is below 1e-15. A step costs
/// less than half of a library sine and cosine; refresh() takes those every millisecond so that rounding cannot add up.
void turn_by(double delta_rad, double& cosine, double& sine) {
  const double q = delta_rad * delta_rad;
  const double s =
      delta_rad *
      (1 - q * (1.0 / 6) *
               (1 - q * (1.0 / 20) *
                        (1 - q * (1.0 / 42) * (1 - q * (1.0 / 72) * (1 - q * (1.0 / 110) * (1 - q * (1.0 / 156)))))));
  const double c =
      1 - q * 0.5 *
              (1 - q * (1.0 / 12) *
                       (1 - q * (1.0 / 30) * (1 - q * (1.0 / 56) * (1 - q * (1.0 / 90) * (1 - q * (1.0 / 132))))));
  const double cosine0 = cosine;
  cosine = cosine0 * c - sine * s;
  sine = sine * c + cosine0 * s;
}

struct Matrix2 {
  double aa, ab, bb;  // symmetric
};

/// Inductance in the stator frame for a rotor at the given electrical angle.
Matrix2 inductance(double d_H, double q_H, double cosine, double sine) {
  const double mean_H = 0.5 * (d_H + q_H), swing_H = 0.5 * (d_H - q_H);
  const double cosine2 = cosine * cosine - sine * sine, sine2 = 2 * sine * cosine;
  return {mean_H + swing_H * cosine2, swing_H * sine2, mean_H - swing_H * cosine2};
}

}  // namespace

MotorDesign motor_from_sheet(const wire::Motor& sheet) {
  MotorDesign design;
  design.phase_resistance_ohm = sheet.phase_resistance_ohm;
  design.inductance_d_H = sheet.inductance_d_H;
  design.inductance_q_H = sheet.inductance_q_H;
  design.flux_linkage_Wb = sheet.flux_linkage_Wb;
  design.pole_pairs = sheet.pole_pairs;
  design.rotor_inertia_kg_m2 = sheet.rotor_inertia_kg_m2;
  design.copper_coefficient_per_K = sheet.copper_coefficient_per_K;
  return design;
}

Motor::Motor(const MotorDesign& design, double period_s)
    : design_(design), period_s_(period_s), magnet_Wb_(design.flux_linkage_Wb) {
  const double r_ohm = design.phase_resistance_ohm;
  set_resistance({r_ohm, r_ohm, r_ohm}, 0);
}

void Motor::refresh() {
  cosine_ = std::cos(design_.pole_pairs * angle_rad_);
  sine_ = std::sin(design_.pole_pairs * angle_rad_);
}

void Motor::set_resistance(const std::array<double, 3>& winding_ohm, double series_ohm) {
  refresh();
  winding_ohm_ = winding_ohm;
  for (int k = 0; k < 3; ++k) total_ohm_[k] = winding_ohm[k] + series_ohm;
  r_aa_ohm_ = (2 * total_ohm_[0] + 0.5 * total_ohm_[1] + 0.5 * total_ohm_[2]) / 3;
  mean_inductance_H_ = std::sqrt(design_.inductance_d_H * design_.inductance_q_H);
  r_ab_ohm_ = (total_ohm_[2] - total_ohm_[1]) / (4 * half_sqrt3);
  r_bb_ohm_ = 0.5 * (total_ohm_[1] + total_ohm_[2]);
  const double mean_ohm = (total_ohm_[0] + total_ohm_[1] + total_ohm_[2]) / 3;
  fitted_d_H_ = fitted(design_.inductance_d_H, mean_ohm, period_s_);
  fitted_q_H_ = fitted(design_.inductance_q_H, mean_ohm, period_s_);
}

void Motor::set_magnet_degC(double magnet_degC) {
  magnet_Wb_ = design_.flux_linkage_Wb * (1 + design_.magnet_coefficient_per_K * (magnet_degC - 25));
}

void Motor::place(double angle_rad, double speed_rad_per_s) {
  turns_ = static_cast<long>(std::floor(angle_rad / (2 * pi)));
  angle_rad_ = angle_rad - 2 * pi * static_cast<double>(turns_);
  speed_rad_per_s_ = speed_rad_per_s;
  acceleration_rad_per_s2_ = 0;
  refresh();
}

void Motor::step(double h_s, const std::array<double, 3>& terminal_V, unsigned open, bool fitted) {
  fitted_ = fitted && design_.saturation_A == 0;
  const double u_alpha_V = (2 * terminal_V[0] - terminal_V[1] - terminal_V[2]) / 3;
  const double u_beta_V = (terminal_V[1] - terminal_V[2]) / (2 * half_sqrt3);
  const Start start{i_alpha_A_, i_beta_A_, angle_rad_, cosine_, sine_, turns_};
  double travel_rad = 0;
  Push push{};
  if (load.mode == Load::Mode::free) {
    // The travel is predicted from the last acceleration. Where the step finds another speed it is done again, or the
    // work of the torque and the gain in speed would part; seldom more than once.
    double middle_rad_per_s = speed_rad_per_s_ + 0.5 * h_s * acceleration_rad_per_s2_;
    for (int round = 0; round < 3; ++round) {
      travel_rad = h_s * middle_rad_per_s;
      advance_electrically(start, h_s, travel_rad, u_alpha_V, u_beta_V, open);
      push = push_freely(h_s);
      const double found_rad_per_s = 0.5 * (speed_rad_per_s_ + push.speed_rad_per_s);
      const double miss_rad_per_s = std::fabs(found_rad_per_s - middle_rad_per_s);
      middle_rad_per_s = found_rad_per_s;
      if (!(miss_rad_per_s > 2e-6 * std::fabs(found_rad_per_s) + 1e-4)) break;
    }
  } else {
    if (load.mode == Load::Mode::imposed_speed) travel_rad = h_s * load.speed_rad_per_s;
    advance_electrically(start, h_s, travel_rad, u_alpha_V, u_beta_V, open);
  }

  const std::array<double, 3> mean_A = mean_current_A();
  for (int k = 0; k < 3; ++k) {
    const double heat_J = h_s * mean_A[k] * mean_A[k];
    work_.copper_J[k] += heat_J * winding_ohm_[k];
    work_.series_J[k] += heat_J * (total_ohm_[k] - winding_ohm_[k]);
    if (!(open >> k & 1)) work_.electrical_J += h_s * terminal_V[k] * mean_A[k];
  }
  if (load.mode == Load::Mode::free) {
    const double middle_rad = 0.5 * h_s * (speed_rad_per_s_ + push.speed_rad_per_s);
    work_.iron_J += push.iron_Nm * middle_rad;
    work_.friction_J += push.friction_Nm * middle_rad;
    work_.shaft_J += push.load_Nm * middle_rad;
    acceleration_rad_per_s2_ = (push.speed_rad_per_s - speed_rad_per_s_) / h_s;
    speed_rad_per_s_ = push.speed_rad_per_s;
  } else {
    book_forced(travel_rad);
  }
}

void Motor::advance_electrically(const Start& start, double h_s, double travel_rad, double u_alpha_V, double u_beta_V,
                                 unsigned open) {
  i_alpha_A_ = start.alpha_A;
  i_beta_A_ = start.beta_A;
  cosine_ = start.cosine;
  sine_ = start.sine;
  angle_rad_ = start.angle_rad + travel_rad;
  turns_ = start.turns;
  if (angle_rad_ >= 2 * pi) {
    angle_rad_ -= 2 * pi;
    ++turns_;
  } else if (angle_rad_ < 0) {
    angle_rad_ += 2 * pi;
    --turns_;
  }
  const double delta_rad = design_.pole_pairs * travel_rad;
  double cosine1 = cosine_, sine1 = sine_;
  if (std::fabs(delta_rad) < 0.5) {
    turn_by(delta_rad, cosine1, sine1);
  } else {
    cosine1 = std::cos(design_.pole_pairs * angle_rad_);
    sine1 = std::sin(design_.pole_pairs * angle_rad_);
  }
  const bool saturable = design_.saturation_A > 0 && open == 0;
  if (saturable) {
    solve_saturable(h_s, u_alpha_V, u_beta_V, cosine1, sine1);
  } else {
    solve(h_s, u_alpha_V, u_beta_V, open, cosine1, sine1);
  }
  mean_alpha_A_ = 0.5 * (start.alpha_A + i_alpha_A_);
  mean_beta_A_ = 0.5 * (start.beta_A + i_beta_A_);

  // Torque of the step: the discrete back-EMF energy divided by the travel, in a form that does not divide by zero.
  // With delta = electrical travel, sum and difference of the end points give tan(delta/2)/(delta/2) as series.
  const double q = 0.25 * delta_rad * delta_rad;
  const double middle = 0.5 * (1 + q * (1.0 / 3 + q * (2.0 / 15 + q * (17.0 / 315))));
  const double c_middle = middle * (cosine_ + cosine1), s_middle = middle * (sine_ + sine1);
  torque_Nm_ = 1.5 * design_.pole_pairs * magnet_Wb_ * (mean_beta_A_ * c_middle - mean_alpha_A_ * s_middle);
  if (saturable) {
    const auto reluctance_Nm = [&](double alpha_A, double beta_A, double cosine, double sine) {
      const double d_A = alpha_A * cosine + beta_A * sine, q_A = beta_A * cosine - alpha_A * sine;
      return 1.5 * design_.pole_pairs *
             (flux_of(d_A, design_.inductance_d_H) * q_A - flux_of(q_A, design_.inductance_q_H) * d_A);
    };
    torque_Nm_ += 0.5 * (reluctance_Nm(start.alpha_A, start.beta_A, cosine_, sine_) +
                         reluctance_Nm(i_alpha_A_, i_beta_A_, cosine1, sine1));
  } else if (design_.inductance_d_H != design_.inductance_q_H) {
    const double swing_H =
        0.5 * (fitted_ ? fitted_d_H_ - fitted_q_H_ : design_.inductance_d_H - design_.inductance_q_H);
    const double norm = 1 / (c_middle * c_middle + s_middle * s_middle);
    const double cosine2 = (c_middle * c_middle - s_middle * s_middle) * norm, sine2 = 2 * s_middle * c_middle * norm;
    const double sinc = 1 - delta_rad * delta_rad / 6 * (1 - delta_rad * delta_rad / 20);
    torque_Nm_ += 1.5 * design_.pole_pairs * swing_H * sinc *
                  (cosine2 * (start.alpha_A * i_beta_A_ + start.beta_A * i_alpha_A_) -
                   sine2 * (start.alpha_A * i_alpha_A_ - start.beta_A * i_beta_A_));
  }
  cosine_ = cosine1;
  sine_ = sine1;
}

/// Flux balance of the step: L1 i1 - L0 i0 + (m1 - m0) = h (u - R (i0 + i1)/2), in the subspace of closed phases.
void Motor::solve(double h_s, double u_alpha_V, double u_beta_V, unsigned open, double cosine1, double sine1) {
  const double d_H = fitted_ ? fitted_d_H_ : design_.inductance_d_H,
               q_H = fitted_ ? fitted_q_H_ : design_.inductance_q_H;
  const Matrix2 before = inductance(d_H, q_H, cosine_, sine_), after = inductance(d_H, q_H, cosine1, sine1);
  const double half_h_s = 0.5 * h_s;
  const double raa = half_h_s * r_aa_ohm_, rab = half_h_s * r_ab_ohm_, rbb = half_h_s * r_bb_ohm_;
  const double b_alpha = (before.aa - raa) * i_alpha_A_ + (before.ab - rab) * i_beta_A_ + h_s * u_alpha_V -
                         magnet_Wb_ * (cosine1 - cosine_);
  const double b_beta =
      (before.ab - rab) * i_alpha_A_ + (before.bb - rbb) * i_beta_A_ + h_s * u_beta_V - magnet_Wb_ * (sine1 - sine_);
  const double aa = after.aa + raa, ab = after.ab + rab, bb = after.bb + rbb;
  if (open == 0) {
    const double inverse = 1 / (aa * bb - ab * ab);
    i_alpha_A_ = (bb * b_alpha - ab * b_beta) * inverse;
    i_beta_A_ = (aa * b_beta - ab * b_alpha) * inverse;
  } else if (open == 1 || open == 2 || open == 4) {
    const int k = open == 1 ? 0 : open == 2 ? 1 : 2;
    const double e_alpha = -axis_beta[k], e_beta = axis_alpha[k];  // the only direction left
    const double amount = (e_alpha * b_alpha + e_beta * b_beta) /
                          (e_alpha * e_alpha * aa + 2 * e_alpha * e_beta * ab + e_beta * e_beta * bb);
    i_alpha_A_ = amount * e_alpha;
    i_beta_A_ = amount * e_beta;
  } else {
    i_alpha_A_ = i_beta_A_ = 0;
  }
}

/// The same balance with the flux map, by Newton's method: the map is smooth and the start is close, four rounds
/// suffice.
void Motor::solve_saturable(double h_s, double u_alpha_V, double u_beta_V, double cosine1, double sine1) {
  const double half_h_s = 0.5 * h_s;
  const auto flux = [&](double alpha_A, double beta_A, double cosine, double sine, double& alpha_Wb, double& beta_Wb) {
    const double d_Wb = flux_of(alpha_A * cosine + beta_A * sine, design_.inductance_d_H) + magnet_Wb_;
    const double q_Wb = flux_of(beta_A * cosine - alpha_A * sine, design_.inductance_q_H);
    alpha_Wb = d_Wb * cosine - q_Wb * sine;
    beta_Wb = d_Wb * sine + q_Wb * cosine;
  };
  double alpha0_Wb, beta0_Wb;
  flux(i_alpha_A_, i_beta_A_, cosine_, sine_, alpha0_Wb, beta0_Wb);
  double alpha_A = i_alpha_A_, beta_A = i_beta_A_;
  for (int round = 0; round < 4; ++round) {
    double alpha1_Wb, beta1_Wb;
    flux(alpha_A, beta_A, cosine1, sine1, alpha1_Wb, beta1_Wb);
    const double sum_alpha_A = i_alpha_A_ + alpha_A, sum_beta_A = i_beta_A_ + beta_A;
    const double f_alpha =
        alpha1_Wb - alpha0_Wb - h_s * u_alpha_V + half_h_s * (r_aa_ohm_ * sum_alpha_A + r_ab_ohm_ * sum_beta_A);
    const double f_beta =
        beta1_Wb - beta0_Wb - h_s * u_beta_V + half_h_s * (r_ab_ohm_ * sum_alpha_A + r_bb_ohm_ * sum_beta_A);
    const Matrix2 slope =
        inductance(incremental_H(alpha_A * cosine1 + beta_A * sine1, design_.inductance_d_H),
                   incremental_H(beta_A * cosine1 - alpha_A * sine1, design_.inductance_q_H), cosine1, sine1);
    const double aa = slope.aa + half_h_s * r_aa_ohm_, ab = slope.ab + half_h_s * r_ab_ohm_,
                 bb = slope.bb + half_h_s * r_bb_ohm_;
    const double inverse = 1 / (aa * bb - ab * ab);
    alpha_A -= (bb * f_alpha - ab * f_beta) * inverse;
    beta_A -= (aa * f_beta - ab * f_alpha) * inverse;
  }
  i_alpha_A_ = alpha_A;
  i_beta_A_ = beta_A;
}

/// Iron drag follows the square of the flux linkage.
double Motor::flux_share() const {
  if (design_.hysteresis_Nm == 0 && design_.eddy_Nm_s == 0) return 0;
  double d_A, q_A;
  current_dq_A(d_A, q_A);
  const double d_Wb = flux_of(d_A, design_.inductance_d_H) + magnet_Wb_, q_Wb = flux_of(q_A, design_.inductance_q_H);
  return (d_Wb * d_Wb + q_Wb * q_Wb) / (design_.flux_linkage_Wb * design_.flux_linkage_Wb);
}

/// Mechanics of a free rotor. Drag linear in speed is implicit; Coulomb friction may stop the rotor but not turn it.
Motor::Push Motor::push_freely(double h_s) const {
  const double share = flux_share(), w0 = speed_rad_per_s_;
  const double iron_dry_Nm = design_.hysteresis_Nm * share, iron_wet_Nm_s = design_.eddy_Nm_s * share;
  const double dry_Nm = iron_dry_Nm + design_.coulomb_Nm;
  const double turned_rad = angle_rad_ + 2 * pi * static_cast<double>(turns_) - 0.5 * h_s * w0;
  double given_Nm = load.torque_Nm + load.spring_Nm_per_rad * turned_rad;
  if (load.more_Nm) given_Nm += load.more_Nm(turned_rad, w0);
  double drive_Nm = torque_Nm_ - given_Nm;
  if (design_.cogging_Nm != 0) drive_Nm -= design_.cogging_Nm * std::sin(design_.cogging_periods * turned_rad);
  const double load_wet_Nm_s = load.viscous_Nm_s + load.quadratic_Nm_s2 * std::fabs(w0);
  const double per_step = (design_.rotor_inertia_kg_m2 + load.inertia_kg_m2) / h_s;
  const double half_wet = 0.5 * (iron_wet_Nm_s + design_.viscous_Nm_s + load_wet_Nm_s);
  double w1 = ((per_step - half_wet) * w0 + drive_Nm) / (per_step + half_wet);
  double dry_now_Nm = 0;
  if (dry_Nm > 0) {
    const double most = dry_Nm / (per_step + half_wet), free_w1 = w1;
    w1 = std::fabs(w1) <= most ? 0 : w1 - std::copysign(most, w1);
    dry_now_Nm = (free_w1 - w1) * (per_step + half_wet);
  }
  const double w_middle = 0.5 * (w0 + w1), iron_part = dry_Nm > 0 ? iron_dry_Nm / dry_Nm : 0;
  Push push;
  push.speed_rad_per_s = w1;
  push.iron_Nm = dry_now_Nm * iron_part + iron_wet_Nm_s * w_middle;
  push.friction_Nm = dry_now_Nm * (1 - iron_part) + design_.viscous_Nm_s * w_middle;
  push.load_Nm = given_Nm + load_wet_Nm_s * w_middle;
  return push;
}

/// Books the work of a rotor whose speed somebody else imposes (or locks at 0).
void Motor::book_forced(double travel_rad) {
  const double speed_rad_per_s = load.mode == Load::Mode::locked ? 0 : load.speed_rad_per_s;
  const double share = flux_share(), distance_rad = std::fabs(travel_rad);
  const double iron_J =
      share * (design_.hysteresis_Nm * distance_rad + design_.eddy_Nm_s * speed_rad_per_s * travel_rad);
  const double friction_J = design_.coulomb_Nm * distance_rad + design_.viscous_Nm_s * speed_rad_per_s * travel_rad;
  work_.iron_J += iron_J;
  work_.friction_J += friction_J;
  work_.shaft_J += torque_Nm_ * travel_rad - iron_J - friction_J;
  speed_rad_per_s_ = speed_rad_per_s;
  acceleration_rad_per_s2_ = 0;
}

void Motor::extinguish(int phase) {
  const double e_alpha = -axis_beta[phase], e_beta = axis_alpha[phase];
  const double amount = e_alpha * i_alpha_A_ + e_beta * i_beta_A_;
  i_alpha_A_ = amount * e_alpha;
  i_beta_A_ = amount * e_beta;
}

std::array<double, 3> Motor::current_A() const {
  return {i_alpha_A_, -0.5 * i_alpha_A_ + half_sqrt3 * i_beta_A_, -0.5 * i_alpha_A_ - half_sqrt3 * i_beta_A_};
}

std::array<double, 3> Motor::mean_current_A() const {
  return {mean_alpha_A_, -0.5 * mean_alpha_A_ + half_sqrt3 * mean_beta_A_,
          -0.5 * mean_alpha_A_ - half_sqrt3 * mean_beta_A_};
}

void Motor::current_dq_A(double& d_A, double& q_A) const {
  d_A = i_alpha_A_ * cosine_ + i_beta_A_ * sine_;
  q_A = i_beta_A_ * cosine_ - i_alpha_A_ * sine_;
}

std::array<double, 3> Motor::back_emf_V() const {
  const double amplitude_V = design_.pole_pairs * speed_rad_per_s_ * magnet_Wb_;
  const double alpha_V = -amplitude_V * sine_, beta_V = amplitude_V * cosine_;
  return {alpha_V, -0.5 * alpha_V + half_sqrt3 * beta_V, -0.5 * alpha_V - half_sqrt3 * beta_V};
}

std::array<double, 3> Motor::magnet_Wb() const {
  const double alpha_Wb = magnet_Wb_ * cosine_, beta_Wb = magnet_Wb_ * sine_;
  return {alpha_Wb, -0.5 * alpha_Wb + half_sqrt3 * beta_Wb, -0.5 * alpha_Wb - half_sqrt3 * beta_Wb};
}

double Motor::flux_of(double current_A, double inductance_H) const {
  if (design_.saturation_A == 0) return inductance_H * current_A;
  const double x = current_A / design_.saturation_A, s = design_.saturated_share;
  return inductance_H * current_A * (s + (1 - s) / std::sqrt(1 + x * x));
}

double Motor::incremental_H(double current_A, double inductance_H) const {
  const double x = current_A / design_.saturation_A, s = design_.saturated_share, root = std::sqrt(1 + x * x);
  return inductance_H * (s + (1 - s) / (root * root * root));
}

double Motor::field_energy_of(double current_A, double inductance_H) const {
  const double linear_J = 0.5 * inductance_H * current_A * current_A;
  if (design_.saturation_A == 0) return linear_J;
  // Integral of i d(psi) for the flux map.
  const double a = design_.saturation_A, s = design_.saturated_share,
               root = std::sqrt(1 + (current_A / a) * (current_A / a));
  return s * linear_J + (1 - s) * inductance_H * (current_A * current_A / root - a * a * (root - 1));
}

double Motor::field_J() const {
  double d_A, q_A;
  current_dq_A(d_A, q_A);
  return 1.5 * (field_energy_of(d_A, fitted_ ? fitted_d_H_ : design_.inductance_d_H) +
                field_energy_of(q_A, fitted_ ? fitted_q_H_ : design_.inductance_q_H));
}

double Motor::kinetic_J() const {
  double energy_J = 0.5 * (design_.rotor_inertia_kg_m2 + load.inertia_kg_m2) * speed_rad_per_s_ * speed_rad_per_s_;
  if (design_.cogging_Nm != 0) {
    const double turned_rad = angle_rad_ + 2 * pi * static_cast<double>(turns_);
    energy_J -= design_.cogging_Nm / design_.cogging_periods * std::cos(design_.cogging_periods * turned_rad);
  }
  return energy_J;
}

Motor::Snapshot Motor::save() const {
  return {i_alpha_A_, i_beta_A_, angle_rad_, speed_rad_per_s_, acceleration_rad_per_s2_,
          cosine_,    sine_,     torque_Nm_, mean_alpha_A_,    mean_beta_A_,
          turns_,     work_};
}

void Motor::restore(const Snapshot& s) {
  i_alpha_A_ = s.i_alpha_A;
  i_beta_A_ = s.i_beta_A;
  angle_rad_ = s.angle_rad;
  speed_rad_per_s_ = s.speed_rad_per_s;
  acceleration_rad_per_s2_ = s.acceleration_rad_per_s2;
  cosine_ = s.cosine;
  sine_ = s.sine;
  torque_Nm_ = s.torque_Nm;
  mean_alpha_A_ = s.mean_alpha_A;
  mean_beta_A_ = s.mean_beta_A;
  turns_ = s.turns;
  work_ = s.work;
}

}  // namespace host_sim

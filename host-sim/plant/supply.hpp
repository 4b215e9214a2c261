// SPDX-License-Identifier: MIT
// The supply and the bus capacitor: an ideal voltage behind a resistance, which may or may not take current back.
// In: joules that the bridges took from the bus in one PWM period (negative: gave back); out: the bus voltage.
// Each period is solved exactly for a constant load current, so the balance supply = loss + capacitor + load holds to
// rounding, and a supply that cannot sink leaves exactly the returned joules in the capacitor.
#pragma once

#include <algorithm>
#include <cmath>

namespace host_sim {

/// Defaults: a 48 V laboratory supply on short leads; assumptions of ours.
struct SupplyDesign {
  double open_V = 48;
  double resistance_ohm = 0.02;
  double capacitor_F = 1e-3;
  bool can_sink = false;
};

struct SupplyWork {
  double given_J = 0;  // by the ideal voltage
  double loss_J = 0;   // in the resistance
};

class Supply {
 public:
  explicit Supply(const SupplyDesign& design) : design_(design), bus_V_(design.open_V) {}

  void advance(double h_s, double load_J) {
    current_A_ = 0;
    double left_s = h_s;
    const bool conducts = design_.can_sink || bus_V_ < design_.open_V || (bus_V_ == design_.open_V && load_J > 0);
    if (!conducts) {
      const double until_J = 0.5 * design_.capacitor_F * (bus_V_ * bus_V_ - design_.open_V * design_.open_V);
      if (load_J <= until_J) {
        discharge(load_J);
        return;
      }
      left_s *= 1 - until_J / load_J;  // the rest of the period the supply conducts
      discharge(until_J);
      load_J -= until_J;
    }
    conduct(left_s, load_J);
    current_A_ *= left_s / h_s;
  }

  double bus_V() const { return bus_V_; }
  double supply_A() const { return current_A_; }  // mean of the last period
  double stored_J() const { return 0.5 * design_.capacitor_F * bus_V_ * bus_V_; }
  const SupplyWork& work() const { return work_; }
  SupplyDesign& design() { return design_; }  // a scene may let the source dip

 private:
  void discharge(double load_J) {
    const double squared = bus_V_ * bus_V_ - 2 * load_J / design_.capacitor_F;
    bus_V_ = std::sqrt(std::max(squared, 0.0));
  }

  void conduct(double h_s, double load_J) {
    const double r_ohm = design_.resistance_ohm, tau_s = r_ohm * design_.capacitor_F, x = h_s / tau_s;
    if (x != last_x_) {  // the same at every whole period
      last_x_ = x;
      last_decay_ = std::exp(-x);
    }
    const double decay = last_decay_, mean_decay = (1 - decay) / x;
    // Mean bus voltage = a - b i; load joules = h i (a - b i).
    const double a_V = design_.open_V + (bus_V_ - design_.open_V) * mean_decay, b_ohm = r_ohm * (1 - mean_decay);
    const double root = std::max(a_V * a_V - 4 * b_ohm * load_J / h_s, 0.0);
    const double load_A = 2 * load_J / h_s / (a_V + std::sqrt(root));
    const double final_V = design_.open_V - r_ohm * load_A;
    const double end_V = final_V + (bus_V_ - final_V) * decay;
    if (!design_.can_sink && end_V > design_.open_V) {  // crosses: the rest only charges the capacitor
      const double before_s = std::clamp(-tau_s * std::log((design_.open_V - final_V) / (bus_V_ - final_V)), 0.0, h_s);
      const double here_J = flow(before_s, load_A, final_V, design_.open_V);
      current_A_ *= before_s / h_s;
      bus_V_ = design_.open_V;
      discharge(load_J - here_J);
      return;
    }
    flow(h_s, load_A, final_V, end_V);
    bus_V_ = end_V;
  }

  /// Books a stretch of conduction that ends at end_V; returns the joules the load got in it.
  double flow(double h_s, double load_A, double final_V, double end_V) {
    if (h_s <= 0) return 0;
    const double charge_C = load_A * h_s + design_.capacitor_F * (end_V - bus_V_);
    const double given_J = design_.open_V * charge_C;
    // i_supply = load + deviation/R, deviation decaying from d0 to d1: integral of its square in closed form.
    const double tau_s = design_.resistance_ohm * design_.capacitor_F;
    const double d0_A = (final_V - bus_V_) / design_.resistance_ohm, d1_A = (final_V - end_V) / design_.resistance_ohm;
    const double loss_J = design_.resistance_ohm * (load_A * load_A * h_s + 2 * load_A * tau_s * (d0_A - d1_A) +
                                                    0.5 * tau_s * (d0_A * d0_A - d1_A * d1_A));
    work_.given_J += given_J;
    work_.loss_J += loss_J;
    current_A_ = charge_C / h_s;
    return given_J - loss_J - 0.5 * design_.capacitor_F * (end_V * end_V - bus_V_ * bus_V_);
  }

  SupplyDesign design_;
  double bus_V_;
  double current_A_ = 0;
  double last_x_ = 0, last_decay_ = 1;
  SupplyWork work_;
};

}  // namespace host_sim

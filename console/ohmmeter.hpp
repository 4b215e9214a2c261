// SPDX-License-Identifier: MIT
// The winding as its own thermometer: its resistance, from telemetry of a current along the magnet, to which a rotor
// that rests or turns slowly adds no voltage.
//
// Volts over amperes are more than that: dead time that is not made up for, and what of a period a sample misses, add
// some 0.06 V; switches and leads add what they have. At one current all of that stays, so there is one at which is
// read, the probe. How much it is there the probe and a larger current tell while all is cold: the difference of their
// voltages holds hardly any of it. The probe comes before the larger one and after it, so that both are as warm.
#pragma once

#include <optional>
#include <vector>

namespace console {

class Ohmmeter {
 public:
  /// A row of telemetry, along the magnet. `share`: of the voltage asked for that the bus could give.
  struct Row {
    double time_s;
    float permitted_A, current_A, asked_V, share;
  };
  struct Reading {
    double time_s;  // the middle of what was averaged
    double ohm;     // of one phase, as the current weighs them
  };

  /// `leads_ohm`: in series with a phase, the switch included; taken to stay cold.
  Ohmmeter(float probe_A, float larger_A, double leads_ohm)
      : probe_A_(probe_A), larger_A_(larger_A), leads_ohm_(leads_ohm) {}

  /// A reading wherever the probe has stood for 0.1 s, and each 0.06 s from there; none before cold().
  std::optional<Reading> take(const Row& row);

  /// Ends the first part, in which probe, larger current and probe again flowed a few times, and then the probe alone:
  /// the readings of the latter. Empty where they did not flow, or came out as no resistance.
  std::vector<double> cold();

 private:
  struct Mean {
    double time_s, V, A;
    bool probe;
  };
  std::optional<Mean> averaged(const Row& row, float level_A);

  float probe_A_, larger_A_, level_A_ = 0;
  double leads_ohm_, added_ohm_ = 0;
  bool cold_ = true;
  std::vector<Mean> first_;  // while cold, of each level
  double from_s_ = 0, first_s_ = 0, volts_ = 0, amperes_ = 0;
  int rows_ = 0;
};

}  // namespace console

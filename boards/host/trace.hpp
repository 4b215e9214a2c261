// SPDX-License-Identifier: MIT
// What a scene leaves behind: one trace for each limiter and axis, its summary, and how both are shown to a person.
#pragma once

#include <string>
#include <vector>

#include "boards/host/scene.hpp"
#include "hal/axis_port.hpp"
#include "wire/codes.hpp"

namespace boards::host {

/// One line of a log. Electrical values are means over the log interval unless said otherwise.
struct Row {
  double time_s;
  double demand_A;            // amplitude asked for
  double allowance_A;         // amplitude that the limiter and the firmware allowed
  double id_now_A, iq_now_A;  // at the end of the interval
  double iq_A;                // rms of the current without its ripple, signed like its torque
  double current_A;  // direct current that heats like the interval's phase currents: sqrt(3/4 mean |i|^2) with the PWM
                     // ripple that sampling cannot see, signed like iq
  double speed_rad_per_s;
  double torque_Nm, shaft_W;
  double bus_V, bus_A;
  double depth_ratio;          // modulation depth of the pulses, see modulation_depth
  double estimated_core_degC;  // hottest phase winding, as the firmware believes
  double core_sigma_K;
  double true_core_degC;     // hottest phase winding of the simulated motor
  double true_winding_degC;  // mean of all copper, as its resistance tells
  double housing_degC;       // as the sensor reads
  double true_housing_degC;
  double ambient_degC;
  wire::Limit limit;
  wire::Fault fault;
};

/// Peak of the pulses' line-to-line voltage over the bus voltage, dead-time compensation included; 0: bridge open.
double modulation_depth(const hal::Duty& duty);

struct Trace {
  Limiter limiter;
  int axis;
  std::vector<Row> rows;
  // Extremes at the full rate, not at the log's.
  double hottest_true_degC = -1e9;
  double peak_shaft_W = 0;
  double impulse_As = 0;  // of |i| while something was asked for
};

/// The scene with everything that is said about it.
struct Result {
  Scene scene;
  std::string motor_name;
  bool surrogate;
  double winding_max_degC;
  double optimal_impulse_As;  // axis 0: time-optimal limiter that knows the true temperatures (optimum.hpp)
  double simulated_s = 0;     // summed over boards
  double cpu_s = 0;
  std::vector<Trace> traces;
};

/// CSV with units in the header; `#` lines say what the file is.
std::string csv(const Result& result, const Trace& trace);

/// One line a trace: what it reached, how hot the winding became, what share of the optimum it delivered.
std::string summary_text(const Result& result);
std::string summary_json(const Result& result);

/// A log a trace and the picture of the scene as SVG, into `folder`.
void write_files(const Result& result, const std::string& folder);

}  // namespace boards::host

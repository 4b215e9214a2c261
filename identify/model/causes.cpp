// SPDX-License-Identifier: MIT
// The table of causes. Bounds and typical sizes are in units of the scale of each parameter (cause.hpp). Typical: of
// heat what catalogue no-load losses of small brushless motors amount to, 0.3 of the mean copper heat, and a third
// more; of couplings and cooling a tenth of the bound; of the rest a guess.
#include "identify/model/cause.hpp"

namespace identify {

using thermal::Boundary;
using thermal::Drive;
using thermal::LinkLaw;

namespace {

constexpr int winding = 0, housing = 1;

Cause heat(const char* id, const char* name, int node, Drive drive, Needs needs, const char* unit, double most,
           const char* signature, const char* rivals, const char* experiment) {
  return {id,
          name,
          Edit::source,
          drive,
          node,
          LinkLaw::constant,
          Boundary::ambient,
          needs,
          {{"gain", unit, Scale::heat_per_drive, 0, most, 0.4}},
          signature,
          rivals,
          experiment};
}

Cause edit(const char* id, const char* name, Edit kind, Needs needs, std::vector<Parameter> parameters,
           const char* signature, const char* rivals, const char* experiment, LinkLaw law = LinkLaw::constant,
           Boundary boundary = Boundary::ambient) {
  return {id,        name,   kind,      Drive::one, housing, law, boundary, needs, std::move(parameters),
          signature, rivals, experiment};
}

}  // namespace

const std::vector<Cause>& causes() {
  static const std::vector<Cause> table = {
      heat("speed_loss_linear",
           "heat in the iron or bearings that grows with speed (hysteresis loss = dry friction of bearing or gear)",
           housing, Drive::speed_rad_per_s, Needs::speed, "W s", 10,
           "the housing warms when the rotor turns without load, in proportion to speed",
           "speed_loss_quadratic, board_heat",
           "spin without load at three speeds or more; the drag torque with and without magnets splits the two"),
      heat("speed_loss_quadratic",
           "heat in the iron that grows with the square of speed (eddy currents = viscous drag)", housing,
           Drive::speed2_rad2_per_s2, Needs::speed, "W s2", 10,
           "the housing warms when the rotor turns without load, with the square of speed", "speed_loss_linear",
           "spin without load at speeds that differ by three"),
      heat("windage", "drag of the air or a fan on the shaft, whose heat grows with the cube of speed", housing,
           Drive::speed3_rad3_per_s3, Needs::speed, "W s3", 10, "the housing warms without load, at top speed only",
           "speed_loss_quadratic", "spin without load at top speed, then at half of it"),
      heat("winding_eddy", "eddy currents in the winding (= a shorted turn)", winding, Drive::speed2_rad2_per_s2,
           Needs::speed, "W s2", 10, "the winding warms first when the rotor turns without load",
           "speed_loss_quadratic",
           "read the winding after spinning without load; compare the resistances of the phases"),
      heat("ac_copper_loss", "copper loss that grows with speed (proximity effect)", winding, Drive::current2_speed2,
           Needs::speed, "ohm s2", 10, "extra heat only with load and speed together", "load_friction, winding_eddy",
           "load and speed crossed: stalled, unloaded, both"),
      heat("load_friction", "friction that grows with load and speed (gear)", housing, Drive::current_speed,
           Needs::speed, "V s", 10, "housing heat with the product of load and speed", "ac_copper_loss, winding_eddy",
           "load and speed crossed: stalled, unloaded, both"),
      edit("copper_coefficient", "temperature coefficient of the winding's resistance (other metal, or leads outside)",
           Edit::coefficient, Needs::copper, {{"alpha", "1/K", Scale::one, 0, 0.009, 0.002, false, 0.00393}},
           "the copper heat grows otherwise with temperature than copper does",
           "natural_convection, bridge_loss, constant_heat", "a long hot stall; or voltage over current, cold and hot"),
      heat("bridge_loss",
           "heat in proportion to current (dead time, switching, brushes; or a current read at the supply) in the "
           "winding",
           winding, Drive::current_A, Needs::current, "V", 10, "too much heat at low current",
           "current_offset, copper_coefficient", "hold low and high currents of both signs"),
      heat("enabled_loss", "constant heat in the winding while the bridge switches (ripple current)", winding,
           Drive::enabled, Needs::current, "W", 10, "the winding is warm whenever the drive is enabled, load or not",
           "constant_heat, winding_eddy", "enable and disable at rest"),
      edit("current_offset", "offset of the current sensor", Edit::current_offset, Needs::several_currents,
           {{"offset", "A", Scale::rms_current, -1, 1, 0.3}},
           "one sign of current heats more than the other, or there is heat where no current is told", "bridge_loss",
           "pairs of equal currents with opposite signs"),
      heat("board_heat",
           "heat of the driver board or leads that reaches the housing directly, with the square of current", housing,
           Drive::current_A2, Needs::current, "ohm", 10, "the housing answers to load without the winding's delay",
           "sensor_placement, hot_spot, speed_loss_linear",
           "short bursts at standstill with winding readings between them"),
      edit("constant_heat",
           "constant heat into or out of the housing (a frame at another temperature, or an ambient told wrong by a "
           "constant)",
           Edit::source, Needs::nothing, {{"heat", "W", Scale::heat, -5, 5, 0.4}},
           "the housing drifts without any power", "sensor_offset, ambient_drift, frame_conduction",
           "start soaked; a sensor on the frame"),
      edit("constant_heat",
           "constant heat into or out of the housing in one of the logs (its frame at another temperature, or its "
           "ambient told wrong by a constant)",
           Edit::source, Needs::several_logs, {{"heat", "W", Scale::heat, -5, 5, 0.4}},
           "one log settles warmer or cooler by a constant", "cooling_change, sensor_offset",
           "the ambient of every log, read beside the motor"),
      edit("frame_conduction", "conduction into the frame", Edit::link, Needs::frame,
           {{"conductance", "W/K", Scale::sink_conductance, 0, 20, 2}}, "the housing follows the frame",
           "constant_heat", "warm the frame alone", LinkLaw::constant, Boundary::frame),
      edit("neighbour_heat", "heat from the neighbouring motor", Edit::link, Needs::neighbour,
           {{"conductance", "W/K", Scale::sink_conductance, 0, 20, 2}}, "the housing follows the neighbour",
           "cooling_change, ambient_drift", "run the neighbour alone", LinkLaw::constant, Boundary::neighbour),
      edit("speed_cooling", "cooling that grows with speed", Edit::sink_law, Needs::speed,
           {{"k", "(s/rad)^0.8", Scale::speed08, 0, 20, 2}}, "cools faster while turning", "cooling_change",
           "cool down once at rest and once turning without load", LinkLaw::speed),
      edit("natural_convection", "cooling that grows with the temperature difference (natural convection)",
           Edit::sink_law, Needs::nothing, {{"exponent", "", Scale::one, -0.05, 0.8, 0.25}}, "cools faster when hot",
           "radiation, copper_coefficient", "rise by 60 K or more and cool down fully", LinkLaw::natural_convection),
      edit("radiation", "radiation", Edit::radiation, Needs::nothing,
           {{"conductance", "W/K at 300 K", Scale::sink_conductance, 0, 20, 2}},
           "cools faster when hot, weaker than convection does", "natural_convection",
           "rise by 80 K or more; paint the housing", LinkLaw::radiation),
      edit("cooling_change", "the cooling changed (fan, coolant, draught) at a moment", Edit::cooling_step,
           Needs::nothing,
           {{"factor", "", Scale::one, 0.2, 5, 0.7, true, 1},
            {"time", "s", Scale::duration, 0.04, 0.96, 0.35, false, 0.5}},
           "a kink at one moment", "neighbour_heat, ambient_drift", "repeat the same profile twice"),
      edit("cooling_change", "the cooling differs between the logs (fan, coolant, mounting)", Edit::cooling_of_log,
           Needs::several_logs, {{"factor", "", Scale::one, 0.1, 20, 1.0, true, 1}},
           "one log runs cooler or hotter throughout", "third_mass", "the same profile, fan on and off"),
      edit("power_share",
           "the winding gets another share of the recorded power in one of the logs (controller, leads, a fan on the "
           "same supply)",
           Edit::power_of_log, Needs::logs_of_power, {{"factor", "", Scale::one, 0.2, 5, 0.5, true, 1}},
           "one log heats slower or faster from its first second", "cooling_change",
           "current and resistance of the winding instead of the power of the supply"),
      edit("current_scale",
           "the current of one of the logs was scaled otherwise (another sensor, amplifier or firmware)",
           Edit::current_of_log, Needs::logs_of_current, {{"factor", "", Scale::one, 0.7, 1.4, 0.05, true, 1}},
           "one log heats slower or faster from its first second", "cooling_change, copper_coefficient",
           "both logs' current beside one clamp; the winding read in both"),
      edit("third_mass", "a further mass on the housing (mount, rotor, gear)", Edit::mass, Needs::nothing,
           {{"capacity", "J/K", Scale::housing_capacity, 0.03, 30, 1.0, true, 1},
            {"resistance", "K/W", Scale::sink_resistance, 0.01, 30, 1.2, true, 0.5}},
           "a slow tail", "ambient_drift, cooling_change", "a long rest after heating, then fast heating again"),
      edit("hot_spot", "a hot spot or end winding with a temperature of its own", Edit::hot_spot, Needs::nothing,
           {{"capacity", "J/K", Scale::core_capacity, 0.02, 20, 1.0, true, 0.4},
            {"resistance", "K/W", Scale::core_resistance, 0.02, 30, 1.2, true, 0.5}},
           "the winding rises fast in bursts and falls fast after", "sensor_lag, clock_delay, board_heat",
           "winding resistance every second after a burst"),
      edit("sensor_lag", "lag of the housing sensor", Edit::sensor_lag, Needs::nothing,
           {{"lag", "s", Scale::one, 0, 300, 40}}, "readings delayed and smoothed", "clock_delay, hot_spot",
           "bursts, with winding readings between them"),
      edit("winding_sensor_lag", "lag of the sensor in the winding", Edit::winding_lag, Needs::winding,
           {{"lag", "s", Scale::one, 0, 60, 5}}, "a winding that follows every burst late and smoothed",
           "clock_delay, hot_spot", "the winding's resistance after a burst, beside its sensor"),
      edit("clock_delay", "the temperatures are shifted in time (two clocks)", Edit::delay, Needs::nothing,
           {{"delay", "s", Scale::one, -60, 60, 20}}, "readings shifted in time", "sensor_lag, winding_sensor_lag",
           "sharp bursts, ten readings a second"),
      edit("sensor_offset", "offset of the housing sensor", Edit::sensor_offset, Needs::nothing,
           {{"offset", "K", Scale::one, -15, 15, 5}}, "a constant difference, from a soaked start as well",
           "constant_heat", "start soaked; read the winding there"),
      edit("sensor_gain", "gain of the housing sensor", Edit::sensor_gain, Needs::nothing,
           {{"gain error", "", Scale::one, -0.7, 0.7, 0.15}}, "differences grow with temperature",
           "sensor_offset, copper_coefficient", "winding readings over a wide range"),
      edit("sensor_offset",
           "offset of the housing sensor in one of the logs (another sensor, mounted or calibrated anew)",
           Edit::sensor_offset, Needs::several_housings, {{"offset", "K", Scale::one, -15, 15, 2}},
           "one log reads warmer or cooler by a constant from its first second", "constant_heat, cooling_change",
           "both sensors side by side, soaked"),
      edit("sensor_gain", "gain of the housing sensor in one of the logs (another sensor, or calibrated anew)",
           Edit::sensor_gain, Needs::several_housings, {{"gain error", "", Scale::one, -0.2, 0.2, 0.03}},
           "one log reads more or less of every rise", "current_scale, cooling_change",
           "both sensors side by side, cold and hot; the winding read in both"),
      edit("sensor_placement", "the housing sensor sits between housing and winding (on the stator or its end turns)",
           Edit::sensor_share, Needs::nothing, {{"share", "", Scale::one, 0, 1, 0.3}},
           "the reading rises with the load and falls with it, by a share of what the winding is above the housing",
           "board_heat, sensor_gain", "short bursts at standstill with winding readings between them"),
      edit("ambient_drift", "the ambient is not what was recorded and drifts", Edit::drift, Needs::nothing,
           {{"drift", "K/s", Scale::one, -0.05, 0.05, 0.015}}, "a slow straight drift",
           "third_mass, cooling_change, constant_heat", "an ambient sensor beside the motor; rest at the end"),
      edit("stall_imbalance", "the standing rotor heats one phase more than the mean", Edit::stall_share, Needs::speed,
           {{"share", "", Scale::one, 0, 2.5, 0.5}}, "a stall is hotter than the mean current says", "hot_spot",
           "stall at two angles a quarter of an electrical turn apart"),
  };
  return table;
}

int cause_named(const std::string& id) {
  for (std::size_t c = 0; c < causes().size(); ++c) {
    if (id == causes()[c].id) return static_cast<int>(c);
  }
  return -1;
}

}  // namespace identify

// SPDX-License-Identifier: MIT
// Names the members of the application in the image's symbol table, each with its place in it, for whoever looks into
// the RAM (tests/chip/image_flips.cpp). Symbols only: the function itself is not linked. Compiled without access
// control.
#include <cstddef>

#include "boards/h8-15d/application.hpp"

namespace h8_15d {

#define PART(member) \
  asm volatile(".globl \"part " #member "\"\n.set \"part " #member "\", %c0" : : "i"(offsetof(Application, member)))
#define AXES(member)             \
  PART(driver_.axes_[0].member); \
  PART(driver_.axes_[1].member)

[[gnu::used]] void name_parts() {
  PART(parameter_flash_);
  PART(parameters_.rating_);
  PART(parameters_.log_);
  PART(parameters_.in_force_);
  PART(parameters_.staged_);
  PART(found_);

  PART(driver_.governor_);
  PART(driver_.board_heat_);
  PART(driver_.board_A_);
  PART(driver_.left_);
  AXES(heat_);
  AXES(allowance_);
  AXES(commands_);
  AXES(rating_);
  AXES(next_);
  AXES(next_state_);
  AXES(finding_);
  AXES(guard_);
  AXES(offsets_);
  AXES(rotor_);
  AXES(setpoint_);
  AXES(permit_);
  AXES(current_loop_);
  AXES(dead_time_);
  AXES(usable_ratio_);
  AXES(last_);
  AXES(trace_);
  AXES(mode_);
  AXES(mode_turned_);
  AXES(control_);
  AXES(A_per_Nm_);
  AXES(configured_);
  AXES(sees_);
  AXES(quiet_rad_per_s_per_V_);
  AXES(offset_bound_A_);
  AXES(core_);
  AXES(core_.uncertainty_);
  AXES(core_.degC_);
  AXES(core_.good_degC_);
  AXES(core_.ambient_degC_);
  AXES(core_.input_);
  AXES(core_.due_K_);
  AXES(core_.watch_);
  AXES(core_.doubted_K_);
  AXES(core_.estimate_);
  AXES(core_.built_);
  AXES(governor_);
  AXES(endurance_);
  AXES(looked_);
  AXES(looks_);
  AXES(unseen_);
  AXES(input_);
  AXES(owed_steps_);
  AXES(steps_);
  AXES(charge_);
  AXES(phase_ohm_);
  AXES(copper_per_K_);
  AXES(flux_Wb_);
  AXES(inductance_H_);
  AXES(pwm_Hz_);
  AXES(peak_A_);
  AXES(blind_A_);
  AXES(blind_cap_A_);
  AXES(senses_housing_);
  AXES(watch_);
  AXES(doubted_);
  AXES(fixed_);
  AXES(built_);
  AXES(tripped_periods_);
  AXES(period_s_);
  AXES(fault_);
  AXES(behind_);
  AXES(housing_measured_degC_);
  AXES(state_);
  AXES(index_);
  PART(driver_.turn_);

  PART(keeper_.flash_);
  PART(keeper_.log_);
  PART(keeper_.records_);
  PART(keeper_.newest_);
  PART(keeper_.serial_);
  PART(keeper_.spoken_);

  PART(recorder_.period_);
  PART(recorder_.streams_);
  PART(recorder_.captures_);
  PART(recorder_.stream_selection_);
  PART(recorder_.put_);
  PART(recorder_.put_at_);
  PART(recorder_.stream_end_);
  PART(recorder_.taken_row_);
  PART(recorder_.capture_selection_);
  PART(recorder_.trigger_);
  PART(recorder_.pre_);
  PART(recorder_.stream_);
  PART(recorder_.capture_);

  PART(serial_);
  PART(identity_);
  PART(link_.commands_);
  PART(link_.reader_);
  PART(link_.held_);
  PART(link_.queue_);
  PART(link_.sent_);
  PART(link_.telemetry_sequence_);
  PART(link_.errand_);
  PART(link_.errand_for_);
  PART(link_.errand_payload_);
  PART(link_.errand_answer_);
  PART(link_.profile_);
  PART(link_.looking_ahead_);
  PART(text_);
  PART(usb_port_.setup_);
  PART(usb_port_.received_);
  PART(usb_port_.received_bytes_);
  PART(usb_.port_);
  PART(usb_.control_);
  PART(usb_.link_);
  PART(usb_.link_pipe_);
  PART(usb_.text_pipe_);
  PART(usb_connected_);

  PART(stage_.counts_);
  PART(stage_.bus_counts_);
  PART(stage_.bus_again_);
  PART(stage_.bus_A_counts_);
  PART(stage_.slow_counts_);
  PART(stage_.slow_wanted_);
  PART(stage_.slow_ready_);
  PART(stage_.reference_good_);
  PART(stage_.slow_running_);
  PART(stage_.over_current_);
  PART(stage_.wanted_on_);
  PART(stage_.broken_);
  PART(stage_.complete_);
  PART(stage_.encoder_good_);
  PART(stage_.encoder_zero_);
  PART(stage_.zero_turned_);
  PART(stage_.zero_seen_);
  PART(stage_.sequence_);
  PART(stage_.cycles_);
  PART(stage_.lost_);
  PART(stage_.armed_);
  PART(stage_.loading_);
  PART(stage_.active_);

  PART(milliseconds_);
  PART(fast_ticks_);
  PART(fast_fed_);
  PART(fed_);
  PART(slow_ticks_);
  PART(slow_ms_);
  PART(index_seen_);
  PART(on_hall_);
  PART(found_with_);
  PART(good_);
  PART(clock_good_);
  PART(slow_channel_);
  PART(force_axis_);
  PART(slow_wait_ms_);
  PART(housing_);
  PART(power_stage_);
  PART(door_serial_);
  PART(door_wish_);
  PART(door_order_);
}

}  // namespace h8_15d

# Every command of hotcore on the simulated board of --sim, which is the firmware itself: exit code and what is said.
#   cmake -D HOTCORE=.../hotcore -D IDENTIFY=.../identify -D SCRATCH=... -P simulated.cmake
include(${CMAKE_CURRENT_LIST_DIR}/expect.cmake)
set(ENV{HOTCORE_SIM_FAST} 1)  # simulated time does not wait for the world's
set(sim ${HOTCORE} --sim)

expect(list 0 "SIM0" ${sim} list)
expect(get 0 "axis1.R1_K_per_W +1.08" ${sim} get)
expect(set 0 "axis0.current_limit_A +20 -> 12.*Saved" ${sim} set axis0.current_limit_A=12 --save)
expect(set_that_the_board_refuses 8 "refused to put the parameters in force: axis0.bus_" ${sim} set axis0.bus_low_end_V=90)
expect(save 0 "Saved" ${sim} save)
expect(diff 0 "axis0.phase_resistance_ohm +0.5 +unset" ${sim} diff)
expect(backup 0 "Written: mine.toml" ${sim} backup mine.toml)
expect(no_difference 0 "No difference to mine.toml" ${sim} diff mine.toml)
expect(restore 0 "Nothing changed" ${sim} restore mine.toml)
set(motors ${CMAKE_CURRENT_LIST_DIR}/../../boards/motors)
expect(restore_a_motor 2 "this is a motor and no parameter file" ${sim} restore ${motors}/ec-16-40w.toml)
expect(another_motor 0 "axis0.phase_resistance_ohm +0.193" ${sim} --motor ec-powermax-30-48v get axis0.phase_resistance_ohm)
expect(motor_of_my_own 0 "axis1.pole_pairs +2" ${sim} --motor ${motors}/ec-powermax-30-48v.toml get pole_pairs)
expect(no_such_motor 2 "did you mean 'ec-16-40w'" ${sim} --motor ec-16-40 list)
expect(backup_for_a_motor 2 "^mine.toml: this is a parameter file and no motor; 'hotcore restore mine.toml' takes it" ${sim} --motor mine.toml list)
expect(arm 0 "Done in 0.5" ${sim} arm --iq 1 --seconds 0.5)
expect(run 0 "Done in 0.5.*peak current 5.*disarmed|disarmed: peak current 5" ${sim} run "5A 0.3s, 0A 0.2s" --axis 1)
# The README's: a free shaft shaken to and fro, so that heat and no speed limits it; the winding is allowed 155 degC.
expect(run_until_hot 0 "core_hot.*peak 1[0-4][0-9].*Held back for [23].*because the winding is close to its limit" ${sim} run "20A 20ms, -20A 40ms, 20A 20ms" --times 40)
expect(run_both 0 "Axis 0: done in 0.3.*Axis 1: done in 0.3" ${sim} run "3A 0.3s" --axis both)
expect(mode 0 "axis 0: current mode, setpoints in A.*axis 1: current mode" ${sim} mode)
expect(run_in_the_wrong_mode 8 "^Axis 0 is in current mode and takes no N m.*'mode torque --axis 0' at the prompt" ${sim} run "20mNm 0.3s")
expect(arm_beyond_any_board 8 "^Axis 0 refused the setpoint 1e.09 A: .*beyond any board" ${sim} arm --iq 1e9)
expect(allowance_for_a_second 0 "\"time_left_s\":null,\"allowance_1s_A\":[1-9]" ${sim} --json watch --seconds 3 --rate 1)
# On this board the magnet lies on phase a where the encoder reads 0.
expect(align 0 "Found to .-0.0.*axis1.angle_offset_rad +0 -> -?0.0[0-5]" ${sim} align --axis 1)
expect(align_what_friction_holds 3 "does not answer 0.12 A: is it free" ${sim} --motor ec-powermax-30-24v align --current 0.12)
expect(align_with_less_than_is_measured 2 "0.02 is out of range; it may be 0.1 to" ${sim} align --current 0.02)
expect(stop 0 "Disarmed: both axes" ${sim} stop)
expect(calibrate 0 "axis 1: the current sensors' offsets are" ${sim} calibrate)
expect(fault 0 "axis 0: no fault" ${sim} fault)
expect(ask 0 "^Yes, standing or turning.*standing.* would reach.*turning.* would reach" ${sim} ask "5A 0.3s")
expect(ask_without_quotes 0 "^Yes, standing or turning" ${sim} ask 5 A 0.3 s, -1A 1s --axis 1)
expect(ask_of_a_standing_rotor 0 "^Not in full where the rotor stands.*standing.*the limit is met.*turning.* would reach" ${sim} ask "20A 0.3s, 6A 5s")
expect(ask_of_a_turning_rotor 0 "^Yes, as long as it turns" ${sim} ask "20A 0.3s, 6A 5s" --turning)
expect(ask_too_much 0 "^Not in full, standing or turning" ${sim} ask "20A 5s")
expect(signals 0 "axis0.housing_measured_degC" ${sim} signals)
expect(watch 0 "\"core_degC\":2[45]" ${sim} watch --seconds 0.2 --json)
expect(watch_signals 0 "axis1.ia_A" ${sim} watch axis1.ia_A --seconds 1)
expect(capture 0 "rows, [0-9]+ of them before" ${sim} capture axis0.ia_A --trigger axis0.ia_A --edge rising --level 0.01)
expect(udev 0 "SUBSYSTEM==\"usb\"" ${HOTCORE} udev)

# What was logged goes to identify as it is. Nothing moved, so identify says that it cannot tell, and says it about heat.
expect(log 0 "Written: x.csv .600[01] rows" ${sim} log --out x.csv --seconds 600 --rate 10)
expect(identify_reads_the_log 0 "Verdict: " ${IDENTIFY} x.csv --motor ec-16-40w)

set(typed "set axis0.current_limit_A=7\nget axis0.current_limit_A\nbogus\nrun \"3A 0.1s\"\nquit\n")
expect(prompt 0 "20 -> 7.*current_limit_A +7.*Done in 0.1" ${sim})
set(typed "mode torque --axis 1\nrun \"20mNm 0.1s\" --axis 1\nrun \"3A 0.1s\"\nmode\nquit\n")
# 3/2 pole pairs flux linkage of this motor: 6.5 mN m/A, so 3.1 A.
expect(prompt_in_torque_mode 0 "axis 1: torque mode, setpoints in N m.*1    ready   torque .*Done in 0.1[0-9]* s and disarmed: peak current 3.[1-3] A.*Done in 0.1.*axis 0: current mode.*axis 1: torque mode" ${sim})
set(typed "get axis0.pole_pairs\nrun \"3A 0.1s\" --serial OTHER\nquit\n")
expect(prompt_asked_for_another_board 2 "axis0.pole_pairs.*This prompt talks to .*SIM0; end it" ${sim})
set(typed "set axis0.angle_offset_rad=2\nalign --yes\nset axis0.pole_pairs=3\nalign\nget axis0.angle_offset_rad\nquit\n")
expect(prompt_aligns 0 "angle_offset_rad +2 -> -?0.0[0-5].*axis0.angle_offset_rad +-?0.0[0-5].*magnet makes 1 electrical turns in one of the shaft, and axis0.pole_pairs is 3" ${sim})
set(typed "")
expect(standard_output_that_is_full 2 "standard output: cannot be written" sh -c "${HOTCORE} --sim get > /dev/full")
expect(a_full_disk_ends_a_run 2 "standard output: cannot be written" sh -c "${HOTCORE} --sim run '1A 60s' > /dev/full")
expect(a_reader_who_leaves_disarms 0 "Stopped and disarmed.*ended with 130" sh -c "(${HOTCORE} --sim run '1A 60s' || echo ended with $? >&2) | head -n 1")
expect(nobody_reads_the_errors 0 "ended with 2" sh -c "${HOTCORE} --sim get nothing 2>/dev/full || echo ended with $?")
expect(identification 0 "axis0.R2_K_per_W +16.3 -> 1[567].*In force until" ${sim} identify --minutes 6 --out found --ambient 25 --yes)
expect(identification_of_an_unknown_room 0 "left out, since it takes the motor for cooler and nobody told how warm the room was .--ambient DEGC.: R2_K_per_W.*Nothing to write" ${sim} identify --minutes 6 --out cold --yes)
# A board that takes its winding for much cooler than it is; its true R1 is 1.08 K/W, C1 1.13 J/K.
set(typed "set axis0.R1_K_per_W=0.7 axis0.C1_J_per_K=1.9\nidentify --turning --minutes 7 --out turned --ambient 25 --yes\nquit\n")
expect(identification_of_the_winding 0 "axis0.C1_J_per_K +1.9 -> 1\\.[01].*axis0.R1_K_per_W +0.7 -> 1\\.[01].*In force until" ${sim})
set(typed "")
# What identify found elsewhere, put in force and saved.
file(WRITE ${SCRATCH}/found.toml "format = 1
[[node]]\ncapacity_J_per_K = 1\nmax_degC = 155\n[[node]]\ncapacity_J_per_K = 20\n[[node]]\ncapacity_J_per_K = 80
[[link]]\nfrom = 0\nto = 1\nlaw = \"constant\"\nconductance_W_per_K = 0.9
[[link]]\nfrom = 1\nto = \"ambient\"\nlaw = \"constant\"\nconductance_W_per_K = 0.05
[[link]]\nfrom = 1\nto = 2\nlaw = \"constant\"\nconductance_W_per_K = 0.5
[[source]]\nnode = 0\ndrive = \"current_A2\"\ngain = 0.75\ncoefficient_per_K = 0.00393
[housing_sensor]\nnode = 1\n[trust]\npower = 0.03\ninner_resistance = 0.05\ncooling = 0.06\ncorrelation = -0.4\n")
expect(model 0 "axis1.R2_K_per_W +16.3 -> 20.*axis1.third_mass_J_per_K +0 -> 80.*axis1.trust_power_share +0.2 -> 0.03.*In force and saved" ${sim} model found.toml --axis 1 --yes --save)
expect(a_save_that_is_refused_says_what_is_in_force 8 "refused to save its parameters, which are in force until the next reset: a save holds five" ${sim} set axis0.constant_heat_W=1 axis0.windage_Nms2=1e-9 axis0.board_heat_ohm=0.1 axis0.bridge_loss_V=0.1 axis0.enabled_loss_W=1 axis0.radiation_W_per_K=0.01 --save)
expect(model_without_a_yes 0 "axis0.third_mass_path_K_per_W +1 -> 2.*Nothing was written; --yes" ${sim} model found.toml)
file(READ ${SCRATCH}/found.toml found)
file(WRITE ${SCRATCH}/spot.toml "${found}[[node]]\ncapacity_J_per_K = 1\nmax_degC = 155\n")
expect(model_that_is_too_much 3 "^spot.toml: it has a hot spot, .*cannot express; run it with host-sim" ${sim} model spot.toml)
expect(motor_for_a_model 2 "this is a motor and no heat model" ${sim} model ${motors}/ec-16-40w.toml)
file(WRITE ${SCRATCH}/numbers.toml "format = 1\nnode = [1, 2]\nlink = []\nsource = []\n[housing_sensor]\nnode = 1\n")
expect(model_of_numbers 2 "^numbers.toml: there is no ..node..; let identify" ${sim} model numbers.toml)
expect(model_that_is_not_there 2 "^nowhere.toml: there is no such file" ${sim} model nowhere.toml)

# A motor's sheet: what the board of this motor holds, and nothing of what was found of the one before.
expect(sheet_that_is_in_force 0 "EC 16.*recalled.*Nothing to write: the board has these values already" ${sim} motor ec-16-40w --supply 48)
set(typed "model found.toml --axis 1 --yes\nmotor ec-powermax-30-48v --supply 24 --axis 1 --yes\nget axis1.phase_resistance_ohm\nmotor ec-powermax-30-48v --supply 24 --axis 1 --save\nquit\n")
expect(sheet_of_another_motor 0 "axis1.bus_low_end_V +24 -> 12.24.*axis1.third_mass_J_per_K +80 -> 0.*axis1.trust_power_share +0.03 -> 0.2.*In force until.*axis1.phase_resistance_ohm +0.193.*The board had these values already. saved" ${sim})
set(typed "")
expect(sheet_without_a_yes 0 "Nothing was written; --yes" ${sim} motor ${motors}/ec-powermax-30-24v.toml --supply 24)
expect(angle_of_the_encoder 0 "axis0.angle_offset_rad +0 -> 1.5" ${sim} motor ec-16-40w --supply 48 --angle-offset 1.5)
foreach(volts 13 55)
  expect(supply_too_near_to_a_trip_${volts} 2 "^--supply ${volts}: this board opens its bridges below 12 and above 58 V" ${sim} motor ec-16-40w --supply ${volts})
endforeach()
expect(sheet_without_a_supply 2 "--supply is required" ${sim} motor ec-16-40w)
expect(sheet_that_is_not_there 2 "did you mean 'ec-16-40w'" ${sim} motor ec-16-40 --supply 48)
expect(model_for_a_motor 2 "heat model" ${sim} motor found.toml --supply 48)

# An identify beside hotcore that ends as by Ctrl-C, which reaches both, and one that is killed.
file(COPY ${HOTCORE} DESTINATION ${SCRATCH}/beside)
foreach(ended "130;Stopped while identify worked; nothing was written, the log is kept;kill -INT \$PPID $$" "3;identify was killed by signal 9; the log is kept, run it by hand;kill -9 $$")
  list(GET ended 0 code)
  list(SUBLIST ended 1 2 said)
  list(GET ended 3 script)
  file(WRITE ${SCRATCH}/beside/identify "#!/bin/sh\n${script}\nsleep 9\n")
  file(CHMOD ${SCRATCH}/beside/identify PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
  expect(identify_ended_${code} ${code} "${said}" ${SCRATCH}/beside/hotcore --sim identify --minutes 1 --out ended --force)
endforeach()

nothing_failed()

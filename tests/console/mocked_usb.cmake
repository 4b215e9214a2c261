# The unmodified program hotcore on real libusb against boards on a mocked bus: what it says, its exit code, no half file.
#   cmake -D WRAPPER=umockdev-wrapper -D BUS=.../mocked_bus -D HOTCORE=.../hotcore -D SCRATCH=... -P mocked_usb.cmake
include(${CMAKE_CURRENT_LIST_DIR}/expect.cmake)

# on_bus(NAME code regex "options of mocked_bus" hotcore's arguments..., or WITH another program)
function(on_bus name code regex bus)
  separate_arguments(bus)
  set(program ${HOTCORE} ${ARGN})
  list(POP_FRONT ARGN first)
  if(first STREQUAL WITH) # another program instead
    set(program ${ARGN})
  endif()
  expect(${name} ${code} "${regex}" ${WRAPPER} ${BUS} ${bus} ${program})
endfunction()

on_bus(list 0 "SIM0 +virtual +bus 1 port 1" "" list)
on_bus(dictionary 0 "axis1.current_limit_A +20 +0 to 100" "" get)
on_bus(set 0 "axis0.current_limit_A +20 -> 12.*Saved" "" set axis0.current_limit_A=12 --save)
on_bus(out_of_range 2 "it may be 0 to 100 A" "" set axis0.current_limit_A=500)
on_bus(run 0 "Done in 0.3.*disarmed" "" run "2A 0.3s")
on_bus(log 0 "Written: x.csv" "" log --out x.csv --seconds 0.5 --rate 100)
on_bus(capture 0 "Written: c.csv .400 rows" "" capture axis0.ia_A axis0.ib_A --out c.csv)
on_bus(backup 0 "Written: whole.toml" "" backup whole.toml)

on_bus(two_boards 4 "2 boards are plugged in .SIM0, SIM1.; choose one" "--boards 2" get)
on_bus(two_with_one_prefix 4 "2 boards have a serial that begins with 'SIM'" "--boards 2" --serial SIM get)
on_bus(none_with_prefix 4 "No board's serial begins with 'X'; there are: SIM0, SIM1" "--boards 2" --serial X get)
on_bus(one_of_two 0 "current_limit_A" "--boards 2" --serial SIM1 get current_limit_A)
on_bus(one_whose_serial_begins_anothers 0 "current_limit_A" "--boards 11" --serial SIM1 get current_limit_A)
on_bus(busy 6 "another program holds the board" "--busy" get)
on_bus(gone_while_backing_up 7 "unplugged when asked to describe parameter" "--unplug-after 20" backup half.toml)
on_bus(gone_while_saving 7 "unplugged when asked to save" "--unplug-after 1" save)
on_bus(gone_while_logging 7 "unplugged when asked to go on.*cut.csv holds the [0-9]+ rows until then" "--unplug-after-in 300" log --out cut.csv --seconds 5 --rate 1000)
expect(identify_reads_what_was_kept 3 "cut.csv: no current and no power flows" ${IDENTIFY} cut.csv --motor ec-16-40w)
on_bus(gone_while_capturing 7 "unplugged when asked to hand over the capture.*cut_c.csv holds the [0-9]+ rows until then" "--unplug-after-in 185" capture axis0.ia_A axis0.ib_A --out cut_c.csv)
foreach(file cut.csv cut_c.csv)
  file(READ ${SCRATCH}/${file} text)
  if(NOT text MATCHES "\n[-0-9.]+(,[-0-9.e]*)+\n$" OR EXISTS ${SCRATCH}/${file}.part)
    fails("${file} ends in the middle of a row")
  endif()
endforeach()

# The board's own stack stalls: in the middle of a frame that takes two packets, and instead of an answer.
set(several axis0.ramp_s=0.3 axis1.ramp_s=0.3 axis0.current_limit_A=12 axis1.current_limit_A=9 axis0.offset_bound_A=0.4
            axis1.offset_bound_A=0.4 axis0.setpoint_timeout_s=0.2 axis1.setpoint_timeout_s=0.2)
on_bus(stalled_on_the_way_out 0 "axis1.setpoint_timeout_s +0.1 -> 0.2.*In force" "--stall-out" set ${several})
foreach(packet 0 1 2 5 8 50)
  on_bus(stalled_on_the_way_in_${packet} 0 "axis0.pole_pairs +1 " "--stall-in ${packet}" get axis0.pole_pairs)
endforeach()
on_bus(no_memory_after_the_start 0 "500 exchanges: 0 blocks by operator new, 10[0-9][0-9] by calloc of libusb" "" WITH ${LINK_MEMORY})

foreach(file half.toml half.toml.part)
  if(EXISTS ${SCRATCH}/${file})
    fails("${file} was left behind")
  endif()
endforeach()

nothing_failed()

# Runs the walk on this PC and under QEMU and wants the same text, digit by digit.
#   cmake -D HOST=build/host/bin/walk -D ELF=build/qemu-m4f/bin/walk.elf -P boards/qemu-m4f/compare.cmake
# Without the target's build there is nothing to compare: skipped, but an error when ./test runs it (HOTCORE_ALL set).
if(NOT EXISTS ${ELF})
  if(DEFINED ENV{HOTCORE_ALL})
    message(FATAL_ERROR "${ELF} is missing: build the preset qemu-m4f first.")
  endif()
  message("skipped: no ${ELF}; build the preset qemu-m4f first")
  return()
endif()
execute_process(COMMAND ${HOST} OUTPUT_VARIABLE host RESULT_VARIABLE host_code)
execute_process(
  COMMAND qemu-system-arm -M mps2-an386 -nographic -monitor none -serial none -semihosting-config enable=on,target=native
          -kernel ${ELF}
  OUTPUT_VARIABLE target ERROR_VARIABLE target_text RESULT_VARIABLE target_code TIMEOUT 240)
string(APPEND target "${target_text}")  # semihosting writes to one or the other, by version
if(NOT host_code EQUAL 0 OR NOT target_code EQUAL 0)
  message(FATAL_ERROR "the walk ended with ${host_code} on the PC and ${target_code} under QEMU:\n${target}")
endif()
string(REGEX MATCHALL "[^\n]+" host_lines "${host}")
string(REGEX MATCHALL "[^\n]+" target_lines "${target}")
list(LENGTH host_lines count)
if(count LESS 10)
  message(FATAL_ERROR "the walk on the PC printed only ${count} lines")
endif()
foreach(host_line target_line IN ZIP_LISTS host_lines target_lines)
  if(NOT host_line STREQUAL target_line)
    message(FATAL_ERROR "host and target differ, first in\n  host   ${host_line}\n  target ${target_line}")
  endif()
endforeach()
message("${count} lines equal, digit by digit")

# For scripts that run a program as a person would: what it must say and with which exit code. Works in an empty ${SCRATCH}.
cmake_minimum_required(VERSION 3.25)
file(REMOVE_RECURSE ${SCRATCH})
file(MAKE_DIRECTORY ${SCRATCH})
set(typed "")

# expect(NAME code regex PROGRAM ARGUMENTS...), standard input from ${typed}
function(expect name code regex)
  file(WRITE ${SCRATCH}/typed "${typed}")
  execute_process(COMMAND ${ARGN} WORKING_DIRECTORY ${SCRATCH} INPUT_FILE ${SCRATCH}/typed
                  RESULT_VARIABLE result OUTPUT_VARIABLE out ERROR_VARIABLE err TIMEOUT 120)
  if(NOT result EQUAL code OR NOT "${out}${err}" MATCHES "${regex}")
    fails("${name}: exit code ${result} (wanted ${code}), did not match '${regex}': ${out}${err}")
  else()
    message(STATUS "${name}: exit code ${result}: ${CMAKE_MATCH_0}")
  endif()
endfunction()

function(fails why)
  set_property(GLOBAL APPEND_STRING PROPERTY failures "\n  ${why}")
endfunction()

# Last line of each script.
function(nothing_failed)
  get_property(failures GLOBAL PROPERTY failures)
  if(failures)
    message(FATAL_ERROR "not as promised:${failures}")
  endif()
endfunction()

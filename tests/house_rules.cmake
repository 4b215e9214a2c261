# The plan of the house: which room may look into which. Reads every #include "..." below ROOT and ends with an error
# that names file, line and wall. Also refuses what may not stand at the top level.
#   cmake -D ROOT=. -P tests/house_rules.cmake

cmake_minimum_required(VERSION 3.25)

get_filename_component(ROOT ${ROOT} ABSOLUTE)

set(may_wire wire)
set(may_hal hal wire)
set(may_thermal thermal wire)
set(may_firmware firmware wire hal thermal)
set(may_host-sim host-sim wire hal)                      # never thermal: a plant that shares the estimator's equations proves nothing
set(may_boards boards wire hal thermal firmware)         # a board hands in the parameter sets, whose types live in thermal
set(may_identify identify wire thermal)
set(may_console console wire)
set(may_tests tests wire hal thermal firmware host-sim boards identify console)

# From a measured file to an answer, one floor on the other: none looks up.
set(floors_of_identify log/ model/ fit/ search/ answer/ [a-z_]+[.]hpp)

set(rooms wire hal thermal firmware host-sim boards identify console tests)
set(top_level CMakeLists.txt CMakePresets.json README.md LICENSE run test build out ${rooms})
set(breaches "")

file(GLOB entries LIST_DIRECTORIES true RELATIVE ${ROOT} ${ROOT}/*)
foreach(entry ${entries})
  if(NOT entry MATCHES "^\\." AND NOT entry IN_LIST top_level)
    list(APPEND breaches "${entry}: does not belong at the top level")
  endif()
endforeach()

foreach(room ${rooms})
  file(GLOB_RECURSE files RELATIVE ${ROOT} ${ROOT}/${room}/*.hpp ${ROOT}/${room}/*.cpp ${ROOT}/${room}/*.h)
  foreach(file ${files})
    if(file MATCHES "^tests/planted_breach/")
      continue()
    endif()
    set(may ${may_${room}})
    if(file MATCHES "^boards/host/")
      list(APPEND may host-sim)
    endif()
    if(file MATCHES "^boards/host/virtual/")
      list(APPEND may console)  # hands its board to the console as a transport, and knows no more of it
    endif()
    set(upstairs "")
    if(file MATCHES "^identify/([a-z]+/)")
      list(FIND floors_of_identify ${CMAKE_MATCH_1} floor)
      math(EXPR floor "${floor} + 1")
      list(SUBLIST floors_of_identify ${floor} -1 upstairs)
      list(JOIN upstairs "|" upstairs)
    endif()
    file(STRINGS ${ROOT}/${file} lines)
    set(number 0)
    foreach(line IN LISTS lines)
      math(EXPR number "${number} + 1")
      if(NOT line MATCHES "^[ \t]*#[ \t]*include[ \t]*\"([^\"]+)\"")
        continue()
      endif()
      string(REGEX MATCH "^[^/]+" into "${CMAKE_MATCH_1}")
      if(NOT into IN_LIST may)
        list(APPEND breaches "${file}:${number}: ${room}/ may not look into ${into}/")
      elseif(upstairs AND line MATCHES "\"identify/(${upstairs})")
        list(APPEND breaches "${file}:${number}: no floor of identify/ may look up, into ${CMAKE_MATCH_1}")
      elseif(line MATCHES "\"wire/pc/" AND room MATCHES "^(hal|thermal|firmware)$")
        list(APPEND breaches "${file}:${number}: ${room}/ runs on the target and may not look into wire/pc/")
      endif()
    endforeach()
  endforeach()
endforeach()

if(breaches)
  list(JOIN breaches "\n" text)
  message(FATAL_ERROR "${text}")
endif()

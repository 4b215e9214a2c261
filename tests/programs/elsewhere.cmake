# A project of somebody else's: the program of thermal/README.md is compiled as it stands there and keeps a winding below
# its limit, and a build that adds this folder is configured, for a PC with all that it may link.
#   cmake -D ROOT=. -D THERMAL=libthermal.a -D CXX=... -D EIGEN=... -D SCRATCH=... -P elsewhere.cmake
include(${CMAKE_CURRENT_LIST_DIR}/../console/expect.cmake)

file(READ ${ROOT}/thermal/README.md readme)
string(REGEX MATCH "```cpp\n(.*)\n```" program "${readme}")
file(WRITE ${SCRATCH}/limit.cpp "${CMAKE_MATCH_1}\n")
expect(compiled 0 "^$" ${CXX} -std=c++20 -Wall -Wextra -Werror -I ${ROOT} -isystem ${EIGEN} limit.cpp ${THERMAL} -o limit)
expect(limited 0 "10.0 s +1[0-4][0-9].[0-9] degC +[5-9].[0-9] A" ./limit)

file(WRITE ${SCRATCH}/CMakeLists.txt "cmake_minimum_required(VERSION 3.25)
project(robot CXX)
add_subdirectory(${ROOT} hotcore EXCLUDE_FROM_ALL)
add_executable(robot limit.cpp)
target_link_libraries(robot PRIVATE thermal console_link virtual_board)
get_target_property(asked house INTERFACE_COMPILE_OPTIONS)
if(asked MATCHES Werror)
  message(FATAL_ERROR \"hotcore's warnings are nobody else's errors\")
endif()
")
expect(configured 0 "Build files have been written" ${CMAKE_COMMAND} -S . -B build)
nothing_failed()

# A log that begins warm, of a motor with an effect of its own, is no log in Fahrenheit.
#   cmake -D BIN=folder of programs -D SCRATCH=... -P warm_log.cmake
include(${CMAKE_CURRENT_LIST_DIR}/../console/expect.cmake)

execute_process(COMMAND ${BIN}/host-sim record duty --hide seed=23 --seed 23 --out ${SCRATCH} OUTPUT_QUIET ERROR_QUIET COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND awk -F, "/^[#t]/ || $1 > 400" ${SCRATCH}/log.csv OUTPUT_FILE ${SCRATCH}/warm.csv COMMAND_ERROR_IS_FATAL ANY)
expect(begun_after_400_s 0 "behaves like bridge_loss" ${BIN}/identify warm.csv --motor ec-16-40w)
nothing_failed()

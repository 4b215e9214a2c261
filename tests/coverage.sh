#!/usr/bin/env bash
# tests/coverage.sh    branch coverage, by file, of all that parses what comes over the cable or out of the flash
#
# Builds build/coverage (unoptimised, --coverage) and runs the tests of these rooms, the fuzz with HOTCORE_FUZZ_CASES of
# each (30000 unless told). Not counted: branches that only an exception takes (out of memory, in nearly every line) and
# those that the compiler marks as unreachable.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
source "$here/boards/host/set_up.sh"
install_missing "${packages_host[@]}" gcovr
tests=(test_wire test_firmware test_usb test_usbip test_console)
cd "$here"
[ -f build/coverage/build.ninja ] ||
  cmake --preset host -B build/coverage -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS=--coverage >/dev/null
cmake --build build/coverage --target "${tests[@]}" >&2
find build/coverage -name '*.gcda' -delete
for test in "${tests[@]}"; do
  say "Running: $test"
  HOTCORE_FUZZ_CASES=${HOTCORE_FUZZ_CASES:-30000} "build/coverage/bin/$test" --gtest_brief=1 >&2
done
gcovr --branches --exclude-throw-branches --exclude-unreachable-branches -r . build/coverage \
  -f wire/framer.hpp -f console/link/board.cpp -f 'console/link/messages.*' -f console/profile.cpp \
  -f boards/host/usbip/transfers.cpp -f boards/host/usbip/server.cpp \
  -f 'firmware/usb/(control|descriptors).cpp' -f firmware/usb/device.hpp -f 'firmware/link/.*.cpp' \
  -f firmware/parameter_store.cpp -f firmware/record_log.hpp

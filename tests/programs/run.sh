#!/usr/bin/env bash
# ./run with programs that only say how they were called: where identify's page goes, and --help without a build.
#   run.sh ROOT SCRATCH
set -euo pipefail
rm -rf "$2"
mkdir -p "$2/boards/host" "$2/build/host/bin"
cd "$2"
cp "$1/run" .
echo 'say() { :; }; set_up() { echo built; }' > boards/host/set_up.sh
for program in identify host-sim; do
  printf '#!/bin/sh\necho %s "$@"\n' $program > build/host/bin/$program
  chmod +x build/host/bin/$program
done
failures=0
expect() { # WANTED ARGS...: the line that identify or run itself says
  local wanted=$1 said
  shift
  said=$(./run "$@" 2>&1) || said="exit code $?: $said"
  if grep -qxF -- "$wanted" <<<"$said"; then echo "run $*: $wanted"; else echo "run $*: got '$said'"; failures=$((failures + 1)); fi
}
expect "identify x.csv --motor m --html $PWD/out/identify.html" x.csv --motor m
expect "identify x.csv --html mine.html" x.csv --html mine.html
expect "identify x.csv --html=mine.html" x.csv --html=mine.html
if said=$(./run --help) && [[ $said == *"./run LOG.csv"* && $said != *built* ]]; then echo "$said"; else echo "--help: got '$said'"; failures=$((failures + 1)); fi
exit $((failures > 0))

#!/usr/bin/env bash
# Mistakes in the driver's source: each is built into a flash image of its own, which the tests of the image must reject.
#   tests/chip/source_mutants.sh                    the whole table, a few minutes
#   tests/chip/source_mutants.sh --few 4            four of it, others with every commit (./test does this)
#   tests/chip/source_mutants.sh --only 'dead time' those whose name contains the words
# The table is source_mutants.txt: a line `= name`, the file below boards/h8-15d, lines `- ` (the text as it stands there, exactly
# once), lines `+ ` (what a careless hand would write), and, if no test can see it, a line `? ` that says why.
# Exit codes: 0 all as it should be; 1 a mistake slipped through, or one that should is caught; 2 the table or a build is wrong.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
build=$root/build/h8-15d
tests=${HOTCORE_TEST_CHIP:-$root/build/host/bin/test_chip}
table=$root/tests/chip/source_mutants.txt
few=0 only=""
case "${1:-}" in
  --few) few=$2 ;;
  --only) only=$2 ;;
  "") ;;
  *) sed -n '2,9s/^# //p' "${BASH_SOURCE[0]}" >&2; exit 2 ;;
esac
wrong() { echo "source_mutants: $*" >&2; exit 2; }
if [ ! -f "$build/bin/h8-15d.elf" ] || [ ! -x "$tests" ]; then
  [ -n "${HOTCORE_ALL:-}" ] && wrong "the flash image or test_chip is missing"
  echo "skipped: no flash image; cmake --preset h8-15d && cmake --build --preset h8-15d"
  exit 0
fi

# The table, and each text counted where it is said to stand.
names=() files=() olds=() news=() reasons=()
while IFS= read -r line || [ -n "$line" ]; do
  last=$((${#names[@]} - 1))
  case "$line" in
    '= '*) names+=("${line#= }") files+=("") olds+=("") news+=("") reasons+=("") ;;
    '- '*) olds[last]+=${olds[last]:+$'\n'}${line#- } ;;
    '+ '* | '+') line=${line#+}; news[last]+=${news[last]:+$'\n'}${line# } ;;
    '? '*) reasons[last]+=${line#\? } ;;
    '#'* | '') ;;
    *) files[last]=$line ;;
  esac
done <"$table"
for i in "${!names[@]}"; do
  [ -f "$root/boards/h8-15d/${files[i]}" ] || wrong "${names[i]}: there is no boards/h8-15d/${files[i]}"
  text=$(<"$root/boards/h8-15d/${files[i]}")
  without=${text//"${olds[i]}"/}
  count=$(((${#text} - ${#without}) / ${#olds[i]}))
  [ "$count" -eq 1 ] || wrong "${names[i]}: its text stands $count times in ${files[i]}; write down anew what it is to change"
done

picked=()
if [ "$few" -gt 0 ]; then
  commit=$(git -C "$root" rev-parse --short=7 HEAD 2>/dev/null || echo 0)
  for ((k = 0; k < few; ++k)); do picked+=($(((16#$commit + k * ${#names[@]} / few) % ${#names[@]}))); done
else
  for i in "${!names[@]}"; do [[ "${names[i]}" == *"$only"* ]] && picked+=("$i"); done
fi
[ ${#picked[@]} -gt 0 ] || wrong "no mutant is called '$only'"

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
mapfile -t commands < <(ninja -C "$build" -t commands bin/h8-15d.elf)
objects=boards/h8-15d/CMakeFiles/h8-15d.dir

# build_mutant I: the changed file before all others on the quoted include path, its objects and the image in the scratch folder.
build_mutant() {
  local i=$1 changed=0 file=${files[$1]} text command object source link=${commands[-1]}
  rm -rf "${scratch:?}"/*
  mkdir -p "$scratch/boards/h8-15d"
  text=$(<"$root/boards/h8-15d/$file")
  printf '%s\n' "${text/"${olds[i]}"/"${news[i]}"}" >"$scratch/boards/h8-15d/$file"
  for command in "${commands[@]}"; do
    [[ "$command" =~ -o\ ($objects/([a-z_]+\.cpp)\.obj)\ -c ]] || continue
    object=${BASH_REMATCH[1]} source=${BASH_REMATCH[2]}
    if [ "$source" = "$file" ]; then
      command=${command//"$root/boards/h8-15d/$source"/"$scratch/boards/h8-15d/$source"}
    elif [[ "$file" == *.cpp || "$(ninja -C "$build" -t deps "$object")" != *"boards/h8-15d/$file"$'\n'* ]]; then
      continue
    fi
    command=${command//"$object"/"$scratch/$source.obj"}
    link=${link//"$object"/"$scratch/$source.obj"}
    changed=1
    (cd "$build" && eval "${command/ -I/ -iquote $scratch -I} -w") >>"$scratch/build.log" 2>&1 || return 1
  done
  [ "$changed" -eq 1 ] || wrong "${names[i]}: nothing is made of $file"
  link=${link//bin\/h8-15d.elf/"$scratch/h8-15d.elf"}
  (cd "$build" && eval "${link//"$build/h8-15d.map"/"$scratch/h8-15d.map"}") >>"$scratch/build.log" 2>&1
}

export CCACHE_DISABLE=1  # its shortcuts do not look for a header that has come to stand in front of another
export HOTCORE_IMAGE=$scratch/h8-15d.elf HOTCORE_ALL=1
filter='Mutation.TheHealthyImagePassesTheExamination:Image.*:*Guards.*:Interrupts.*:Usb.ComesNever*:Figures/Agreement.*/jump'
if [ "$few" -eq 0 ]; then  # or every mistake would seem to be caught
  HOTCORE_IMAGE=$build/bin/h8-15d.elf "$tests" --gtest_brief=1 --gtest_filter="$filter" >/dev/null ||
    wrong "the tests reject the healthy image as well"
fi
caught=0 bad=0
for i in "${picked[@]}"; do
  verdict=""
  if ! build_mutant "$i"; then
    grep -q 'static assertion failed' "$scratch/build.log" || { cat "$scratch/build.log"; wrong "${names[i]}: does not compile"; }
    verdict="the compiler, by a static_assert"
  elif ! timeout 900 "$tests" --gtest_fail_fast --gtest_brief=1 --gtest_filter="$filter" >"$scratch/test.log" 2>&1; then
    verdict=$(sed -n 's/^\[  FAILED  \] \([^ ]*\) (.*/\1/p' "$scratch/test.log" | head -1)
    verdict="${verdict:-no answer in time}: $(grep -m1 -A1 -E '^(Expected|Value of|  Actual|Which is|examine)|^\S+:[0-9]+: Failure$' "$scratch/test.log" | tail -1)"
  fi
  if [ -n "$verdict" ]; then
    caught=$((caught + 1))
    [ -z "${reasons[i]}" ] || { bad=1; verdict+=" - BUT THE TABLE SAYS THAT NO TEST CAN SEE IT"; }
  elif [ -n "${reasons[i]}" ]; then
    verdict="not seen: ${reasons[i]}"
  else
    bad=1
    verdict="SURVIVED"
  fi
  printf '%-62s %s\n' "${names[i]}" "$verdict"
done
echo "$caught of ${#picked[@]} mistakes in the source caught; the table has ${#names[@]}"
exit $bad

#!/usr/bin/env bash
# What a person at a terminal has: completion by the function of hotcore.bash with the words bash would hand it, then the
# TAB key in an interactive bash and at the prompt of hotcore, both on a pseudo-terminal, the prompt without a board, and
# every option in the manual page.   completion.sh HOTCORE hotcore.bash hotcore.1
set -uo pipefail
hotcore=$1 completion=$2 manual=$3
export HOTCORE_SIM_FAST=1 TERM=dumb
source "$completion"
failures=0
check() { # WHAT GOT WANTED
  if [ "$2" = "$3" ]; then echo "$1: $2"; else echo "$1: got '$2', wanted '$3'"; failures=$((failures + 1)); fi
}
offered() { # WORD... (the last one is being typed): what is offered for it
  COMP_WORDS=("$hotcore" "$@") COMP_CWORD=$# COMPREPLY=()
  _hotcore 2>/dev/null
  echo "${COMPREPLY[*]}"
}
check "a command" "$(offered ca)" "calibrate capture"
check "an option of the program" "$(offered --s)" "--serial --sim"
check "an option of a command" "$(offered arm --t)" "--torque"
check "a mode" "$(offered mode t)" "torque"
check "a parameter" "$(offered --sim get axis0.pole)" "axis0.pole_pairs"
check "a parameter to set" "$(offered --sim set axis1.cur)" "axis1.current_limit_A= axis1.current_bandwidth_Hz="
check "a signal" "$(offered --sim watch sp)" "speed_rad_per_s"
check "the board of that serial" "$(offered --sim --serial X7 get offset_b)" "offset_bound_A"
check "no board: no names, no noise" "$(offered --serial NOBODY get axis0.pole)" ""
cd "$(mktemp -d)"
touch mine.toml
check "a file" "$(offered restore mi)" "mine.toml"
each=$(for c in $("$hotcore" --help | sed -n '/^Subcommands:/,/^$/s/^  \([a-z]*\) .*/\1/p'); do offered "$c" | sed "s/.*/$c/"; done | wc -l)
check "every command of --help" "$each" "$("$hotcore" --help | sed -n '/^Subcommands:/,$p' | grep -c '^  [a-z]')"

typed() { script -qec "$1" /dev/null 2>&1 | tr -d '\r'; }
said=$(printf 'PATH=%s:$PATH\nsource %s\nhotcore --sim get axis0.pole\t\nexit\n' "$(dirname "$hotcore")" "$completion" | typed "bash --norc --noprofile -i")
check "TAB in an interactive bash" "$(grep -o '^axis0.pole_pairs  *1 ' <<<"$said" | tr -s ' ')" "axis0.pole_pairs 1 "
said=$(printf 'get axis1.pole\t\nquit\n' | typed "$hotcore --sim")
check "TAB at the prompt" "$(grep -o '^axis1.pole_pairs  *1 ' <<<"$said" | tr -s ' ')" "axis1.pole_pairs 1 "
said=$(typed "$hotcore --serial NOBODY")
check "the prompt without a board: exit code 4, one line" "$? $(wc -l <<<"$said") ${said:0:8}" "4 1 No board"
said=$(printf 'Y\n' | typed "$hotcore --sim motor ec-powermax-30-24v --supply 24")
check "a yes in capitals" "$(grep -o 'In force' <<<"$said")" "In force"
told() { printf '%s' "$1" && sleep 1; } # once the question is there
for key in $'\003' $'\004'; do
  motor=$'motor ec-powermax-30-24v --supply 24\n'
  said=$({ told "$motor" && told "$key" && told "$motor" && told $'y\n' && told $'quit\n'; } | typed "$hotcore --sim")
  check "$(cat -v <<<"$key") ends a question and not the next one" "$(grep -o 'In force' <<<"$said")" "In force"
done

# paragraph COMMAND: what the manual says of it.
paragraph() { sed 's/\\-/-/g; s/\\f.//g' "$manual" | awk -v c="$1" '/^\.TP/ { on = 0; getline; on = $2 == c } on'; }
untold="" plain=$(sed 's/\\-/-/g' "$manual")  # no pipe: grep -q that ends first would break it
for o in $("$hotcore" --help | sed -n 's/^  \(--[a-z]*\).*/\1/p'); do
  grep -q "^\.BI\? $o\b" <<<"$plain" || untold+=" $o"
done
for c in $("$hotcore" --help | sed -n '/^Subcommands:/,/^$/s/^  \([a-z]*\) .*/\1/p'); do
  [ -n "$(paragraph "$c")" ] || untold+=" $c"
  for o in $("$hotcore" "$c" --help | sed -n 's/^  \(-h,\)\{0,1\}\(--[a-z]*\).*/\2/p' | grep -v '^--help$'); do
    grep -q -- "$o\b" <<<"$(paragraph "$c")" || untold+=" '$c $o'"
  done
done
check "commands and options that hotcore.1 does not tell" "$untold" ""
exit $((failures > 0))

# SPDX-License-Identifier: MIT
# Completion of hotcore in bash:  source console/hotcore.bash
# Commands and options come from --help, names of parameters and signals from the board that is plugged in.
_hotcore() {
  local word=${COMP_WORDS[COMP_CWORD]} command="" choice=() i
  for ((i = 1; i < COMP_CWORD; i++)); do
    case ${COMP_WORDS[i]} in
      --serial | --motor) choice+=("${COMP_WORDS[i]}" "${COMP_WORDS[++i]}") ;;
      --sim) choice+=(--sim) ;;
      -*) ;;
      *) command=${COMP_WORDS[i]}; break ;;
    esac
  done
  local words
  if [[ -z $command ]]; then
    words=$("${COMP_WORDS[0]}" --help 2>/dev/null | sed -n '/^Subcommands:/,/^$/s/^  \([a-z]*\) .*/\1/p; s/^  \(--[a-z]*\).*/\1/p')
  elif [[ $word == -* ]]; then
    words=$("${COMP_WORDS[0]}" "$command" --help 2>/dev/null | sed -n 's/^  \(-h,\)\{0,1\}\(--[a-z]*\).*/\2/p')
  else
    case $command in
      get) words=$("${COMP_WORDS[0]}" "${choice[@]}" get --names 2>/dev/null) ;;
      set) words=$("${COMP_WORDS[0]}" "${choice[@]}" get --names 2>/dev/null | sed 's/$/=/'); compopt -o nospace 2>/dev/null ;;
      mode) words="current torque" ;;
      watch | log | capture) words=$("${COMP_WORDS[0]}" "${choice[@]}" signals --names 2>/dev/null) ;;
      *) COMPREPLY=($(compgen -f -- "$word")); return ;;
    esac
  fi
  COMPREPLY=($(compgen -W "$words" -- "$word"))
}
complete -F _hotcore hotcore

# Flash and RAM of the image by room, from the linker's map. .data counts twice: its start values lie in the flash.
#   awk -f tests/chip/sizes.awk build/h8-15d/h8-15d.map
function number(hex,   i, n) { n = 0; hex = tolower(substr(hex, 3)); for (i = 1; i <= length(hex); ++i) n = 16 * n + index("0123456789abcdef", substr(hex, i, 1)) - 1; return n }
function room(file) {
  if (file ~ /libfirmware\.a/) return "firmware"
  if (file ~ /libthermal\.a/) return "thermal"
  if (file ~ /boards\//) return "boards"
  return "toolchain"
}
/^Linker script and memory map/ { on = 1 }
!on { next }
/^\.[a-zA-Z_]/ { section = $1; if ($1 == ".stack" && NF >= 3) { stack = number($3) } }
{
  for (i = 1; i + 2 <= NF; ++i) {
    if ($i !~ /^0x/ || $(i + 1) !~ /^0x/ || $(i + 2) !~ /\.(obj|o|a\(|a)/) continue
    bytes = number($(i + 1)); at = number($i)
    if (bytes == 0) continue
    r = room($(i + 2))
    if (at >= 134217728 && at < 135266304) flash[r] += bytes
    if (at >= 536870912) { ram[r] += bytes; if (section == ".data") flash[r] += bytes }
    break
  }
}
/^\.stack/ { if (NF >= 3) stack = number($3); else pending = 1; next }
pending && /^ +0x/ { stack = number($2); pending = 0 }
END {
  printf "%-12s %10s %10s\n", "room", "flash", "RAM"
  n = split("firmware thermal boards toolchain", rooms, " ")
  for (i = 1; i <= n; ++i) { printf "%-12s %10d %10d\n", rooms[i], flash[rooms[i]], ram[rooms[i]]; f += flash[rooms[i]]; m += ram[rooms[i]] }
  printf "%-12s %10s %10d\n", "stack", "", stack
  printf "%-12s %10d %10d   of 131072 and 49152\n", "all", f, m + stack
  if (f > 131072 || m + stack > 49152) { print "over budget"; exit 1 }
  if (f < 10000 || flash["thermal"] == 0 || flash["firmware"] == 0) { print "the map was not understood"; exit 1 }
}

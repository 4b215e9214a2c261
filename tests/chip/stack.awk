# Deepest stack of the image, from the compiler's call graphs (-fcallgraph-info=su): the main program, and on it every priority
# level once with its deepest handler and a frame of 26 words + alignment (Armv7-M ARM B1.5.7). Library functions that come
# without a figure count as `library` bytes (the deepest, newlib's pow, takes 192 with all it calls, log 108, exp 92, as disassembled).
#   awk -v limit=24576 -f tests/chip/stack.awk build/h8-15d/**/*.ci
BEGIN { library = 256; frame = 27 * 4 + 4 }
/^node:/ {
  split($0, q, "\""); title = q[2]; label = q[4]
  if (match(label, /[0-9]+ bytes \((static|dynamic,bounded)\)/)) { bytes = substr(label, RSTART, RLENGTH) + 0; if (!(title in own) || bytes > own[title]) own[title] = bytes }
  else if (match(label, /bytes \(dynamic\)/)) { print "unbounded frame: " title; bad = 1 }
}
/^edge:/ { split($0, q, "\""); if (!((q[2], q[4]) in seen)) { seen[q[2], q[4]] = 1; calls[q[2]] = calls[q[2]] " " q[4] } }
function deepest(f,   parts, n, i, d, most) {
  if (!(f in own)) sub(/C1E/, "C2E", f)  # a complete constructor is an alias of the base one
  if (f in done) return done[f]
  if (f in open) { print "recursion through " f; bad = 1; return 0 }
  open[f] = 1
  n = split(calls[f], parts, " ")
  most = 0
  for (i = 1; i <= n; ++i) {
    if (parts[i] == "__indirect_call") { print "indirect call in " f; bad = 1; continue }
    d = deepest(parts[i]); if (d > most) most = d
  }
  delete open[f]
  done[f] = most + ((f in own) ? own[f] : library)
  return done[f]
}
END {
  # Levels of boards/h8-15d/board.hpp: main, SysTick 14, USB 8, ADC 2, index 1, PVD 0, then NMI or a fault.
  n = split("reset_handler systick_handler usb_handler adc_handler index0_handler pvd_handler nmi_handler", entry, " ")
  for (i = 1; i <= n; ++i) {
    if (!(entry[i] in own)) { print "no such function: " entry[i]; bad = 1 }
    d = deepest(entry[i]); total += d + (i > 1 ? frame : 0)
    printf "%-18s %6d bytes\n", entry[i], d
  }
  printf "all nested         %6d of %d bytes\n", total, limit
  if (bad || total > limit || total < 500) exit 1
}

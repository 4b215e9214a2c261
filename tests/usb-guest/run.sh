#!/usr/bin/env bash
# The whole chain once: flash image on the chip model - OTG_FS registers - USB/IP - a Linux kernel in a QEMU guest -
# libusb - the console. run.sh PROGRAMS IMAGE GUEST: folder of the built programs, the flash image, the unpacked packages
# of kernel and udev. Says "skipped: why" if something is missing, which is a failure where HOTCORE_ALL is set.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
programs=$1 image=$2 kernel=$3/kernel udev=$3/udev

missing() {
  echo "skipped: $1"
  [ -z "${HOTCORE_ALL:-}" ] || exit 1
  exit 0
}
command -v qemu-system-x86_64 >/dev/null || missing "no qemu-system-x86_64 (set_up_guest in boards/host/set_up.sh)"
command -v busybox >/dev/null || missing "no busybox"
vmlinuz=$(ls "$kernel"/boot/vmlinuz-* 2>/dev/null | head -1) || true
[ -n "$vmlinuz" ] || missing "no kernel in $kernel (set_up_guest in boards/host/set_up.sh)"
[ -x "$udev/bin/udevadm" ] || missing "no udev in $udev (set_up_guest in boards/host/set_up.sh)"
[ -x "$programs/hotcore" ] || missing "no program hotcore"
[ -f "$image" ] || missing "no flash image $image (cmake --preset h8-15d && cmake --build --preset h8-15d)"

work=$(mktemp -d) server="" guest=""
trap 'kill $server $guest 2>/dev/null || true; rm -rf "$work"' EXIT
root=$work/root
mkdir -p "$root"/{bin,dev,proc,sys,run,tmp,modules,lib/udev}
cp "$here/init" "$here/scenario" "$root/"
chmod +x "$root/init"
cp "$(command -v busybox)" "$programs/attach" "$root/bin/"
for m in e1000 usb-common usbcore usbip-core vhci-hcd cdc-acm; do
  cp "$(find "$kernel/lib/modules" -name "$m.ko")" "$root/modules/"
done
cp -r "$udev/lib/udev/rules.d" "$root/lib/udev/"
cp "$udev/bin/udevadm" "$root/bin/"
ln -s udevadm "$root/bin/systemd-udevd"
cp "$programs/hotcore" "$root/bin/"
ldd "$programs/hotcore" "$udev/bin/udevadm" | grep -o '/[^ ]*\.so[^ ]*' | sort -u |
  while read -r library; do cp --parents "$library" "$root/"; done  # what they are linked to
(cd "$root" && find . | busybox cpio -o -H newc 2>/dev/null | gzip -1) >"$work/initrd"

"$programs/virtual-chip" --port 0 --image "$image" >"$work/server" 2>"$work/mistakes" &
server=$!
for _ in $(seq 100); do
  port=$(sed -n 's/.*127\.0\.0\.1:\([0-9]*\).*/\1/p' "$work/server")
  [ -n "$port" ] && break
  kill -0 $server 2>/dev/null || break
  sleep 0.1
done
[ -n "$port" ] || { cat "$work/mistakes"; exit 1; }

timeout 150 qemu-system-x86_64 -accel tcg -m 256 -nographic -no-reboot -nodefaults -serial stdio \
  -kernel "$vmlinuz" -initrd "$work/initrd" -append "console=ttyS0 quiet panic=-1 mitigations=off hotcore_port=$port" \
  -netdev user,id=n -device e1000,netdev=n,romfile= </dev/null >"$work/said" 2>&1 &
guest=$!
while kill -0 $guest 2>/dev/null && ! grep -q '^GUEST: cut the power' "$work/said"; do sleep 0.2; done
kill -HUP $server || true  # the scenario's wish
wait $guest || true
tr -d '\r' <"$work/said" >"$work/console"
grep '^GUEST' "$work/console" || tail -20 "$work/console"
kill -INT $server
code=0
wait $server || code=$?
cat "$work/mistakes"
yes=$(grep -c '^GUEST: yes' "$work/console" || true)
expected=$(grep -c '^want "' "$here/scenario")
echo "$yes of $expected steps; the firmware's mistakes on its registers: $([ $code -eq 0 ] && echo none || echo "code $code")"
[ "$yes" -eq "$expected" ] && [ $code -eq 0 ]

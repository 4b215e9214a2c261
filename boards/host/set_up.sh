# Sourced by ./run and ./test: installs what is missing (Debian, root or sudo) and builds one preset. Quick when nothing is to do.

packages_host=(g++ cmake ninja-build libeigen3-dev libfmt-dev libcli11-dev nlohmann-json3-dev libtomlplusplus-dev
               libgtest-dev gnuplot-nox libunicorn-dev pkg-config libusb-1.0-0-dev libedit-dev umockdev libumockdev-dev)
packages_guest=(qemu-system-x86 busybox-static)
packages_qemu_m4f=(gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib qemu-system-arm)

say() { printf '\033[1m%s\033[0m\n' "$*" >&2; }

install_missing() {
  local missing=() package
  for package in "$@"; do
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || missing+=("$package")
  done
  [ ${#missing[@]} -eq 0 ] && return 0
  local as_root=""
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || { echo "Missing packages: ${missing[*]}. Run this as root or install sudo." >&2; exit 2; }
    as_root=sudo
  fi
  say "Installing: ${missing[*]}"
  $as_root apt-get update -qq
  DEBIAN_FRONTEND=noninteractive $as_root apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
}

# set_up PRESET [TARGET]: packages, configuration, build (all of it, or one target). The root folder is $here.
set_up() {
  local preset=$1
  install_missing "${packages_host[@]}"
  [[ "$preset" == qemu-m4f || "$preset" == h8-15d ]] && install_missing "${packages_qemu_m4f[@]}"
  say "Building: $preset"
  (cd "$here" && { [ -f "build/$preset/build.ninja" ] || cmake --preset "$preset" >/dev/null; } && cmake --build --preset "$preset" ${2:+--target "$2"} >&2)
}

# set_up_guest: a Linux kernel and udev of Debian's, unpacked (not installed) into build/guest, for the test of the whole USB chain.
set_up_guest() {
  install_missing "${packages_guest[@]}"
  unpack_into_guest kernel "$(apt-cache depends linux-image-amd64 | awk '/Depends: linux-image/ { print $2; exit }')"
  unpack_into_guest udev udev
}
unpack_into_guest() {
  local guest=$here/build/guest folder=$1 package=$2
  [ -d "$guest/$folder" ] && return 0
  say "Fetching: $package"
  mkdir -p "$guest"
  (cd "$guest" && apt-get download -qq -o APT::Sandbox::User=root "$package" && dpkg -x "$package"_*.deb unpacked && rm "$package"_*.deb && mv unpacked "$folder")
}

# Shared by tools/run and tools/test: packages, configure, build. Sourced, not run; `root` is the project's folder,
# `preset` the one of CMakePresets.json that is built. Nothing is said when there is nothing to do.

preset=release
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# The one list of packages. libglib2.0-dev: lcm.pc asks for it, and Debian's liblcm-dev does not bring it.
run_packages=(
  cmake g++ ninja-build pkg-config
  libcli11-dev libeigen3-dev libfmt-dev libglib2.0-dev liblcm-bin liblcm-dev libsundials-dev libtomlplusplus-dev nlohmann-json3-dev
  python3 python3-matplotlib
  ca-certificates  # for what `ballast report` fetches once from the npm registry
)
# The browser: for the tests of `ballast report`. Java and what follows it: for those of `ballast spy`, which says itself
# what it lacks where it is run.
test_packages=(
  libgtest-dev libbenchmark-dev libsimbody-dev
  chromium chromium-driver python3-selenium python3-jsonschema
  default-jdk-headless default-jre libjchart2d-java liblcm-java xvfb
)
# The firmware on a microcontroller: its compiler, and the machine it runs on.
target_packages=(gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib qemu-system-arm)
# missing_packages NAME...: those that are not installed, one per line.
missing_packages() {
  local name
  for name in "$@"; do
    [[ $(dpkg-query -W -f '${db:Status-Status}' "$name" 2>/dev/null) == installed ]] || printf '%s\n' "$name"
  done
}

# install_packages NAME...: what is missing of these, with apt-get; exit status 2 if that cannot be done.
install_packages() {
  if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
    printf 'This is not a Debian system: packages are not looked after here. Needed are: %s\n' "$*" >&2
    return
  fi
  local missing as_root=() log get='apt-get install -y --no-install-recommends'
  mapfile -t missing < <(missing_packages "$@")
  ((${#missing[@]})) || return 0
  if ((EUID != 0)); then
    if ! command -v sudo >/dev/null; then
      printf 'Packages are missing, and installing them needs root. As root, run:\n' >&2
      printf '  apt-get update && %s %s\n' "$get" "${missing[*]}" >&2
      exit 2
    fi
    as_root=(sudo)
  fi
  printf 'Installing packages, which takes a minute or two: %s\n' "${missing[*]}" >&2
  log=$(mktemp)
  as_root+=(env DEBIAN_FRONTEND=noninteractive)
  if ! { "${as_root[@]}" apt-get update && "${as_root[@]}" $get "${missing[@]}"; } >"$log" 2>&1; then
    cat "$log" >&2
    rm -f "$log"
    printf 'The packages could not be installed; apt-get says why above.\n' >&2
    exit 2
  fi
  rm -f "$log"
}

# build_dir PRESET: its folder.
build_dir() {
  if [[ $1 == release ]]; then printf '%s/build' "$root"; else printf '%s/build-%s' "$root" "$1"; fi
}

# configured ON|OFF: whether the preset is, and with tests if they are wanted; where they are not they do no harm.
configured() {
  local dir
  dir=$(build_dir "$preset")
  [[ -e $dir/build.ninja ]] || return
  [[ $1 == OFF ]] || grep -qx 'BALLAST_TESTS:BOOL=ON' "$dir/CMakeCache.txt"
}

# build ON|OFF TARGET...: configures the preset, with or without tests, if need be, and builds the targets.
build() {
  local tests=$1 dir log first='' said='' line
  shift
  dir=$(build_dir "$preset")
  [[ -e $dir/bin/ballast ]] || first=', which takes some minutes the first time'
  log=$(mktemp)
  if ! configured "$tests"; then
    if ! (cd "$root" && cmake --preset "$preset" -DBALLAST_TESTS="$tests") >"$log" 2>&1; then
      cat "$log" >&2
      rm -f "$log"
      printf 'Configuring failed, as said above.\n' >&2
      exit 2
    fi
  fi
  : >"$log"
  # Ninja numbers its steps; one that is not the look for new files means that there is something to build.
  if ! ninja -C "$dir" "$@" 2>&1 | while IFS= read -r line; do
    if [[ ! $said && $line == '['*/*']'* && $line != *'Re-checking globbed directories'* ]]; then
      printf 'Building%s ...\n' "$first" >&2
      said=yes
    fi
    printf '%s\n' "$line" >>"$log"
  done; then
    if grep -q '^FAILED:' "$log"; then sed -n '/^FAILED:/,$p' "$log" >&2; else cat "$log" >&2; fi
    rm -f "$log"
    printf 'The build failed, as said above.\n' >&2
    exit 2
  fi
  rm -f "$log"
}

# Shared by the scripts of tools/: packages, configure, build. Sourced, not run. It sets `root`, the project's folder, and
# `preset`, the one of CMakePresets.json to build. It prints nothing when there is nothing to do.

preset=release
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# The only lists of packages, by the first script that needs them.
# tools/run, before it builds. Debian's liblcm-dev lacks libglib2.0-dev, which lcm.pc asks for.
run_packages=(
  cmake g++ ninja-build pkg-config python3
  libcli11-dev libeigen3-dev libfmt-dev libglib2.0-dev liblcm-bin liblcm-dev libtomlplusplus-dev nlohmann-json3-dev
)
# tools/run, before it draws pictures.
picture_packages=(python3-matplotlib)
# tools/build: SUNDIALS for `ballast integrate`, NetCDF for `ballast sweep`, certificates for what `ballast report` fetches
# once from the npm registry, websockets for `ballast live` and `ballast watch --foxglove`, pybind11 and what it needs for the Python package.
build_packages=(libsundials-dev libnetcdf-dev ca-certificates python3-websockets pybind11-dev python3-dev python3-numpy)
# tools/test. The browser opens the pages of `ballast report`, node runs Foxglove's own readers. Java and the packages after
# it are for `ballast spy`, which says itself what a machine lacks.
test_packages=(
  libgtest-dev libbenchmark-dev libsimbody-dev python3-jsonschema dpkg-dev file groff-base
  chromium chromium-driver python3-selenium nodejs
  default-jdk-headless default-jre libjchart2d-java liblcm-java xvfb
)
# tools/firmware and tools/test: the compiler for microcontrollers, and the machine that their programs run on.
target_packages=(gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib qemu-system-arm)
# tools/slurm: a cluster of one node, to try out what runs on larger ones.
cluster_packages=(slurm-wlm munge libopenmpi-dev openmpi-bin python3)

# missing_packages NAME...: the packages that are not installed, one per line.
missing_packages() {
  local name
  for name in "$@"; do
    [[ $(dpkg-query -W -f '${db:Status-Status}' "$name" 2>/dev/null) == installed ]] || printf '%s\n' "$name"
  done
}

# report_progress LABEL PERCENT: prints a line for every fifth of the work. The caller has a variable `reported`, 0 at first.
report_progress() {
  (($2 >= reported + 20)) || return 0
  reported=$(($2 / 20 * 20))
  printf '%s: %d %%\n' "$1" "$reported" >&2
}

# apt_progress LABEL: reads what apt-get prints with APT::Status-Fd=1, reports its progress and passes the rest on.
apt_progress() {
  local line percent reported=0 phase=''
  while IFS= read -r line; do
    if [[ $line =~ ^(dl|pm)status:[^:]*:([0-9]+) ]]; then
      [[ ${BASH_REMATCH[1]} == "$phase" ]] || phase=${BASH_REMATCH[1]} reported=0
      percent=${BASH_REMATCH[2]}
      [[ $phase == dl ]] || report_progress "$1" "$percent"
    else
      printf '%s\n' "$line"
    fi
  done
}

# install_packages NAME...: installs the missing ones with apt-get. Exit status 2 if that fails.
install_packages() {
  if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
    printf 'This is not a Debian system, so no packages are installed. Needed: %s\n' "$*" >&2
    return
  fi
  local missing as_root=() log install=(apt-get install -y --no-install-recommends)
  mapfile -t missing < <(missing_packages "$@")
  ((${#missing[@]})) || return 0
  if ((EUID != 0)); then
    if ! command -v sudo >/dev/null; then
      printf 'Packages are missing, and installing them needs root. As root, run:\n' >&2
      printf '  apt-get update && %s %s\n' "${install[*]}" "${missing[*]}" >&2
      exit 2
    fi
    as_root=(sudo)
  fi
  printf 'Installing packages: %s\n' "${missing[*]}" >&2
  log=$(mktemp)
  as_root+=(env DEBIAN_FRONTEND=noninteractive)
  if ! { "${as_root[@]}" apt-get update &&
    "${as_root[@]}" "${install[@]}" -o APT::Status-Fd=1 "${missing[@]}"; } 2>&1 |
    apt_progress "Installing ${missing[0]} and others" >"$log"; then
    cat "$log" >&2
    rm -f "$log"
    printf 'The packages could not be installed; see the messages of apt-get above.\n' >&2
    exit 2
  fi
  rm -f "$log"
}

# build_dir PRESET: the folder that the preset is built in.
build_dir() {
  if [[ $1 == release ]]; then printf '%s/build' "$root"; else printf '%s/build-%s' "$root" "$1"; fi
}

# configured LEVEL: whether the preset is configured for the level or a higher one.
configured() {
  local dir
  dir=$(build_dir "$preset")
  [[ -e $dir/build.ninja ]] || return
  case $1 in
    run) ;;
    tools) ! grep -qx 'BALLAST_RUN_ONLY:BOOL=ON' "$dir/CMakeCache.txt" ;;
    tests) grep -qx 'BALLAST_TESTS:BOOL=ON' "$dir/CMakeCache.txt" ;;
  esac
}

# configure LEVEL: configures the preset, unless it is. The levels are run, tools and tests; each contains those before it.
configure() {
  local log run_only=OFF tests=OFF
  case $1 in
    run) run_only=ON ;;
    tests) tests=ON ;;
  esac
  configured "$1" && return
  log=$(mktemp)
  if ! (cd "$root" && cmake --preset "$preset" -DBALLAST_RUN_ONLY="$run_only" -DBALLAST_TESTS="$tests") >"$log" 2>&1; then
    cat "$log" >&2
    rm -f "$log"
    printf 'Configuring failed; see the messages of CMake above.\n' >&2
    exit 2
  fi
  rm -f "$log"
}

# build LEVEL TARGET...: configures the preset for the level and builds the targets. Exit status 2 if that fails.
build() {
  local level=$1 dir log line reported=0 said=''
  shift
  dir=$(build_dir "$preset")
  configure "$level"
  log=$(mktemp)
  # Ninja numbers its steps: '[12/96] ...'. The step that looks for new source files does not count as building.
  if ! ninja -C "$dir" "$@" 2>&1 | while IFS= read -r line; do
    if [[ $line =~ ^\[([0-9]+)/([0-9]+)\] && $line != *'Re-checking globbed directories'* ]]; then
      [[ $said ]] || printf 'Building ...\n' >&2
      said=yes
      report_progress Building $((100 * BASH_REMATCH[1] / BASH_REMATCH[2]))
    fi
    printf '%s\n' "$line" >>"$log"
  done; then
    if grep -q '^FAILED:' "$log"; then sed -n '/^FAILED:/,$p' "$log" >&2; else cat "$log" >&2; fi
    rm -f "$log"
    printf 'The build failed; see the messages above.\n' >&2
    exit 2
  fi
  rm -f "$log"
}

# build_tools: packages and build of everything but the tests.
build_tools() {
  install_packages "${run_packages[@]}" "${picture_packages[@]}" "${build_packages[@]}"
  build tools tools/all
}

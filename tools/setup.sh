# Sourced by ./env when a part of the environment is missing or old: brings uv, installs the groups that are
# needed, builds the messages, registers the packages for `ros2 run`, compiles the kernels.
#
# What is half-made has no stamp, so the next run makes it again; a lock lets one set-up run at a time.
# uv cannot do three things: choose PyTorch's build (the machine's pip settings do), build messages (CMake does),
# and take one folder out of a wheel that does not fit the Python (PyBullet's data above Python 3.11).
# shellcheck shell=bash disable=SC2154  # root, venv, stamps, ros and groups are set by ./env

logs=$root/ros2_ws/log/setup
uv_version=0.13.9
declare -A job_pid=() job_label=() job_started=()
if [[ ${LC_ALL:-${LC_CTYPE:-${LANG:-}}} == *[Uu][Tt][Ff]* ]]; then tick="✓"; else tick="ok"; fi

set_up() {
  local python
  require_usable_path
  require_own_venv
  require_compilers
  find_python
  # what is imported here need not be compiled when it is used
  unset PYTHONDONTWRITEBYTECODE
  trap on_interrupt INT TERM HUP
  exec 9>"$root/ros2_ws/.setup.lock"
  if ! flock -n 9; then
    say "Another ./env is setting up this checkout; waiting for it."
    flock 9
  fi
  SECONDS=0
  mkdir -p "$logs"
  rm -f "$logs"/*.log
  if [[ -f $stamps/base && $(<"$stamps/base") == "$root $ros "* ]]; then
    say "Bringing $venv up to date."
  else
    say "Setting up SAIN in $venv (only this once, about two minutes)."
    run_job venv "Python environment" make_venv
  fi
  use_settings_of_pip
  if ! is_made base "$packages_now"; then
    rm -f "$stamps/base"
    run_job packages "Packages" install_base
    start_job kernels "Kernels" compile_kernels
  fi
  if ! is_made messages "$messages_now"; then
    start_job messages "Messages" build_messages src/sain_interfaces
    start_job transforms "Messages of tf2" build_missing tf2_msgs
  fi
  await_jobs
  stamp messages "$messages_now"
  stamp base "$packages_now"
  for group in "${groups[@]}"; do
    is_made "$group" "$packages_now" || run_job "$group" "Packages: $group" install_group "$group"
  done
  say "Ready in $SECONDS s."
  trap - INT TERM HUP
  exec 9>&- # lets the next one in
}

stamp() { mkdir -p "$stamps" && echo "$2" >"$stamps/$1"; } # PART FROM

# --- refusals: one line each, before anything is touched ----------------------------------------------

refuse() {
  say "./env: $1"
  exit 1
}

require_usable_path() {
  local odd=$'[][:space:]"\'`$:;&|<>()*?[{}!#~%^\\]'
  if [[ $root =~ $odd ]]; then
    refuse "cannot work in '$root': CMake and virtual environments need a path without spaces or special characters; move the checkout."
  fi
  [[ -w $root ]] || refuse "cannot write to '$root', where the environment is made."
  for group in "${groups[@]}"; do
    [[ $group == base ]] || grep -q "^$group = \[" "$root/pyproject.toml" ||
      refuse "there is no group '$group'; pyproject.toml has train, test, lint, docs, lerobot, ray, robots and peers."
  done
}

require_own_venv() {
  [[ ! -e $venv || -d $stamps ]] || refuse "$venv is not SAIN's, and would be replaced; move it away."
}

require_compilers() {
  local tool
  for tool in gcc g++ make cmake; do
    command -v "$tool" >/dev/null || refuse "needs $tool to build the messages: sudo apt install build-essential cmake"
  done
}

# Sets `python` to an interpreter that can make an environment and has the headers to compile against.
find_python() {
  local candidate candidates="python3.11 python3.12 python3.13" found=""
  local probe='import ensurepip, os, sys, sysconfig
sys.exit(not os.path.exists(sysconfig.get_path("include") + "/Python.h"))'
  if [[ $ros == system ]]; then candidates=python3.12; fi # the one that Jazzy is compiled for
  for candidate in ${SAIN_PYTHON:-$candidates}; do
    if "$candidate" -c "$probe" &>/dev/null; then
      python=$(command -v "$candidate")
      return
    fi
    if [[ ! $found ]] && "$candidate" -c "" &>/dev/null; then found=$candidate; fi
  done
  [[ ! $found ]] || refuse "$found has no venv module or no headers: sudo apt install $found-venv $found-dev"
  candidate=${SAIN_PYTHON:-${candidates%% *}}
  refuse "needs $candidate: sudo apt install $candidate $candidate-venv $candidate-dev"
}

# --- packages -----------------------------------------------------------------------------------------

make_venv() {
  local flags=(--without-pip)
  if [[ $ros == system ]]; then flags+=(--system-site-packages); fi
  rm -rf "$venv" && mkdir -p "$stamps" # which says whose it is
  # The pip that Python brings is unpacked: ensurepip takes longer than all that it is for.
  "$python" -m venv "${flags[@]}" "$venv" && "$venv/bin/python" -c 'import ensurepip, glob, os, sysconfig, zipfile
folders = os.path.dirname(ensurepip.__file__) + "/_bundled", sysconfig.get_config_var("WHEEL_PKG_DIR") or ""
wheel = [pip for folder in folders for pip in glob.glob(folder + "/pip-*.whl")][0]
zipfile.ZipFile(wheel).extractall(sysconfig.get_path("purelib"))' &&
    "$venv/bin/python" -m pip install --disable-pip-version-check --no-input --quiet "uv==$uv_version"
}

# uv reads no settings of pip: where pip finds packages, uv has to find them, too.
use_settings_of_pip() {
  local settings
  settings=$("$venv/bin/python" -m pip config list 2>/dev/null || true)
  setting() { sed -nE "s/^(global|install|:env:)\.$1='(.*)'$/\2/p" <<<"$settings" | tail -n 1; }
  export UV_DEFAULT_INDEX=${UV_DEFAULT_INDEX:-$(setting index-url)} UV_FIND_LINKS=${UV_FIND_LINKS:-$(setting find-links)}
  export SSL_CERT_FILE=${SSL_CERT_FILE:-$(setting cert)}
  [[ $UV_DEFAULT_INDEX ]] || unset UV_DEFAULT_INDEX
  [[ $UV_FIND_LINKS ]] || unset UV_FIND_LINKS
  [[ $SSL_CERT_FILE ]] || unset SSL_CERT_FILE
}

install() { (cd "$root" && "$venv/bin/uv" pip install --python "$venv/bin/python" "$@"); }

install_base() {
  if [[ $ros == system ]]; then
    # Jazzy's own message modules are compiled against NumPy 1.26.
    install --no-config -c <(echo "numpy<2") -r pyproject.toml --group graph
  else
    install -c requirements.txt -r pyproject.toml --group ros --group graph && mend_wheels
  fi && install_bullet_data && "$venv/bin/python" "$root/tools/register.py" "$venv"
}

compile_kernels() {
  # All that shipped commands run, on all cores; none is compiled later, while somebody waits.
  in_environment python -m sain_model.cli.kernels &&
    in_environment python -c 'import matplotlib.pyplot, mujoco, pybullet_data, rclpy, rosbags, scipy, shapely, tyro'
}

install_group() { # GROUP
  [[ $1 == train ]] || install -c requirements.txt --group "$1" || return
  case $1 in train | test | lerobot) install --no-config -c requirements.txt --group train || return ;; esac
  if [[ $1 == test || $1 == robots ]]; then build_missing control_msgs vision_msgs || return; fi
  # It asks for one certain build of PyTorch; LeRobot imports it and its data sets do without.
  # The wheel of draccus, which it needs, has a package `tests` that would hide ours.
  if [[ $1 == test || $1 == lerobot ]]; then
    install --no-config --no-deps torchvision==0.25.0 || return
    rm -rf "$venv"/lib/python3.*/site-packages/tests
  fi
  for group in "$1" $([[ $1 != test ]] || echo train docs robots lerobot peers ray); do # which tests bring
    stamp "$group" "$packages_now"
  done
}

# PyBullet has no wheel above Python 3.11 (the engine there is MuJoCo); its description of the Panda is data.
install_bullet_data() {
  local wheel site
  site=$(echo "$venv"/lib/python3.*/site-packages)
  if [[ -d $site/pybullet_data ]]; then return; fi
  wheel=$(mktemp -d)
  install --quiet --target "$wheel" --no-deps --python-version 3.11 --python-platform x86_64-manylinux_2_28 pybullet==3.2.7 &&
    mv "$wheel/pybullet_data" "$site"
  rm -rf "$wheel"
  [[ -d $site/pybullet_data ]]
}

# The message wheels' CMake files name the header folders of the machine that built them.
mend_wheels() {
  local include numpy_include
  include=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
  numpy_include=$("$venv/bin/python" -c 'import numpy; print(numpy.get_include())')
  { grep -rl --include='*.cmake' '/opt/python/cp3' "$venv/share" || true; } | xargs -r sed -i -E \
    -e "s#/opt/python/[^/;\"]+/lib/python3\.[0-9]+/site-packages/numpy/_core/include#$numpy_include#g" \
    -e "s#/opt/python/[^/;\"]+/include/python3\.[0-9]+#$include#g"
}

# --- messages -----------------------------------------------------------------------------------------

in_environment() { SAIN_SETTING_UP=yes "$root/env" "$@"; }

# Into the virtual environment, which is an ament prefix.
build_messages() { # FOLDER
  local python_only=OFF build
  build=$venv/build/$(basename "$1")
  if [[ $ros == wheels ]]; then python_only=ON; fi
  if [[ -f $build/install_manifest.txt ]]; then xargs rm -f <"$build/install_manifest.txt"; fi
  rm -rf "$build"
  in_environment cmake -S "$root/$1" -B "$build" -DCMAKE_INSTALL_PREFIX="$venv" -DPYTHON_ONLY=$python_only \
    -DBUILD_TESTING=OFF -DPython3_EXECUTABLE="$venv/bin/python" &&
    in_environment make --no-print-directory -C "$build" "-j$(nproc)" install
}

# Message packages of a full ROS that have no wheel are built beside ours, where nothing else has them.
build_missing() { # PACKAGES
  local package
  if [[ $ros == system ]]; then return; fi
  for package; do
    if [[ -d $venv/build/$package || ! -e $venv/share/$package ]]; then build_messages "tools/missing/$package" || return; fi
  done
}

# --- jobs: in the background, watched, ended together, explained when they fail -----------------------

say() { printf '%s\n' "$1" >&2; }

# A process group of its own lets everything that a job started be ended with it.
start_job() { # NAME LABEL FUNCTION [ARGS]
  set -m
  "${@:3}" >"$logs/$1.log" 2>&1 </dev/null 9>&- &
  set +m
  job_pid[$1]=$!
  job_label[$1]=$2
  job_started[$1]=$SECONDS
}

await_jobs() {
  local name
  while [[ ${#job_pid[@]} -gt 0 ]]; do
    for name in "${!job_pid[@]}"; do
      kill -0 "${job_pid[$name]}" 2>/dev/null || finish_job "$name"
    done
    sleep 0.1
  done
}

run_job() {
  start_job "$@"
  await_jobs
}

finish_job() { # NAME
  local pid=${job_pid[$1]}
  unset "job_pid[$1]"
  if wait "$pid"; then
    say "$(printf '  %s %-40s%4d s' "$tick" "${job_label[$1]}" $((SECONDS - job_started[$1])))"
  else
    say "Failed: ${job_label[$1]}. The end of $logs/$1.log:"
    tail -n 15 "$logs/$1.log" | sed 's/^/    /' >&2
    end_jobs
    exit 1
  fi
}

end_jobs() {
  local pid
  for pid in "${job_pid[@]}"; do
    kill -TERM -- "-$pid" 2>/dev/null || true
    wait "$pid" 2>/dev/null || true
  done
  job_pid=()
}

on_interrupt() {
  trap '' INT TERM HUP
  say "Interrupted; clearing up. The next ./env starts again."
  end_jobs
  [[ -f $stamps/base ]] || rm -rf "$venv"
  exit 130
}

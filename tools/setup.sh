# Sourced by ./env when something has to be made: the virtual environment, the workspace or both.
#
# Whatever is half-made carries no recipe file, so an interrupted run is noticed and made anew by the
# next one; a lock lets only one set-up run at a time. Everything is told on stderr.
# shellcheck shell=bash disable=SC2154  # the paths are set by recipe.sh

# shellcheck source=tools/progress.sh
source "$root/tools/progress.sh"

logs=$workspace/log/setup

# --- refusals: one line each, before anything is touched ----------------------------------------------

refuse() {
  say "./env: $1"
  exit 1
}

require_usable_path() {
  if [[ ! $root =~ ^[A-Za-z0-9_./+@,-]+$ ]]; then
    refuse "cannot work in '$root': colcon and virtual environments need a path without spaces or special characters; move the checkout."
  fi
  [[ -w $root ]] || refuse "cannot write to '$root', where the environment would be made."
}

require_tool() { # COMMAND WHAT-FOR PACKAGE
  command -v "$1" >/dev/null || refuse "needs $1, $2: sudo apt install $3"
}

require_compilers() {
  require_tool make "to build the messages" make
  require_tool gcc "a C compiler, to build the messages" build-essential
  require_tool g++ "a C++ compiler, to build the messages" build-essential
  require_tool cmake "to build the messages" cmake
}

# Sets `python` to the best interpreter that can make an environment and compile against itself.
find_python() {
  local candidate seen="" probe='import ensurepip, sysconfig, os, sys
sys.exit(0 if os.path.exists(sysconfig.get_path("include") + "/Python.h") else 3)'
  for candidate in ${SAIN_PYTHON:-python3.11 python3.12 python3.13 python3.10}; do
    if "$candidate" -c "$probe" &>/dev/null; then
      python=$(command -v "$candidate")
      return
    elif "$candidate" -c "" &>/dev/null; then
      seen=$candidate
    fi
  done
  if [[ -n $seen ]]; then
    refuse "$seen lacks its venv module or its headers: sudo apt install $seen-venv $seen-dev"
  fi
  refuse "needs Python 3.11 (3.10, 3.12 and 3.13 will do): sudo apt install python3.11 python3.11-venv python3.11-dev"
}

# --- jobs: run in the background, watched, ended together, explained when they fail --------------------

declare -A job_pid=() job_label=() job_started=()

# A process group of its own lets everything that the job started be ended with it.
start_job() { # NAME LABEL FUNCTION
  set -m
  "$3" >"$logs/$1.log" 2>&1 </dev/null &
  set +m
  job_pid[$1]=$!
  job_label[$1]=$2
  job_started[$1]=$SECONDS
}

end_jobs() {
  local name
  for name in "${!job_pid[@]}"; do
    kill -TERM -- "-${job_pid[$name]}" 2>/dev/null || true
    wait "${job_pid[$name]}" 2>/dev/null || true
  done
  job_pid=()
}

# Waits until the named jobs are done; whichever others run go on meanwhile.
await_jobs() { # NAME...
  local name waiting=("$@")
  while [[ ${#waiting[@]} -gt 0 ]]; do
    for name in "${!job_pid[@]}"; do
      kill -0 "${job_pid[$name]}" 2>/dev/null || finish_job "$name"
    done
    for name in "${!waiting[@]}"; do
      [[ -n ${job_pid[${waiting[$name]}]:-} ]] || unset "waiting[$name]"
    done
    progress_show "$(percent_done)" "$(where_it_stands)"
    sleep 0.2
  done
}

finish_job() { # NAME
  if wait "${job_pid[$1]}"; then
    progress_done "${job_label[$1]}" $((SECONDS - job_started[$1]))
    unset "job_pid[$1]"
  else
    unset "job_pid[$1]"
    fail_with_log "${job_label[$1]}" "$logs/$1.log"
  fi
}

abandon() {
  end_jobs
  environment_is_ready || rm -rf "$venv"
}

on_interrupt() {
  trap '' INT TERM HUP
  progress_clear
  say "Interrupted; clearing up."
  abandon
  exit 130
}

fail_with_log() { # WHAT LOG
  abandon
  say "$(red "Set-up failed"): $1. The end of ${2#"$root"/}:"
  tail -n 15 "$2" | sed 's/^/    /' >&2
  exit 1
}

# --- how far it is: packages fetched, unpacked and built, each kind with its usual share of the time ---

count() { # PATTERN FILE
  { grep -cE "$1" "$2" 2>/dev/null || true; } | tail -n 1
}

percent_done() {
  local fetched unpacked built wanted part=0
  built=$(count '^(Finished <<<)' "$logs/build.log")
  if [[ $makes_environment ]]; then
    wanted=$(cat "${requirement_files[@]}" | grep -c ==)
    fetched=$(cat "$logs"/{ros,python}.log 2>/dev/null | grep -c '^Collecting' || true)
    unpacked=$(find "$venv"/lib/python*/site-packages -maxdepth 1 -name '*.dist-info' 2>/dev/null | wc -l)
    part=$((3 + (40 * fetched + 30 * unpacked) / wanted))
    echo $((part + 27 * built / package_count > 99 ? 99 : part + 27 * built / package_count))
  else
    echo $((5 + 94 * built / package_count))
  fi
}

where_it_stands() {
  local name labels=""
  for name in "${!job_pid[@]}"; do
    labels+="${labels:+ + }${job_label[$name]}"
  done
  echo "$labels"
}

# --- the steps ----------------------------------------------------------------------------------------

make_venv() {
  rm -rf "$venv"
  if [[ $(ros_kind) == system ]]; then
    "$python" -m venv --system-site-packages "$venv"
  else
    "$python" -m venv "$venv"
  fi
}

install_from() { # PIP-ARGUMENTS...
  "$venv/bin/python" -m pip install --disable-pip-version-check --no-input --no-compile --progress-bar off "$@"
}

install_ros() { install_from --no-deps -r "$root/requirements/lock-3.11-ros.txt" && mend_wheels; }
install_python() { install_from --no-deps -r "$root/requirements/lock-3.11-python.txt"; }

# The message wheels' CMake files name the header folders of the machine that built them.
mend_wheels() {
  local include numpy_include
  include=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
  numpy_include=$("$venv/bin/python" -c 'import numpy; print(numpy.get_include())')
  grep -rlE --include='*.cmake' '/opt/python/cp3' "$venv/share" | xargs -r sed -i -E \
    -e "s#/opt/python/[^/;\"]+/lib/python3\.[0-9]+/site-packages/numpy/_core/include#$numpy_include#g" \
    -e "s#/opt/python/[^/;\"]+/include/python3\.[0-9]+#$include#g"
}

check_imports() {
  LD_LIBRARY_PATH=$(wheel_libraries) _ROS_WHEELS_BOOTSTRAP_COMPLETE=1 "$venv/bin/python" -c 'import rclpy, torch, numba, pybullet'
}

make_environment() {
  environment_recipe_now=$(environment_recipe)
  rm -f "$venv/recipe"
  requirement_files=("$root"/requirements/lock-3.11-{ros,python}.txt)
  start_job venv "Python environment" make_venv
  await_jobs venv
  start_job ros "ROS 2 Jazzy" install_ros
  start_job python "PyTorch, PyBullet and the tools" install_python
  await_jobs ros
}

finish_environment() {
  await_jobs python
  start_job check "Check that it all imports" check_imports
  await_jobs check
  install_ros2_stand_in
  echo "$environment_recipe_now" >"$venv/recipe"
}

install_ros2_stand_in() {
  ln -sfn ../../tools/ros2 "$venv/bin/ros2"
}

# Where the wheels keep the shared libraries that they share with one another.
wheel_libraries() {
  printf '%s:' "$venv"/lib/python3*/site-packages/ros_*.libs
  printf '%s\n' "$venv/lib"
}

# The packages whose part of the recipe changed since they were built, one a line.
changed_packages() {
  diff "$workspace/install/recipe" <(workspace_recipe) | sed -nE 's#^[<>] [^ ]+  \./([^/]+)/.*#\1#p' | sort -u
}

build_workspace() {
  local selection=() package recipe
  recipe=$(workspace_recipe)
  cd "$workspace"
  if [[ -f install/recipe && $(head -n 1 install/recipe) == "$(head -n 1 <<<"$recipe")" ]]; then
    for package in $(changed_packages); do
      # Python packages are made anew, or an executable that was taken out would stay.
      [[ -f src/$package/setup.py || ! -d src/$package ]] && rm -rf "build/$package" "install/$package"
      [[ -f src/$package/package.xml ]] && selection+=("$package")
    done
    [[ ${#selection[@]} -gt 0 ]] && selection=(--packages-select "${selection[@]}")
  else
    rm -rf build install
  fi
  (
    if [[ $(ros_kind) == wheels ]]; then
      export AMENT_PREFIX_PATH=$venv CMAKE_PREFIX_PATH=$venv LD_LIBRARY_PATH=$(wheel_libraries)
      export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
      unset PYTHONPATH COLCON_PREFIX_PATH
    fi
    PYTHONUNBUFFERED=1 PATH=$venv/bin:$PATH colcon --log-base log build --symlink-install "${selection[@]}" \
      --event-handlers console_cohesion- console_direct- --cmake-args -DBUILD_TESTING=OFF "-DPython3_EXECUTABLE=$venv/bin/python"
  ) || return 1
  write_activation
  echo "$recipe" >install/recipe
}

# Sourcing colcon's own set-up at every call would be slow, so its outcome is written down once.
write_activation() {
  local name value wheels=""
  [[ $(ros_kind) == system ]] || wheels=$venv
  {
    cat <<'PREAMBLE'
# Written by tools/setup.sh and sourced by ./env: what `. install/setup.bash` would set, without its work.
prepend() { # a second ./env inside the first adds nothing
  case ":${!1-}:" in
    *":$2:"*) ;;
    *) export "$1=$2${!1:+:${!1}}" ;;
  esac
}
PREAMBLE
    if [[ $wheels ]]; then
      echo "# Libraries of another ROS distribution must not mix with these."
      echo 'case ${AMENT_PREFIX_PATH:-} in */opt/ros/*) unset PYTHONPATH LD_LIBRARY_PATH ;; esac'
      echo "export ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3"
      echo "export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1 # the library path below makes the wheels' re-start needless"
    fi
    env -i PATH=/usr/bin:/bin HOME="$HOME" bash -c '. "$1/install/setup.bash" && env' _ "$workspace" |
      while IFS='=' read -r name value; do
        value=${value%:}
        case $name in
          AMENT_PREFIX_PATH | CMAKE_PREFIX_PATH) echo "export $name='$value${wheels:+:$wheels}'" ;;
          COLCON_PREFIX_PATH) echo "export $name='$value'" ;;
          LD_LIBRARY_PATH) echo "prepend $name '$value${wheels:+:$(wheel_libraries)}'" ;;
          PYTHONPATH) echo "prepend $name '$value'" ;;
        esac
      done
    cat <<DEFAULTS
prepend PATH '$venv/bin'
export VIRTUAL_ENV='$venv' PYTHONNOUSERSITE=1
export RMW_IMPLEMENTATION="\${RMW_IMPLEMENTATION:-rmw_fastrtps_cpp}"
export ROS_AUTOMATIC_DISCOVERY_RANGE="\${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
export OMP_NUM_THREADS="\${OMP_NUM_THREADS:-1}"
DEFAULTS
  } >"$activation.part"
  mv "$activation.part" "$activation"
}

set_up() {
  local makes_environment="" requirement_files=() package_count
  require_usable_path
  require_compilers
  find_python
  mkdir -p "$logs"
  exec 9>"$workspace/.setup.lock"
  if ! flock -n 9; then
    say "Another ./env is setting up this checkout; waiting for it."
    flock 9
  fi
  trap on_interrupt INT TERM HUP
  SECONDS=0
  rm -f "$logs"/*.log
  package_count=$(find "$root/src" -mindepth 2 -maxdepth 2 -name package.xml | wc -l)
  if ! environment_is_ready; then
    makes_environment=yes
    say "$(bold "Setting up SAIN") in .venv: once, about a minute and a download of 450 MB."
    make_environment
  fi
  if ! workspace_is_ready; then
    start_job build "Workspace" build_workspace
  fi
  [[ ! $makes_environment ]] || finish_environment
  [[ -z ${job_pid[build]:-} ]] || await_jobs build
  trap - INT TERM HUP
  exec 9>&-
}

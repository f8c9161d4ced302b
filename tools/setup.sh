# Sourced by ./env when something has to be made: the virtual environment, the workspace or both.
#
# What is half-made has no recipe file, so the next run makes it anew; a lock lets one set-up run at a time.
# shellcheck shell=bash disable=SC2154  # the paths are set by recipe.sh

logs=$workspace/log/setup
fonts=$venv/matplotlib # what Matplotlib knows of fonts; looking them up takes seconds
lock="" # without the kind and .txt: where the versions of this Python stand

# shellcheck source=tools/jobs.sh
source "$root/tools/jobs.sh"
# shellcheck source=tools/activation.sh
source "$root/tools/activation.sh"

set_up() {
  local makes_environment="" usual_seconds=25 package_count
  require_usable_path
  require_compilers
  find_python
  export MPLCONFIGDIR=$fonts
  unset PYTHONDONTWRITEBYTECODE # what is imported here need not be compiled when it is used
  trap on_interrupt INT TERM HUP
  take_lock
  if environment_is_ready && workspace_is_ready; then return; fi # made while this run waited
  SECONDS=0
  mkdir -p "$logs"
  rm -f "$logs"/*.log
  package_count=$(find "$root/src" -mindepth 2 -maxdepth 2 -name package.xml | wc -l)
  if ! environment_is_ready; then
    makes_environment=yes
    usual_seconds=140
    if [[ -f $venv/recipe ]]; then
      say "$(paint 1 "The requirements changed"): bringing $venv up to date."
    else
      say "$(paint 1 "Setting up SAIN") in $venv (only this once)."
    fi
    install_packages
  fi
  if ! workspace_is_ready; then start_job build "Workspace ($package_count packages)" build_workspace; fi
  if [[ $makes_environment ]]; then finish_environment; else start_job kernels "Kernels" compile_kernels; fi
  await_jobs build kernels
  clear_line
  if [[ $makes_environment ]]; then say "Ready in $SECONDS s."; fi
}

# --- refusals: one line each, before anything is touched ----------------------------------------------

refuse() {
  say "./env: $1"
  exit 1
}

require_usable_path() {
  local odd=$'[][:space:]"\'`$:;&|<>()*?[{}!#~%^\\]'
  if [[ $root =~ $odd ]]; then
    refuse "cannot work in '$root': colcon and virtual environments need a path without spaces or special characters; move the checkout."
  fi
  [[ -w $root ]] || refuse "cannot write to '$root', where the environment is made."
}

require_tool() { # COMMAND PACKAGE
  command -v "$1" >/dev/null || refuse "needs $1 to build the workspace: sudo apt install $2"
}

require_compilers() {
  require_tool gcc build-essential
  require_tool g++ build-essential
  require_tool make build-essential
  require_tool cmake cmake
  if [[ $(ros_kind) == system ]]; then require_tool colcon python3-colcon-common-extensions; fi
}

# Sets `python` to an interpreter that can make an environment and has the headers to compile against.
find_python() {
  local candidate candidates="python3.11 python3.12 python3.13" found=""
  local probe='import ensurepip, os, sys, sysconfig
sys.exit(not os.path.exists(sysconfig.get_path("include") + "/Python.h"))'
  if [[ $(ros_kind) == system ]]; then candidates=python3.12; fi # the one that Jazzy is compiled for
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

take_lock() {
  exec 9>"$workspace/.setup.lock"
  if ! flock -n 9; then
    say "Another ./env is setting up this checkout; waiting for it."
    flock 9
  fi
}

# --- what happens when it does not go well ------------------------------------------------------------

on_interrupt() {
  trap '' INT TERM HUP
  say "Interrupted; clearing up. The next ./env starts again."
  abandon
  exit 130
}

abandon() {
  end_jobs
  environment_is_ready || rm -rf "$venv"
}

# --- the environment ----------------------------------------------------------------------------------

install_packages() {
  local fresh="" libraries
  recipe_of_this_run=$(environment_recipe)
  # An environment of the same place and kind is brought up to date; anything else is made anew.
  if [[ ! -f $venv/recipe || $(head -n 1 "$venv/recipe") != "$(head -n 1 <<<"$recipe_of_this_run")" ]]; then
    fresh=yes
    start_job venv "Python environment" make_venv
    await_jobs venv
  fi
  rm -f "$venv/recipe"
  libraries=("$venv"/lib/python3.*)
  lock=$root/requirements/lock-${libraries[0]##*python}
  if [[ $(ros_kind) == system ]]; then
    usual_seconds=300
    start_job python "Numba and the tools" install_beside_ros
  elif [[ $fresh ]]; then
    start_job ros "ROS 2 Jazzy" install_locked_ros
    start_job python "Numba and the tools" install_locked_python
    await_jobs ros
  else
    start_job python "ROS 2 Jazzy, Numba and the tools" update_locked
  fi
  await_jobs python
  start_job torch "PyTorch" install_torch # goes on while the workspace is built
}

make_venv() {
  local flags=()
  if [[ $(ros_kind) == system ]]; then flags=(--system-site-packages); fi
  rm -rf "$venv"
  "$python" -m venv "${flags[@]}" "$venv" && install -r "$root/requirements/pip.txt"
}

# Python compiles what it imports when it first does; compiling all of it here would only take time.
install() {
  "$venv/bin/python" -m pip install --disable-pip-version-check --no-input --no-compile --progress-bar off "$@"
}

# Two pips side by side must not look at what the other one is unpacking, hence --ignore-installed.
install_locked_ros() { install --ignore-installed --no-deps -r "$lock-ros.txt" && mend_wheels; }

install_locked_python() { install --ignore-installed --no-deps -r "$lock-python.txt" && install_arms; }

update_locked() { install --no-deps -r "$lock-ros.txt" -r "$lock-python.txt" && install_arms && mend_wheels; }

install_beside_ros() {
  (cd "$root/requirements" && install -c jazzy-constraints.txt -r python.in && install --no-deps -r as_is.txt) &&
    install_arms
}

# Descriptions and meshes of arms are data in large wheels: only their folders are taken out. PyBullet has no
# wheel above Python 3.11 (the engine there is MuJoCo); example-robot-data unpacks 40 robots, 414 MB.
install_arms() {
  local robots=cmeel.prefix/share/example-robot-data/robots
  unpack_from_wheel bullet.txt pybullet_data &&
    unpack_from_wheel robots.txt $robots/{panda_description,so_arm_description,xarm_description} \
      $robots/ur_description/{urdf,meshes/ur5/collision}
}

unpack_from_wheel() { # REQUIREMENTS FOLDER...
  local wheel
  if [[ -d $(site_packages)/$2 ]]; then return; fi
  wheel=$(mktemp -d)
  "$venv/bin/python" -m pip download --disable-pip-version-check --no-input --progress-bar off --dest "$wheel" \
    --no-deps --only-binary=:all: --implementation cp --python-version 3.11 --abi cp311 --abi none \
    --platform manylinux_2_17_x86_64 --platform manylinux2014_x86_64 --platform any -r "$root/requirements/$1" &&
    "$venv/bin/python" -c 'import sys, zipfile
folders = tuple(f"{folder}/" for folder in sys.argv[3:])
with zipfile.ZipFile(sys.argv[1]) as wheel:
    wheel.extractall(sys.argv[2], [name for name in wheel.namelist() if name.startswith(folders)])' \
      "$wheel"/*.whl "$(site_packages)" "${@:2}"
  rm -rf "$wheel"
  [[ -d $(site_packages)/$2 ]]
}

site_packages() { echo "$venv"/lib/python3.*/site-packages; }

install_torch() {
  local constraints=()
  if [[ $(ros_kind) == system ]]; then
    constraints=(-c "$root/requirements/jazzy-constraints.txt")
  else
    constraints=(-c "$lock-ros.txt" -c "$lock-python.txt")
  fi
  install "${constraints[@]}" -r "$root/requirements/torch.txt"
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

finish_environment() {
  await_jobs torch
  start_job kernels "Kernels of physics and network" compile_kernels
  start_job check "Check that everything imports" check_imports
  await_jobs check
  if [[ $(ros_kind) == wheels ]]; then ln -sfn ../../tools/ros2 "$venv/bin/ros2"; fi
  echo "$recipe_of_this_run" >"$venv/recipe"
}

check_imports() {
  if [[ $(ros_kind) == wheels ]]; then eval "$(declare -f prepend; wheels_activation)"; fi
  "$venv/bin/python" -c 'import matplotlib.pyplot, mujoco, numba, pybullet_data, rclpy, rosbags, scipy, torch'
}

# All that shipped commands run, on all cores; none is compiled later, while somebody waits.
compile_kernels() {
  if [[ $(ros_kind) == wheels ]]; then eval "$(declare -f prepend; wheels_activation)"; fi
  PYTHONPATH=$root/src/sain_core:$root/src/sain_model "$venv/bin/python" -m sain_model.cli.kernels
}

# --- the workspace ------------------------------------------------------------------------------------

build_workspace() {
  local recipe base selection=() underlay=()
  recipe=$(workspace_recipe)
  cd "$workspace" || return
  if [[ -f install/recipe && $(head -n 1 install/recipe) == "$(head -n 1 <<<"$recipe")" ]]; then
    mapfile -t selection < <(changed_packages)
    forget "${selection[@]}"
    selection=(--packages-select "${selection[@]}")
  else
    rm -rf build install
  fi
  if [[ $(ros_kind) == wheels ]]; then
    underlay=(-u PYTHONPATH -u COLCON_PREFIX_PATH AMENT_PREFIX_PATH="$venv" CMAKE_PREFIX_PATH="$venv"
      LD_LIBRARY_PATH="$(wheel_libraries)" _ROS_WHEELS_BOOTSTRAP_COMPLETE=1)
  fi
  read -ra base <<<"--base-paths src $(missing_packages)"
  # Executables get the interpreter that runs colcon, so that has to be the environment's. Make gets a job
  # for each core, whatever else keeps them busy: PyTorch is unpacked meanwhile.
  PATH=$venv/bin:$PATH
  env "${underlay[@]}" PYTHONUNBUFFERED=1 MAKEFLAGS="-j$(nproc)" "$venv/bin/python" "$(command -v colcon)" \
    --log-base log build --symlink-install "${base[@]}" --event-handlers console_direct+ "${selection[@]}" \
    --cmake-args -DBUILD_TESTING=OFF "-DPython3_EXECUTABLE=$venv/bin/python" &&
    write_launchers && write_activation && echo "$recipe" >install/recipe
}

# The executables that setuptools writes import for a tenth of a second before any code of ours runs, and a
# Ctrl-C then leaves a traceback. These end quietly from their first line on.
write_launchers() {
  local entries package name module function
  write_launcher sain_core.cli.program main "$venv/bin/sain" || return
  for entries in build/*/*.egg-info/entry_points.txt; do
    package=${entries#build/} && package=${package%%/*}
    while IFS=' =:' read -r name module function; do
      write_launcher "$module" "$function" "install/$package/lib/$package/$name" || return
    done < <(sed -n '/^\[console_scripts\]/,/^$/{/ = /p}' "$entries")
  done
}

write_launcher() { # MODULE FUNCTION FILE
  printf '%s\n' "#!$venv/bin/python" '# Written by tools/setup.sh.' 'if __name__ == "__main__":' \
    '    import os, signal, sys' \
    '    signal.signal(signal.SIGINT, lambda *_: os._exit(130))' \
    "    from $1 import $2" \
    '    signal.signal(signal.SIGINT, signal.default_int_handler)' \
    "    sys.exit($2())" \
    >"$3" && chmod +x "$3"
}

# The packages whose part of the recipe differs from what was built, one a line.
changed_packages() {
  diff install/recipe <(workspace_recipe) | sed -nE 's#^[<>] [^ ]+  (\.|\.\./tools/missing)/([^/]+)/.*#\2#p' | sort -u
}

# Takes packages out of the recipe of what is built. A Python package's products go too, or an executable
# that is no more would stay; those of the interfaces stay, to be built upon, unless one of them is no more.
forget() { # PACKAGE...
  local package file gone
  for package in "$@"; do
    gone=
    while read -r file; do
      if [[ ! -e src/$file ]]; then gone=yes; fi
    done < <(sed -nE "s#^[^ ]+  \./($package/.*)#\1#p" install/recipe)
    sed -i -E "\#  (\.|\.\./tools/missing)/$package/#d" install/recipe
    if [[ -f src/$package/CMakeLists.txt && ! $gone ]]; then continue; fi
    rm -rf "build/$package" "install/$package"
  done
}

# --- how far it is ------------------------------------------------------------------------------------

# Packages fetched, unpacked and built, and kernels compiled, each weighed by its usual share of the time.
percent_done() {
  local wanted fetched unpacked percent
  if [[ $makes_environment ]]; then
    wanted=$(cat "$lock"-*.txt 2>/dev/null | grep -c == || true)
    if ((wanted == 0)); then wanted=330; fi # before it is clear which Python it is
    fetched=$(cat "$logs"/{ros,python,torch}.log 2>/dev/null | grep -c '^Collecting' || true)
    unpacked=$(find "$venv"/lib/python*/site-packages -maxdepth 1 -name '*.dist-info' 2>/dev/null | wc -l)
    percent=$((2 + (12 * fetched + 20 * unpacked) / wanted + 44 * $(percent_built) / 100 + 20 * $(percent_compiled) / 100))
  else
    percent=$((80 * $(percent_built) / 100 + 20 * $(percent_compiled) / 100))
  fi
  echo $((percent > 98 ? 98 : percent))
}

percent_compiled() {
  sed -nE 's/^compiling ([0-9]+) of ([0-9]+) .*/\1 \2/p; s/^kernels are .*/1 1/p' "$logs/kernels.log" 2>/dev/null |
    awk 'END {print NR ? int(100 * $1 / $2) : 0}'
}

# The messages take about as long as all the Python packages, and make counts its steps in percent.
percent_built() {
  local made finished
  made=$(grep -oE '^\[ *[0-9]+%' "$logs/build.log" 2>/dev/null | tail -n 1 | tr -dc 0-9)
  finished=$(grep -c '^Finished <<<' "$logs/build.log" 2>/dev/null || true)
  echo $((${made:-0} / 2 + 50 * ${finished:-0} / (package_count + 1)))
}

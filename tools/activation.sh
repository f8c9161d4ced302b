# Sourced by tools/setup.sh: writes the file that ./env sources at every call. Sourcing the set-up scripts
# of colcon each time would be slower, so what they would set is written down once.
# shellcheck shell=bash disable=SC2016,SC2154  # text for later; the paths are set by recipe.sh

write_activation() {
  {
    printf '# Written by tools/setup.sh, sourced by ./env.\n'
    declare -f prepend
    if [[ $(ros_kind) == wheels ]]; then wheels_activation; fi
    workspace_variables | while IFS='=' read -r name value; do
      case $name in
        AMENT_PREFIX_PATH | CMAKE_PREFIX_PATH | COLCON_PREFIX_PATH) printf "export %s='%s'\n" "$name" "$value" ;;
        PYTHONPATH | LD_LIBRARY_PATH) printf "prepend %s '%s'\n" "$name" "$value" ;;
      esac
    done
    printf "prepend PATH '%s/bin'\n" "$venv"
    printf "export VIRTUAL_ENV='%s' PYTHONNOUSERSITE=1\n" "$venv"
    printf 'export RMW_IMPLEMENTATION="${RMW_IMPLEMENTATION:-rmw_fastrtps_cpp}"\n'
    printf 'export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"\n'
    # What is not compiled at set-up must be kept when it is: the graph starts a process for every node.
    printf 'unset PYTHONDONTWRITEBYTECODE\n'
    printf 'export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}"\n'
    # Nothing of the workspace stays in the home folder.
    printf 'export ROS_LOG_DIR="${ROS_LOG_DIR:-%s}" MPLCONFIGDIR="${MPLCONFIGDIR:-%s}"\n' "$workspace/log/ros" "$fonts"
  } >"$activation.part"
  mv "$activation.part" "$activation"
}

# Puts a value before a list of paths; a second ./env inside the first adds nothing.
prepend() { # NAME VALUE
  case ":${!1-}:" in
    *":$2:"*) ;;
    *) export "$1=$2${!1:+:${!1}}" ;;
  esac
}

wheels_activation() {
  # Libraries of another ROS distribution must not mix with these.
  printf 'case ${AMENT_PREFIX_PATH:-} in */opt/ros/*) unset PYTHONPATH LD_LIBRARY_PATH ;; esac\n'
  printf 'export ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3 RMW_IMPLEMENTATION=rmw_fastrtps_cpp\n'
  # The wheels start Python a second time to set the library path, unless told that it is set.
  printf 'export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1\n'
  printf "prepend LD_LIBRARY_PATH '%s'\n" "$(wheel_libraries)"
}

# NAME=VALUE lines: what the workspace's own set-up makes of an empty environment.
workspace_variables() {
  local underlay=""
  if [[ $(ros_kind) == wheels ]]; then underlay=$venv; fi
  env -i PATH=/usr/bin:/bin HOME="$HOME" AMENT_PREFIX_PATH="$underlay" CMAKE_PREFIX_PATH="$underlay" \
    bash -c '. "$1/install/setup.bash" && env' _ "$workspace" | sed 's/:*$//'
}

# Where the wheels keep the shared libraries that they share with one another.
wheel_libraries() {
  printf '%s:' "$venv"/lib/python3*/site-packages/ros_*.libs
  printf '%s\n' "$venv/lib"
}

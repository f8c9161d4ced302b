# Sourced by ./env: what the environment and the workspace are made from, and whether both are current.
# Everything here runs on every call, so it is bash and two cheap processes, and never starts Python.
# shellcheck shell=bash disable=SC2154  # root is set by ./env

venv=$root/.venv
workspace=$root/ros2_ws
activation=$workspace/install/activate.sh

# "system" where a full Jazzy install is sourced, else "wheels". Our own activation names no /opt/ros.
ros_kind() {
  if [[ ${ROS_DISTRO:-} == jazzy && ${AMENT_PREFIX_PATH:-} == */opt/ros/jazzy* ]]; then
    echo system
  else
    echo wheels
  fi
}

# A virtual environment works only where it was made, so the checkout's path is part of the recipe.
environment_recipe() {
  echo "$root $(ros_kind)"
  cat "$root"/requirements/*
}

# Message packages of a full ROS that have no wheel, in one line: built here, beside ours, where nobody else
# has them.
missing_packages() {
  local package
  [[ $(ros_kind) == wheels ]] || return 0
  for package in "$root"/tools/missing/*/; do
    package=${package%/} package=${package##*/}
    if [[ ! -e $venv/share/$package ]]; then echo -n "../tools/missing/$package "; fi
  done
}

# With --symlink-install Python files are used where they stand; these are the files that are not.
workspace_recipe() {
  { echo "$root $(ros_kind)" && cat "$root"/requirements/ros.in "$root"/requirements/lock-*-ros.txt; } | cksum
  cd "$root/src" || return
  # shellcheck disable=SC2046  # paths from this file, without spaces
  find . $(missing_packages) -type f \( -name package.xml -o -name setup.py -o -name setup.cfg -o -name CMakeLists.txt \
    -o -path './*/resource/*' -o -name '*.msg' -o -name '*.srv' -o -name '*.action' \) -exec sha256sum {} + | sort -k 2
  sha256sum ../tools/activation.sh
  # Of a launch or configuration file only its being there matters: the installed one is a link to it.
  find . -type f \( -path './*/launch/*.py' -o -path './*/config/*.yaml' -o -path './*/config/*.rviz' \) -printf 'linked  %p\n' | sort
}

environment_is_ready() {
  [[ -f $venv/recipe && $(<"$venv/recipe") == "$(environment_recipe)" ]]
}

workspace_is_ready() {
  [[ -f $activation && -f $workspace/install/recipe && $(<"$workspace/install/recipe") == "$(workspace_recipe)" ]]
}

#!/usr/bin/env bash
# Runs a command inside the workspace, on the image's own ROS 2.
set -eo pipefail
# shellcheck source=/dev/null
source /opt/ros/jazzy/setup.bash
exec "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/../env" "$@"

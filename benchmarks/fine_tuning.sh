#!/usr/bin/env bash
#
# benchmarks/fine_tuning.sh OUT [WORLD...]   records what benchmarks/fine_tuning.py compares on.
#
# For each world: four bags of 40 episodes to learn from and one of 60 others to be judged by, all
# of them the whole graph closing the loop with the shipped model; and each bag as a data set.
# The shipped model was trained for none of these worlds:
#
#   cube     the target is a cube
#   rubber   friction with the table 0.25 to 0.45, in place of 0.08 to 0.20
#   rims     friction between the disks 0.2 to 0.4, in place of 0.12
#
# What is there already is left as it is.

set -euo pipefail
cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/.."

out=$1
shift
worlds=("$@")
[[ $# -gt 0 ]] || worlds=(cube rims rubber)
mkdir -p "$out"

cat >"$out/rims.yaml" <<'YAML'
/sain/sim_node:
  ros__parameters:
    world: rough
    effects: rims
YAML

# record NAME EPISODES SEED OPTIONS...: one bag, and the data set made of it.
record() {
  local name=$1 episodes=$2 seed=$3
  shift 3
  if [[ ! -f $out/$name/summary.json ]]; then
    rm -rf "${out:?}/$name"
    # It exits with 1 when an episode misses its goal, as some do here.
    ./env ros2 run sain_bringup closed_loop --episodes "$episodes" --seed "$seed" --tolerance 0.01 \
      --no-video --out "$out/$name" "$@" || [[ -f $out/$name/summary.json ]]
  fi
  ./env ros2 run sain_bags to_dataset "$out/$name/bag" --out "$out/data/$name"
}

for world in "${worlds[@]}"; do
  case $world in
    cube) options=(--scenario anywhere_cube) ;;
    rubber) options=(--scenario anywhere_rubber) ;;
    rims) options=(--scenario anywhere --params-file "$out/rims.yaml") ;;
    *) echo "no world $world; known: cube, rims, rubber" >&2 && exit 2 ;;
  esac
  record "${world}_test" 60 1000 "${options[@]}"
  for bag in 1 2 3 4; do
    record "${world}_$bag" 40 $((40 * (bag - 1))) "${options[@]}"
  done
done

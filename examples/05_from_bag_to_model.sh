#!/usr/bin/env bash
#
# From recordings to a model, and back into the loop: every run becomes training data.
#
#   ./env examples/05_from_bag_to_model.sh [FOLDER] [EPISODES] [EPOCHS]
#
# The shipped model knows disks. Here the target is a cube, which it was not trained for. The graph
# closes the loop with it all the same, is recorded, and the recording teaches the model the cube.
# docs/walk.md tells what each step prints. FOLDER is made; it must not exist.

set -euo pipefail

folder=${1:-runs/walk}
episodes=${2:-40}
epochs=${3:-100}

step() { printf '\n--- %s\n' "$*"; }

# The graph: simulator, model, planner and recorder. It exits with 1 where an episode missed its
# goal, as happens with a cube; a summary is there whenever the graph itself went well.
play() {
  local out=$1
  shift
  ros2 run sain_bringup closed_loop --scenario anywhere_cube --tolerance 0.01 --no-video \
    --out "$out" "$@" || [[ -f $out/summary.json ]]
}

step "1. Record: the loop closed with the shipped model, $episodes episodes"
play "$folder/before" --model sain --seed 0 --episodes "$episodes"

step "2. What is in the bag"
ros2 run sain_bags info "$folder/before/bag"

step "3. The bag as a data set: one row for each push"
ros2 run sain_bags to_dataset "$folder/before/bag" --out "$folder/data"

step "4. Fine-tune the shipped model on it"
ros2 run sain_model train "$folder/data" --from sain --epochs "$epochs" --out "$folder/model"

step "5. The loop closed with the new model, in episodes that nobody has seen"
model=$folder/model/sain.safetensors
play "$folder/after" --model "$model" --seed 1000 --episodes "$(((episodes + 3) / 4))"

step "6. Both models on the pushes of these episodes: tables in shipped.txt and tuned.txt"
ros2 run sain_bags to_dataset "$folder/after/bag" --out "$folder/unseen"
judge() { ros2 run sain_model evaluate "$folder/unseen" --open-loop "$@"; }
judge --out "$folder/shipped.json" >"$folder/shipped.txt"
judge --checkpoint "$model" --out "$folder/tuned.json" >"$folder/tuned.txt"

step "7. What it brought"
python - "$folder" <<'PYTHON'
import json, sys
from pathlib import Path

folder = Path(sys.argv[1])
read = lambda name: json.loads((folder / name).read_text())

shipped, tuned = read("shipped.json"), read("tuned.json")
print(f"one push predicted, {shipped['transitions']} pushes of {shipped['episodes']} episodes:")
for name, errors, row in (
    ("physics alone", shipped, "its prior, history"),
    ("SAIN as shipped", shipped, "SAIN, history"),
    ("fine-tuned", tuned, "SAIN, history"),
):
    print(f"  {name:16s}{errors['all'][row]['target_mean']:6.2f} mm off, where the target ends")
for name, errors in (("SAIN as shipped", shipped), ("fine-tuned", tuned)):
    held = errors["intervals"]["SAIN"]["target"]["parts"]["all"]["coverage"]
    print(f"  {name:16s}{100 * held:6.0f} % of the targets in its 90 % regions")
print("in the loop, each in episodes of its own:")
for name, run in (("SAIN as shipped", "before"), ("fine-tuned", "after")):
    played = read(f"{run}/summary.json")["episodes"]
    solved = [episode["pushes"] for episode in played if episode["success"]]
    pushes = f"{sum(solved) / len(solved):.1f} pushes" if solved else "none"
    print(f"  {name:16s}{len(solved):3d} of {len(played)} reached the goal, {pushes} on average")
PYTHON

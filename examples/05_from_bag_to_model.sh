#!/usr/bin/env bash
#
# Record the closed loop, fine-tune the shipped model on the recording, and close the loop again.
#
#   ./env examples/05_from_bag_to_model.sh [FOLDER] [EPISODES] [EPOCHS]
#
# Here the target is a cube. FOLDER is created; it must not exist.

set -euo pipefail

folder=${1:-runs/walk}
episodes=${2:-40}
epochs=${3:-100}

step() { printf '\n--- %s\n' "$*"; }

# Runs simulator, model, planner and recorder. closed_loop exits with 1 if an episode missed its goal,
# which happens with a cube. A summary exists if the graph itself succeeded.
play() {
  local out=$1
  shift
  ros2 run sain_bringup closed_loop --scenario anywhere_cube --tolerance 0.01 --no-video \
    --out "$out" "$@" || [[ -f $out/summary.json ]]
}

step "1. Record the closed loop with the shipped model, $episodes episodes"
play "$folder/before" --model sain --seed 0 --episodes "$episodes"

step "2. Contents of the bag"
ros2 run sain_bags info "$folder/before/bag"

step "3. Convert the bag to a data set: one row for each push"
ros2 run sain_bags to_dataset "$folder/before/bag" --out "$folder/data"

step "4. Fine-tune the shipped model"
ros2 run sain_model train "$folder/data" --from sain --epochs "$epochs" --out "$folder/model"

step "5. Close the loop with the new model, in new episodes"
model=$folder/model/sain.safetensors
play "$folder/after" --model "$model" --seed 1000 --episodes "$(((episodes + 3) / 4))"

step "6. Evaluate both models on the pushes of these episodes: tables in shipped.txt and tuned.txt"
ros2 run sain_bags to_dataset "$folder/after/bag" --out "$folder/unseen"
judge() { ros2 run sain_model evaluate "$folder/unseen" "$@"; }
judge --out "$folder/shipped.json" >"$folder/shipped.txt" & # both at once
judge --checkpoint "$model" --out "$folder/tuned.json" >"$folder/tuned.txt"
wait $!

step "7. Result"
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
    moved = errors["after"]["1"]["errors"]["all that moved"]
    print(f"  {name:16s}{moved[row]['mm'][0]:6.2f} mm mean error of the bodies that moved")
for name, errors in (("SAIN as shipped", shipped), ("fine-tuned", tuned)):
    held = errors["after"]["1"]["errors"]["all that moved"]["SAIN, history"]["coverage"][0]
    print(f"  {name:16s}{100 * held:6.0f} % of them in its 90 % regions")
print("in the closed loop, each model in different episodes:")
for name, run in (("SAIN as shipped", "before"), ("fine-tuned", "after")):
    played = read(f"{run}/summary.json")["episodes"]
    solved = [episode["pushes"] for episode in played if episode["success"]]
    pushes = f"{sum(solved) / len(solved):.1f} pushes" if solved else "none"
    print(f"  {name:16s}{len(solved):3d} of {len(played)} reached the goal, {pushes} on average")
PYTHON

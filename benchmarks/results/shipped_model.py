"""The shipped model: its data sets, its training, and its errors in worlds of all kinds.

    ./env python -m benchmarks.results.shipped_model collect train errors

Everything lies below `--out`, and a second call goes on where the first one stopped. Every fourth
shape of the library is unseen: the network does not learn from it.
"""

import argparse
import subprocess
from pathlib import Path
from typing import Final

from sain_core.shapes.library import library
from sain_core.shapes.solids import DISK

NAMES: Final = tuple(shape.name for shape in library())
UNSEEN: Final = NAMES[3::4]
DRAWN: Final = tuple(name for name in NAMES if name not in UNSEEN)
SEEN: Final = ",".join((*DRAWN, DISK))
SPEEDS: Final = "--speeds 0.05-0.3"
SHAPES: Final = f"{SPEEDS} --bodies 1-2 --shapes"
MUJOCO: Final = "--engine mujoco"
LEARNED: Final = {  # name of a data set: episodes, options of `collect`
    "disks": (600, SPEEDS),
    "feet": (500, f"{SHAPES} {SEEN}"),
    "flat": (250, f"--bottom flat {SHAPES} {SEEN}"),
    "rough": (250, f"--world rough --labs 1000 {SHAPES} {SEEN}"),
    "mujoco_feet": (250, f"{MUJOCO} {SHAPES} {SEEN}"),
    "mujoco_flat": (200, f"{MUJOCO} --bottom flat {SHAPES} {SEEN}"),
    "measured": (350, f"{MUJOCO} --world measured --labs 1000 {SHAPES} {SEEN}"),
}
FRESH: Final = {  # what it has not learned from: seeds, labs and, but for disks, shapes
    name: (40, how.replace(SEEN, ",".join(UNSEEN)).replace("--labs", "--lab 7000 --labs"))
    for name, (_, how) in LEARNED.items()
}
TRAINING: Final = (
    "--prior planar_axes --position-scale 0.0001 --heading-scale 0.01 --weight-decay 0.01"
    " --epochs 40 --batch 256 --members 3 --history earlier --believed --test 0.05"
)


def main() -> None:
    """Do the steps that are named; see the module."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("steps", nargs="+", choices=("collect", "train", "errors"))
    parser.add_argument("--out", type=Path, default=Path("data/shipped"))
    parser.add_argument("--checkpoint", help="to measure in place of the new one")
    arguments = parser.parse_args()
    out = arguments.out
    for step in arguments.steps:
        if step == "collect":
            for kind, seed, sets in (("learned", 100, LEARNED), ("fresh", 300, FRESH)):
                for number, (name, (episodes, how)) in enumerate(sets.items(), seed):
                    collect(out / kind / name, episodes, number, how)
        elif step == "train":
            folders = [str(out / "learned" / name) for name in LEARNED]
            run("sain_model", "train", *folders, "--out", str(out / "sain"), *TRAINING.split())
        else:
            checkpoint = arguments.checkpoint or str(out / "sain/sain.safetensors")
            for name in FRESH:
                result = out / f"errors/{name}.json"
                where = ("--checkpoint", checkpoint, "--out", str(result), "--overwrite")
                run("sain_model", "evaluate", str(out / "fresh" / name), "--open-loop", "1", *where)


def collect(folder: Path, episodes: int, seed: int, how: str) -> None:
    """Collect a data set, or go on with it."""
    size = ("--episodes", str(episodes), "--seed", str(seed), "--workers", "2")
    run("sain_sim", "collect", "--out", str(folder), *size, *how.split())


def run(package: str, command: str, *arguments: str) -> None:
    """Run a command of the project, and stop where it fails."""
    print(package, command, *arguments, flush=True)
    subprocess.run(["ros2", "run", package, command, *arguments], check=True)


if __name__ == "__main__":
    main()

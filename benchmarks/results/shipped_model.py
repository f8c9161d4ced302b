"""The shipped model: its data sets, its training, and its errors in worlds of all kinds.

    ./env python -m benchmarks.results.shipped_model collect train regions errors

Everything lies below `--out`, and a second call goes on where the first one stopped. Every fourth
shape of the library is unseen: the network does not learn from it.
"""

import argparse
import subprocess
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Final

from sain_core.shapes.library import library
from sain_core.shapes.solids import DISK
from sain_model.data.dataset import load_dataset
from sain_model.dynamics.identify import with_all_parameters
from sain_model.dynamics.load import load_checkpoint, parse_card, save_checkpoint
from sain_model.dynamics.sain import weights_of
from sain_model.training.interval_fit import fit_intervals

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
REGIONS: Final = {  # what its regions are fitted to: the shapes that it learned from
    name: (40 if name == "rough" else 24, how.replace("--labs", "--lab 9000 --labs"))
    for name, (_, how) in LEARNED.items()
}
TRAINING: Final = (
    "--prior planar_axes --position-scale 0.0001 --heading-scale 0.01 --weight-decay 0.01"
    " --epochs 40 --batch 256 --members 3 --history earlier --believed --test 0.05"
)


def main() -> None:
    """Do the steps that are named; see the module."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("steps", nargs="+", choices=("collect", "train", "regions", "errors"))
    parser.add_argument("--out", type=Path, default=Path("data/shipped"))
    parser.add_argument("--checkpoint", help="to measure in place of the new one")
    arguments = parser.parse_args()
    out = arguments.out
    checkpoint = arguments.checkpoint or str(out / "sain/sain.safetensors")
    for step in arguments.steps:
        if step == "collect":
            each = ("learned", 100, LEARNED), ("fresh", 300, FRESH), ("regions", 500, REGIONS)
            for kind, seed, sets in each:
                for number, (name, (episodes, how)) in enumerate(sets.items(), seed):
                    collect(out / kind / name, episodes, number, how)
        elif step == "train":
            folders = [str(out / "learned" / name) for name in LEARNED]
            run("sain_model", "train", *folders, "--out", str(out / "sain"), *TRAINING.split())
        elif step == "regions":
            fit_card(Path(checkpoint), [out / "regions" / name for name in REGIONS])
        else:
            for name in FRESH:
                result = out / f"errors/{name}.json"
                where = ("--checkpoint", checkpoint, "--out", str(result), "--overwrite")
                run("sain_model", "evaluate", str(out / "fresh" / name), "--open-loop", "1", *where)


def collect(folder: Path, episodes: int, seed: int, how: str) -> None:
    """Collect a data set, or go on with it."""
    size = ("--episodes", str(episodes), "--seed", str(seed), "--workers", "2")
    run("sain_sim", "collect", "--out", str(folder), *size, *how.split())


def fit_card(path: Path, folders: Sequence[Path]) -> None:
    """Fit the regions of a checkpoint to data sets, and write them on its card."""
    model = load_checkpoint(path)
    regions = fit_intervals(with_all_parameters(model), *load_dataset(*folders).parts)
    card = replace(parse_card(path, model.origin.card), intervals=asdict(regions))
    save_checkpoint(path, weights_of(model), card)


def run(package: str, command: str, *arguments: str) -> None:
    """Run a command of the project, and stop where it fails."""
    print(package, command, *arguments, flush=True)
    subprocess.run(["ros2", "run", package, command, *arguments], check=True)


if __name__ == "__main__":
    main()

"""How many pushes one controller saves another, scene by scene.

./env python -m benchmarks.paired_pushes results/cube --second runs/cube/sain.safetensors

Reads what `ros2 run sain_eval evaluate` wrote. Over the scenes that both controllers solve, the
mean of the differences of their pushes and of their mean prediction errors, with 95 % bootstrap
intervals over scenes.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from sain_core.bootstrap import Interval, bootstrap_mean
from sain_core.seeding import generator
from sain_model.evaluation.tables import markdown_table


@dataclass(frozen=True)
class Command:
    """What to compare."""

    results: Annotated[Path, tyro.conf.Positional]
    """Folder of an evaluation."""
    first: str = "sain"
    """A controller."""
    second: str = "planar_axes"
    """Another one, by which the first is to be measured."""


def main() -> None:
    """Print a line for each tolerance."""
    command = tyro.cli(Command, description=__doc__)
    scenes = json.loads((command.results / "results.json").read_text())["scenes"]
    rows = []
    for tolerance in sorted({scene["tolerance"] for scene in scenes}, reverse=True):
        solved = [_solved(scenes, name, tolerance) for name in (command.first, command.second)]
        both = sorted(solved[0].keys() & solved[1].keys())
        pairs = [[solved[way][key] for key in both] for way in (0, 1)]
        saved = [first["pushes"] - second["pushes"] for first, second in zip(*pairs, strict=True)]
        closer = [_error(first) - _error(second) for first, second in zip(*pairs, strict=True)]
        cells = [_cell(saved, 1), _cell(closer, 2)]
        rows.append([f"{100 * tolerance:g} cm", *(str(len(s)) for s in solved), *cells])
    header = ["within", command.first, command.second, "pushes saved", "error less by, mm"]
    print(markdown_table(header, rows), end="")


def _solved(
    scenes: list[dict[str, Any]], controller: str, tolerance: float
) -> dict[tuple[str, int], dict[str, Any]]:
    """Return what a controller solved, by scenario and seed."""
    return {
        (scene["scenario"], scene["seed"]): scene
        for scene in scenes
        if scene["controller"] == controller and scene["tolerance"] == tolerance
        if scene["success"] and scene["target_errors"]
    }


def _error(scene: dict[str, Any]) -> float:
    return 1e3 * float(np.mean(scene["target_errors"]))


def _cell(differences: list[float], digits: int) -> str:
    if not differences:
        return ""
    found: Interval = bootstrap_mean(np.array(differences), generator(0, "paired"))
    return f"{found.estimate:.{digits}f} [{found.low:.{digits}f}, {found.high:.{digits}f}]"


if __name__ == "__main__":
    main()

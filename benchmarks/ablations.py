"""What each part of the planner is worth, in closed loop on the same scenes.

./env python -m benchmarks.ablations --learned runs/learned/sain.safetensors

Every variant differs from the default settings in what its name says, and plays the same seeded
scenes with the real arm. Success at four tolerances; pushes until within 2 cm and 5 mm, over the
scenes solved; and how many pushes more than the default, over scenes that both solved, with a 95 %
bootstrap interval. A run that was stopped goes on where it was.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.console import Console
from rich.progress import track

from sain_core.bootstrap import bootstrap_mean
from sain_core.errors import ConfigError
from sain_core.seeding import generator
from sain_eval.commands import evaluate
from sain_model.evaluation.tables import markdown_table
from sain_mppi.algorithms.config import PlannerConfig

TOLERANCES = (0.05, 0.02, 0.01, 0.005)
LEARNED = "network alone, as the paper plans"
DEFAULT = "default"
Changes = dict[str, str | int | float]
VARIANTS: dict[str, Changes] = {
    DEFAULT: {},
    "weighted mean": {"selection": "mean"},
    "one round, as many sequences": {"rounds": 1, "samples": 1.75},
    "two rounds, as many sequences": {"rounds": 2, "samples": 1.167},
    "no warm start": {"no-warm-start": ""},
    "no informed candidates": {"candidate-share": 0},
    "no wider plans": {"progress.surprise": 9, "progress.stalled-after": 99},
    "gradient": {"algorithm": "gradient"},
    "icem": {"algorithm": "icem"},
    "mppi, as many sequences": {"algorithm": "mppi", "samples": 1.75},
    "mppi, weighted mean": {"algorithm": "mppi", "samples": 1.75, "selection": "mean"},
    "exhaustive": {"algorithm": "exhaustive"},
    **{f"K x {share}": {"samples": share} for share in (0.125, 0.25, 0.5, 2.0)},
    **{f"H = {h}": {"horizon": h} for h in (1, 2, 3, 6, 8, 10, 15)},
}


@dataclass(frozen=True)
class Options:
    """What to compare."""

    variants: tuple[str, ...] = tuple(VARIANTS)
    """Names of variants."""
    samples: int = PlannerConfig().samples
    """K of the default; variants that change it have so many times as many."""
    learned: Path | None = None
    """A checkpoint trained with --prior identity: the paper's way to plan, as one more variant."""
    scenario: str = "anywhere"
    """Which scenes."""
    scenes: int = 100
    """How many, from seed 0 on."""
    controllers: str = "sain"
    """One model to plan over."""
    world: str = "randomised"
    """The world that is played in."""
    workers: int = 1
    """Processes that play side by side."""
    out: Path = Path("runs/ablations")
    """Folder of the results, a folder for each variant."""


def main() -> None:
    """Play every variant and print the table."""
    options = tyro.cli(Options, description=__doc__)
    unknown = [name for name in options.variants if name not in VARIANTS]
    if unknown:
        raise ConfigError(f"no variant {unknown[0]!r}; there are: {', '.join(VARIANTS)}")
    names = [*options.variants, *([LEARNED] if options.learned else [])]
    scenes = {name: play(name, options) for name in track(names, "variants")}
    Console().print(table(scenes), markup=False, highlight=False, soft_wrap=True)


def play(name: str, options: Options) -> list[dict[str, Any]]:
    """Play one variant, or what is left of it; return one record for each scene and tolerance."""
    out = options.out / "".join(c if c.isalnum() else "_" for c in name)
    controller = str(options.learned) if name == LEARNED else options.controllers
    arguments = ["--out", str(out), "--scenario", options.scenario, "--controllers", controller]
    arguments += ["--scenes", str(options.scenes), "--workers", str(options.workers)]
    arguments += ["--world", options.world, "--tolerances", ",".join(map(str, TOLERANCES))]
    if code := evaluate(arguments + settings(VARIANTS.get(name, {}), options.samples)):
        raise SystemExit(code)
    records: list[dict[str, Any]] = json.loads((out / "results.json").read_text())["scenes"]
    return records


def settings(changes: Changes, samples: int) -> list[str]:
    """Return changes of the planner as options of the command line."""
    factor = float(changes.get("samples", 1.0))
    given = {**changes, "samples": round(factor * samples)}
    options = [(f"--planner.{name}", str(value)) for name, value in given.items()]
    return [word for option in options for word in option if word]


def table(scenes: dict[str, list[dict[str, Any]]]) -> str:
    """Return the comparison in Markdown."""
    head = ["planner", "solved at 5 / 2 / 1 / 0.5 cm", "pushes at 2 cm", "at 0.5 cm"]
    head += ["more than the default at 0.5 cm", "planning, ms"]
    rows = []
    for name, records in scenes.items():
        solved = " / ".join(str(sum(r["success"] for r in at(records, t))) for t in TOLERANCES)
        times = [time for r in at(records, TOLERANCES[-1]) for time in r["plan_seconds"]]
        known = name != DEFAULT and DEFAULT in scenes
        more = difference(records, scenes[DEFAULT]) if known else ""
        cells = [name, solved, pushes(records, 0.02), pushes(records, 0.005), more]
        rows.append([*cells, f"{1e3 * np.median(times):.0f}"])
    return markdown_table(head, rows)


def at(records: list[dict[str, Any]], tolerance: float) -> list[dict[str, Any]]:
    """Return the records of one tolerance."""
    return [record for record in records if record["tolerance"] == tolerance]


def pushes(records: list[dict[str, Any]], tolerance: float) -> str:
    """Return the mean number of pushes over the scenes solved."""
    counts = [r["pushes"] for r in at(records, tolerance) if r["success"]]
    return f"{np.mean(counts):.1f}" if counts else ""


def difference(records: list[dict[str, Any]], usual: list[dict[str, Any]]) -> str:
    """Return how many pushes more than the default, over the scenes that both solved."""
    both = [
        {r["seed"]: r["pushes"] for r in at(which, TOLERANCES[-1]) if r["success"]}
        for which in (records, usual)
    ]
    seeds = sorted(set(both[0]) & set(both[1]))
    if len(seeds) < 2:
        return ""
    more = np.array([both[0][seed] - both[1][seed] for seed in seeds], dtype=float)
    mean, low, high = bootstrap_mean(more, generator(0, "bootstrap"), np.array(seeds))
    return f"{mean:+.2f} [{low:.2f}, {high:.2f}]"


if __name__ == "__main__":
    main()

"""One push at home, and closed loops on few scenes that nothing else plays."""

import subprocess
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from benchmarks.gates.table import Gate
from benchmarks.results.shipped_model import DRAWN, UNSEEN
from sain_core.randomness import Interval
from sain_core.workers import WorkerOptions
from sain_eval.episode import Tolerance
from sain_eval.loop.evaluation import EpisodeJob, run_jobs
from sain_eval.loop.results import SceneRecord, summarise
from sain_model.data.dataset import load_dataset
from sain_model.dynamics.load import load_shipped
from sain_model.evaluation.errors import (
    DEG,
    MM,
    PRIOR_HISTORY,
    PUSHED,
    SAIN,
    SAIN_HISTORY,
    TARGETS,
    evaluate,
)
from sain_sim.world.engines import MUJOCO
from sain_sim.world.truth import RANDOMISED_TRUTH, ROUGH, TruthConfig

SHIPPED, PLANAR = "sain", "planar"
WITHIN: Final = Tolerance(0.005, 0.03)
WORKERS: Final = WorkerOptions(workers=2)
FIRST: Final = {"Bullet": 70_000, "rough": 71_000, "MuJoCo": 72_000}  # seeds
WORLDS: Final = {
    "Bullet": RANDOMISED_TRUTH,
    "rough": TruthConfig(world=ROUGH),
    "MuJoCo": TruthConfig(engine=MUJOCO),
}
SAMPLES: Final = {
    "disks": ["--episodes", "150", "--seed", "9101"],
    "seen shapes": ["--episodes", "100", "--seed", "9102", "--shapes", ",".join(DRAWN)],
    "unseen shapes": ["--episodes", "100", "--seed", "9103", "--shapes", ",".join(UNSEEN)],
}


ONE_PUSH: Final = {  # groups of bodies, units of errors, and by which share they may be worse
    "disks": (TARGETS, (MM,), 0.03),
    "seen shapes": (PUSHED, (MM, DEG), 0.01),
    "unseen shapes": (PUSHED, (MM, DEG), 0.01),
}


@dataclass(frozen=True)
class Part:
    """Scenes of one scenario in one world."""

    world: str
    scenario: str
    scenes: int
    controller: str = SHIPPED

    @property
    def name(self) -> str:
        """Names it in the table."""
        world = "" if self.world == "Bullet" else f"{self.world}, "
        controller = "" if self.controller == SHIPPED else f", {self.controller}"
        return f"{world}{self.scenario}{controller}"

    def jobs(self) -> list[EpisodeJob]:
        """Return the episodes to play."""
        first, truth = FIRST[self.world], WORLDS[self.world]
        return [
            EpisodeJob(self.scenario, seed, self.controller, (WITHIN,), truth=truth)
            for seed in range(first, first + self.scenes)
        ]

    def has(self, record: SceneRecord) -> bool:
        """Tell whether a record is of it."""
        same = (record.scenario, record.controller) == (self.scenario, self.controller)
        return same and 0 <= record.seed - FIRST[self.world] < self.scenes


PARTS: Final = (
    Part("Bullet", "paper", 8),
    Part("Bullet", "paper_cube", 8),
    Part("Bullet", "anywhere", 20),
    Part("Bullet", "anywhere_cube", 8),
    Part("Bullet", "push_t", 8),
    Part("Bullet", "shapes", 20),
    Part("Bullet", "shapes_indirect", 10),
    Part("Bullet", "rearrange_2", 3),
    Part("Bullet", "rearrange_3", 3),
    Part("Bullet", "rearrange_4", 3),
    Part("Bullet", "blocked", 8),
    Part("rough", "anywhere", 12),
    Part("rough", "anywhere", 12, PLANAR),
    Part("MuJoCo", "anywhere", 12),
    Part("MuJoCo", "push_t", 6),
)


def measure_one_push(data: Path) -> list[Gate]:
    """Measure SAIN's mean error over that of its physics with the same history."""
    model, gates = load_shipped(), []
    for name, how in SAMPLES.items():
        collect(data / name.split()[0], how)
    for name, (group, units, slack) in ONE_PUSH.items():
        found = evaluate(load_dataset(data / name.split()[0]), {SAIN: model})["after"]["1"]
        errors, ratios = (found[part][group][SAIN_HISTORY] for part in ("errors", "ratios"))
        for unit in units:
            gates += _errors(name, unit, errors[unit][0], ratios[PRIOR_HISTORY][unit], slack)
    return gates


def collect(folder: Path, how: list[str]) -> None:
    """Collect a sample once."""
    if (folder / "card.json").exists():
        return
    bodies = ["--bodies", "1-2"] if "--shapes" in how else []
    command = ["ros2", "run", "sain_sim", "collect", "--out", str(folder), "--workers", "2"]
    subprocess.run([*command, *how, *bodies], check=True, stdout=subprocess.DEVNULL)


def _errors(name: str, unit: str, error: float, ratio: Interval, slack: float) -> list[Gate]:
    """Return the gates of a mean error, and of its ratio to that of physics.

    The sample is the same each time, so the interval of the ratio is only shown.
    """
    value, low, high = ratio
    shown = f"{value:.3f} [{low:.2f}, {high:.2f}]"
    return [
        Gate(f"{name}: SAIN, {unit}", error, unit, slack=slack),
        Gate(f"{name}: SAIN / physics, {unit}", value, "", slack=slack, shown=shown),
    ]


def measure() -> list[Gate]:
    """Play the scenes of all parts."""
    jobs = [job for part in PARTS for job in part.jobs()]
    with closing(run_jobs(jobs, WORKERS)) as results:
        records = [record for played in results for record in played]
    groups = {part: [one for one in records if part.has(one)] for part in PARTS}
    rows = {part: summarise(group)[0] for part, group in groups.items()}
    gates = [gate for part, row in rows.items() for gate in _gates(part.name, row)]
    plain = [one for part in PARTS if part.world == "Bullet" for one in groups[part]]
    plain = [replace(one, scenario="all", heading_tolerance=0.0) for one in plain]
    gates += _gates("Bullet, all of these", summarise(plain)[0])
    shipped, planar = (row for part, row in rows.items() if part.world == "rough")
    more = shipped["successes"] - planar["successes"]
    gates.append(Gate("rough, anywhere: SAIN - planar", more, "scenes", at_least=0))
    return gates


def _gates(name: str, row: dict[str, Any]) -> list[Gate]:
    """Return the gates of a row of a summary: scenes solved, and pushes in these."""
    rate, pushes = row["rate"], row["pushes"]
    interval = rate["low"], rate["high"]
    share = f"({100 * rate['low']:.0f}-{100 * rate['high']:.0f} %)"
    shown = f"{row['successes']}/{row['scenes']} {share}"
    gates = [
        Gate(
            f"{name}: solved",
            rate["estimate"],
            interval=interval,
            shown=shown,
            more_is_better=True,
        )
    ]
    if pushes["estimate"] is not None:
        spread = pushes["low"], pushes["high"]
        gates.append(Gate(f"{name}: pushes", pushes["estimate"], interval=spread))
    return gates

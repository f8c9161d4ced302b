"""Optimizers of other projects in our loop: ``./env python -m benchmarks.peers``.

Scenes of `anywhere` in Bullet, the shipped model, at most 15 pushes, 0.5 cm. All planners have the
same model, costs, feasibility and agent. Times are processor seconds of a plan in a process with
one thread, so that other jobs on the machine hardly count. Nothing is planned ahead.

A run that was stopped goes on where it was. Table and picture have all that the journal has: slow
settings can play fewer scenes. judo is optional:

    {install}
"""

import json
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import numba
import torch
import tyro
from rich.console import Console
from rich.progress import Progress

from benchmarks.peer_figure import draw, table
from benchmarks.peer_optimizers import (
    INSTALL,
    JUDO_CEM,
    JUDO_MPPI,
    JUDO_PS,
    PYTORCH,
    PeerSettings,
)
from benchmarks.peer_planning import PeerDecider, TimedDecider
from sain_core.drawing.figures import write_png
from sain_core.model import load_dynamics
from sain_core.storage import append_json
from sain_core.workers.pool import FunctionRunner, Software, Work
from sain_core.workers.running import WorkerOptions, run_on_workers
from sain_eval.loop.closed_loop import run_episode
from sain_eval.loop.results import scene_records
from sain_eval.scenes.scenarios import SCENARIOS
from sain_mppi.agent.agent import Agent, AgentConfig
from sain_mppi.agent.planning import PlanningDecider
from sain_mppi.algorithms.config import ICEM, MPPI, MPPI_ROUNDS, PlannerConfig

TOLERANCES: Final = (0.02, 0.005)
OURS: Final = (MPPI_ROUNDS, ICEM, MPPI)
PEERS: Final[dict[str, PeerSettings]] = {
    PYTORCH: PeerSettings(PYTORCH, iterations=4, noise=0.2, cheapest=True),
    JUDO_MPPI: PeerSettings(JUDO_MPPI, iterations=8, noise=0.2, cheapest=True),
    JUDO_CEM: PeerSettings(JUDO_CEM, iterations=4, noise=0.2, cheapest=True),
    JUDO_PS: PeerSettings(JUDO_PS, iterations=8, noise=0.2),
}
COUNTS: Final = (64, 256, 1024, 4096, 16384)


@dataclass(frozen=True)
class Options:
    """What to play."""

    planners: tuple[str, ...] = (*OURS, *PEERS)
    """Names."""
    samples: tuple[int, ...] = COUNTS
    """K, in a plan, all iterations or rounds together."""
    scenes: int = 100
    """How many, from the first seed on; 0: only table and picture."""
    seed: int = 0
    """Of the first scene."""
    model: str = "sain"
    """Name or checkpoint of what all of them roll out."""
    set: tuple[str, ...] = ()
    """Other settings of the peers, as noise=0.2; they are part of the name in the journal."""
    workers: int = 1
    """Processes that play side by side."""
    out: Path = Path("runs/peers")
    """Folder of the journal."""
    picture: Path | None = None
    """Draw success and pushes against time into this file."""


@dataclass(frozen=True)
class PeerJob:
    """An episode."""

    planner: str
    samples: int
    seed: int
    model: str
    changes: tuple[tuple[str, Any], ...] = ()

    @property
    def key(self) -> list[Any]:
        """What names it in the journal."""
        name = " ".join([self.planner, *(f"{k}={v}" for k, v in self.changes)])
        return [name, self.samples, self.seed, self.model]


def play(job: PeerJob) -> dict[str, Any]:
    """Play an episode; return its line of the journal."""
    torch.set_num_threads(1)
    numba.set_num_threads(1)
    case = SCENARIOS["anywhere"].scene(job.seed)
    model, physics = (load_dynamics(name) for name in (job.model, "planar"))
    planner = ours_with(job.samples)
    if job.planner in PEERS:
        peer = replace(PEERS[job.planner], samples=job.samples, **dict(job.changes))
        config = AgentConfig(planner=replace(planner, horizon=peer.horizon))
        decider = TimedDecider(PeerDecider(model, physics, config, peer))
    else:
        config = AgentConfig(planner=ours_with(job.samples, job.planner))
        decider = TimedDecider(PlanningDecider(model, physics, config.planner))
    outcome = run_episode(case, Agent(decider, config), TOLERANCES[-1])
    records = scene_records(case, job.planner, outcome, TOLERANCES)
    return {
        "key": job.key,
        "success": [record.success for record in records],
        "pushes": [record.pushes for record in records],
        "left": records[-1].final_distance,
        "failure": records[-1].failure,
        "seconds": decider.seconds,
    }


def ours_with(samples: int, algorithm: str = MPPI) -> PlannerConfig:
    """Return our settings with so many samples in a plan, all rounds together."""
    usual = PlannerConfig(algorithm=algorithm, ahead=False)
    rounds = 1 if algorithm == MPPI else usual.rounds
    share = sum(usual.thinning**number for number in range(rounds))
    return replace(usual, samples=max(round(samples / share), 1))


def jobs_of(options: Options) -> list[PeerJob]:
    """Return all episodes, the cheap ones first."""
    changes = tuple(
        (name, json.loads(value)) for name, value in (s.split("=") for s in options.set)
    )
    return [
        PeerJob(name, count, seed, options.model, changes if name in PEERS else ())
        for count in options.samples
        for name in options.planners
        for seed in range(options.seed, options.seed + options.scenes)
    ]


def main() -> None:
    """Play what is left, print the table and draw."""
    options = tyro.cli(Options, description=(__doc__ or "").format(install=INSTALL))
    journal = options.out / "episodes.jsonl"
    journal.parent.mkdir(parents=True, exist_ok=True)
    lines = journal.read_text().splitlines() if journal.exists() else []
    done = {json.dumps(line["key"]): line for line in map(json.loads, lines)}
    left = [job for job in jobs_of(options) if json.dumps(job.key) not in done]
    work = Work(partial(FunctionRunner, play), Software(("benchmarks",), ("torch",)), str)
    workers = WorkerOptions(workers=options.workers)
    with Progress(transient=True) as progress:
        task = progress.add_task("episodes", total=len(left))
        for line in run_on_workers(work, left, workers, ordered=False):
            append_json(journal, line)
            done[json.dumps(line["key"])] = line
            progress.advance(task)
    played = list(done.values())
    Console(width=160, highlight=False).print(table(played, OURS), markup=False)
    if options.picture is not None:
        write_png(draw(played, OURS), options.picture)


if __name__ == "__main__":
    main()

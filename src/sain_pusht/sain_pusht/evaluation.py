"""Many episodes of gym-pusht on workers, and what they add up to."""

import csv
import dataclasses
import io
import json
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from sain_core.bootstrap import Interval, bootstrap_mean
from sain_core.seeding import generator
from sain_core.storage import write_whole
from sain_core.workers.pool import FunctionRunner, Software, Work
from sain_core.workers.running import WorkerOptions
from sain_eval.loop.evaluation import SOURCES, EpisodeDone, play_on_workers
from sain_eval.loop.results import RESULTS_FILE, how_it_was_made, interval_row
from sain_eval.loop.statistics import wilson_interval
from sain_mppi.algorithms.config import PlannerConfig
from sain_pusht.agent import PLANNER, pusht_agent
from sain_pusht.episode import PushtRecord, play_pusht
from sain_pusht.film import gif_of
from sain_pusht.model import PushtModel, load_model
from sain_pusht.motion import Pace
from sain_pusht.world import PushtWorld

PACKAGES: Final = ("gym-pusht", "pymunk", "gymnasium", "numpy", "numba", "torch")
REALITY: Final = "gym-pusht"
SUCCESS: Final = "95 % covered"
EPISODES_FILE: Final = "episodes.csv"


@dataclass(frozen=True)
class PushtJob:
    """One episode to play; `picture` is where to write it as an animation."""

    seed: int
    model: str
    planner: PlannerConfig = PLANNER
    pace: Pace = Pace()
    picture: Path | None = None


def run_pusht_job(job: PushtJob) -> EpisodeDone[PushtRecord]:
    """Play one episode."""
    known = _load(job.model)
    world = _world(job.model, job.pace)
    world.frames = [] if job.picture else None
    agent = pusht_agent(known.model, known.physics, job.planner, world.tool)
    record, _ = play_pusht(job.seed, agent, world)
    if not job.picture:
        return EpisodeDone(record)
    return EpisodeDone(record, job.picture, gif_of(world.frames or []))


def run_pusht_jobs(
    jobs: Sequence[PushtJob], options: WorkerOptions = WorkerOptions()
) -> Generator[PushtRecord, None, None]:
    """Play all jobs on workers, write their animations, and yield their records in order."""
    work = Work(
        partial(FunctionRunner, run_pusht_job),
        Software(SOURCES, PACKAGES),
        lambda job: f"episode {job.seed}",
        goes_on=False,
    )
    return play_on_workers(work, jobs, options, ordered=True)


@cache
def _load(model: str) -> PushtModel:
    return load_model(model)


@cache
def _world(model: str, pace: Pace) -> PushtWorld:
    return PushtWorld(pace=pace, bodies=_load(model).bodies)


@dataclass(frozen=True)
class PushtSummary:
    """What many episodes add up to. Times and errors are over all strokes."""

    episodes: int
    successes: int
    success: Interval
    steps: Interval
    steps_median: float
    free_share: float
    strokes: float
    best_coverage: float
    planning_median_s: float
    planning_p95_s: float
    error_mm: float
    error_deg: float
    refusals: int


def summarise_pusht(records: Sequence[PushtRecord]) -> PushtSummary:
    """Add up episodes; steps count in all of them, solved or not."""
    steps = np.array([record.steps for record in records], dtype=float)
    successes = sum(record.success for record in records)
    times = _joined(records, "planning_s")
    return PushtSummary(
        episodes=len(records),
        successes=successes,
        success=wilson_interval(successes, len(records)),
        steps=bootstrap_mean(steps, generator(0, "bootstrap", "pusht")),
        steps_median=float(np.median(steps)),
        free_share=float(sum(record.free_steps for record in records) / max(steps.sum(), 1.0)),
        strokes=float(np.mean([record.pushes for record in records])),
        best_coverage=float(np.mean([record.best_coverage for record in records])),
        planning_median_s=float(np.median(times)),
        planning_p95_s=float(np.quantile(times, 0.95)),
        error_mm=float(np.median(_joined(records, "error_mm"))),
        error_deg=float(np.median(_joined(records, "error_deg"))),
        refusals=sum(record.refusals for record in records),
    )


def results_row(model: str, records: Sequence[PushtRecord]) -> dict[str, Any]:
    """Return the row of these episodes in results; see `sain_eval.loop.results.summarise`.

    Pushes are strokes of the solved episodes, steps are over all of them.
    """
    summary = summarise_pusht(records)
    strokes = np.array([record.pushes for record in records if record.success], dtype=float)
    pushes = bootstrap_mean(strokes, generator(0, "bootstrap", "pusht", "strokes"))
    errors = _joined(records, "error_mm")
    return {
        "scenario": REALITY,
        "controller": model,
        "tolerance": 0.0,
        "heading_tolerance": 0.0,
        "within": SUCCESS,
        "scenes": summary.episodes,
        "successes": summary.successes,
        "rate": interval_row(summary.success),
        "pushes": interval_row(pushes),
        "steps": summary.steps.estimate,
        "target_error": 1e-3 * float(errors.mean()) if np.isfinite(errors).all() else None,
        "refusals": summary.refusals,
        "goals_in_a_row": [],
        "most_goals": 1,
    }


def _joined(records: Sequence[PushtRecord], column: str) -> np.ndarray:
    values = [value for record in records for value in getattr(record, column)]
    return np.array(values or [0.0])


def write_pusht_results(
    folder: Path, records: Sequence[PushtRecord], config: dict[str, Any], command: str
) -> None:
    """Write ``results.json``, with all it takes to make it again, and ``episodes.csv``."""
    content = {
        **how_it_was_made(config, command, PACKAGES),
        "reality": REALITY,
        "summary": [results_row(config["model"], records)],
        "gym_pusht": dataclasses.asdict(summarise_pusht(records)),
        "episodes": [dataclasses.asdict(record) for record in records],
    }
    text = json.dumps(content, indent=1, default=str) + "\n"
    write_whole(folder / RESULTS_FILE, text.encode())
    table = io.StringIO()
    rows = csv.writer(table, lineterminator="\n")
    names = [item.name for item in dataclasses.fields(PushtRecord)]
    plain = [name for name in names if not isinstance(getattr(records[0], name), tuple)]
    rows.writerow([*plain, "planning_s"])
    for record in records:
        total = round(sum(record.planning_s), 4)
        rows.writerow([*(getattr(record, name) for name in plain), total])
    write_whole(folder / EPISODES_FILE, table.getvalue().encode())

"""Many episodes over worker processes, paired seeds for all controllers, in any order."""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path

from sain_core.drawing.figures import write_png
from sain_eval.loop.closed_loop import EpisodeOutcome, run_episode
from sain_eval.loop.controllers import ControllerMaker, controller_maker
from sain_eval.loop.results import SceneRecord, scene_records
from sain_eval.plots.pictures import draw_episode
from sain_eval.scenes.scenarios import SCENARIOS
from sain_mppi.search.config import PlannerConfig
from sain_sim.episodes.truth import RANDOMISED_TRUTH, TruthConfig

THREAD_LIMITS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True)
class Job:
    """One episode to run."""

    scenario: str
    seed: int
    controller: str
    tolerances: tuple[float, ...]  # [m]; the controller plays to the tightest
    planner: PlannerConfig
    history: bool = True  # whether a model is told the episode's earlier pushes
    picture: Path | None = None  # where to draw it
    truth: TruthConfig = RANDOMISED_TRUTH


def run_job(job: Job) -> list[SceneRecord]:
    """Run one episode and judge it at each tolerance."""
    case = SCENARIOS[job.scenario].scene(job.seed).within(job.truth)
    controller = _maker(job.controller, job.planner, job.history)(case)
    outcome = run_episode(case, controller, min(job.tolerances))
    if job.picture is not None:
        _draw(job, outcome, job.picture)
    return scene_records(case, job.controller, outcome, job.tolerances)


def run_jobs(jobs: Sequence[Job], workers: int) -> Iterator[list[SceneRecord]]:
    """Run all jobs over worker processes and yield their records as they come.

    With one worker they run in this process, in order.
    """
    if workers == 1:
        yield from map(run_job, jobs)
        return
    limits = dict.fromkeys(THREAD_LIMITS, "1")  # read once, when a worker starts
    before = {name: os.environ.get(name) for name in limits}
    os.environ.update(limits)
    pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"))
    try:
        futures: list[Future[list[SceneRecord]]] = [pool.submit(run_job, job) for job in jobs]
        for future in as_completed(futures):
            yield future.result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@cache
def _maker(controller: str, planner: PlannerConfig, history: bool) -> ControllerMaker:
    """Load each model once in a process."""
    return controller_maker(controller, planner, learns=history)


def _draw(job: Job, outcome: EpisodeOutcome, path: Path) -> None:
    title = f"{job.scenario}, scene {job.seed}, {job.controller}"
    write_png(draw_episode(outcome.record, title), path)

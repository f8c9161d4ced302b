"""Many episodes over worker processes, paired seeds for all controllers, in any order."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread
from typing import TypeVar

from sain_core.drawing.figures import write_png
from sain_eval.loop.closed_loop import EpisodeOutcome, run_episode
from sain_eval.loop.controllers import agent_maker
from sain_eval.loop.results import SceneRecord, scene_records
from sain_eval.plots.pictures import draw_episode
from sain_eval.scenes.scenario_scene import ScenarioScene
from sain_eval.scenes.scenarios import SCENARIOS
from sain_eval.tolerance import Tolerance, tightest
from sain_mppi.loop.agent import AgentConfig
from sain_sim.collecting.workers import environment
from sain_sim.episodes.truth import RANDOMISED_TRUTH, TruthConfig
from sain_sim.world.camera import WorldCameraConfig

THREAD_LIMITS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

Job = TypeVar("Job")
Done = TypeVar("Done")


@dataclass(frozen=True)
class EpisodeJob:
    """One episode to run."""

    scenario: str
    seed: int
    controller: str
    tolerances: tuple[Tolerance | float, ...]  # the controller plays to the tightest; a number: [m]
    agent: AgentConfig = AgentConfig()
    picture: Path | None = None  # where to draw it
    truth: TruthConfig = RANDOMISED_TRUTH
    belief: str = ""  # path of what models begin with
    camera: WorldCameraConfig = WorldCameraConfig()

    def case(self) -> ScenarioScene:
        """Return the scene to solve, in its world."""
        return SCENARIOS[self.scenario].scene(self.seed).within(self.truth)


def play_job(job: EpisodeJob) -> EpisodeOutcome:
    """Run one episode to the tightest tolerance."""
    case = job.case()
    agent = agent_maker(job.controller, job.agent, job.belief)(case)
    return run_episode(case, agent, tightest(job.tolerances), camera=job.camera)


def run_job(job: EpisodeJob) -> list[SceneRecord]:
    """Run one episode and judge it at each tolerance."""
    outcome = play_job(job)
    if job.picture is not None:
        goal = f", goal {len(outcome.records)}" if len(outcome.records) > 1 else ""
        title = f"{job.scenario}, scene {job.seed}{goal}, {job.controller}"
        write_png(draw_episode(outcome.record, title), job.picture)
    return scene_records(job.case(), job.controller, outcome, job.tolerances)


def run_jobs(jobs: Sequence[EpisodeJob], workers: int) -> Iterator[list[SceneRecord]]:
    """Run all jobs over worker processes and yield their records as they come.

    See `run_on_workers`.
    """
    yield from run_on_workers(run_job, jobs, workers)


def run_on_workers(
    work: Callable[[Job], Done], jobs: Sequence[Job], workers: int
) -> Iterator[Done]:
    """Do work for all jobs over worker processes; yield what it returns as it comes.

    With one worker it is done in this process, in order. A worker ends when this process does.
    """
    if workers == 1:
        yield from map(work, jobs)
        return
    pool = ProcessPoolExecutor(workers, get_context("spawn"), initializer=_end_with_parent)
    with environment(dict.fromkeys(THREAD_LIMITS, "1")):  # read once, when a worker starts
        try:
            for future in as_completed([pool.submit(work, job) for job in jobs]):
                yield future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _end_with_parent() -> None:
    """End this process as soon as the one that started it has ended, killed or not."""
    parent = parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    Thread(target=follow, daemon=True).start()

"""Many episodes over worker processes, paired seeds for all controllers, in any order."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

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

    With one worker they run in this process, in order.
    """
    if workers == 1:
        yield from map(run_job, jobs)
        return
    pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"))
    with environment(dict.fromkeys(THREAD_LIMITS, "1")):  # read once, when a worker starts
        try:
            futures = [pool.submit(run_job, job) for job in jobs]
            for future in as_completed(futures):
                yield future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)

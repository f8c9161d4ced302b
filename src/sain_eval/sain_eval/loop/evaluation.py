"""Many episodes on workers, paired seeds for all controllers, in any order."""

from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from sain_core.output import write_whole
from sain_core.workers import FunctionRunner, Work, WorkerOptions, run_on_workers
from sain_eval.episode import Tolerance, tightest
from sain_eval.loop.closed_loop import agent_maker, run_episode
from sain_eval.loop.journal import Journal
from sain_eval.loop.play import EpisodeOutcome
from sain_eval.loop.results import PACKAGES, SceneRecord, scene_records
from sain_eval.scenes.families import ScenarioScene
from sain_eval.scenes.scenarios import draw_scene
from sain_mppi.agent.agent import AgentConfig
from sain_sim.camera.camera import WorldCameraConfig
from sain_sim.world.engines import modules_of
from sain_sim.world.truth import RANDOMISED_TRUTH, TruthConfig

SOURCES: Final = ("sain_core", "sain_sim", "sain_model", "sain_mppi", "sain_eval")


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
    outlines: Path | None = None  # file with the bodies of `anything`

    def case(self) -> ScenarioScene:
        """Return the scene to solve, in its world."""
        return draw_scene(self.scenario, self.seed, self.outlines).within(self.truth)


@dataclass(frozen=True)
class EpisodeDone:
    """An episode that was played: its records, and its picture where one was wanted."""

    records: list[SceneRecord]
    picture: Path | None = None  # where to write it
    drawn: bytes = b""


def play_job(job: EpisodeJob) -> EpisodeOutcome:
    """Run one episode to the tightest tolerance."""
    case = job.case()
    agent = agent_maker(job.controller, job.agent, job.belief)(case)
    return run_episode(case, agent, tightest(job.tolerances), camera=job.camera)


def run_job(job: EpisodeJob) -> EpisodeDone:
    """Run one episode and judge it at each tolerance."""
    outcome = play_job(job)
    records = scene_records(job.case(), job.controller, outcome, job.tolerances)
    if job.picture is None:
        return EpisodeDone(records)
    from sain_core.view.figures import png_of  # loads Matplotlib
    from sain_eval.plots.pictures import draw_episode

    goal = f", goal {len(outcome.records)}" if len(outcome.records) > 1 else ""
    title = f"{job.scenario}, scene {job.seed}{goal}, {job.controller}"
    return EpisodeDone(records, job.picture, png_of(draw_episode(outcome.record, title)))


def run_jobs(
    jobs: Sequence[EpisodeJob], options: WorkerOptions
) -> Generator[list[SceneRecord], None, None]:
    """Run all jobs on workers, write their pictures, and yield their records as they come."""
    engines = modules_of(job.truth.engine for job in jobs)
    work = Work(partial(FunctionRunner, run_job), SOURCES, (*PACKAGES, *engines))
    with closing(run_on_workers(work, jobs, options, ordered=False)) as results:
        for done in results:
            if done.picture is not None:
                write_whole(done.picture, done.drawn)
            yield done.records


def keep_records(
    results: Generator[list[SceneRecord], None, None],
    count: int,
    journal: Journal,
    console: Console,
) -> None:
    """Keep the records of so many episodes in a journal as they come, under a bar."""
    if done := len(journal.done):
        console.print(f"{done} episodes are done already", highlight=False)
    times = (TimeElapsedColumn(), "left", TimeRemainingColumn())
    columns = ("episodes", BarColumn(), MofNCompleteColumn(), *times)
    with Progress(*columns, console=console) as progress, closing(results):
        task = progress.add_task("episodes", total=count)
        for records in results:
            journal.add(records)
            progress.advance(task)

"""`ros2 run sain_pusht evaluate`: the evaluation of `sain_eval`, with gym-pusht as the world."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import numpy as np
import tyro
from PIL import Image
from rich.console import Console

from sain_core.config import MOST_SEED, option
from sain_core.output import OVERWRITE_HELP, claim_folder, write_whole
from sain_core.provenance import ros2_command
from sain_core.randomness import bootstrap_mean, generator
from sain_core.scene import make_scene
from sain_core.shapes.library import get_shape
from sain_core.view.film import gif_of
from sain_core.view.image import TopPicture
from sain_core.view.scenes import bodies_in, goal_marks
from sain_core.view.things import DrawnBody
from sain_core.workers import FunctionRunner, Software, Work, WorkerOptions
from sain_eval.episode import Tolerance
from sain_eval.loop.closed_loop import EpisodeOutcome
from sain_eval.loop.evaluation import SOURCES, EpisodeDone, play, run_on
from sain_eval.loop.results import (
    RESULT_FILES,
    Journal,
    SceneRecord,
    interval_row,
    scene_records,
    summarise,
    write_results,
)
from sain_eval.loop.tables import (
    FAILURES_FILE,
    TABLE_FILE,
    TABLES,
    failures_page,
    results_table,
    show_failures,
    show_summary,
)
from sain_eval.scenes.families import ScenarioScene
from sain_mppi.config import PlannerConfig
from sain_pusht.agent import AGENT_RADIUS, FEASIBILITY, PLANNER, pusht_agent
from sain_pusht.block import pusht_bodies
from sain_pusht.world import MOST_STEPS, NEAR, TURNED, Moment, PushtWorld, make_env, play_pusht

if TYPE_CHECKING:
    from sain_pusht.model import PushtModel

PACKAGES: Final = ("gym-pusht", "pymunk", "gymnasium", "numpy", "numba", "torch")
REALITY: Final = "gym-pusht"
SUCCESS: Final = "95 % covered"
FILM_FILE: Final = "episode.gif"
RATE: Final = 10  # [1/s], of pictures: as fast as it happens
HOLD: Final = 1.5  # [s], of the last picture
PICTURE: Final = 320  # [px], width and height
COLOURS: Final = 48


@dataclass(frozen=True)
class PushtOptions(WorkerOptions):
    """Play Push-T in gym-pusht: its physics, seeds, steps and measure of success.

    The agent is the one that sain_eval's evaluate and mppi_node run. An episode ends when gym-pusht
    says so, after 300 steps at the latest. After a stop, the same command continues.
    """

    out: Path = option(
        Path("results/pusht"),
        "folder for results.json, table.md, episodes.jsonl and episode.gif; made if need be",
    )
    overwrite: bool = option(False, OVERWRITE_HELP)
    episodes: int = option(500, "episodes to play", minimum=1)
    seed: int = option(
        0,
        "seed of the first episode; the next ones have the next seeds",
        minimum=0,
        maximum=MOST_SEED,
    )
    model: str = option(
        "pusht",
        "what plans: pusht, the shipped model; prior, its physics alone; oracle, gym-pusht's own"
        " physics; or a name or path as in sain_eval's evaluate",
    )
    film: bool = option(True, "write the first episode as episode.gif")
    planner: Annotated[PlannerConfig, tyro.conf.arg(help="How the agent plans.")] = field(
        default_factory=lambda: PLANNER
    )


@dataclass(frozen=True)
class PushtRecord(SceneRecord):
    """What became of an episode; its pushes are strokes, its success is that of gym-pusht."""

    steps: int = 0  # of control, all of them
    free_steps: int = 0  # those of them that led to where strokes start
    coverage: float = 0.0  # of the goal, the largest


@dataclass(frozen=True)
class PushtJob:
    """One episode to play; `picture` is where to write it as an animation."""

    seed: int
    model: str
    planner: PlannerConfig = PLANNER
    picture: Path | None = None


def run(options: PushtOptions, console: Console) -> None:
    """Play what is left, write the results, and print them as tables."""
    folder = claim_folder(options.out, (*RESULT_FILES, *TABLES, FILM_FILE), options.overwrite)
    make_env(MOST_STEPS)  # what is missing should not wait for the first episode
    _load(options.model)
    seeds = range(options.seed, options.seed + options.episodes)
    settings = {"planner": dataclasses.asdict(options.planner)}
    journal = Journal(folder, settings, PushtRecord, options.overwrite)
    jobs = [
        PushtJob(seed, options.model, options.planner)
        for seed in seeds
        if (REALITY, seed, options.model) not in journal.done
    ]
    if options.film and jobs:
        jobs[0] = replace(jobs[0], picture=folder / FILM_FILE)
    play(run_on(WORK, jobs, options), len(jobs), journal, Console(stderr=True, soft_wrap=True))
    wanted = [r for r in journal.records if r.controller == options.model and r.seed in seeds]
    records = sorted(wanted, key=lambda record: record.seed)
    config = {**dataclasses.asdict(options), "out": str(options.out)}
    rows = write_pusht_results(folder, records, config, ros2_command("sain_pusht", "evaluate"))
    show_summary(rows, console)
    console.print(steps_text(rows[0]), highlight=False, soft_wrap=True)
    show_failures(records, folder / FAILURES_FILE, console)


def run_job(job: PushtJob) -> EpisodeDone[PushtRecord]:
    """Play one episode."""
    models, world = _load(job.model), _world(job.model)
    world.moments = [] if job.picture else None
    agent = pusht_agent(models.model, models.physics, job.planner, world.tool)
    outcome = play_pusht(job.seed, agent, world)
    drawn = film_of(outcome, world.moments) if world.moments else b""
    return EpisodeDone([pusht_record(job, outcome, world)], job.picture, drawn)


WORK: Final = Work(
    partial(FunctionRunner, run_job),
    Software((*SOURCES, "sain_pusht"), PACKAGES),
)


@cache
def _load(model: str) -> "PushtModel":
    from sain_pusht.model import load_model

    return load_model(model)


@cache
def _world(model: str) -> PushtWorld:
    return PushtWorld(_load(model).bodies)


def pusht_record(job: PushtJob, outcome: EpisodeOutcome, world: PushtWorld) -> PushtRecord:
    """Return the record of an episode that a world has just played."""
    episode = outcome.record
    shapes = tuple(shape.name for shape in episode.bodies.shapes)
    case = ScenarioScene(REALITY, job.seed, episode.start, np.nan, shapes, episode.goal)
    (judged,) = scene_records(case, job.model, outcome, (Tolerance(NEAR, TURNED),))
    why = "no steps are left" if world.over else outcome.failure or "the agent stopped"
    fields = vars(judged) | {
        "success": world.success,
        "failure": "" if world.success else why,
        "within": SUCCESS,
    }
    return PushtRecord(
        **fields, steps=world.steps, free_steps=world.free_steps, coverage=world.coverage
    )


def pusht_row(records: Sequence[PushtRecord]) -> dict[str, Any]:
    """Return the row of these episodes in results, with what only gym-pusht counts.

    Steps count in all episodes, solved or not.
    """
    (row,) = summarise(records)
    steps = np.array([float(record.steps) for record in records])
    interval = bootstrap_mean(steps, generator(0, "bootstrap", "pusht"))
    return row | {
        "steps": float(steps.mean()),
        "steps_interval": interval_row(interval),
        "steps_median": float(np.median(steps)),
        "free_share": sum(record.free_steps for record in records) / max(float(steps.sum()), 1.0),
        "coverage": float(np.mean([record.coverage for record in records])),
    }


def steps_text(row: dict[str, Any]) -> str:
    """Return in words what only gym-pusht counts."""
    low, high = row["steps_interval"]["low"], row["steps_interval"]["high"]
    return (
        f"steps: mean {row['steps']:.1f} [{low:.1f}, {high:.1f}], median {row['steps_median']:.0f},"
        f" {100 * row['free_share']:.0f} % without contact; largest coverage: mean"
        f" {row['coverage']:.3f}"
    )


def write_pusht_results(
    folder: Path, records: Sequence[PushtRecord], config: dict[str, Any], command: str
) -> list[dict[str, Any]]:
    """Write results and tables as `evaluate` does; return the rows of the summary."""
    rows = [pusht_row(records)]
    write_results(folder, records, config, command, PACKAGES, reality=REALITY, summary=rows)
    table = f"{results_table(rows)}\n{steps_text(rows[0])}\n"
    write_whole(folder / TABLE_FILE, table.encode())
    write_whole(folder / FAILURES_FILE, failures_page(records).encode())
    return rows


def film_of(outcome: EpisodeOutcome, moments: Sequence[Moment]) -> bytes:
    """Return an episode as a GIF: the block, the goal and the disk that pushes, x to the right."""
    picture, bodies, goal = TopPicture(PICTURE, FEASIBILITY), pusht_bodies(), outcome.record.goal
    frames = []
    for scene, tool in moments:
        disk = make_scene(tool[None], np.ones(1), np.array([AGENT_RADIUS]))[0]
        pusher = DrawnBody(1, "", get_shape("disk"), disk, "ink")
        marks = goal_marks(goal, scene, bodies)
        image = picture.draw([*bodies_in(scene, bodies, goal), *marks, pusher])
        frames.append(Image.fromarray(np.rot90(image, -1)))
    return gif_of(frames, RATE, HOLD, COLOURS)

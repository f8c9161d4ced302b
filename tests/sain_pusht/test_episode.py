"""Whole episodes, with few samples."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from sain_core.push import make_push
from sain_core.workers import WorkerOptions
from sain_eval.loop.evaluation import run_on
from sain_pusht.agent import FEASIBILITY, PLANNER, ToolPlace
from sain_pusht.block import scene_of
from sain_pusht.evaluation import WORK, PushtJob, PushtRecord, pusht_row
from sain_pusht.world import PushtWorld

FEW = replace(PLANNER, samples=96)


def play(jobs: list[PushtJob], options: WorkerOptions = WorkerOptions()) -> list[PushtRecord]:
    records = [record for played in run_on(WORK, jobs, options) for record in played]
    return sorted(records, key=lambda record: record.seed)


def without_times(records: list[PushtRecord]) -> list[PushtRecord]:
    return [replace(record, plan_seconds=()) for record in records]


def test_an_episode_is_solved_and_filmed(tmp_path: Path) -> None:
    film = tmp_path / "episode.gif"
    (record,) = play([PushtJob(2, "pusht", FEW, picture=film)])
    assert record.success
    assert record.coverage > 0.95
    assert record.steps < 150
    assert record.free_steps < record.steps
    assert np.median(record.target_errors) < 0.5e-3
    with Image.open(film) as picture:
        assert picture.n_frames == record.steps  # type: ignore[attr-defined]


def test_workers_change_nothing(tmp_path: Path) -> None:
    films = [tmp_path / name for name in ("alone.gif", "together.gif")]
    fewer = replace(PLANNER, samples=32)
    jobs = [PushtJob(seed, "prior", fewer) for seed in (2, 4)]
    alone, together = (
        play([replace(jobs[0], picture=film), jobs[1]], options)
        for film, options in zip(films, (WorkerOptions(), WorkerOptions(workers=2)), strict=True)
    )
    assert without_times(alone) == without_times(together)
    assert films[0].read_bytes() == films[1].read_bytes()
    row = pusht_row(alone)
    assert row["successes"] == sum(record.success for record in alone)
    assert row["steps"] == np.mean([record.steps for record in alone])


def test_a_tool_that_is_shut_in_pushes_what_it_reaches(world: PushtWorld) -> None:
    scene = scene_of(np.array([68.0, 393.5, -1.0268]))  # across a corner of the room
    pushes = make_push(np.linspace(-3.1, 3.1, 400), 0.0, 0.03)
    scenes, corner = np.broadcast_to(scene, (400, 1, 8)), ToolPlace()
    corner.place = np.array([0.043, 0.040])
    outside = FEASIBILITY.mask(scenes, pushes, world.bodies)
    inside = replace(FEASIBILITY, tool=corner).mask(scenes, pushes, world.bodies)
    assert 100 < inside.sum() < outside.sum() < 300
    assert not (inside & outside).any()

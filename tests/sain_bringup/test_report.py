"""Figures, moments and pictures of a run, made from episodes as a bag gives them."""

from dataclasses import replace
from functools import partial
from io import BytesIO, StringIO
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image
from rich.console import Console

from sain_bags.rows.episodes import Episode
from sain_bags.rows.results import PlanRecord, RecordedPush
from sain_bringup.display import Display
from sain_bringup.movie import CAMERA, Moment, describe_distance, encode_gif, render
from sain_bringup.report import PlayedEpisode, summary_table
from sain_bringup.ros.progress import Progress
from sain_core.goal import Goal, Judgement
from sain_core.push import idle_pushes, make_push
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from sain_sim.camera.renderer import Renderer
from sain_sim.world.workcell import WorldConfig

GOAL = np.array([0.60, 0.0])


def scene(target_x: float) -> Scene:
    positions = np.array([[target_x - 0.15, 0.0], [target_x, 0.0]])
    return make_scene(positions, np.full(2, 8.0), np.array([0.08, 0.06]))


def push(number: int, before: Scene, after: Scene, error_code: int = 1) -> RecordedPush:
    plan = PlanRecord(
        plan_id=number, push_id=number, status=1, error_code=1, error_message="",
        dynamics="planar", fallback=False, pushes=idle_pushes(1),
        predicted=(after + 0.003)[None], goal_distance=0.1, planning_time=0.1 * number,
    )  # fmt: skip
    made = RecordedPush(
        make_push(0.0, 0.0, 0.1), before, after, push_id=number, code=error_code, source="test",
        duration=1.0, physics=after + 0.004,
    )  # fmt: skip
    return made.planned(plan)


def played(*targets: float, refused: int = 0, name: str = "paper") -> PlayedEpisode:
    scenes = [scene(x) for x in targets]
    pushes = [push(n, *pair) for n, pair in enumerate(pairwise(scenes), 1)]
    pushes += [push(90 + n, scenes[-1], scenes[-1], error_code=9) for n in range(refused)]
    episode = Episode(
        episode_id=1, start=scenes[0], final=scenes[-1], goal=Goal.place(*GOAL, 0.02),
        max_pushes=15, pushes=tuple(pushes), plans=(), interval=(0, 1),
    )  # fmt: skip
    return PlayedEpisode(name, 4, episode)


def test_summary_figures():
    summary = played(0.45, 0.52, 0.59, refused=1).summary()
    assert (summary["scenario"], summary["seed"]) == ("paper", 4)
    assert summary["success"]
    assert (summary["pushes"], summary["refused"], summary["fallbacks"]) == (2, 1, 0)
    assert summary["final_distance"] == pytest.approx(0.01)
    assert summary["planning_time"] == pytest.approx(0.15)
    assert summary["longest_planning_time"] == pytest.approx(0.2)
    assert summary["model_error"] == pytest.approx(0.003 * 2**0.5)
    assert summary["physics_error"] == pytest.approx(0.004 * 2**0.5)


def test_goals_in_a_row_are_counted_and_the_last_is_shown():
    first, second = played(0.45, 0.59).episode, played(0.59, 0.5, 0.4).episode
    whole = replace(second, start=first.start, pushes=first.pushes + second.pushes)
    streak = PlayedEpisode("paper", 4, replace(whole, parts=(first, second)))
    summary = streak.summary()
    assert (summary["goals"], summary["goals_in_a_row"], summary["pushes"]) == (2, 1, 3)
    assert not summary["success"]
    out = StringIO()
    Console(file=out, width=120).print(summary_table((summary, played(0.45).summary())))
    assert "1 of 2 reached in a row" in out.getvalue()
    last = streak.last_part()
    assert last.title == "paper 4, goal 2" and len(last.episode.records) == 2
    assert played(0.45).last_part().title == "paper 4"


def judged(distance: float) -> Judgement:
    goal = Goal.place(*GOAL, 0.27)
    return Judgement(goal, np.array([distance]), np.zeros(1), np.zeros(0), True, True)


def moments(count: int, step: float) -> list[Moment]:
    return [
        Moment(step * n, np.full(7, 0.1 * n), scene(0.4), judged(0.3 - 0.01 * n), True, step * n)
        for n in range(count)
    ]


def test_the_gif_moves_and_ends_with_a_pause():
    bodies = Bodies.disks(2)
    renderer = Renderer(WorldConfig().arm, bodies, (0.08, 0.06), CAMERA)
    frames = render(renderer, bodies, moments(5, 0.1), partial(describe_distance, "paper 4"))
    with Image.open(BytesIO(encode_gif(frames))) as shown:
        assert (shown.n_frames, shown.size, shown.info["duration"]) == (5, (480, 360), 80)
        first = np.array(shown.convert("RGB")).astype(int)
        shown.seek(4)
        assert shown.info["duration"] == 2080
        last = np.array(shown.convert("RGB"))
    moved = np.abs(last - first).max(axis=-1)[:320] > 40  # above the caption
    assert 1000 < moved.sum() < moved.size / 2


def shown(distances: list[float]) -> str:
    progress = Progress(Display(Console(file=StringIO())), "1/1  paper 4")
    for distance in distances:
        progress.at(distance)
    return progress.summary()


def test_the_line_of_an_episode():
    assert shown([0.2, 0.1]) == " 1 push    200 → 100 mm"
    assert shown([0.3, 0.2, 0.0154]) == " 2 pushes  300 → 200 → 15 mm"
    long = shown([0.1 * n for n in range(12)])
    assert "0 → … → 500 → 600" in long
    assert long.endswith("1100 mm")

"""The environment is one by Gymnasium's own check, and the same in any process."""

import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from sain_core.push import make_push
from sain_core.view.image import TopPicture
from sain_core.view.palette import PALETTE, rgba
from sain_core.view.scenes import bodies_in, goal_marks
from sain_core.view.things import hue
from sain_eval.scenes.scenarios import SCENARIOS
from sain_gym.push_env import FIRST_DRAWN
from tests.sain_gym.playing import digest, played, random_actions

UNITS = "we recommend using a symmetric and normalized space"  # ours are metres and radians
FRESH = """
import sys, gymnasium
from tests.sain_gym.playing import digest, played, random_actions
env = gymnasium.make("sain_gym:sain/Push-v0", scenario="anywhere").unwrapped
print(digest(played(env, 3, random_actions(env, 6))))
print(sorted({"torch", "numba", "matplotlib", "rclpy"} & set(sys.modules)))
"""


def paint(colour: str) -> np.ndarray:
    return np.round(255 * np.array(rgba(colour)[:3]))


def check(env: gymnasium.Env) -> None:
    """Check an environment; all warnings but that about units are errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=f".*{UNITS}")
        check_env(env)


@pytest.mark.parametrize(
    ("observation", "engine"), [("state", "bullet"), ("image", "mujoco"), ("lerobot", "bullet")]
)
def test_gymnasiums_check_passes(make, observation, engine):
    check(make(observation=observation, engine=engine, render_mode="rgb_array"))


def test_the_seed_is_the_scene_of_an_evaluation(make):
    env = make(scenario="push_t")
    observation, info = env.reset(seed=7)
    case = SCENARIOS["push_t"].scene(7)
    assert info["scene_seed"] == 7
    assert np.array_equal(observation["bodies"], case.disks)
    pose = case.goal.poses[0]
    assert observation["goal"].tolist() == [[1.0, pose.x, pose.y, 1.0, pose.heading]]
    assert env.case.seed == 7


def test_scenes_that_are_drawn_are_none_of_an_evaluation(make):
    env = make()
    env.reset(seed=7)
    drawn = [env.reset()[1]["scene_seed"] for _ in range(5)]
    assert min(drawn) >= FIRST_DRAWN
    assert len(set(drawn)) == 5
    env.reset(seed=7)
    assert [env.reset()[1]["scene_seed"] for _ in range(5)] == drawn
    assert env.reset(options={"scene": 12})[1]["scene_seed"] == 12


@pytest.mark.parametrize(("observation", "engine"), [("state", "bullet"), ("image", "mujoco")])
def test_the_same_seed_and_actions_give_the_same_bytes(make, observation, engine):
    first, second = (make(observation=observation, engine=engine) for _ in range(2))
    actions = random_actions(first, 6)
    steps = played(first, 3, actions)
    assert digest(steps) == digest(played(second, 3, actions))
    assert digest(steps) != digest(played(first, 4, actions))
    assert any(step[-1]["pushes"] for step in steps)


def test_a_fresh_process_gives_the_same_bytes_and_loads_no_planner(make):
    env = make()
    command = [sys.executable, "-c", FRESH]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n")[:2] == [digest(played(env, 3, random_actions(env, 6))), "[]"]


def test_an_image_shows_bodies_and_goal_and_is_rendered_only_when_asked_for(make):
    env = make(scenario="rearrange_3", observation="image", image_size=240)
    image, _ = env.reset(seed=2)
    kept, picture, record = image.copy(), TopPicture(240), env.episode.record
    marks = goal_marks(record.goal, env.scene, record.bodies)
    first, *_ = bodies_in(env.scene, record.bodies, record.goal)
    for body in (first, *(mark.body for mark in marks)):
        assert (image[picture.pixel(body.place)] == paint(hue(body))).all()
    for corner in np.concatenate([mark.body.outline for mark in marks])[::8]:
        row, column = picture.pixel(corner)
        near = image[row - 2 : row + 3, column - 2 : column + 3]
        assert (near == paint(PALETTE.goal)).all(axis=-1).any()
    after, *_ = env.step(make_push(0.0, 0.0, 0.15))
    assert (after != image).any() and np.array_equal(image, kept)
    assert env.render() is None
    env = make(render_mode="rgb_array")
    env.reset(seed=0)
    assert (env.render().shape, env.render().dtype) == ((480, 480, 3), np.uint8)

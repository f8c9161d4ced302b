"""Bad input is refused with what was wrong and what is allowed, and changes nothing."""

import numpy as np
import pytest
from gymnasium.error import ResetNeeded

import sain_gym.push_env
from sain_core.errors import ConfigError, ErrorCode, InvalidInputError, OutOfRangeError, SainError
from sain_core.push import make_push
from sain_eval.scenes.scenarios import SCENARIOS

AHEAD = make_push(0.0, 0.0, 0.1)
NAN = float("nan")


def test_a_scene_with_more_bodies_than_the_first_is_refused(make, monkeypatch):
    env = make(scenario="anywhere")
    more = SCENARIOS["clutter"].scene(0)
    monkeypatch.setattr(sain_gym.push_env, "draw_scene", lambda name, seed: more)
    message = (
        "scene 5 of anywhere has [345] bodies; observations have room for 2, as many as scene 0"
    )
    with pytest.raises(ConfigError, match=message):
        env.reset(seed=5)


@pytest.mark.parametrize(
    ("action", "kind", "message"),
    [
        ([0.0, 0.0, NAN, 0.1, 0.2], InvalidInputError, "angle of the action is nan; must be"),
        ([0.0, 0.1], InvalidInputError, r"shape \(2,\); needed: numbers with shape \(5,\) \(body"),
        (["a", "b", "c"], InvalidInputError, "an array of <U1"),
        ([True, False, True], InvalidInputError, "an array of bool"),
        ([0, 3.2, 0.0, 0.1, 0.2], OutOfRangeError, "location of the action is 3.2; allowed: -3.1"),
        ([0, 0.0, 0.0, 1e300, 0.2], OutOfRangeError, r"length of the action is 1e\+300"),
    ],
)  # fmt: skip
def test_a_bad_action_moves_nothing(make, action, kind, message):
    env = make(scenario="paper")
    env.reset(seed=0)
    before = env.scene
    with pytest.raises(kind, match=message):
        env.step(np.array(action))
    assert env.scene.tobytes() == before.tobytes()
    assert env.episode.steps == 0
    assert env.step(AHEAD)[4]["pushes"] == 1


def test_a_refused_push_moves_nothing_and_costs(make):
    env = make(scenario="paper", refusal_cost=0.25)
    _, info = env.reset(seed=0)
    before = env.scene
    towards_the_base = make_push(np.pi, 0.0, 0.1)  # the tool would start inside the target
    _, reward, terminated, truncated, after = env.step(towards_the_base)
    assert env.scene.tobytes() == before.tobytes()
    assert reward == -(info["distance"] + 0.25)
    assert (terminated, truncated) == (False, False)
    assert after["refusal_code"] == ErrorCode.BLOCKED
    assert "the tool would pass another body" in after["refusal"]
    assert (after["pushes"], after["refusals"]) == (0, 1)


def test_a_step_before_the_first_episode_and_after_the_end(make):
    env = make(scenario="paper")
    with pytest.raises(ResetNeeded, match="no episode has begun; call reset first"):
        env.step(AHEAD)
    env.reset(seed=0)
    while not env.episode.over:
        env.step(make_push(np.pi, 0.0, 0.1))
    before = env.scene
    with pytest.raises(ResetNeeded, match="the episode has ended after 10 steps; call reset") as e:
        env.step(AHEAD)
    assert isinstance(e.value, SainError)
    assert env.scene.tobytes() == before.tobytes()
    env.reset()
    env.step(AHEAD)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"scenario": "nowhere"}, "scenario 'nowhere' is unknown .*; known: .*paper, "),
        ({"engine": "havok"}, "engine 'havok' is unknown; known: bullet, mujoco"),
        ({"observation": "pixels"}, "observation is 'pixels'; allowed: 'state', 'image'"),
        ({"tolerance": NAN}, "tolerance is nan; it must be finite"),
        ({"tolerance": 0.2}, "tolerance is 0.2 m; it must be at most 0.075 m"),
        ({"image_size": 96.5}, "image_size is 96.5; it must be an integer"),
        ({"goal": 1}, "no setting goal; allowed: scenario, engine, .*, render_mode"),
        ({"engine": "mujoco", "world": "rough"}, "engine mujoco cannot simulate direction"),
        ({"render_mode": "ansi"}, "render_mode is 'ansi'; allowed: None, 'rgb_array'"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*render_mode")
def test_bad_settings(make, settings, message):
    with pytest.raises(ConfigError, match=message):
        make(**settings)


@pytest.mark.parametrize(
    ("options", "kind", "message"),
    [
        ({"scene": -1}, OutOfRangeError, "the option scene is -1; allowed: whole numbers from 0"),
        ({"scene": True}, OutOfRangeError, "the option scene is True"),
        ({"goal": 1}, ConfigError, "reset has no option 'goal'; allowed: scene"),
    ],
)
def test_bad_options(make, options, kind, message):
    env = make()
    env.reset(seed=1)
    before = env.scene
    with pytest.raises(kind, match=message):
        env.reset(options=options)
    assert env.scene.tobytes() == before.tobytes()

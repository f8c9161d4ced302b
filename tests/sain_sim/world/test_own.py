"""A stranger's world behind our checks."""

from importlib.metadata import EntryPoint

import numpy as np
import pytest

from sain_core.conformance import two_disks
from sain_core.errors import BlockedError, ConfigError, OutOfRangeError
from sain_core.push import LENGTH, idle_pushes, make_push
from sain_core.scene import MID, TARGET, X
from sain_core.world import Outcome, WorldFailedError
from sain_sim.world.engines import OFFERED
from sain_sim.world.own import open_world
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.shadow import BulletPrior
from sain_sim.world.truth import TruthConfig

NAME = "stranger"
PUSH = make_push(0.0, 0.0, 0.05)
SCENE = two_disks().scene


class Stranger:
    """A world in which a push moves both disks by its length, or fails."""

    fault = ""

    def reset(self, start):
        self.start, self.scene = start, start.scene
        return self.observe()

    def observe(self):
        return self.scene.copy()

    def push(self, push, *, seen=None):
        self.seen, before = seen, self.observe()
        self.scene[[MID, TARGET], X] += push[LENGTH]
        if self.fault == "refuses":
            raise BlockedError("not this one")
        if self.fault == "raises":
            raise KeyError("a bug")
        return Outcome(before, self.scene * np.nan if self.fault else self.observe())


def load(name: str) -> Stranger:
    return Stranger()


@pytest.fixture
def offered(monkeypatch):
    entry = EntryPoint(NAME, f"{__name__}:load", OFFERED.group)
    monkeypatch.setattr(OFFERED, "entries", lambda: {NAME: [entry]})


@pytest.fixture
def world(offered):
    made = open_world(WorldParameters.of_scene(SCENE), engine=NAME)
    made.reset(SCENE)
    return made


def test_it_gets_scene_bodies_and_friction(world):
    world.reset(SCENE, WorldParameters.of_scene(SCENE, friction=0.2))
    start = world._world.start
    assert start.friction == 0.2
    assert len(start.bodies) == 2
    np.testing.assert_array_equal(start.scene, SCENE)


def test_a_push_takes_the_time_of_the_tool_which_is_shown(world):
    samples = []
    outcome = world.push(PUSH, samples.append, every=4)
    assert outcome.settled and not outcome.fallen.any()
    assert outcome.after[TARGET, X] == pytest.approx(SCENE[TARGET, X] + 0.05)
    assert 0.25 < outcome.duration == world.time < 0.5  # 5 cm at 0.2 m/s, and its ramps
    assert samples[-1].tool[0] > samples[0].tool[0] + 0.04
    assert all(sample.scene.tobytes() == SCENE.tobytes() for sample in samples)


def test_a_push_that_is_checked_first_does_not_arrive(world):
    with pytest.raises(OutOfRangeError):
        world.push(make_push(0.0, 0.0, 0.5))
    assert world.push(idle_pushes()).after.tobytes() == SCENE.tobytes()
    assert not hasattr(world._world, "seen")


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ("raises", r"engine 'stranger' of .*test_own: push raised KeyError: 'a bug'; repair or"),
        ("nan", r"engine 'stranger' of .*: push: body 0 has NaN or Inf; allowed: finite"),
    ],
)
def test_after_a_failure_the_bodies_are_where_they_were(world, fault, text):
    world._world.fault = fault
    with pytest.raises(WorldFailedError, match=text):
        world.push(PUSH)
    world._world.fault = ""
    assert world.observe().tobytes() == world._world.observe().tobytes() == SCENE.tobytes()


def test_what_needs_an_engine_of_ours_is_refused(offered):
    with pytest.raises(ConfigError, match=r"engine stranger cannot simulate mass, .* use eng"):
        TruthConfig(world="rough", engine=NAME)
    with pytest.raises(ConfigError, match="engine 'stranger' is no engine of ours: bullet, mujoco"):
        BulletPrior(engine=NAME)

"""One contract, all worlds: those of the engines, and what a stranger's must not do."""

import numpy as np
import pytest

from sain_core.conformance import check_world, two_disks
from sain_core.push import LENGTH, make_push
from sain_core.scene import TARGET, X
from sain_core.world import Outcome, WorldFailedError
from sain_sim.world.engines import ENGINES
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.world import World

PUSH = make_push(0.0, 0.0, 0.05)


class Stranger:
    """A world in which every push moves the target by 1 mm."""

    def reset(self, start):
        self._scene = start.scene.copy()
        return self.observe()

    def observe(self):
        return self._scene.copy()

    def push(self, push, *, seen=None):
        before = self.observe()
        self._scene[TARGET, X] += 0.001 * (push[LENGTH] > 0.0)
        return Outcome(before, self.observe())


class Alias(Stranger):
    def observe(self):
        return self._scene


class Restart(Stranger):
    def reset(self, start):
        self._scene = start.scene + np.array([0.001, 0, 0, 0, 0, 0, 0, 0])
        return self.observe()


class Idle(Stranger):
    def push(self, push, *, seen=None):
        return super().push(PUSH)


class Memory(Stranger):
    way = 0.001

    def push(self, push, *, seen=None):
        before = self.observe()
        self.way *= 2.0
        self._scene[TARGET, X] += self.way * (push[LENGTH] > 0.0)
        return Outcome(before, self.observe())


class Forgetful(Stranger):
    def push(self, push, *, seen=None):
        outcome = super().push(push)
        return Outcome(outcome.after, outcome.after)


@pytest.mark.parametrize("engine", ENGINES)
def test_the_worlds_of_all_engines_keep_it(engine):
    start = two_disks().scene
    with World(WorldParameters.of_scene(start), engine=engine) as world:
        after = check_world(world, start, PUSH)
    assert after[TARGET, X] > start[TARGET, X] + 0.02


@pytest.mark.parametrize(
    ("world", "text"),
    [
        (Alias, "who writes into a scene"),
        (Restart, "the first scene is not the one of the setting"),
        (Idle, "a push of length 0 changed the scene"),
        (Memory, "the same push from the same start led elsewhere"),
        (Forgetful, "the outcome's scene before the push is not the one there was"),
    ],
)
def test_what_breaks_it_is_said(world, text):
    check_world(Stranger(), two_disks(), PUSH)
    with pytest.raises(WorldFailedError, match=text):
        check_world(world(), two_disks(), PUSH)

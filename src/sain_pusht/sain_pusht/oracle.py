"""The oracle: strokes rolled out in a copy of gym-pusht's own physics.

It is an upper bound for models, not a model: nobody else has the world to look into.
"""

from typing import Any, Final, Self

import numpy as np

from sain_core.model import Model
from sain_core.push import LENGTH, PushLimits, strokes
from sain_core.scene import unit
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Pushes, Scene, Scenes
from sain_pusht.agent import LIMITS
from sain_pusht.block import PIXEL, pixels, pose_of, pusht_bodies, scene_of
from sain_pusht.extra import make_env
from sain_pusht.motion import Pace, ramp
from sain_pusht.servo import Servo, servo_of

ORACLE_STEPS: Final = 300  # any: the copy is never stepped as an environment


class PushtOracle(Model):
    """A `Model` that knows gym-pusht: it is gym-pusht."""

    def __init__(self, limits: PushLimits = LIMITS, pace: Pace = Pace()) -> None:
        """Make a copy of the world."""
        self._inner: Any = make_env(ORACLE_STEPS).unwrapped
        self._servo: Servo = servo_of(self._inner)
        self._limits, self._pace = limits, pace
        self._bodies = pusht_bodies()

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the same: there is one body."""
        return self

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Return the scenes (B, 1, 8) after pushes (B, 5), one after another."""
        after = scenes.copy()
        for index, (scene, push) in enumerate(zip(scenes, pushes, strict=True)):
            if push[LENGTH] > 0.0:
                after[index] = self._push(scene, push)
        return after

    def _push(self, scene: Scene, push: PushArray) -> Scene:
        start, heading = strokes(scene, push, self._limits, self._bodies)
        way = unit(heading)
        places = start + ramp(float(push[LENGTH]), self._pace.pushing)[:, None] * way
        motion = np.stack([start, self._pace.landing * way])
        targets = self._servo.targets(motion, places, {len(places) - 1: np.zeros(2)})
        moved = self._servo.follow(motion, targets)
        inner, pose = self._inner, pose_of(scene)
        inner._setup()
        inner.block.angle = float(pose[2])
        inner.block.position = tuple(pose[:2].tolist())
        inner.agent.position = tuple(pixels(start).tolist())
        for velocity in (moved[:, 1] * [1.0, -1.0] / PIXEL).tolist():
            inner.agent.velocity = tuple(velocity)
            inner.space.step(inner.dt)
        place, angle = inner.block.position, inner.block.angle
        return scene_of(np.array([place.x, place.y, angle]))

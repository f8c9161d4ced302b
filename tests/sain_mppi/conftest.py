"""A tiny world of its own for the planner's tests: disks that are pushed apart, no more."""

import numpy as np
import pytest

from sain_core.model import Model
from sain_core.push import LENGTH, PushLimits, push_direction
from sain_core.scene import MID, POSITION, RADIUS, make_scene, unit
from sain_core.types import Pushes, Scenes
from tests.strokes import tool_start


class PushedApart(Model):
    """Quasi-static: the tool moves in small steps and overlaps are pushed out."""

    def __init__(self, steps: int = 20) -> None:
        self.limits = PushLimits()
        self.steps = steps

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        after = scenes.copy()
        start = tool_start(scenes, pushes, self.limits)
        way = unit(push_direction(pushes)) * pushes[..., LENGTH, None]
        for step in range(1, self.steps + 1):
            tool = start + way * step / self.steps
            self._push_out(after, MID, tool, self.limits.tool_radius, pushes[..., LENGTH] > 0)
            for disk in range(1, scenes.shape[-2]):
                mid, reach = after[..., MID, POSITION], after[..., MID, RADIUS]
                self._push_out(after, disk, mid, reach, np.ones(len(scenes), bool))
        return after

    @staticmethod
    def _push_out(scenes, disk, centre, radius, active) -> None:
        offset = scenes[..., disk, POSITION] - centre
        apart = np.linalg.norm(offset, axis=-1)
        overlap = np.where(active, np.maximum(scenes[..., disk, RADIUS] + radius - apart, 0.0), 0.0)
        scenes[..., disk, POSITION] += (overlap / np.maximum(apart, 1e-9))[..., None] * offset


@pytest.fixture
def dynamics():
    """A model that any planner test can roll out."""
    return PushedApart()


@pytest.fixture
def scene():
    """The target in front of the mid disk, touching it but for 1 mm."""
    return make_scene(
        np.array([[0.40, 0.0], [0.541, 0.0]]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
    )

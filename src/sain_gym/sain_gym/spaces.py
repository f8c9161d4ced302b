"""Actions and observations as arrays of fixed shapes, and pushes and scenes made from them.

An action is a push (`sain_core.push`): body, location, angle, length and speed. The body is rounded
to the nearest whole number.

A state is ``bodies`` (M, 8), the scene, and ``goal`` (M, 5): whether the body is wanted at a place,
x, y, whether a heading is wanted, and the heading. M is the largest number of bodies of any scene
of the scenario; rows of bodies that a scene lacks are zeros.
"""

from collections.abc import Sequence
from math import pi
from typing import Any, Final

import numpy as np
from gymnasium.spaces import Box, Dict, Space, flatten_space
from numpy import ndarray

from sain_core.goal import Goal
from sain_core.push import action_ranges, push_of
from sain_core.scene import STATE_SIZE
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Scene
from sain_eval.scenes.scenarios import draw_scene

MOST_BODIES_IN: Final = {"clutter": 5, "blocked": 4}  # of scenarios whose scenes differ in number
FARTHEST: Final = 10.0  # [m], any coordinate: a body that falls off the table stays well within
# x, y, theta, vx, vy, omega, mass, radius
LARGEST: Final = (FARTHEST, FARTHEST, pi, 100.0, 100.0, 1000.0, 100.0, 0.2)
SMALLEST: Final = (*(-value for value in LARGEST[:6]), 0.0, 0.0)
AS_LEROBOT: Final = {"bodies": "agent_pos", "goal": "environment_state"}  # flat, in its evaluation
GOAL_LARGEST: Final = (1.0, FARTHEST, FARTHEST, 1.0, pi)
GOAL_SMALLEST: Final = (0.0, -FARTHEST, -FARTHEST, 0.0, -pi)


class PushSpaces:
    """The spaces of a scenario.

    Attributes:
        most: bodies of a scene, at most.
        action: of pushes.
        state: of scenes and goals.
    """

    def __init__(self, scenario: str) -> None:
        first = draw_scene(scenario, 0)
        self.most = MOST_BODIES_IN.get(scenario, len(first.disks))
        alone = Bodies.named(first.shapes, first.roles).pushable == (0,)
        self._last = 0 if alone else self.most - 1  # body that may be named
        self.action = Box(*action_ranges(self._last), dtype=np.float64)
        self.state = Dict(
            {
                "bodies": self._rows(SMALLEST, LARGEST),
                "goal": self._rows(GOAL_SMALLEST, GOAL_LARGEST),
            }
        )

    @property
    def flat(self) -> dict[str, Space[Any]]:
        """The parts of a state as LeRobot's evaluation calls them."""
        return {AS_LEROBOT[key]: flatten_space(rows) for key, rows in self.state.items()}

    def _rows(self, low: Sequence[float], high: Sequence[float]) -> Box:
        return Box(np.tile(low, (self.most, 1)), np.tile(high, (self.most, 1)), dtype=np.float64)

    def push_of(self, action: Any) -> PushArray:
        """Return the push (5,) that an action stands for; see `sain_core.push.push_of`."""
        return push_of(action, self._last)

    def state_of(self, scene: Scene, goal: Goal) -> dict[str, ndarray]:
        """Return a scene (N, 8) and a goal as they are observed."""
        bodies = np.zeros((self.most, STATE_SIZE))
        bodies[: len(scene)] = scene
        return {"bodies": bodies, "goal": goal.observed(self.most)}

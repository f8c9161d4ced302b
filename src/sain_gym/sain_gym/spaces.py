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
from gymnasium.spaces import Box, Dict
from numpy import ndarray

from sain_core.errors import InvalidInputError, OutOfRangeError
from sain_core.goal import Goal, observed_poses
from sain_core.push import BODY, LOCATION, PUSH_NAMES, PushLimits
from sain_core.scene import STATE_SIZE
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Scene
from sain_eval.scenes.scenarios import draw_scene

MOST_BODIES_IN: Final = {"clutter": 5, "blocked": 4}  # of scenarios whose scenes differ in number
FARTHEST: Final = 10.0  # [m], any coordinate: a body that falls off the table stays well within
# x, y, theta, vx, vy, omega, mass, radius
LARGEST: Final = (FARTHEST, FARTHEST, pi, 100.0, 100.0, 1000.0, 100.0, 0.2)
SMALLEST: Final = (*(-value for value in LARGEST[:6]), 0.0, 0.0)
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
        limits = PushLimits()
        first = draw_scene(scenario, 0)
        self.most = MOST_BODIES_IN.get(scenario, len(first.disks))
        alone = Bodies.named(first.shapes, first.roles).pushable == (0,)
        self._last = 0 if alone else self.most - 1  # body that may be named
        low = [-0.5, -pi, -limits.max_angle, 0.0, limits.min_speed]
        high = [self._last + 0.5, pi, limits.max_angle, limits.max_length, limits.max_speed]
        self.action = Box(np.array(low), np.array(high), dtype=np.float64)
        self.state = Dict(
            {
                "bodies": self._rows(SMALLEST, LARGEST),
                "goal": self._rows(GOAL_SMALLEST, GOAL_LARGEST),
            }
        )

    def _rows(self, low: Sequence[float], high: Sequence[float]) -> Box:
        return Box(np.tile(low, (self.most, 1)), np.tile(high, (self.most, 1)), dtype=np.float64)

    def push_of(self, action: Any) -> PushArray:
        """Return the push (5,) that an action stands for.

        A number in single or half precision that equals a limit rounded to that precision is the
        limit. The location -pi is pi.

        Raises `InvalidInputError`: no array of numbers, another shape, NaN or Inf;
        `OutOfRangeError`: a number outside its range.
        """
        push = self._numbers(action)
        low, high = self.action.low, self.action.high
        wrong = (push < low) | (push > high)
        if wrong.any():
            column = int(np.argmax(wrong))
            raise OutOfRangeError(
                f"{PUSH_NAMES[column]} of the action is {push[column]:.6g}; allowed:"
                f" {low[column]:.6g} to {high[column]:.6g}"
            )
        if push[LOCATION] == -pi:
            push[LOCATION] = pi
        push[BODY] = min(np.floor(push[BODY] + 0.5), self._last)
        return push

    def _numbers(self, action: Any) -> PushArray:
        """Return an action as finite numbers of the right shape."""
        given, names = np.asarray(action), ", ".join(PUSH_NAMES)
        if given.dtype.kind not in "fiu" or given.shape != self.action.shape:
            raise InvalidInputError(
                f"the action is an array of {given.dtype} with shape {given.shape}; needed:"
                f" numbers with shape {self.action.shape} ({names})"
            )
        push = given.astype(np.float64)
        if not np.isfinite(push).all():
            column = int(np.argmin(np.isfinite(push)))
            raise InvalidInputError(
                f"{PUSH_NAMES[column]} of the action is {push[column]}; it must be finite"
            )
        if given.dtype.kind == "f":
            for limit in (self.action.low, self.action.high):
                push = np.where(given == limit.astype(given.dtype), limit, push)
        return push

    def state_of(self, scene: Scene, goal: Goal) -> dict[str, ndarray]:
        """Return a scene (N, 8) and a goal as they are observed."""
        bodies = np.zeros((self.most, STATE_SIZE))
        bodies[: len(scene)] = scene
        poses = np.full((self.most, 3), np.nan)
        for pose in goal.poses:
            poses[pose.body] = pose.x, pose.y, np.nan if pose.heading is None else pose.heading
        return {"bodies": bodies, "goal": observed_poses(poses)}

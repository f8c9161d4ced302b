"""Rows in the making, until it is known which of them are rows."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from sain_bags.transitions.push_groups import PushGroup
from sain_core.scene import MASS, POSITION, RADIUS, STATE_SIZE, TARGET
from sain_core.shards import MOVED
from sain_core.types import Scenes


class Dropped(NamedTuple):
    """A push that is no row, and why."""

    reason: str
    detail: str


@dataclass
class Draft:
    """Rows in the making: M pushes of a group, whose scenes have one number of disks."""

    group: PushGroup
    dropped: dict[int, Dropped]
    chosen: ndarray  # (M,) in the group
    state: Scenes  # (M, N, 8)
    next_state: Scenes
    physics: Scenes  # NaN where there is no prediction, or one of another number of disks

    def keep(self, right: ndarray, reason: str, why: Callable[[int], str]) -> None:
        """Drop all but the right ones (M,)."""
        if right.all():
            return
        drop(self.group, self.chosen[~right], reason, why, self.dropped)
        self.chosen, self.state = self.chosen[right], self.state[right]
        self.next_state, self.physics = self.next_state[right], self.physics[right]

    def sensible(self) -> ndarray:
        """Tell which are of numbers that can be (M,)."""
        predicted = self.group.predicted[self.chosen]
        right = possible(self.state) & possible(self.next_state)
        right &= np.isfinite(self.group.actions[self.chosen]).all(axis=-1)
        return np.asarray(right & (np.isfinite(self.physics).all(axis=(1, 2)) | ~predicted))

    def moved(self) -> ndarray:
        """Tell which moved the target (M,)."""
        travel = self.next_state[:, TARGET, POSITION] - self.state[:, TARGET, POSITION]
        return np.asarray(np.hypot(travel[:, 0], travel[:, 1]) >= MOVED)

    def columns(self) -> dict[str, ndarray]:
        """Return what rows have of the scenes."""
        size = self.state.shape[1] * STATE_SIZE
        return {
            "state": self.state.reshape(-1, size),
            "physics_next": self.physics.reshape(-1, size),
            "next_state": self.next_state.reshape(-1, size),
            "masses": self.state[..., MASS],
            "radii": self.state[..., RADIUS],
            "moved": self.moved(),
        }


def drop(
    group: PushGroup,
    pushes: ndarray,
    reason: str,
    why: Callable[[int], str],
    dropped: dict[int, Dropped],
) -> None:
    """Note of pushes (M,) of a group that they are no rows, and why."""
    for push in pushes.tolist():
        detail = why(push)
        named = f"{group.about(push)}: {detail}" if detail else group.about(push)
        dropped[int(group.places[push])] = Dropped(reason, named)


def possible(scenes: Scenes) -> ndarray:
    """Tell which scenes (M, N, 8) are of finite numbers, with masses and radii."""
    finite = np.isfinite(scenes).all(axis=(1, 2))
    return finite & (scenes[..., [MASS, RADIUS]] > 0.0).all(axis=(1, 2))

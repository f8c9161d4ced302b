"""A policy for faults of a graph: a straight push through the mid disk towards the target."""

import numpy as np

from sain_core.policy import STATE, Observation, Policy


class Straight(Policy):
    """Pushes the mid disk where the target is; asked again about a scene, a little beside it."""

    def reset(self, seed: int) -> None:
        """Draw from this seed on."""
        self._random = np.random.default_rng(seed)

    def select_action(self, observation: Observation) -> np.ndarray:
        """Return a push of 4 cm."""
        mid, target = observation[STATE].reshape(-1, 8)[:2, :2]
        way = target - mid
        location = np.arctan2(way[1], way[0]) + self._random.normal(scale=0.3)
        return np.array([0.0, location, 0.0, 0.04, 0.2])


def make(name: str) -> Policy:
    """Return it."""
    return Straight()

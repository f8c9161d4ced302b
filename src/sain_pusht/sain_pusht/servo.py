"""Targets for the agent disk: what makes it pass given places at given steps.

The disk of gym-pusht has no mass: it follows its target by a PD controller, whatever it pushes. So
its way is known before it moves.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.types import Points

Motion = Float[ndarray, "2 2"]  # place [m] and velocity [m/s] of the disk

STEADY: Final = 0.02  # weight of a target's change, so that targets stay near the places
FIRM: Final = 30.0  # weight of places and velocities where the disk has to be exact


@dataclass(frozen=True)
class Servo:
    """The controller of the disk: acceleration = k_p (target - place) - k_v velocity.

    Attributes:
        k_p: [1/s^2].
        k_v: [1/s].
        time_step: [s], of the simulation.
        substeps: of the simulation in a step of control.
    """

    k_p: float = 100.0
    k_v: float = 20.0
    time_step: float = 0.01
    substeps: int = 10

    @property
    def period(self) -> float:
        """The time [s] of a step of control."""
        return self.time_step * self.substeps

    @cached_property
    def _once(self) -> tuple[ndarray, ndarray]:
        """What a step of the simulation makes of place and velocity, and of the target."""
        dt, k_p, k_v = self.time_step, self.k_p, self.k_v
        speed = np.array([-dt * k_p, 1.0 - dt * k_v])
        return np.array([np.array([1.0, 0.0]) + dt * speed, speed]), np.array([dt**2, dt]) * k_p

    @cached_property
    def _step(self) -> tuple[ndarray, ndarray]:
        """The same for a step of control."""
        keep, gain = self._once
        kept, gained = np.eye(2), np.zeros(2)
        for _ in range(self.substeps):
            kept, gained = keep @ kept, keep @ gained + gain
        return kept, gained

    def follow(self, motion: Motion, targets: Points) -> Float[ndarray, "T 2 2"]:
        """Return the disk's motion after each step of the simulation, for targets (S, 2)."""
        keep, gain = self._once
        way = np.empty((len(targets) * self.substeps, 2, 2))
        for index in range(len(way)):
            motion = keep @ motion + gain[:, None] * targets[index // self.substeps]
            way[index] = motion
        return way

    def targets(
        self, motion: Motion, places: Points, stops: dict[int, Float[ndarray, "2"]]
    ) -> Points:
        """Return targets (S, 2) that lead the disk through places (S, 2), one a step of control.

        By least squares: places are met nearly, the more exactly the less the disk must hurry.

        Args:
            motion: the disk's now.
            places: [m].
            stops: velocities [m/s] at the end of steps, by their numbers.
        """
        count = len(places)
        keep, gain = self._step
        free, answer = [], []
        here, force = motion, gain
        for _ in range(count):
            here = keep @ here
            free.append(here)
            answer.append(force)
            force = keep @ force
        later = np.subtract.outer(np.arange(count), np.arange(count))  # (S, S)
        gains = np.array(answer)[np.maximum(later, 0)] * (later >= 0)[..., None]  # (S, S, 2)
        drift = np.array(free)  # (S, 2, 2)
        moments = sorted(stops)
        smooth = STEADY * (np.eye(count) - np.eye(count, k=-1))
        first = np.zeros((count, 2))
        first[0] = STEADY * motion[0]
        firm, speed = np.ones((count, 1)), 2.0 * FIRM / self.k_v
        firm[moments] = FIRM
        rows = np.concatenate([firm * gains[..., 0], speed * gains[moments][..., 1], smooth])
        speeds = np.array([stops[moment] for moment in moments]).reshape(-1, 2)
        wanted = np.concatenate(
            [firm * (places - drift[:, 0]), speed * (speeds - drift[moments, 1]), first]
        )
        return np.asarray(np.linalg.lstsq(rows, wanted, rcond=None)[0])


def servo_of(env: Any) -> Servo:
    """Return the controller of a gym-pusht environment."""
    return Servo(env.k_p, env.k_v, env.dt, int(1 / (env.dt * env.control_hz)))

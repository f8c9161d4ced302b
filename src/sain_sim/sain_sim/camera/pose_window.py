"""The latest poses of all bodies: whether they rest, how fast they move, whether they jumped."""

from collections import deque
from math import pi

import numpy as np

from sain_core.scene import wrap_angle
from sain_sim.camera.body_file import BodyFile, Poses
from sain_sim.camera.settings import TrackingConfig

SCATTER = 5.0  # standard deviations that a pose may be off
AT_ONCE = 0.005  # [m], that two poses may differ at any time
TURN_AT_ONCE = 0.05  # [rad]
ROUNDING = 1e-5  # [s], of stamps
SHORTEST = 0.05  # [s], over which a velocity is a difference


class PoseWindow:
    """Poses within the time that bodies must be at rest, with continuous headings."""

    def __init__(self, bodies: BodyFile, config: TrackingConfig) -> None:
        """Begin without poses."""
        self._bodies, self._config = bodies, config
        self._known: deque[tuple[float, Poses]] = deque()
        self._since = 0.0  # of the first of poses that follow each other
        place, turn = config.noise_std
        self.slack = np.array([config.rest_distance + SCATTER * place] * 2 + [0.0])
        self.slack[2] = config.rest_turn + SCATTER * turn

    def __bool__(self) -> bool:
        """Tell whether there are poses."""
        return bool(self._known)

    @property
    def stamp(self) -> float:
        """The time [s] of the latest poses."""
        return self._known[-1][0]

    @property
    def latest(self) -> Poses:
        """The latest poses (N, 3)."""
        return self._known[-1][1]

    @property
    def mean(self) -> Poses:
        """The mean of the poses (N, 3)."""
        return np.mean([poses for _, poses in self._known], axis=0)

    def clear(self) -> None:
        """Forget all poses."""
        self._known.clear()

    def forget_until(self, stamp: float) -> None:
        """Forget the poses up to a time [s]."""
        while self._known and self._known[0][0] <= stamp:
            self._known.popleft()
        if self._known:
            self._since = self._known[0][0]

    def add(self, poses: Poses, stamp: float) -> str:
        """Add poses (N, 3) of a time [s]; return in words which body jumped; empty: none."""
        jump = ""
        if self._known:
            poses = self.continued(poses, self.latest)
            jump = self._jump(poses, stamp - self.stamp)
        if jump or not self._known:
            self._known.clear()
            self._since = stamp
        self._known.append((stamp, poses))
        while len(self._known) > 2 and self._known[1][0] <= stamp - self._config.rest_time:
            self._known.popleft()
        return jump

    def continued(self, poses: Poses, before: Poses) -> Poses:
        """Return poses with the headings that are nearest to those before.

        A body that looks the same after a turn may be seen at any such turn.
        """
        near = poses.copy()
        for body, shape in enumerate(self._bodies.bodies.shapes):
            turn = shape.symmetry
            if turn == 0.0:
                near[body, 2] = before[body, 2]  # a disk's heading is no observation
                continue
            off = poses[body, 2] - before[body, 2]
            near[body, 2] = before[body, 2] + off - turn * np.round(off / turn)
        return near

    def at_rest(self) -> bool:
        """Tell whether nothing moved for the time that it takes to be at rest."""
        if not self._known or self.stamp - self._since < self._config.rest_time - ROUNDING:
            return False
        poses = np.stack([poses for _, poses in self._known])
        return bool((np.abs(poses - poses.mean(axis=0)) <= self.slack).all())

    def scatter(self) -> tuple[float, float]:
        """Return the largest standard deviation of a body's place [m] and of its heading [rad]."""
        spread = np.std([poses for _, poses in self._known], axis=0)
        return float(spread[:, :2].max()), float(spread[:, 2].max())

    def velocities(self) -> Poses:
        """Return the velocities (N, 3) [m/s, rad/s], as differences."""
        for stamp, poses in reversed(self._known):
            if (time := self.stamp - stamp) >= SHORTEST:
                return (self.latest - poses) / time
        return np.zeros_like(self.latest)

    def differs(self, one: Poses, other: Poses) -> bool:
        """Tell whether poses (N, 3) at rest are others than before."""
        off = self.continued(other, one) - one
        return bool((np.abs(off) > 2.0 * self.slack).any())

    def _jump(self, poses: Poses, time: float) -> str:
        config, (place, turn) = self._config, self._config.noise_std
        off = poses - self.latest
        way, spin = np.hypot(off[:, 0], off[:, 1]), np.abs(off[:, 2])
        far = config.max_speed * time + AT_ONCE + 2 * SCATTER * place
        wide = min(config.max_spin * time + TURN_AT_ONCE + 2 * SCATTER * turn, pi)
        for body, (length, angle) in enumerate(zip(way.tolist(), spin.tolist(), strict=True)):
            if length > far:
                what, most = f"{length:.3f} m", f"{config.max_speed:g} m/s"
            elif angle > wide:
                what, most = f"{angle:.2f} rad", f"{config.max_spin:g} rad/s"
            else:
                continue
            return (
                f"{self._bodies.called(body)} jumped by {what} in {time:.3f} s; at most {most} is"
                " taken for motion: nothing is pushed until all rest"
            )
        return ""


def wrapped(poses: Poses) -> Poses:
    """Return poses (N, 3) with headings in (-pi, pi]."""
    result = poses.copy()
    result[:, 2] = wrap_angle(poses[:, 2])
    return result

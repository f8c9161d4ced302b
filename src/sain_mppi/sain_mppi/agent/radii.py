"""The radii of disks that are not measured, from where pushes leave the disks.

Of two disks that one push moves, the distance at rest grows with both radii. What is left is the
error of the model. A Kalman filter over the radii weighs these distances against the predicted
ones. The distance from the tool tells little: it depends as much on the friction, which is not
known either.
"""

from typing import Final

import numpy as np

from sain_core.push import ANGLE, LENGTH, LOCATION, PATH, PushLimits, pushed_bodies
from sain_core.scene import POSITION, RADIUS, unit, wrap_angle
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.transitions import PushHistory
from sain_core.types import PushArray, Scalars, Scene

BEFOREHAND: Final = 0.003  # [m], standard deviation of radii: those of disks are nominal +- 5 mm
AT_DISK: Final = 0.0015  # [m], error of the predicted distance of two disks
MOVED: Final = 0.003  # [m], a disk that is predicted to move so far is touched
TOUCHING: Final = 0.01  # [m], of disks that are predicted to end nearer, one pushed the other
OUTLIER: Final = 4.0  # standard deviations


class RadiusFilter:
    """Estimates the radii of an episode's disks. Those of other shapes are measured."""

    def __init__(self, radii: Scalars, bodies: Bodies = PAPER_DISKS) -> None:
        """Begin with radii (N,) [m], those of disks nominal."""
        self.round = np.array([shape.is_round for shape in bodies.fitted(len(radii)).shapes])
        self.radii = radii.copy()
        self._covariance = np.diag(np.where(self.round, BEFOREHAND**2, 0.0))

    @property
    def std(self) -> Scalars:
        """Standard deviations (N,) [m]."""
        return np.sqrt(np.maximum(np.diag(self._covariance), 0.0))

    def update(
        self, before: Scene, push: PushArray, predicted: Scene, after: Scene, noise: Scalars
    ) -> None:
        """Update by a push.

        Args:
            before: (N, 8), that it was planned from, with the radii of then.
            push: (5,).
            predicted: (N, 8).
            after: (N, 8), as observed.
            noise: (N,) [m], standard deviation of each coordinate of `after`.
        """
        way = np.linalg.norm((predicted - before)[:, POSITION], axis=1)
        pushed = int(pushed_bodies(push))
        for other in np.flatnonzero(self.round & (way > MOVED)).tolist():
            pair = (pushed, other)
            if other == pushed or not self.round[pushed]:
                continue
            expected, observed = (_apart(*scene[pair, POSITION]) for scene in (predicted, after))
            if expected - before[pair, RADIUS].sum() < TOUCHING:
                error = np.sqrt((noise[[*pair]] ** 2).sum() + AT_DISK**2)
                self._update(pair, before, observed - expected, float(error))

    def exclude_overlaps(self, scene: Scene, noise: Scalars) -> None:
        """Update by disks of a scene (N, 8) that would overlap with these radii."""
        rounds = np.flatnonzero(self.round).tolist()
        for place, first in enumerate(rounds):
            for second in rounds[place + 1 :]:
                pair = (first, second)
                short = _apart(*scene[pair, POSITION]) - self.radii[[*pair]].sum()
                if short < 0.0:
                    assumed = scene.copy()
                    assumed[:, RADIUS] = self.radii
                    self._update(pair, assumed, short, float(np.hypot(*noise[[*pair]])))

    def _update(self, bodies: tuple[int, ...], assumed: Scene, more: float, error: float) -> None:
        """Take it that these bodies' radii add up to so much more [m] than was assumed."""
        chosen = np.zeros(len(self.radii))
        chosen[[*bodies]] = 1.0
        column = self._covariance @ chosen
        variance = float(chosen @ column) + error**2
        surprise = more + float(chosen @ (assumed[:, RADIUS] - self.radii))
        if abs(surprise) > OUTLIER * np.sqrt(variance):
            return
        self.radii = self.radii + column * (surprise / variance)
        self._covariance = self._covariance - np.outer(column, column) / variance

    def apply(self, scene: Scene) -> Scene:
        """Return a scene (N, 8) with these radii."""
        resized = scene.copy()
        resized[:, RADIUS] = self.radii
        return resized

    def restated(self, history: PushHistory, limits: PushLimits) -> PushHistory:
        """Return earlier pushes as they would be stated with these radii: the tool went as it did.

        Each scene has the radii with which its push was planned, and these tell where the tool was.
        """
        state, after, action = (
            array.copy() for array in (history.state, history.next_state, history.action)
        )
        for row, push in enumerate(action):
            body = int(pushed_bodies(push))
            if self.round[body]:
                old = state[row, body, RADIUS]
                push[:] = resized_push(push, old, self.radii[body], limits)
        state[..., RADIUS] = after[..., RADIUS] = self.radii
        return PushHistory(state, action, after, history.noise)


def resized_push(push: PushArray, old: float, new: float, limits: PushLimits) -> PushArray:
    """Return (5,) the same way of the tool for a disk of another radius [m] in the same place.

    It begins where the tool has its clearance from that disk.
    """
    location, angle, length = push[PATH]
    extra = limits.tool_radius + limits.clearance
    start, heading = -(old + extra) * unit(location), location + angle
    aside = (old + extra) * np.sin(angle)
    if (new + extra) ** 2 <= aside**2:
        return push
    along = (old + extra) * np.cos(angle) - np.sqrt((new + extra) ** 2 - aside**2)
    way = -(start + along * unit(heading))
    resized = push.copy()
    resized[LOCATION] = np.arctan2(way[1], way[0])
    resized[ANGLE] = wrap_angle(heading - resized[LOCATION])
    resized[LENGTH] = max(length - along, 0.0)
    return resized


def _apart(first: np.ndarray, second: np.ndarray) -> float:
    return float(np.linalg.norm(second - first))

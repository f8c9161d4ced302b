"""When the joints are where: the fastest motion along a given way within the limits.

A way is a line through joint space, q(s), with s the tool's travel. Its speed ds/dt is bounded by
the joints' speeds and by a speed asked for, and with its acceleration by those of the joints:
|q' u + q'' x| <= a, with x the squared speed and u the acceleration. On a grid in s, one sweep back
finds the speeds from which the way can be ended, and one ahead the fastest of these: Pham and Pham,
2018, "A new approach to time-optimal path parameterization based on reachability analysis".
"""

from dataclasses import dataclass
from math import sqrt
from typing import Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from sain_arm.robot.robot import Joints, Robot, Vector
from sain_core.types import Scalars

Times = Float[ndarray, "_"]
Rows = Float[ndarray, "S L"]

GRID: Final = 200  # places along a way
SHARE: Final = 0.95  # of the limits that is used
MOST: Final = 0.99  # of the accelerations between points, where the grid is coarse for a bend
PERIOD: Final = 0.01  # [s] between points of a trajectory
FLAT: Final = 1e-9  # [rad/m], of a joint that hardly moves
SHORTEST: Final = 1e-6  # [m], below which nothing moves


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Joints over time, as a controller gets them.

    Attributes:
        times: (T,) [s], from 0.
        positions: (T, J) [rad].
        velocities: (T, J) [rad/s]; 0 at both ends.
    """

    times: Scalars
    positions: Joints
    velocities: Joints

    @property
    def duration(self) -> float:
        """From start to end [s]."""
        return float(self.times[-1])

    def at(self, time: float) -> tuple[Vector, Vector]:
        """Return positions (J,) and velocities (J,) at a time [s]: cubic between the points."""
        if time >= self.duration:
            return self.positions[-1], np.zeros_like(self.positions[-1])
        index = max(int(np.searchsorted(self.times, time, side="right")) - 1, 0)
        step = self.times[index + 1] - self.times[index]
        t = np.clip((time - self.times[index]) / step, 0.0, 1.0)
        first, last = self.positions[index], self.positions[index + 1]
        out, into = step * self.velocities[index], step * self.velocities[index + 1]
        rise = last - first
        bend, twist = 3 * rise - 2 * out - into, out + into - 2 * rise
        position = first + t * (out + t * (bend + t * twist))
        return position, (out + t * (2 * bend + 3 * t * twist)) / step

    def sampled(self, step: float) -> Joints:
        """Return positions (T, J) after 0, 1, 2 .. steps [s], the last one at its end."""
        count = int(np.ceil(self.duration / step - 1e-9))
        spline = CubicHermiteSpline(self.times, self.positions, self.velocities)
        return np.asarray(spline(np.minimum(np.arange(count + 1) * step, self.duration)))

    @classmethod
    def joined(cls, parts: list["Trajectory"]) -> Self:
        """Return parts one after another; each begins where the one before ends, at rest."""
        times, start = [parts[0].times[:1]], 0.0
        for part in parts:
            times.append(part.times[1:] + start)
            start += part.duration
        rows = [[getattr(parts[0], name)[:1]] for name in ("positions", "velocities")]
        for part in parts:
            rows[0].append(part.positions[1:])
            rows[1].append(part.velocities[1:])
        return cls(np.concatenate(times), *(np.concatenate(row) for row in rows))


@dataclass(frozen=True, eq=False)
class Way:
    """Joints along a way of the tool.

    Attributes:
        travel: (T,), of the tool [m], or of the joints [rad] where these are what is given.
        joints: (T, J).
        speed: limit of the travel [1/s].
        acceleration: likewise [1/s^2].
    """

    travel: Scalars
    joints: Joints
    speed: float
    acceleration: float

    def timed(self, robot: Robot) -> Trajectory:
        """Return the fastest motion within the robot's limits and those of the travel."""
        length = float(self.travel[-1])
        if length < SHORTEST or len(self.travel) < 2:
            still = np.repeat(self.joints[:1], 2, axis=0)
            return Trajectory(np.array([0.0, PERIOD]), still, np.zeros_like(still))
        spline = CubicSpline(self.travel, self.joints)
        places, step = np.linspace(0.0, length, GRID, retstep=True)
        with np.errstate(divide="ignore"):
            most = (SHARE * robot.velocity / np.abs(spline(places, 1))).min(axis=1)
        middles = places[:-1] + 0.5 * step
        slope, bend = spline(middles, 1), spline(middles, 2)  # (S - 1, J)
        limits = np.append(SHARE * robot.acceleration, self.acceleration)  # and of the tool
        slope = np.append(slope + step * bend, np.ones((len(middles), 1)), axis=1)
        bend = np.append(bend, np.zeros((len(middles), 1)), axis=1)
        speed = np.sqrt(_swept(np.minimum(most, self.speed) ** 2, slope, bend, limits, 2.0 * step))
        steps = 2.0 * (length / (GRID - 1)) / (speed[1:] + speed[:-1])
        times = np.concatenate([[0.0], np.cumsum(steps)])
        count = max(int(np.ceil(times[-1] / PERIOD)), 2)
        sampled = np.linspace(0.0, times[-1], count + 1)
        travel, rate = _travelled(sampled, times, places, speed)
        rate[[0, -1]] = 0.0
        velocities = spline(travel, 1) * rate[:, None]
        changes = np.abs(np.diff(velocities, axis=0)) / sampled[1] / robot.acceleration
        slower = max(1.0, sqrt(changes.max() / MOST))
        return Trajectory(slower * sampled, spline(travel), velocities / slower)

    def speed_share(self, robot: Robot) -> float:
        """Return how much of its speed the joints allow at the slowest place, at most 1."""
        spline = CubicSpline(self.travel, self.joints)
        slope = np.abs(spline(np.linspace(0.0, self.travel[-1], GRID), 1))
        return float(min(1.0, (robot.velocity / np.maximum(slope, 1e-12)).min() / self.speed))


def _swept(most: Scalars, slope: Rows, bend: Rows, limits: Vector, step: float) -> Scalars:
    """Return the highest squared speeds x (S,) from rest to rest, at most `most`.

    From one place to the next x grows by `step` u, and |slope u + bend x| <= limit (S - 1, L). With
    an x that allows u = 0 no place is a trap. Each limit puts u between two lines over x.
    """
    slope = np.where(np.abs(slope) < FLAT, FLAT, slope)
    with np.errstate(divide="ignore"):
        steady = np.append((limits / np.abs(bend)).min(axis=1), np.inf)
    found = np.minimum(most, np.minimum(steady, np.roll(steady, 1))).tolist()
    found[0] = found[-1] = 0.0
    rows = zip((limits / np.abs(slope)).tolist(), (bend / slope).tolist(), strict=True)
    lines = [list(zip(*row, strict=True)) for row in rows]  # floats of Python are faster here
    for place in range(len(lines) - 1, 0, -1):
        for room, fall in lines[place]:
            if (share := 1.0 - step * fall) > 0.0:
                found[place] = min(found[place], (found[place + 1] + step * room) / share)
    for place in range(len(lines) - 1):
        push = min(room - fall * found[place] for room, fall in lines[place])
        found[place + 1] = min(found[place + 1], found[place] + step * push)
    return np.array(found)


def _travelled(sampled: Times, times: Times, places: Times, speed: Times) -> tuple[Times, Times]:
    """Return travel and speed at times: with constant acceleration between the places of a grid."""
    index = np.clip(np.searchsorted(times, sampled, side="right") - 1, 0, len(times) - 2)
    since, step = sampled - times[index], times[index + 1] - times[index]
    gain = (speed[index + 1] - speed[index]) / step
    travel = places[index] + speed[index] * since + 0.5 * gain * since**2
    return np.minimum(travel, places[-1]), speed[index] + gain * since

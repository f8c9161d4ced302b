"""One body over time: outliers, jumps, rest, and the estimate of its pose."""

from collections import deque
from dataclasses import dataclass
from math import pi
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import Config, option
from sain_core.world import ObservationConfig

SCATTER = 5.0  # standard deviations that a pose may be off
AT_ONCE = 0.005  # [m], that two poses may differ at any time
TURN_AT_ONCE = 0.05  # [rad]
ROUNDING = 1e-5  # [s], of stamps
SHORTEST = 0.05  # [s], over which a velocity is a difference
BODIES = "YAML file of the bodies: shape, role, radius, mass, and how each is found"

Pose = Float[ndarray, "3"]  # x, y [m], heading [rad]
Covariance = Float[ndarray, "3 3"]


@dataclass(frozen=True)
class TrackingConfig(Config):
    """How poses of bodies become scenes, and how often these are published."""

    noise: str = option(
        "0,0",
        "standard deviation of the poses, as the planner's `estimator.noise`: METRES,RADIANS",
    )
    rest_time: float = option(
        0.15, "time without motion after which bodies are at rest", unit="s", minimum=0.05
    )
    rest_distance: float = option(
        0.0005, "motion in this time that counts as none, besides noise", unit="m", minimum=1e-5
    )
    rest_turn: float = option(0.005, "the same for headings", unit="rad", minimum=1e-4)
    max_speed: float = option(
        1.0, "fastest motion of a body; more is a jump", unit="m/s", minimum=0.01
    )
    max_spin: float = option(
        15.0, "fastest turn of a body; more is a jump", unit="rad/s", minimum=0.1
    )
    max_age: float = option(0.5, "age above which poses are not used", unit="s", minimum=0.02)
    push_timeout: float = option(
        60.0, "time after which a push without a result counts as lost", unit="s", minimum=1.0
    )
    bodies: str = option("", BODIES, live=True)
    frame: str = option("world", "frame of the poses, whose z axis points up")
    rate: float = option(30.0, "most scenes per second", unit="Hz", minimum=1.0, maximum=240.0)
    state_file: str = option("", "file that keeps the ids, so that none is used twice; empty: none")

    def __post_init__(self) -> None:
        super().__post_init__()
        ObservationConfig(noise=self.noise)

    @property
    def noise_std(self) -> tuple[float, float]:
        """The noise of a pose, [m] and [rad]."""
        return ObservationConfig(noise=self.noise).noise_std

    @property
    def noise_covariance(self) -> Covariance:
        """The covariance of a pose that came without one."""
        place, turn = self.noise_std
        return np.diag([place**2, place**2, turn**2])


class Observed(NamedTuple):
    """A pose of a body as something saw it; without a covariance it is the configured one."""

    pose: Pose
    covariance: Covariance | None = None


class _Sample(NamedTuple):
    stamp: float  # [s]
    pose: Pose
    covariance: Covariance


class BodyTrack:
    """The poses of one body within the time in which it must not move to be at rest.

    A pose that is too far from the one before is an outlier, until the next one is near it: then
    the body has jumped.
    """

    def __init__(self, name: str, symmetry: float, config: TrackingConfig) -> None:
        """Begin without poses of a body that looks the same after a turn [rad]; 0: after any."""
        self._name, self._symmetry, self._config = name, symmetry, config
        self._known: deque[_Sample] = deque()
        self._since = 0.0  # of the first of poses that follow each other
        self._outlier: _Sample | None = None
        self._last: Pose | None = None  # the latest pose, also where all are forgotten
        self.doubt = ""  # how far an outlier is off, in words
        place, turn = config.noise_std
        self._slack = np.array([config.rest_distance + SCATTER * place] * 2 + [0.0])
        self._slack[2] = config.rest_turn + SCATTER * turn

    def __bool__(self) -> bool:
        """Return whether the body was ever seen."""
        return self._last is not None

    @property
    def stamp(self) -> float:
        """The time [s] of the latest pose; -inf: there is none."""
        return self._known[-1].stamp if self._known else -np.inf

    @property
    def latest(self) -> Pose:
        """The latest pose (3,); it is held while the body is not seen."""
        assert self._last is not None, "seen comes first"
        return self._last

    def forget_until(self, stamp: float) -> None:
        """Forget the poses up to a time [s], but for where the body is taken to be."""
        while self._known and self._known[0].stamp <= stamp:
            self._known.popleft()
        if self._known:
            self._since = self._known[0].stamp

    def rest_from(self, stamp: float) -> None:
        """Take what is seen before a time [s] for no sign of rest."""
        self._since = max(self._since, stamp)

    def add(self, seen: Observed, stamp: float) -> str:
        """Add a pose of a time [s]; return how the body jumped, in words; empty: it did not."""
        covariance = self._config.noise_covariance if seen.covariance is None else seen.covariance
        sample = _Sample(stamp, self.continued(seen.pose, self._last), covariance)
        if self._known and stamp - self.stamp > self._config.max_age:
            self._known.clear()  # how it moved meanwhile is unknown
        jump = self._jump(self._known[-1], sample) if self._known else ""
        if not jump:
            self._take(sample)
            return ""
        before, self._outlier = self._outlier, sample
        self.doubt = jump
        if before is None or self._jump(before, sample):
            return ""
        self._known.clear()
        self._take(before)
        self._take(sample)
        return jump

    def _take(self, sample: _Sample) -> None:
        if not self._known:
            self._since = sample.stamp
        self._known.append(sample)
        self._last, self._outlier, self.doubt = sample.pose, None, ""
        while (
            len(self._known) > 2 and self._known[1].stamp <= sample.stamp - self._config.rest_time
        ):
            self._known.popleft()

    def continued(self, pose: Pose, before: Pose | None) -> Pose:
        """Return a pose with the heading that is nearest to the one before.

        A body that looks the same after a turn may be seen at any such turn.
        """
        if before is None:
            return pose
        near = pose.copy()
        if self._symmetry == 0.0:
            near[2] = before[2]  # a disk's heading is no observation
            return near
        off = pose[2] - before[2]
        near[2] = before[2] + off - self._symmetry * np.round(off / self._symmetry)
        return near

    @property
    def moves(self) -> bool:
        """Whether the body is not known to be at rest."""
        if not self._known or self.doubt:
            return True
        if self.stamp - self._since < self._config.rest_time - ROUNDING:
            return True
        poses = self._poses()
        return bool((np.abs(poses - poses.mean(axis=0)) > self._slack).any())

    def estimate(self) -> tuple[Pose, Covariance]:
        """Return the mean of the poses, weighted, and its covariance.

        Frames share the errors of calibration, so the covariance is that of a frame, and no less.
        """
        if not self._known:
            return self.latest, self._config.noise_covariance
        poses = self._poses()
        covariances = np.stack([sample.covariance for sample in self._known])
        if not covariances.any():
            return poses.mean(axis=0), covariances[0]
        weights = np.linalg.inv(covariances + 1e-18 * np.eye(3))
        total = np.linalg.inv(weights.sum(axis=0))
        mean = total @ np.einsum("sij,sj->i", weights, poses)
        return mean, len(poses) * total

    def velocity(self) -> Pose:
        """Return the velocity (3,) [m/s, rad/s], as a difference."""
        for sample in reversed(self._known):
            if (time := self.stamp - sample.stamp) >= SHORTEST:
                return np.asarray((self.latest - sample.pose) / time)
        return np.zeros(3)

    def scatter(self) -> tuple[float, float]:
        """Return the standard deviation of the place [m] and of the heading [rad]."""
        spread = np.std(self._poses(), axis=0) if self._known else np.zeros(3)
        return float(spread[:2].max()), float(spread[2])

    def differs(self, one: Pose, other: Pose) -> bool:
        """Return whether a pose at rest is another one than before."""
        off = self.continued(other, one) - one
        return bool((np.abs(off) > 2.0 * self._slack).any())

    def _poses(self) -> Float[ndarray, "S 3"]:
        return np.stack([sample.pose for sample in self._known])

    def _jump(self, before: _Sample, after: _Sample) -> str:
        config, (place, turn) = self._config, self._config.noise_std
        time = after.stamp - before.stamp
        off = after.pose - before.pose
        length, angle = float(np.hypot(off[0], off[1])), float(abs(off[2]))
        far = config.max_speed * time + AT_ONCE + 2 * SCATTER * place
        wide = min(config.max_spin * time + TURN_AT_ONCE + 2 * SCATTER * turn, pi)
        if length > far:
            what, most = f"{length:.3f} m", f"{config.max_speed:g} m/s"
        elif angle > wide:
            what, most = f"{angle:.2f} rad", f"{config.max_spin:g} rad/s"
        else:
            return ""
        return (
            f"{self._name} jumped by {what} in {time:.3f} s; at most {most} is taken for motion:"
            " nothing is pushed until all rest"
        )
